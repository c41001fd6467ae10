//! The table of what came out: for the terminal, and as the Markdown document.

use super::check::{Check, Verdict};
use crate::error::Result;
use crate::output::files::write_atomically;
use std::fmt::Write as _;
use std::path::Path;

/// One figure of the paper as it came out.
#[derive(Debug, Clone)]
pub struct Chapter {
    /// Number of the figure.
    pub number: u32,
    /// What it shows.
    pub title: &'static str,
    /// What was run, and how it differs from the paper.
    pub setting: &'static str,
    /// The checks.
    pub checks: Vec<Check>,
    /// Names of its pictures, without ending.
    pub pictures: Vec<String>,
    /// Number of runs.
    pub runs: usize,
    /// Sum of the wall times of its runs, and the longest \[s\].
    pub wall: (f64, f64),
}

/// How many checks ended in each way.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Count {
    /// Passed.
    pub passed: usize,
    /// Failed.
    pub failed: usize,
    /// Findings.
    pub findings: usize,
}

/// Count the checks of all figures.
pub fn count(chapters: &[Chapter]) -> Count {
    let number = |verdict| chapters.iter().flat_map(|c| &c.checks).filter(|check| check.verdict == verdict).count();
    Count { passed: number(Verdict::Pass), failed: number(Verdict::Fail), findings: number(Verdict::Finding) }
}

fn effort(chapter: &Chapter) -> String {
    let (sum, longest) = chapter.wall;
    format!("{} runs, {sum:.1} s together, the longest {longest:.2} s", chapter.runs)
}

/// Print the table of one figure.
pub fn print(chapter: &Chapter) {
    say!("\nFig. {}: {} ({})", chapter.number, chapter.title, effort(chapter));
    for check in &chapter.checks {
        say!("  {:<72} {:>18}  {:<32} {}", check.claim, check.expected, check.got, check.verdict.word());
        if let Some(note) = check.note {
            say!("      {note}");
        }
    }
}

/// Write the document `wahn2022.md` into `folder`; `pictures` is where the pictures lie as seen from it.
///
/// # Errors
/// It cannot be written.
pub fn write(folder: &Path, command: &str, chapters: &[Chapter], total: f64) -> Result<()> {
    let mut text = format!(
        "# Wahn, Gan, Kamlah 2022: what we reproduce, and how well\n\n\
         Written by `{command}`, which makes every run, draws every picture and fills in\n\
         every number below. W is *Viscoelastic behavior in discrete element method realized by interparticle\n\
         Maxwell–Zener model*, doi:10.1142/S2424913022410053. Values over several packings stand as mean (least … most).\n\n"
    );
    let Count { passed, failed, findings } = count(chapters);
    let _ = writeln!(
        text,
        "**{passed} passed, {findings} findings, {failed} failed; {total:.0} s wall time.** A *finding* is a statement of \
         the paper, or a\nrequirement, that does not come out, with the measurement that shows why.\n"
    );
    text.push_str(include_str!("preface.md"));
    text.push('\n');
    for chapter in chapters {
        let _ = writeln!(text, "## Fig. {}: {}\n\n{}\n", chapter.number, chapter.title, chapter.setting);
        for name in &chapter.pictures {
            let _ = writeln!(text, "![Fig. {}](wahn2022/{name}.png)\n", chapter.number);
        }
        let _ = writeln!(text, "| must show | expected | came out | |\n| --- | --- | --- | --- |");
        for check in &chapter.checks {
            let _ =
                writeln!(text, "| {} | {} | {} | {} |", check.claim, check.expected, check.got, check.verdict.word());
        }
        for check in &chapter.checks {
            if let Some(note) = check.note {
                let _ = writeln!(text, "\n*{}*: {note}", check.claim);
            }
        }
        let _ = writeln!(text, "\n{}.\n", effort(chapter));
    }
    write_atomically(&folder.join("wahn2022.md"), text.as_bytes())
}
