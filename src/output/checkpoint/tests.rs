use super::*;
use crate::output::digest::tests::sample;

fn columns() -> Vec<Vec<Column>> {
    vec![vec![Column { name: "overlap".to_owned(), unit: "m" }]]
}

fn write_sample(directory: &Path, step: u64, keep: usize) -> (PathBuf, GlobalState) {
    let (global, particles, memory) = sample(23);
    let global = GlobalState { step, ..global };
    let comm = Communicator::single();
    let path =
        write(&comm, directory, "title = \"größe\"\n", &columns(), &global, particles, memory, keep).expect("written");
    (path, global)
}

fn message_of<T: std::fmt::Debug>(result: Result<T>) -> String {
    let error = result.expect_err("must be refused");
    assert!(matches!(error, Error::Checkpoint { .. }), "{error:?}");
    error.to_string()
}

#[test]
fn what_is_written_reads_back_bit_for_bit_in_id_order() {
    let folder = tempfile::tempdir().expect("folder");
    let (path, global) = write_sample(folder.path(), 1_000, 2);
    assert!(path.ends_with("checkpoint-000000001000.h5"));
    let comm = Communicator::single();
    let back = read(&comm, &path).expect("read");
    let (_, mut particles, memory) = sample(23);
    particles.sort_by_key(|particle| particle.id);
    assert_eq!(back.global, global);
    assert_eq!(back.particles, particles);
    assert_eq!(back.memory, redistribute::memory_to_id_blocks(&comm, 23, &memory, 0).expect("rows"));
    assert_eq!(back.config_resolved, "title = \"größe\"\n");
    assert_eq!(digest_of(&path).expect("digest"), back.digest);
    assert_eq!(digest_of(folder.path()).expect("digest"), back.digest);
}

#[test]
fn the_same_state_gives_the_same_bytes() {
    let [a, b] = [(), ()].map(|()| tempfile::tempdir().expect("folder"));
    let (first, _) = write_sample(a.path(), 7, 2);
    std::thread::sleep(std::time::Duration::from_millis(1100));
    let (second, _) = write_sample(b.path(), 7, 2);
    assert_eq!(fs::read(first).expect("read"), fs::read(second).expect("read"));
}

#[test]
fn contacts_without_memory_and_no_contacts_at_all_survive() {
    let folder = tempfile::tempdir().expect("folder");
    let comm = Communicator::single();
    let (global, particles, memory) = sample(5);
    let bare = ContactMemory { width: 0, values: Vec::new(), ..memory };
    let none = ContactMemory::new(4);
    for memory in [redistribute::memory_to_id_blocks(&comm, 5, &bare, 0).expect("rows"), none] {
        let path = write(&comm, folder.path(), "", &[], &global, particles.clone(), memory.clone(), 1).expect("write");
        let back = read(&comm, &path).expect("read");
        assert_eq!(back.memory, memory);
        assert_eq!(back.config_resolved, "");
    }
}

#[test]
fn only_the_newest_are_kept_and_later_ones_can_be_discarded() {
    let folder = tempfile::tempdir().expect("folder");
    fs::write(folder.path().join("checkpoint-000000000005.h5.part"), "cut off by a kill").expect("write");
    for step in [10, 20, 30] {
        write_sample(folder.path(), step, 2);
    }
    assert_eq!(steps(folder.path()).expect("steps"), [20, 30]);
    discard_after(folder.path(), 20).expect("discard");
    assert_eq!(steps(folder.path()).expect("steps"), [20]);
    let left: Vec<_> = fs::read_dir(folder.path()).expect("folder").collect();
    assert_eq!(left.len(), 1, "no part files remain: {left:?}");
}

