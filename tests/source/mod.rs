//! Reads Rust source as text: blanks comments and literals, drops test modules, lists the paths that
//! a file names. Enough for the checks on the architecture; not a parser of the language.

use std::fs;
use std::path::{Path, PathBuf};

/// One source file.
pub struct Source {
    /// Path from the repository's root, with forward slashes.
    pub path: String,
    /// The text as written.
    pub text: String,
    /// The text with comments and the insides of literals blanked; lines keep their numbers.
    pub code: String,
}

impl Source {
    fn read(root: &Path, path: &Path) -> Self {
        let text = fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        let relative = path.strip_prefix(root).expect("files are listed below the root");
        let code = blank_comments_and_literals(&text);
        Self { path: relative.to_string_lossy().replace('\\', "/"), text, code }
    }

    /// Module path of a file below `src/`: `src/force/lane.rs` is `["force", "lane"]`.
    pub fn module(&self) -> Vec<&str> {
        let inside = self.path.trim_start_matches("src/").trim_end_matches(".rs");
        inside.split('/').filter(|part| !matches!(*part, "mod" | "lib" | "main")).collect()
    }

    /// Name of the file without its folder.
    pub fn file_name(&self) -> &str {
        self.path.rsplit('/').next().unwrap_or(&self.path)
    }

    /// Tokens of the code without `#[cfg(test)]` modules, which may import whatever they compare with.
    pub fn tokens(&self) -> Vec<Token<'_>> {
        without_test_modules(&tokens(&self.code))
    }
}

/// A word or a mark of the code, with its line.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Token<'a> {
    /// The word; `::` is one mark, any other mark one character.
    pub text: &'a str,
    /// Line number from 1.
    pub line: usize,
}

/// The repository's root.
pub fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

/// Every Rust file below these folders of the repository.
pub fn rust_files(folders: &[&str]) -> Vec<Source> {
    let root = root();
    let paths = folders.iter().flat_map(|folder| files_below(&root.join(folder)));
    paths.filter(|path| path.extension().is_some_and(|e| e == "rs")).map(|path| Source::read(&root, &path)).collect()
}

/// Every file below a folder, in the order of names; none if the folder is absent.
pub fn files_below(folder: &Path) -> Vec<PathBuf> {
    let Ok(entries) = fs::read_dir(folder) else { return Vec::new() };
    let mut paths: Vec<PathBuf> = entries.filter_map(|entry| Some(entry.ok()?.path())).collect();
    paths.sort();
    paths.into_iter().flat_map(|path| if path.is_dir() { files_below(&path) } else { vec![path] }).collect()
}

/// Comments and the insides of string and character literals become spaces.
pub fn blank_comments_and_literals(text: &str) -> String {
    let bytes = text.as_bytes();
    let mut code = bytes.to_vec();
    let mut at = 0;
    while at < bytes.len() {
        let end = match bytes[at] {
            b'/' if bytes.get(at + 1) == Some(&b'/') => find(bytes, at, b"\n"),
            b'/' if bytes.get(at + 1) == Some(&b'*') => block_comment_end(bytes, at),
            b'"' => string_end(bytes, at),
            b'r' if !follows_word(bytes, at) => raw_string_end(bytes, at),
            b'b' if bytes.get(at + 1) == Some(&b'r') && !follows_word(bytes, at) => raw_string_end(bytes, at + 1),
            b'\'' => character_end(bytes, at),
            _ => at,
        };
        if end == at {
            at += 1;
        } else {
            code[at..end].iter_mut().filter(|byte| **byte != b'\n').for_each(|byte| *byte = b' ');
            at = end;
        }
    }
    String::from_utf8(code).expect("whole characters are blanked")
}

fn find(bytes: &[u8], from: usize, what: &[u8]) -> usize {
    bytes[from..].windows(what.len()).position(|window| window == what).map_or(bytes.len(), |offset| from + offset)
}

fn block_comment_end(bytes: &[u8], start: usize) -> usize {
    let (mut depth, mut at) = (0, start);
    while at < bytes.len() {
        match &bytes[at..bytes.len().min(at + 2)] {
            b"/*" => (depth, at) = (depth + 1, at + 2),
            b"*/" if depth == 1 => return at + 2,
            b"*/" => (depth, at) = (depth - 1, at + 2),
            _ => at += 1,
        }
    }
    at
}

fn string_end(bytes: &[u8], start: usize) -> usize {
    let mut at = start + 1;
    while at < bytes.len() && bytes[at] != b'"' {
        at += if bytes[at] == b'\\' { 2 } else { 1 };
    }
    bytes.len().min(at + 1)
}

