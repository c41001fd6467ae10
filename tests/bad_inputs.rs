//! Every file in `bad_inputs/` is refused, with the fragments of its `# expect:` lines in the message,
//! and with one problem at each line that ends in `# <-` (or begins with it: the file as a whole).

use dem_mpi::config::load;
use std::path::{Path, PathBuf};

fn files() -> Vec<PathBuf> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/bad_inputs");
    let entries = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let mut files: Vec<PathBuf> = entries.filter(|path| path.extension().is_some_and(|e| e == "toml")).collect();
    files.sort();
    files
}

/// What is wrong with the message for this file, if anything.
fn fault(file: &Path) -> Option<String> {
    let text = std::fs::read_to_string(file).unwrap();
    let message = match load(file, &[], None, None) {
        Ok(_) => return Some("it was accepted".to_owned()),
        Err(error) => error.to_string(),
    };
    let expected: Vec<&str> = text.lines().filter_map(|line| line.strip_prefix("# expect: ")).collect();
    assert!(!expected.is_empty(), "{} says nothing of what it expects", file.display());
    let mut wanted: Vec<String> = expected.into_iter().map(str::to_owned).collect();
    let marked = text.lines().enumerate().filter(|(_, line)| line.contains("# <-")).map(|(index, _)| index + 1);
    let places: Vec<String> = marked.map(|line| format!("--> {}:{line}:", file.display())).collect();
    wanted.push(format!("{} problem{} found", places.len(), if places.len() == 1 { "" } else { "s" }));
    wanted.extend(places);
    let missing: Vec<String> = wanted.into_iter().filter(|fragment| !message.contains(fragment.as_str())).collect();
    (!missing.is_empty()).then(|| format!("missing: {missing:#?}\nin:\n{message}"))
}

#[test]
fn every_bad_input_is_refused_with_place_value_and_remedy() {
    let files = files();
    assert!(files.len() >= 30, "only {} bad inputs", files.len());
    let faults = files.iter().filter_map(|file| fault(file).map(|fault| format!("{}: {fault}\n\n", file.display())));
    let faults: String = faults.collect();
    assert!(faults.is_empty(), "{faults}");
}

#[test]
fn a_fault_on_the_command_line_is_shown_as_one() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/quickstart.toml");
    let cases = [
        ("stage.0.duration", "has no `=`"),
        ("stage.7.duration=1", "`7` is no entry of this list of 2"),
        ("material.0.densty=1", "material.0.densty: unknown key `densty`; did you mean `density`?"),
        ("parallel.threads=0", "--> command line, --set:1:18"),
        ("..=1", "has an empty part"),
        ("parallel.threads=100000", "parallel.threads: 100000 threads per rank"),
        ("stage=[]", "error: stage: is an empty list"),
        ("stage.0.cycles=9223372036854775807", "at most 100000 stages in all"),
        ("time_step.automatic.safety=0.6", "the number 0.6 is out of range"),
        ("title=[]", "error: title: found a list of 0"),
        ("output.checkpoints_kept=18446744073709551615", "at most 9223372036854775807"),
        ("parallel.min_particles_per_rank=1e19", "is too large\n"),
        ("packing.file.path=.", "is a folder"),
    ];
    for (argument, fragment) in cases {
        let message = load(&file, &[argument.to_owned()], None, None).unwrap_err().to_string();
        assert!(message.contains(fragment), "{message}");
    }
    let message = load(&file, &[], None, Some(0)).unwrap_err().to_string();
    assert!(message.contains("command line, --threads"), "{message}");
}

#[test]
fn a_number_that_cannot_be_read_is_one_problem() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/quickstart.toml");
    let argument = "output.checkpoints_kept=18446744073709551615".to_owned();
    let message = load(&file, &[argument], None, None).unwrap_err().to_string();
    assert!(message.contains(": 1 problem found"), "{message}");
}

#[test]
fn folders_and_files_that_are_no_text_are_named_as_such() {
    let folder = tempfile::tempdir().expect("folder");
    let message = load(folder.path(), &[], None, None).unwrap_err().to_string();
    assert!(message.contains("is a folder") && !message.contains("dem-mpi init"), "{message}");
    let file = folder.path().join("bytes.toml");
    std::fs::write(&file, b"title = \"a\"\n# \xff\n").expect("file");
    let message = load(&file, &[], None, None).unwrap_err().to_string();
    assert!(message.contains("line 2 is not UTF-8 text"), "{message}");
}

#[test]
fn whatever_is_refused_has_its_reason() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/quickstart.toml");
    let keys =
        "title seed particles gravity cell material species contact pair packing load stage time_step output parallel";
    for key in keys.split(' ') {
        for value in ["[]", "{}", "[[]]", "[{}]", "true", "-1", "nan", "word"] {
            if let Err(error) = load(&file, &[format!("{key}={value}")], None, None) {
                let message = error.to_string();
                assert!(message.contains("error: ") && !message.contains(": 0 problems"), "{key}={value}: {message}");
            }
        }
    }
}

#[test]
fn no_damage_to_an_input_makes_the_reader_panic() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs/mixed.toml");
    let text = std::fs::read_to_string(&file).unwrap();
    for (start, _) in text.char_indices().step_by(7) {
        for replacement in ["", "\"", "[", "=", "-1", "é", "{", "\t"] {
            let damaged = format!("{}{replacement}{}", &text[..start], text.get(start + 3..).unwrap_or(""));
            let _ = dem_mpi::config::Config::parse(&damaged, &file, &[], None, None);
        }
    }
}
