//! What `ARCHITECTURE.md` promises, checked on the source text: imports run one way, MPI, unsafe code and
//! the HDF5 C interface stay in their named places, files stay short, nothing is left half done.

mod source;

use source::{Source, Token, crate_paths, files_below, root, rust_files};
use std::collections::BTreeSet;
use std::fs;

/// The modules in the order of the data's way through a run, each with what it may import. A name stands
/// for a whole module and must be listed above; `module::part` opens one part of a module that comes later.
#[rustfmt::skip]
const LAYERS: &[(&str, &[&str])] = &[
    ("error", &[]),
    ("units", &["error"]),
    // The catalogue of laws says which sections of the input exist.
    ("config", &["error", "units", "force::registry", "force::documentation"]),
    ("state", &["error", "config"]),
    ("exchange", &["error", "config", "state"]),
    ("packing", &["error", "config", "state", "exchange"]),
    ("neighbour", &["error", "config", "state", "contact::shift"]),
    ("contact", &["error", "config", "state", "neighbour"]),
    // Sums over contacts go into the exact accumulator, which knows nothing of ranks.
    ("force", &["error", "config", "state", "contact", "exchange::exact_sum"]),
    ("integrate", &["error", "config", "state", "contact", "force"]),
    ("load", &["error", "config", "state"]),
    ("homogenise", &["error", "config", "state", "exchange", "contact", "force"]),
    ("output", &["error", "config", "units", "state", "exchange", "force::law", "homogenise"]),
    ("plot", &["error", "config", "output"]),
    (
        "simulation",
        &[
            "error", "config", "state", "exchange", "neighbour", "contact", "force", "integrate", "load", "homogenise",
            "output",
        ],
    ),
    (
        "setup",
        &[
            "error", "config", "state", "exchange", "packing", "contact", "force", "integrate", "load", "output",
            "simulation",
        ],
    ),
    ("run", &["error", "config", "state", "exchange", "force", "output", "plot", "setup", "simulation"]),
    ("verify", &["*"]),
    ("bench", &["*"]),
    ("scaling", &["error", "exchange"]),
    ("cli", &["*"]),
];

/// Files that may hold unsafe code, with the reason.
const UNSAFE_FILES: &[(&str, &str)] = &[
    ("src/contact/ends.rs", "ends and offsets without a check for each: the list makes them"),
    ("src/force/lane/avx2.rs", "vector instructions"),
    ("src/force/lane/avx512.rs", "vector instructions"),
    ("src/force/pass/laws.rs", "calls into code compiled for vector instructions"),
    ("src/force/pass/output.rs", "calls into code compiled for vector instructions"),
    ("src/force/pass/spheres.rs", "calls into code compiled for vector instructions"),
    ("src/force/ellipsoid/touch.rs", "calls into code compiled for vector instructions"),
    ("src/integrate/gather.rs", "output lines without a check for each: the ends name slots of the buffer"),
    ("src/integrate/leap_frog.rs", "calls into code compiled for vector instructions"),
    ("src/exchange/mpi_backend.rs", "MPI's own handles and calls that the safe layer lacks"),
    ("src/run/signals.rs", "the mask of signals, which the safe layer lacks"),
    ("src/output/hdf5_file/reader.rs", "collective reads through the HDF5 C interface"),
    ("src/output/hdf5_file/writer.rs", "collective writes through the HDF5 C interface; reserving disk space"),
];

/// The module that speaks to the HDF5 C interface.
const HDF5_MODULE: &str = "src/output/hdf5_file";

/// Longest file in lines.
const MAX_LINES: usize = 500;

fn report(problems: &[String]) {
    assert!(problems.is_empty(), "\n{}\n", problems.join("\n"));
}

fn layer(name: &str) -> Option<usize> {
    LAYERS.iter().position(|(module, _)| *module == name)
}