/// End of `r"…"` or `r#"…"#` that starts at `start`; `start` itself if it is an ordinary word.
fn raw_string_end(bytes: &[u8], start: usize) -> usize {
    let hashes = bytes[start + 1..].iter().take_while(|byte| **byte == b'#').count();
    let open = start + 1 + hashes;
    if bytes.get(open) != Some(&b'"') {
        return start;
    }
    let close = [b"\"".as_slice(), &b"#".repeat(hashes)].concat();
    bytes.len().min(find(bytes, open + 1, &close) + close.len())
}

/// End of a character literal; `start` itself for a lifetime.
fn character_end(bytes: &[u8], start: usize) -> usize {
    if bytes.get(start + 1) == Some(&b'\\') {
        return bytes.len().min(find(bytes, start + 3, b"'") + 1);
    }
    let close = find(bytes, start + 1, b"'");
    let inside = std::str::from_utf8(&bytes[(start + 1).min(close)..close]).unwrap_or("");
    if inside.chars().count() == 1 { close + 1 } else { start }
}

fn follows_word(bytes: &[u8], at: usize) -> bool {
    at > 0 && (bytes[at - 1].is_ascii_alphanumeric() || bytes[at - 1] == b'_')
}

/// Words and marks of blanked code.
pub fn tokens(code: &str) -> Vec<Token<'_>> {
    let is_word = |c: char| c.is_alphanumeric() || c == '_';
    let mut found = Vec::new();
    for (index, line) in code.lines().enumerate() {
        let mut rest = line.trim_start();
        while let Some(first) = rest.chars().next() {
            let length = match first {
                c if is_word(c) => rest.find(|c| !is_word(c)).unwrap_or(rest.len()),
                ':' if rest.starts_with("::") => 2,
                c => c.len_utf8(),
            };
            found.push(Token { text: &rest[..length], line: index + 1 });
            rest = rest[length..].trim_start();
        }
    }
    found
}

/// Drops each `#[cfg(test)] mod name { … }`.
fn without_test_modules<'a>(all: &[Token<'a>]) -> Vec<Token<'a>> {
    const OPENING: [&str; 8] = ["#", "[", "cfg", "(", "test", ")", "]", "mod"];
    let mut kept = Vec::with_capacity(all.len());
    let mut at = 0;
    while at < all.len() {
        let opens = OPENING.iter().enumerate().all(|(k, text)| all.get(at + k).is_some_and(|t| t.text == *text));
        if opens && all.get(at + OPENING.len() + 1).is_some_and(|t| t.text == "{") {
            at = matching_brace(all, at + OPENING.len() + 1) + 1;
        } else {
            kept.push(all[at]);
            at += 1;
        }
    }
    kept
}

fn matching_brace(all: &[Token<'_>], open: usize) -> usize {
    let mut depth = 0;
    for (at, token) in all.iter().enumerate().skip(open) {
        match token.text {
            "{" => depth += 1,
            "}" if depth == 1 => return at,
            "}" => depth -= 1,
            _ => {}
        }
    }
    all.len()
}

/// Paths inside the crate that the tokens name, each from the crate's root, with its line. `module` is
/// the module of the file, for `super::`.
pub fn crate_paths(all: &[Token<'_>], module: &[&str]) -> Vec<(Vec<String>, usize)> {
    let mut paths = Vec::new();
    for (at, token) in all.iter().enumerate() {
        let after_path = at > 0 && all[at - 1].text == "::";
        if after_path || !matches!(token.text, "crate" | "super") || all.get(at + 1).is_none_or(|t| t.text != "::") {
            continue;
        }
        let (mut start, mut prefix) = (at + 2, Vec::new());
        if token.text == "super" {
            let mut levels = 1;
            while all.get(start).is_some_and(|t| t.text == "super")
                && all.get(start + 1).is_some_and(|t| t.text == "::")
            {
                (levels, start) = (levels + 1, start + 2);
            }
            let kept = module.len().saturating_sub(levels);
            prefix.extend(module[..kept].iter().map(ToString::to_string));
        }
        expand(all, start, &prefix, &mut paths);
    }
    paths
}

/// Follows one use tree from `at`; returns the place behind it.
fn expand(all: &[Token<'_>], mut at: usize, prefix: &[String], paths: &mut Vec<(Vec<String>, usize)>) -> usize {
    let mut path = prefix.to_vec();
    while let Some(token) = all.get(at) {
        if token.text == "{" {
            at += 1;
            while all.get(at).is_some_and(|t| t.text != "}") {
                let next = expand(all, at, &path, paths);
                at = if next == at { at + 1 } else { next };
            }
            return at + 1;
        }
        if !token.text.starts_with(|c: char| c.is_alphabetic() || c == '_' || c == '*') {
            return at;
        }
        path.push(token.text.to_string());
        at += 1;
        if all.get(at).is_none_or(|t| t.text != "::") {
            paths.push((path, token.line));
            return at;
        }
        at += 1;
    }
    at
}
