//! Carries out docs/adding_a_law.md word by word on a copy of the sources: writes its files, applies its
//! changes, types its commands and compares what they print. The page fails here as soon as it goes stale.

#![cfg(feature = "mpi")]

mod common;

use common::{root, scratch};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::{env, fs};

const PAGE: &str = "docs/adding_a_law.md";

/// What the build and the commands of the page need.
const COPIED: &[&str] = &["Cargo.toml", "Cargo.lock", "src", "tests/data", "configs", "benches"];

/// A fenced block of the page.
#[derive(Debug)]
struct Block {
    /// Line of its opening fence.
    line: usize,
    /// Language.
    kind: String,
    /// The file it goes to.
    file: Option<String>,
    text: String,
}

/// The fenced blocks of a Markdown page in their order.
fn blocks(page: &str) -> Vec<Block> {
    let mut blocks = Vec::new();
    let mut open: Option<Block> = None;
    for (index, line) in page.lines().enumerate() {
        match (line.strip_prefix("```"), open.take()) {
            (Some(info), None) => {
                let mut words = info.split_whitespace();
                let kind = words.next().unwrap_or_default().to_owned();
                let file = words.find_map(|word| word.strip_prefix("file=")).map(str::to_owned);
                open = Some(Block { line: index + 1, kind, file, text: String::new() });
            }
            (Some(_), Some(block)) => blocks.push(block),
            (None, Some(mut block)) => {
                let _ = writeln!(block.text, "{line}");
                open = Some(block);
            }
            (None, None) => {}
        }
    }
    assert!(open.is_none(), "{PAGE}: the block {open:?} is not closed");
    blocks
}

/// The text after a change: lines with ` ` and `-` in front must stand in it in one place, those with `+`
/// come in, those with `-` go out.
fn changed(text: &str, change: &str) -> Result<String, String> {
    let with = |signs: [char; 2]| -> String {
        change.lines().filter_map(|line| line.strip_prefix(signs).map(|rest| format!("{rest}\n"))).collect()
    };
    let (old, new) = (with([' ', '-']), with([' ', '+']));
    match text.matches(&old).count() {
        1 => Ok(text.replacen(&old, &new, 1)),
        count => Err(format!("these lines stand in it {count} times, once was expected:\n{old}")),
    }
}

/// Whether `line` holds the parts of `wanted` between its `…` in their order.
fn agrees(line: &str, wanted: &str) -> bool {
    let mut rest = line;
    wanted.split('…').all(|part| match rest.find(part) {
        Some(at) => {
            rest = &rest[at + part.len()..];
            true
        }
        None => false,
    })
}

fn copy(from: &Path, to: &Path) {
    if from.is_dir() {
        fs::create_dir_all(to).expect("the folder can be made");
        for entry in fs::read_dir(from).expect("the sources can be read") {
            let entry = entry.expect("the sources can be read");
            copy(&entry.path(), &to.join(entry.file_name()));
        }
    } else {
        fs::create_dir_all(to.parent().expect("a file has a folder")).expect("the folder can be made");
        // Without the times, so that the build sees new files.
        fs::write(to, fs::read(from).expect("the file can be read")).expect("the file can be written");
    }
}

/// A copy of the sources whose build takes the compiled dependencies of this one (with a cargo that knows no
/// `build-dir` they are compiled anew) and does not optimise, to save time.
fn copy_of_the_sources() -> PathBuf {
    let folder = scratch("repository");
    for name in COPIED {
        copy(&root().join(name), &folder.join(name));
    }
    let build = Path::new(env!("CARGO_TARGET_TMPDIR")).parent().expect("a folder in the build folder");
    let settings = format!(
        "[build]\nbuild-dir = {:?}\ntarget-dir = \"target\"\n[net]\noffline = true\n\
         [profile.release.package.dem-mpi]\nopt-level = 0\ndebug = 0\n",
        build.display()
    );
    fs::create_dir_all(folder.join(".cargo")).expect("the folder can be made");
    fs::write(folder.join(".cargo/config.toml"), settings).expect("the file can be written");
    folder
}