#[test]
fn every_flipped_byte_is_noticed() {
    let folder = tempfile::tempdir().expect("folder");
    let (path, _) = write_sample(folder.path(), 1, 2);
    let good = fs::read(&path).expect("read");
    let comm = Communicator::single();
    // The header's zero padding carries nothing; all else does.
    for at in [0, 22, 30, 512, 600, good.len() / 2, good.len() - 1] {
        let mut bad = good.clone();
        bad[at] ^= 0x10;
        fs::write(&path, &bad).expect("write");
        message_of(read(&comm, &path));
    }
    let mut bad = good;
    let middle = bad.len() / 2;
    bad[middle] ^= 1;
    fs::write(&path, &bad).expect("write");
    assert!(message_of(read(&comm, &path)).contains("damaged: checksum"));
}

#[test]
fn a_state_that_contradicts_its_digest_is_refused_even_with_a_good_checksum() {
    let folder = tempfile::tempdir().expect("folder");
    let (path, _) = write_sample(folder.path(), 1, 2);
    let comm = Communicator::single();
    {
        let file = hdf5_for_tests(&path);
        let radius = file.dataset("particles/radius").expect("radius");
        let mut values = radius.read_raw::<f64>().expect("read");
        values[4] *= 2.0;
        radius.write_raw(&values).expect("write");
    }
    seal::seal(&comm, &path).expect("seal");
    assert!(message_of(read(&comm, &path)).contains("digest"));
}

fn hdf5_for_tests(path: &Path) -> hdf5::File {
    hdf5::File::open_rw(path).expect("open")
}

#[test]
fn truncated_foreign_missing_and_future_files_are_refused_with_the_reason() {
    let folder = tempfile::tempdir().expect("folder");
    let (path, _) = write_sample(folder.path(), 1, 2);
    let comm = Communicator::single();
    let good = fs::read(&path).expect("read");
    fs::write(&path, &good[..good.len() - 100]).expect("write");
    assert!(message_of(read(&comm, &path)).contains("truncated"));
    fs::write(&path, b"").expect("write");
    assert!(message_of(read(&comm, &path)).contains("not a dem-mpi checkpoint"));
    fs::write(&path, b"step,time_s\n1,2\n").expect("write");
    assert!(message_of(read(&comm, &path)).contains("not a dem-mpi checkpoint"));
    let mut future = good;
    future[MAGIC_LENGTH] = b'9';
    fs::write(&path, &future).expect("write");
    assert!(message_of(read(&comm, &path)).contains("format version 9"));
    assert!(message_of(read(&comm, &folder.path().join("none.h5"))).contains("cannot be opened"));
}

/// Where the version stands in the header.
const MAGIC_LENGTH: usize = "dem-mpi checkpoint ".len();

#[test]
fn latest_passes_over_a_damaged_checkpoint_with_a_warning() {
    let folder = tempfile::tempdir().expect("folder");
    let comm = Communicator::single();
    assert!(message_of(latest(&comm, folder.path(), None)).contains("no checkpoint-STEP.h5"));
    let (old, _) = write_sample(folder.path(), 1, 2);
    let (new, _) = write_sample(folder.path(), 2, 2);
    assert_eq!(latest(&comm, folder.path(), None).expect("latest").path, new);
    let mut bad = fs::read(&new).expect("read");
    bad.truncate(4000);
    fs::write(&new, bad).expect("write");
    let found = latest(&comm, folder.path(), None).expect("latest");
    assert_eq!(found.path, old);
    assert!(found.warnings[0].contains("truncated"), "{:?}", found.warnings);
    fs::write(&old, b"x").expect("write");
    assert!(message_of(latest(&comm, folder.path(), None)).contains("can be used"));
}

#[test]
fn a_value_that_is_not_finite_is_refused_instead_of_written() {
    let folder = tempfile::tempdir().expect("folder");
    let (global, particles, memory) = sample(3);
    let global = GlobalState { measured_stress: [f64::NAN; 3], ..global };
    let result = write(&Communicator::single(), folder.path(), "", &[], &global, particles, memory, 2);
    assert!(matches!(result, Err(Error::Simulation { .. })));
}