fn names_crate(tokens: &[Token<'_>], at: usize, name: &str) -> bool {
    let root_of_path = at == 0 || tokens[at - 1].text != "::";
    let is_path = tokens.get(at + 1).is_some_and(|t| t.text == "::");
    let is_import = at > 0 && matches!(tokens[at - 1].text, "use" | "crate") && !is_path;
    tokens[at].text == name && root_of_path && (is_path || is_import)
}

fn lines_naming(source: &Source, name: &str) -> Vec<usize> {
    let tokens = source::tokens(&source.code);
    (0..tokens.len()).filter(|&at| names_crate(&tokens, at, name)).map(|at| tokens[at].line).collect()
}

#[test]
fn the_table_of_layers_runs_one_way() {
    let mut problems = Vec::new();
    for (index, (module, imports)) in LAYERS.iter().enumerate() {
        for import in imports.iter().filter(|import| !import.contains("::") && **import != "*") {
            if layer(import).is_none_or(|place| place >= index) {
                problems.push(format!("LAYERS: {module} imports {import}, which is not listed above it"));
            }
        }
    }
    report(&problems);
}

#[test]
fn imports_run_one_way() {
    let mut problems = Vec::new();
    // Files of tests may compare with whatever they like.
    for source in rust_files(&["src"]).iter().filter(|source| !source.file_name().starts_with("test")) {
        let module = source.module();
        let Some(own) = module.first().copied() else { continue };
        let Some(index) = layer(own) else {
            problems.push(format!("{}: module {own} is not in LAYERS (tests/architecture.rs): add it", source.path));
            continue;
        };
        let allowed = LAYERS[index].1;
        for (path, line) in crate_paths(&source.tokens(), &module) {
            let first = path[0].as_str();
            let second = path.get(1).map_or_else(String::new, |part| format!("{first}::{part}"));
            let fits = |entry: &str| entry == first || entry == second || entry == "*";
            if layer(first).is_some() && first != own && !allowed.iter().any(|entry| fits(entry)) {
                problems.push(format!(
                    "{}:{line}: {own} must not import {first} (allowed: {}); pass what it needs as data or move the code",
                    source.path,
                    allowed.join(", ")
                ));
            }
        }
    }
    report(&problems);
}

#[test]
fn mpi_is_named_in_one_file_of_exchange() {
    let using: BTreeSet<String> = rust_files(&["src"])
        .iter()
        .filter(|source| !lines_naming(source, "mpi").is_empty() || !lines_naming(source, "mpi_sys").is_empty())
        .map(|source| source.path.clone())
        .collect();
    let outside: Vec<&String> = using.iter().filter(|path| !path.starts_with("src/exchange/")).collect();
    assert!(outside.is_empty(), "MPI is used outside src/exchange: {outside:?}; go through the communicator");
    assert!(using.len() <= 1, "MPI is used in several files, one is allowed: {using:?}");
}

#[test]
fn the_hdf5_c_interface_is_called_in_one_module() {
    let mut problems = Vec::new();
    for source in rust_files(&["src"]).iter().filter(|source| !source.path.starts_with(HDF5_MODULE)) {
        for line in lines_naming(source, "hdf5_sys") {
            problems.push(format!("{}:{line}: HDF5 C calls belong in {HDF5_MODULE}", source.path));
        }
    }
    report(&problems);
}

#[test]
fn unsafe_code_stays_in_named_files_and_gives_its_reason() {
    let mut problems = Vec::new();
    for source in rust_files(&["src", "benches"]) {
        let tokens = source::tokens(&source.code);
        let places = tokens.iter().enumerate().filter(|(_, token)| token.text == "unsafe");
        for (at, token) in places {
            let place = format!("{}:{}", source.path, token.line);
            if !UNSAFE_FILES.iter().any(|(path, _)| *path == source.path) {
                problems.push(format!("{place}: unsafe code outside UNSAFE_FILES (tests/architecture.rs)"));
            }
            let claims = tokens.get(at + 1).is_some_and(|next| matches!(next.text, "{" | "impl"));
            if claims && !has_safety_comment(&source, token.line) {
                problems.push(format!("{place}: a `// SAFETY:` comment must stand right before this"));
            }
        }
    }
    report(&problems);
}

/// Looks upwards from the statement that holds `line` for a `// SAFETY:` comment.
fn has_safety_comment(source: &Source, line: usize) -> bool {
    let text: Vec<&str> = source.text.lines().collect();
    let code: Vec<&str> = source.code.lines().collect();
    if text[line - 1].contains("// SAFETY:") {
        return true;
    }
    for above in (0..line - 1).rev() {
        if text[above].trim_start().starts_with("// SAFETY:") {
            return true;
        }
        let ends_statement = code[above].trim_end().ends_with([';', '{', '}', ',']);
        if ends_statement || text[above].trim().is_empty() {
            return false;
        }
    }
    false
}

#[test]
fn files_stay_short() {
    let problems: Vec<String> = rust_files(&["src", "tests", "benches"])
        .iter()
        .map(|source| (source, source.text.lines().count()))
        .filter(|(_, lines)| *lines > MAX_LINES)
        .map(|(source, lines)| format!("{}: {lines} lines, at most {MAX_LINES}: split it", source.path))
        .collect();
    report(&problems);
}

#[test]
fn nothing_is_left_half_done() {
    let mut problems = Vec::new();
    for source in rust_files(&["src", "tests", "benches"]) {
        let tokens = source::tokens(&source.code);
        for pair in tokens.windows(2) {
            if pair[1].text == "!" && matches!(pair[0].text, "todo" | "unimplemented" | "dbg") {
                problems.push(format!("{}:{}: {}! is left in the code", source.path, pair[0].line, pair[0].text));
            }
        }
    }
    report(&problems);
}

#[test]
fn no_file_names_a_path_of_one_machine() {
    let homes = ["root", "home", "work", "Users"].map(|folder| format!("/{folder}/"));
    let folders = ["src", "tests", "benches", "configs", "jobscripts", "scripts", "docs", ".ci"];
    let single = ["README.md", "ARCHITECTURE.md", "CHANGELOG.md", "Makefile", "Cargo.toml"];
    let below = folders.iter().flat_map(|folder| files_below(&root().join(folder)));
    let mut problems = Vec::new();
    for path in below.chain(single.iter().map(|name| root().join(name))) {
        let Ok(text) = fs::read_to_string(&path) else { continue };
        for (index, line) in text.lines().enumerate() {
            for home in &homes {
                let starts_path =
                    |at: usize| !line[..at].ends_with(|c: char| c.is_alphanumeric() || "._-})/".contains(c));
                if line.match_indices(home.as_str()).any(|(at, _)| starts_path(at)) {
                    problems.push(format!("{}:{}: absolute path {home}…", path.display(), index + 1));
                }
            }
        }
    }
    report(&problems);
}

mod of_the_checks_themselves {
    use super::source::{blank_comments_and_literals, crate_paths, tokens};

    fn paths(code: &str, module: &[&str]) -> Vec<String> {
        crate_paths(&tokens(code), module).into_iter().map(|(path, _)| path.join("::")).collect()
    }

    #[test]
    fn comments_and_literals_are_blanked() {
        let code = blank_comments_and_literals(
            "a /* unsafe /* nested */ */ b // unsafe\n\"unsafe \\\" \" r#\"un\"safe\"# '\"' 'x: &'a c '\\'' d \"é\" e",
        );
        let words: Vec<&str> = tokens(&code).iter().map(|token| token.text).collect();
        assert_eq!(words, ["a", "b", "'", "x", ":", "&", "'", "a", "c", "d", "e"]);
    }

    #[test]
    fn grouped_imports_are_expanded() {
        assert_eq!(
            paths("use crate::{state::{Cell, self}, force::lane::*}; fn f() { crate::error::new() }", &[]),
            ["state::Cell", "state::self", "force::lane::*", "error::new"]
        );
    }

    #[test]
    fn super_is_resolved_to_the_root() {
        assert_eq!(paths("use super::lane::Lane;", &["force", "hertz"]), ["force::lane::Lane"]);
        assert_eq!(paths("use super::super::exchange::X;", &["force", "hertz"]), ["exchange::X"]);
        assert_eq!(paths("pub(super) fn f() {} pub(crate) fn g() {}", &["force", "hertz"]), [""; 0]);
    }
}