/// Types the lines of a block in the folder; returns what they print.
fn typed(lines: &str, folder: &Path) -> Result<String, String> {
    let mut shell = Command::new("bash");
    shell.args(["-euo", "pipefail", "-c", &format!("exec 2>&1\n{lines}")]).current_dir(folder).stdin(Stdio::null());
    for (name, _) in env::vars_os() {
        // What cargo tells this test is not meant for the build in the copy.
        let text = name.to_string_lossy();
        let own = ["CARGO_PKG_", "CARGO_MANIFEST_", "CARGO_BIN_", "CARGO_TARGET_", "CARGO_BUILD_", "CARGO_CRATE_"];
        if own.iter().any(|start| text.starts_with(start)) {
            shell.env_remove(&name);
        }
    }
    let settings = [
        ("OMPI_ALLOW_RUN_AS_ROOT", "1"),
        ("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1"),
        // As `common::command`: more ranks than cores, for Open MPI up to 4 and from 5 on.
        ("OMPI_MCA_rmaps_base_oversubscribe", "1"),
        ("PRTE_MCA_rmaps_default_mapping_policy", ":oversubscribe"),
        ("OMPI_MCA_hwloc_base_binding_policy", "none"),
        ("OMPI_MCA_mpi_yield_when_idle", "1"),
    ];
    // What the page exports lasts for one block here; the program must never be an installed one.
    let mut path = folder.join("target/release").into_os_string();
    path.push(":");
    path.push(env::var_os("PATH").unwrap_or_default());
    shell.env("PATH", path);
    let output = shell.envs(settings).output().map_err(|error| error.to_string())?;
    let text = common::text(&output);
    if output.status.success() { Ok(text) } else { Err(format!("{}:\n{text}", output.status)) }
}

#[test]
fn the_page_on_adding_a_law_holds_word_by_word() {
    let folder = copy_of_the_sources();
    let page = fs::read_to_string(root().join(PAGE)).expect("the page is there");
    let mut printed = String::new();
    let (mut files, mut commands, mut digests) = (Vec::new(), 0, Vec::new());
    for block in blocks(&page) {
        let fail = |what: String| -> ! { panic!("{PAGE}:{}: {what}", block.line) };
        match (block.kind.as_str(), block.file.as_deref()) {
            ("rust" | "toml", Some(name)) => {
                let path = folder.join(name);
                let before = if files.contains(&name.to_owned()) {
                    fs::read_to_string(&path).expect("written before") + "\n"
                } else if path.exists() {
                    fail(format!("{name} exists already"))
                } else {
                    String::new()
                };
                files.push(name.to_owned());
                fs::write(&path, before + &block.text).expect("the copy can be written");
            }
            ("diff", Some(name)) => {
                let path = folder.join(name);
                let text = fs::read_to_string(&path).unwrap_or_else(|error| fail(format!("{name}: {error}")));
                let text = changed(&text, &block.text).unwrap_or_else(|problem| fail(format!("{name}: {problem}")));
                fs::write(&path, text).expect("the copy can be written");
            }
            ("sh", None) => {
                printed = typed(&block.text, &folder).unwrap_or_else(|problem| fail(problem));
                digests.extend(printed.lines().filter(|line| line.starts_with("digest ")).map(str::to_owned));
                commands += 1;
            }
            ("text", None) => {
                for wanted in block.text.lines() {
                    if !printed.lines().any(|line| agrees(line, wanted)) {
                        fail(format!("the commands above did not print `{wanted}` but:\n{printed}"));
                    }
                }
            }
            _ => fail(format!("a block of unknown kind `{}`, file {:?}", block.kind, block.file)),
        }
    }
    assert!(files.len() >= 2 && commands >= 3, "{PAGE} writes {files:?} and has {commands} blocks of commands");
    assert!(digests.len() >= 4, "one run for each of four layouts: {digests:?}");
    assert!(digests.iter().all(|digest| *digest == digests[0]), "the digests differ: {digests:?}");
}

#[test]
fn a_change_needs_its_place_and_a_line_its_parts() {
    assert_eq!(changed("a\nb\nc\n", " a\n-b\n+d\n c\n"), Ok("a\nd\nc\n".to_owned()));
    assert!(changed("a\nb\n", " b\n a\n").is_err());
    assert!(changed("a\na\n", " a\n+b\n").is_err());
    assert!(agrees("error: stiffness = 7 is too large", "…stiffness…7…"));
    assert!(!agrees("7 stiffness", "stiffness…7"));
    let found = blocks("x\n```rust file=a.rs\none\n```\n\n```sh\ntwo\n```\n");
    assert_eq!(found.len(), 2);
    assert_eq!((found[0].line, found[0].file.as_deref(), found[1].text.as_str()), (2, Some("a.rs"), "two\n"));
}
