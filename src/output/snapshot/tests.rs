use super::*;
use crate::output::hdf5_file::Reader;

const MOMENT: Moment = Moment { step: 12, time: 0.25, sides: [1.0, 2.0, 3.0] };

fn particles(count: u32) -> Vec<SnapshotParticle> {
    let of = |id: u32| SnapshotParticle {
        id,
        position: [f64::from(id), 0.5, 0.25],
        radius: 0.1 + f64::from(id),
        orientation: [1.0, 0.0, 0.0, 0.0],
        coordination: id % 7,
        ..SnapshotParticle::zeroed()
    };
    (0..count).rev().map(of).collect()
}

fn contacts(count: u32) -> SnapshotContacts {
    let of = |low: u32| SnapshotContact {
        key: ContactKey { low, high: low + 1, shift: [0; 4] },
        start: [f64::from(low), 0.5, 0.25],
        branch: [1.0, 0.0, 0.0],
        force: [-2.0, 0.0, 0.0],
        normal_force: 2.0,
        overlap: 1.0e-3,
    };
    let rows: Vec<SnapshotContact> = (0..count).rev().map(of).collect();
    let memory = rows.iter().flat_map(|c| [f64::from(c.key.low), -1.0]).collect();
    let column = |name: &str| Column { name: name.to_owned(), unit: "m" };
    let columns = vec![vec![column("overlap"), column("slip")], vec![column("overlap"), column("dent")]];
    SnapshotContacts { contacts: rows, width: 2, memory, columns }
}

#[test]
fn snapshot_holds_particles_in_id_order_and_contacts_as_lines() {
    let folder = tempfile::tempdir().expect("folder");
    let comm = Communicator::single();
    let mut series = SnapshotSeries::create(&comm, folder.path()).expect("create");
    let path = series.write(&MOMENT, 10, particles(10), Some(contacts(9))).expect("write");
    let reader = Reader::open(&path).expect("open");
    assert_eq!(reader.attribute("VTKHDF", "Type").expect("type"), "PolyData");
    let ids = reader.read::<u32>("VTKHDF/PointData/id", 0, 10).expect("ids");
    assert_eq!(ids, (0..10).collect::<Vec<u32>>());
    let points = reader.read::<f64>("VTKHDF/Points", 4, 1).expect("points");
    assert_eq!(points, [4.0, 0.5, 0.25]);
    let reader = Reader::open(&folder.path().join("snapshots/contacts-000000.vtkhdf")).expect("open");
    assert_eq!(reader.rows("VTKHDF/Points").expect("rows"), 18);
    assert_eq!(reader.read::<i64>("VTKHDF/Lines/Offsets", 0, 10).expect("offsets")[9], 18);
    assert_eq!(reader.read::<f64>("VTKHDF/CellData/memory_overlap", 3, 1).expect("memory"), [3.0]);
    assert_eq!(reader.read::<f64>("VTKHDF/CellData/memory_1", 3, 1).expect("memory"), [-1.0]);
}

/// Name and contents of every file in the snapshot folder.
fn contents(folder: &Path) -> Vec<(String, Vec<u8>)> {
    let mut files: Vec<_> = fs::read_dir(folder.join("snapshots"))
        .expect("folder")
        .map(|entry| entry.expect("entry").path())
        .map(|path| (path.file_name().expect("name").to_string_lossy().into_owned(), fs::read(path).expect("read")))
        .collect();
    files.sort();
    files
}

#[test]
fn a_resumed_series_equals_an_uninterrupted_one_byte_for_byte() {
    let comm = Communicator::single();
    let [whole, stopped] = [(); 2].map(|()| tempfile::tempdir().expect("folder"));
    let write = |series: &mut SnapshotSeries, k: u64| {
        let moment = Moment { step: k, time: k as f64 / 3.0, ..MOMENT };
        series.write(&moment, 6, particles(6), Some(contacts(5))).expect("write");
    };
    let mut series = SnapshotSeries::create(&comm, whole.path()).expect("create");
    (0..3).for_each(|k| write(&mut series, k));
    let after_three = contents(whole.path());
    let mut series = SnapshotSeries::create(&comm, stopped.path()).expect("create");
    (0..5).for_each(|k| write(&mut series, k));
    let mut series = SnapshotSeries::resume(&comm, stopped.path(), 3).expect("resume");
    assert_eq!(contents(stopped.path()), after_three);
    assert_eq!(series.count(), 3);
    write(&mut series, 3);
    assert_eq!(series.count(), 4);
    let fresh = SnapshotSeries::create(&comm, stopped.path()).expect("create");
    assert_eq!(fresh.count(), 0);
    assert!(contents(stopped.path()).is_empty());
}

#[test]
fn resuming_after_more_snapshots_than_there_are_is_an_error() {
    let comm = Communicator::single();
    let folder = tempfile::tempdir().expect("folder");
    let mut series = SnapshotSeries::create(&comm, folder.path()).expect("create");
    series.write(&MOMENT, 2, particles(2), None).expect("write");
    let message =
        SnapshotSeries::resume(&comm, folder.path(), 2).err().map(|error| error.to_string()).unwrap_or_default();
    assert!(message.contains("lists 1 snapshots"), "{message}");
}
