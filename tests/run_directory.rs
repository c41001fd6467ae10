//! What a run finds in its directory, what it refuses, and what it leaves.

mod common;

use common::{Run, data, digest_of, history_of, launch, listing, scratch, start, text, wait, wait_for_file};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Output;
use std::time::SystemTime;

/// Snapshots at steps 0, 300, 600, 900 and at the end.
const SNAPSHOTS: [&str; 2] = ["--set", "output.snapshots=300 steps"];

/// What is done to a run directory.
type Damage<'a> = &'a dyn Fn(&Path);

/// A complete run with checkpoints of steps 500 and 1000.
fn complete(name: &str) -> (PathBuf, Output) {
    let directory = scratch(name).join("run");
    let output = run(&directory, 1, &SNAPSHOTS);
    assert!(output.status.success(), "{}", text(&output));
    (directory, output)
}

fn run(directory: &Path, ranks: usize, extra: &[&str]) -> Output {
    launch(&Run { config: &data("mixed_flow.toml"), ranks, threads: 1 }, directory, extra)
}

fn restart(from: &Path, directory: &Path, ranks: usize, extra: &[&str]) -> Output {
    run(directory, ranks, &[&["--restart", from.to_str().expect("a UTF-8 path")], extra].concat())
}

/// One error with these words, and a code that says so.
fn assert_refused(output: &Output, words: &[&str]) {
    assert!(matches!(output.status.code(), Some(1 | 2)), "{}", text(output));
    for word in words {
        assert_eq!(text(output).matches(word).count(), 1, "{word}: {}", text(output));
    }
}

#[test]
fn a_refused_restart_leaves_nothing_in_a_new_directory_and_its_remedies_work() {
    let (whole, first) = complete("whole");
    let half = whole.join("checkpoint-000000000500.h5");
    let folder = scratch("new");
    let spoil = |name: &str, spoil: Damage| {
        let directory = folder.join(name);
        fs::create_dir_all(directory.join("snapshots")).expect("the build folder can be written");
        for inside in ["", "snapshots"] {
            for entry in fs::read_dir(whole.join(inside)).expect("the run is there").flatten() {
                if entry.path().is_file() {
                    fs::copy(entry.path(), directory.join(inside).join(entry.file_name())).expect("a copy");
                }
            }
        }
        spoil(&directory);
        directory
    };
    let cut = |directory: &Path| {
        let table = String::from_utf8(history_of(directory)).expect("text");
        let rows: Vec<&str> = table.split_inclusive('\n').take(15).collect();
        fs::write(directory.join("history.csv"), rows.concat()).expect("the table can be cut");
    };
    let index = |directory: &Path| {
        fs::remove_file(directory.join("snapshots/particles.vtkhdf.series")).expect("it is there");
    };
    let snapshot = |directory: &Path| {
        fs::remove_file(directory.join("snapshots/particles-000003.vtkhdf")).expect("it is there");
    };
    let table = |directory: &Path| fs::remove_file(directory.join("history.csv")).expect("it is there");
    let spoilt: [(&str, Damage, &str, &str); 4] = [
        ("cut", &cut, "holds 14 rows", "an older checkpoint"),
        ("index", &index, "lists 0 snapshots where the checkpoint has written 4", "leave out output.snapshots"),
        ("snapshot", &snapshot, "particles-000003.vtkhdf: is missing", "an older checkpoint"),
        ("table", &table, "history.csv: is not there", "give the checkpoint where it lies"),
    ];
    for (name, how, fault, remedy) in spoilt {
        let from = spoil(name, how);
        let (made, empty) = (folder.join("made").join("below"), folder.join("empty"));
        fs::create_dir_all(&empty).expect("the build folder can be written");
        for to in [&made, &empty] {
            assert_refused(&restart(&from, to, 2, &SNAPSHOTS), &[fault, remedy]);
        }
        assert!(!folder.join("made").exists(), "{name}");
        assert_eq!(fs::read_dir(&empty).expect("it stays").count(), 0, "{name}");
        // What the message says, in the directory that was refused.
        let (older, extra): (_, &[&str]) = match name {
            "index" => (from.clone(), &[]),
            "table" => (half.clone(), &SNAPSHOTS),
            _ => (from.join("checkpoint-000000000500.h5"), &SNAPSHOTS),
        };
        let again = restart(&older, &made, 2, extra);
        assert!(again.status.success(), "{name}: {}", text(&again));
        assert_eq!(digest_of(&again), digest_of(&first), "{name}");
        assert_eq!(history_of(&made), history_of(&whole), "{name}");
        fs::remove_dir_all(folder.join("made")).expect("it is there");
    }
}

