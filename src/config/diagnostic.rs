//! Problems found in the input and how they are shown: place, what is wrong, what is allowed.

use std::fmt::Write as _;
use std::ops::Range;

/// A text that input comes from: the file, or one `--set` of the command line.
#[derive(Debug, Clone)]
pub(super) struct Source {
    pub name: String,
    pub text: String,
}

/// Where something stands: a source and a byte range in it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Place {
    pub source: usize,
    pub span: Range<usize>,
}

/// One problem.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Problem {
    pub place: Place,
    /// Dotted key, empty for syntax errors.
    pub key: String,
    /// What is wrong, with the value found.
    pub message: String,
    /// What is allowed or what to do.
    pub remedy: String,
}

/// All problems as one text, in the order of the input, each with its source line and a caret.
pub(super) fn render(sources: &[Source], mut problems: Vec<Problem>) -> String {
    problems.sort_by_key(|p| (p.place.source, p.place.span.start, p.place.span.end));
    problems.dedup();
    let mut text = String::new();
    for problem in &problems {
        render_one(&mut text, &sources[problem.place.source], problem);
    }
    let name = sources.first().map_or("the input", |s| s.name.as_str());
    let count = problems.len();
    let _ = write!(text, "{name}: {count} problem{} found, nothing was run", if count == 1 { "" } else { "s" });
    text
}

fn render_one(text: &mut String, source: &Source, problem: &Problem) {
    let (line, column, content, width) = locate(&source.text, &problem.place.span);
    let colon = if problem.key.is_empty() { "" } else { ": " };
    let gutter = line.to_string();
    let margin = " ".repeat(gutter.len());
    // Tabs stay tabs so that the caret stands below its text in any terminal.
    let indent: String = content.chars().take(column - 1).map(|c| if c == '\t' { '\t' } else { ' ' }).collect();
    let _ = writeln!(text, "error: {}{colon}{}", problem.key, problem.message);
    let _ = writeln!(text, "{margin}--> {}:{line}:{column}", source.name);
    let _ = writeln!(text, "{gutter} | {content}");
    let _ = writeln!(text, "{margin} | {indent}{}", "^".repeat(width));
    let _ = writeln!(text, "{margin} = {}\n", problem.remedy);
}

/// Line and column (from 1, in characters), the line's text, and the width to underline.
fn locate<'a>(text: &'a str, span: &Range<usize>) -> (usize, usize, &'a str, usize) {
    let boundary = |mut at: usize| {
        at = at.min(text.len());
        while !text.is_char_boundary(at) {
            at -= 1;
        }
        at
    };
    let (start, end) = (boundary(span.start), boundary(span.end));
    let line_start = text[..start].rfind('\n').map_or(0, |at| at + 1);
    let content = text[line_start..].lines().next().unwrap_or("");
    let line = text[..line_start].matches('\n').count() + 1;
    let column = text[line_start..start].chars().count() + 1;
    let line_end = (line_start + content.len()).max(start);
    let width = text[start..end.clamp(start, line_end)].chars().count().max(1);
    (line, column, content, width)
}

/// The candidate most like `name`, if any is near enough to be what was meant.
pub(super) fn nearest<'a>(name: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    candidates
        .into_iter()
        .map(|candidate| (strsim::jaro_winkler(&name.to_lowercase(), &candidate.to_lowercase()), candidate))
        .filter(|(likeness, _)| *likeness > 0.75)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, candidate)| candidate)
}

/// `; did you mean `x`?` or nothing.
pub(super) fn did_you_mean<'a>(name: &str, candidates: impl IntoIterator<Item = &'a str>) -> String {
    nearest(name, candidates).map_or_else(String::new, |near| format!("; did you mean `{near}`?"))
}
