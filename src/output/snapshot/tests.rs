use super::*;
use crate::output::hdf5_file::Reader;

const MOMENT: Moment = Moment { step: 12, time: 0.25, sides: [1.0, 2.0, 3.0] };

/// Everything that a series can hold.
const ALL: Style = Style { ellipsoids: true, dump: true };

fn particles(count: u32) -> Vec<SnapshotParticle> {
    let of = |id: u32| SnapshotParticle {
        id,
        position: [f64::from(id), 0.5, 0.25],
        radius: 0.1 + f64::from(id),
        semi_axes: [0.1 + f64::from(id), 0.05, 0.025],
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
    let mut series = SnapshotSeries::create(&comm, folder.path(), Style::default()).expect("create");
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
    resumes_after_three(|k| k as f64 / 3.0);
}

#[test]
fn a_series_resumed_from_where_time_still_went_on_tells_seconds_again() {
    resumes_after_three(|k| k.min(2) as f64 / 3.0);
    resumes_after_three(|_| 0.0);
}

#[test]
fn where_time_stands_still_the_indices_count_steps() {
    let comm = Communicator::single();
    let folder = tempfile::tempdir().expect("folder");
    let mut series = SnapshotSeries::create(&comm, folder.path(), Style::default()).expect("create");
    let mut write = |step: u64, time: f64| {
        series.write(&Moment { step, time, ..MOMENT }, 2, particles(2), None).expect("write");
        let text = |name: &str| fs::read_to_string(folder.path().join("snapshots").join(name)).expect("index");
        let index: serde_json::Value = serde_json::from_str(&text("particles.vtkhdf.series")).expect("JSON");
        let files = index["files"].as_array().expect("files");
        let times: Vec<f64> = files.iter().map(|file| file["time"].as_f64().expect("time")).collect();
        let sidecar = text("particles.xmf");
        assert!(times.iter().all(|time| sidecar.contains(&format!("<Time Value=\"{time:?}\"/>"))), "{sidecar}");
        times
    };
    assert_eq!(write(0, 0.0), [0.0]);
    assert_eq!(write(40, 0.5), [0.0, 0.5]);
    assert_eq!(write(90, 0.5), [0.0, 40.0, 90.0]);
    assert_eq!(write(95, 0.7), [0.0, 40.0, 90.0, 95.0]);
}

/// A series of five snapshots at these times is stopped, resumed after three, and equals one of three.
fn resumes_after_three(time: impl Fn(u64) -> f64) {
    let comm = Communicator::single();
    let [whole, stopped] = [(); 2].map(|()| tempfile::tempdir().expect("folder"));
    let write = |series: &mut SnapshotSeries, k: u64| {
        let moment = Moment { step: k, time: time(k), ..MOMENT };
        series.write(&moment, 6, particles(6), Some(contacts(5))).expect("write");
    };
    let mut series = SnapshotSeries::create(&comm, whole.path(), ALL).expect("create");
    (0..3).for_each(|k| write(&mut series, k));
    let after_three = contents(whole.path());
    let mut series = SnapshotSeries::create(&comm, stopped.path(), ALL).expect("create");
    (0..5).for_each(|k| write(&mut series, k));
    let mut series = SnapshotSeries::resume(&comm, stopped.path(), 3, ALL).expect("resume");
    assert_eq!(contents(stopped.path()), after_three);
    assert_eq!(series.count(), 3);
    write(&mut series, 3);
    assert_eq!(series.count(), 4);
    let mut uninterrupted = SnapshotSeries::resume(&comm, whole.path(), 3, ALL).expect("resume");
    write(&mut uninterrupted, 3);
    assert_eq!(contents(stopped.path()), contents(whole.path()));
    let fresh = SnapshotSeries::create(&comm, stopped.path(), ALL).expect("create");
    assert_eq!(fresh.count(), 0);
    assert!(contents(stopped.path()).is_empty());
}

#[test]
fn resuming_after_more_snapshots_than_there_are_is_an_error() {
    let comm = Communicator::single();
    let folder = tempfile::tempdir().expect("folder");
    let mut series = SnapshotSeries::create(&comm, folder.path(), Style::default()).expect("create");
    series.write(&MOMENT, 2, particles(2), None).expect("write");
    let message = SnapshotSeries::resume(&comm, folder.path(), 2, Style::default())
        .err()
        .map(|error| error.to_string())
        .unwrap_or_default();
    assert!(message.contains("lists 1 snapshots"), "{message}");
}

#[test]
fn ellipsoids_have_semi_axes_and_the_tensor_of_their_glyph() {
    let folder = tempfile::tempdir().expect("folder");
    let comm = Communicator::single();
    let mut series = SnapshotSeries::create(&comm, folder.path(), ALL).expect("create");
    let mut shown = particles(3);
    // A quarter turn about z takes the long axis to y.
    let half = std::f64::consts::FRAC_1_SQRT_2;
    shown[0].orientation = [half, 0.0, 0.0, half];
    let path = series.write(&MOMENT, 3, shown, None).expect("write");
    let reader = Reader::open(&path).expect("open");
    assert_eq!(reader.read::<f64>("VTKHDF/PointData/semi_axes", 1, 1).expect("axes"), [1.1, 0.05, 0.025]);
    let upright = reader.read::<f64>("VTKHDF/PointData/shape_tensor", 1, 1).expect("tensor");
    assert_eq!(upright, [1.1, 0.0, 0.0, 0.0, 0.05, 0.0, 0.0, 0.0, 0.025]);
    let turned = reader.read::<f64>("VTKHDF/PointData/shape_tensor", 2, 1).expect("tensor");
    let expected = [0.05, 0.0, 0.0, 0.0, 2.1, 0.0, 0.0, 0.0, 0.025];
    assert!(turned.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-15), "{turned:?}");
}

#[test]
fn a_dump_is_a_lammps_text_dump_with_diameters_and_quaternions() {
    let folder = tempfile::tempdir().expect("folder");
    let comm = Communicator::single();
    let mut series = SnapshotSeries::create(&comm, folder.path(), ALL).expect("create");
    series.write(&MOMENT, 2, particles(2), None).expect("write");
    let text = fs::read_to_string(folder.path().join("snapshots/particles-000000.dump")).expect("dump");
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(lines[..6], ["ITEM: UNITS", "si", "ITEM: TIME", "2.5e-1", "ITEM: TIMESTEP", "12"]);
    assert_eq!(lines[6..12], ["ITEM: NUMBER OF ATOMS", "2", "ITEM: BOX BOUNDS pp pp pp", "0 1e0", "0 2e0", "0 3e0"]);
    let names: Vec<&str> = lines[12].split(' ').skip(2).collect();
    let row: Vec<&str> = lines[14].split(' ').collect();
    assert_eq!(names.len(), row.len());
    let value = |name: &str| row[names.iter().position(|known| *known == name).expect("column")];
    let shown = ["id", "type", "x", "radius", "shapex", "shapey", "quatw", "quatk"].map(value);
    assert_eq!(shown, ["2", "1", "1e0", "1.1e0", "2.2e0", "1e-1", "1e0", "0e0"]);
    assert_eq!(lines.len(), 15);
}