#[test]
fn a_second_run_in_the_directory_of_one_that_runs_is_refused_and_a_kill_frees_it() {
    let directory = scratch("shared").join("run");
    let long = ["--set", "stage.1.steps=1000000", "--set", "output.checkpoint_steps=500"];
    let mut first = start(&Run { config: &data("mixed_flow.toml"), ranks: 1, threads: 1 }, &directory, &long);
    wait_for_file(&directory, |name| name.ends_with(".h5"));
    for ranks in [1, 2] {
        for again in [run(&directory, ranks, &[]), restart(&directory, &directory, ranks, &long)] {
            assert_refused(
                &again,
                &["another run is writing there", &format!("process {} on", first.id()), "--output"],
            );
        }
    }
    assert!(first.try_wait().expect("it can be asked").is_none());
    first.kill().expect("it runs");
    wait(first);
    let after = run(&directory, 2, &SNAPSHOTS);
    assert!(after.status.success(), "{}", text(&after));
    let (whole, reference) = complete("whole");
    assert_eq!((digest_of(&after), history_of(&directory)), (digest_of(&reference), history_of(&whole)));
    assert!(!listing(&directory).iter().any(|(name, _)| name.contains("lock")));
}

#[test]
fn a_restart_into_a_new_directory_can_be_gone_on_with_at_once() {
    let (whole, first) = complete("whole");
    let (half, directory) = (whole.join("checkpoint-000000000500.h5"), scratch("new").join("run"));
    // No checkpoint of its own yet.
    let extra = ["--set", "contact.max_overlap_fraction=0.001", "--set", "output.snapshots=300 steps"];
    let overlap = restart(&half, &directory, 1, &extra);
    assert_refused(&overlap, &["overlaps by"]);
    assert!(directory.join("history.csv").exists());
    let refused = restart(&half, &directory, 1, &SNAPSHOTS);
    let remedy = format!("go on with that run with --restart {}", directory.display());
    assert_refused(&refused, &["holds another run", &remedy]);
    let again = restart(&directory, &directory, 2, &SNAPSHOTS);
    assert!(again.status.success(), "{}", text(&again));
    assert_eq!((digest_of(&again), history_of(&directory)), (digest_of(&first), history_of(&whole)));
    let names = |directory: &Path| listing(directory).into_iter().map(|(name, _)| name).collect::<Vec<_>>();
    assert_eq!(names(&directory), names(&whole));
}

#[test]
fn a_complete_run_that_is_restarted_unchanged_changes_no_file() {
    let (directory, first) = complete("whole");
    let (names, before) = (listing(&directory), contents(&directory));
    for ranks in [1, 2] {
        let again = restart(&directory, &directory, ranks, &SNAPSHOTS);
        assert!(again.status.success() && text(&again).contains("nothing to do"), "{}", text(&again));
        assert_eq!(digest_of(&again), digest_of(&first));
        assert!(contents(&directory) == before, "{ranks} ranks");
    }
    // A kill came before the end was written down: then it is.
    fs::remove_file(directory.join("status.toml")).expect("it is there");
    let again = restart(&directory, &directory, 1, &SNAPSHOTS);
    assert!(again.status.success(), "{}", text(&again));
    assert_eq!(listing(&directory), names);
}

/// Paths, times and bytes of all files of a run, checkpoints and snapshots among them.
fn contents(directory: &Path) -> Vec<(PathBuf, SystemTime, Vec<u8>)> {
    let folders = [directory.to_path_buf(), directory.join("snapshots")].into_iter().filter(|folder| folder.exists());
    let paths = folders.flat_map(|folder| listing(&folder).into_iter().map(move |(name, _)| folder.join(name)));
    let time = |path: &Path| fs::metadata(path).and_then(|data| data.modified()).expect("it is there");
    paths.map(|path| (path.clone(), time(&path), fs::read(path).expect("it is there"))).collect()
}

#[test]
fn a_complete_run_goes_on_to_a_later_end_as_if_it_had_been_there() {
    let later = |end: &'static str| [&SNAPSHOTS[..], &["--set", end]].concat();
    let steps = later("stage.1.steps=700");
    let reference = scratch("reference").join("run");
    let whole = run(&reference, 1, &steps);
    assert!(whole.status.success(), "{}", text(&whole));
    let ends = |directory: &Path, output: &Output| {
        assert!(output.status.success(), "{}", text(output));
        let names = |directory: &Path| listing(directory).into_iter().map(|(name, _)| name).collect::<Vec<_>>();
        (digest_of(output), history_of(directory), names(&directory.join("snapshots")))
    };
    // From the last state, as its last step was not cut.
    let (directory, _) = complete("steps");
    let again = restart(&directory, &directory, 2, &steps);
    assert!(text(&again).contains("(step 1000,"), "{}", text(&again));
    assert_eq!(ends(&directory, &again), ends(&reference, &whole));
    // And on, by further stages or not at all.
    let earlier = restart(&directory, &directory, 2, &SNAPSHOTS);
    assert_refused(&earlier, &["stage.1.steps is 400 and was 700", "a checkpoint file from before that end"]);
    let begun = restart(&directory, &directory, 1, &later("stage.0.steps=700"));
    assert_refused(&begun, &["stage.0.steps is 700 and was 600", "put the end back"]);
    assert_eq!(ends(&directory, &again), ends(&reference, &whole));

    // From the checkpoint before, as the last step was cut to end with the stage.
    let [short, long] = ["stage.1.duration=0.6 ms", "stage.1.duration=1.2 ms"];
    let unlimited = ["--set", "stage.1.steps=100000"];
    let set = |duration: &'static str| [&later(duration)[..], &unlimited].concat();
    let whole = run(&reference, 1, &set(long));
    let directory = scratch("duration").join("run");
    let first = run(&directory, 1, &set(short));
    assert!(first.status.success(), "{}", text(&first));
    let last = listing(&directory).into_iter().map(|(name, _)| name).filter(|name| name.ends_with(".h5")).max();
    let last = directory.join(last.expect("a checkpoint"));
    let refused = restart(&last, &directory, 2, &set(long));
    assert_refused(&refused, &["stage.1.duration is 0.0012 and was 0.0006", "a checkpoint file from before that end"]);
    let again = restart(&directory, &directory, 2, &set(long));
    assert!(
        text(&again).contains("checkpoints passed over, as they are too late for another end: 1"),
        "{}",
        text(&again)
    );
    assert_eq!(ends(&directory, &again), ends(&reference, &whole));
    // No such checkpoint is left.
    let only = ["--set", "output.checkpoint_steps=0"];
    let alone = scratch("alone").join("run");
    assert!(run(&alone, 1, &[&set(short)[..], &only].concat()).status.success());
    let before = contents(&alone);
    let refused = restart(&alone, &alone, 2, &[&set(long)[..], &only].concat());
    assert_refused(&refused, &["no older checkpoint is left", "add a stage", "without --restart"]);
    assert!(contents(&alone) == before);
}

#[test]
fn a_later_end_of_a_quasi_static_stage_leads_back_before_an_increment_that_the_old_end_cut() {
    let folder = scratch("cut");
    let input = fs::read_to_string(data("quasi_static.toml")).expect("the input is text");
    let (hold, output) = (input.rfind("[[stage]]").expect("a stage"), input.find("[output]").expect("output"));
    let config = folder.join("input.toml");
    fs::write(&config, [&input[..hold], &input[output..]].concat()).expect("the build folder can be written");
    let often = ["--set", "output.checkpoint_steps=100"];
    let later = [&often[..], &["--set", "stage.1.until_strain.z=0.0046"]].concat();
    let launched = |name: &str, extra: &[&str]| {
        let output = launch(&Run { config: &config, ranks: 2, threads: 1 }, &folder.join(name), extra);
        assert!(output.status.success(), "{}", text(&output));
        (digest_of(&output), history_of(&folder.join(name)), text(&output))
    };
    let whole = launched("whole", &later);
    launched("run", &often);
    let directory = folder.join("run");
    let again = launched("run", &[&later[..], &["--restart", directory.to_str().expect("a UTF-8 path")]].concat());
    let number = again.2.split("too late for another end: ").nth(1).and_then(|rest| rest.lines().next());
    assert!(number.is_some_and(|number| number.parse::<u32>().is_ok_and(|number| number >= 2)), "{}", again.2);
    assert_eq!((again.0, again.1), (whole.0, whole.1));
}
