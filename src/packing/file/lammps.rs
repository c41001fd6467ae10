//! LAMMPS data files of `atom_style sphere`: box, atoms with diameter and density, velocities.

use super::{Contents, Problems, Region, Row, refuse};
use crate::packing::grid::Cell;
use crate::packing::rcp::wrap;
use std::fs::File;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::str::{FromStr, SplitAsciiWhitespace};

/// The section of atoms is looked for within so many lines when a file's name does not tell its format.
const HEADER_LINES: usize = 40;
/// Largest difference between the box and the sides of the input, as a fraction.
const SAME_SIDE: f64 = 1e-9;

/// What stands before the sections.
#[derive(Debug, Clone, PartialEq)]
pub struct Header {
    /// Number of atoms.
    pub atoms: usize,
    /// Number of atom types.
    pub types: usize,
    /// Low corner of the box \[m\].
    pub low: [f64; 3],
    /// Sides of the box \[m\].
    pub sides: [f64; 3],
}

/// Whether the text looks like a data file: a line `N atoms` near its beginning.
pub fn recognise(path: &Path) -> bool {
    let Ok(file) = File::open(path) else { return false };
    let mut lines = BufReader::new(file).lines().take(HEADER_LINES).map_while(Result::ok);
    lines.any(|line| {
        let words: Vec<&str> = line.split_ascii_whitespace().collect();
        matches!(words[..], [number, "atoms"] if number.parse::<usize>().is_ok())
    })
}

/// The header alone.
///
/// # Errors
/// A text with line, value and remedy.
pub fn header(path: &Path) -> Result<Header, String> {
    Reader::open(path)?.header().map(|(header, _)| header)
}

/// Read all particles: atom `id` becomes particle `id − 1`, type `t` the `t`-th species.
///
/// # Errors
/// A text with line, value and remedy of every problem.
pub fn read(path: &Path, species: &[&str], region: &Region) -> Result<Contents, String> {
    let mut reader = Reader::open(path)?;
    let (header, mut section) = reader.header()?;
    let cell = Cell { sides: fitting_sides(&header, region)?, periodic: region.periodic };
    let mut atoms = Atoms { header, cell, types: species.len(), rows: Vec::new(), problems: Problems::default() };
    let mut has_atoms = false;
    while let Some(name) = section {
        let place = reader.line;
        match name.as_str() {
            "Atoms" if !has_atoms => {
                atoms.rows.resize(atoms.header.atoms, None);
                atoms.read_section(&mut reader, "Atoms", Atoms::atom)?;
                has_atoms = true;
            }
            "Velocities" if has_atoms => atoms.read_section(&mut reader, "Velocities", Atoms::velocity)?,
            "Atoms" => return Err(format!("line {place}: a second section Atoms; remove it")),
            "Velocities" => return Err(format!("line {place}: Velocities stand before Atoms; put them behind")),
            other => {
                let numbers = other.starts_with(|c: char| c.is_ascii_digit());
                let remedy = if numbers {
                    "there are more lines than the header has atoms; correct the number of atoms"
                } else {
                    "only Atoms and Velocities are read; remove it, or write the file with `write_data FILE nocoeff` \
                     from atom_style sphere"
                };
                atoms.problems.add(format!("line {place}: \"{other}\" begins no section: {remedy}"));
                break;
            }
        }
        section = reader.next()?.map(str::to_owned);
    }
    if !has_atoms {
        atoms.problems.into_result(())?;
        return Err("there is no section Atoms; the file is not complete, write it again".into());
    }
    let Atoms { cell, rows, problems, .. } = atoms;
    // Every line held an id of its own, so none is left empty.
    problems.into_result(Contents { sides: cell.sides, rows: rows.into_iter().flatten().collect() })
}

/// The sides of the box, if those of the input (when it has any) are the same.
fn fitting_sides(header: &Header, region: &Region) -> Result<[f64; 3], String> {
    let Some(wanted) = region.sides else { return Ok(header.sides) };
    for axis in 0..3 {
        let (own, given) = (header.sides[axis], wanted[axis]);
        if (own - given).abs() > SAME_SIDE * own {
            let name = ["x", "y", "z"][axis];
            return Err(format!(
                "the box is {own:e} m wide in {name}, the cell of the input {given:e} m; remove `sides` from the input, \
                 then the box of the file is the cell"
            ));
        }
    }
    Ok(wanted)
}

/// Lines without comments, counted.
struct Reader {
    input: BufReader<File>,
    text: String,
    line: usize,
    /// The word behind `#` on the present line.
    comment: String,
}

impl Reader {
    fn open(path: &Path) -> Result<Self, String> {
        let file =
            File::open(path).map_err(|error| format!("cannot be read ({error}); correct the path in the input"))?;
        let input = BufReader::with_capacity(1 << 20, file);
        let mut reader = Self { input, text: String::new(), line: 0, comment: String::new() };
        // The first line is a title, whatever it says.
        reader.advance()?;
        Ok(reader)
    }

    fn advance(&mut self) -> Result<bool, String> {
        self.text.clear();
        self.line += 1;
        let read = self.input.read_line(&mut self.text);
        read.map(|bytes| bytes > 0)
            .map_err(|error| format!("line {} cannot be read ({error}); write the file as plain text", self.line))
    }

    /// The next line that holds something, without its comment; `None` at the end.
    fn next(&mut self) -> Result<Option<&str>, String> {
        while self.advance()? {
            let (text, comment) = self.text.split_once('#').unwrap_or((&self.text, ""));
            let length = text.trim_end().len();
            if !text.trim().is_empty() {
                self.comment.clear();
                self.comment.push_str(comment.trim());
                self.text.truncate(length);
                return Ok(Some(self.text.trim_start()));
            }
        }
        Ok(None)
    }

    /// The header, and the name of the first section.
    fn header(&mut self) -> Result<(Header, Option<String>), String> {
        let (mut atoms, mut types) = (None, None);
        let mut bounds: [Option<[f64; 2]>; 3] = [None; 3];
        let mut section = None;
        while self.next()?.is_some() {
            let line = self.line;
            let words: Vec<&str> = self.text.split_ascii_whitespace().collect();
            match words[..] {
                [number, "atoms"] => atoms = Some(parsed(number, line, "a number of atoms")?),
                [number, "atom", "types"] => types = Some(parsed(number, line, "a number of types")?),
                [low, high, name @ ("xlo" | "ylo" | "zlo"), _] => {
                    let axis = usize::from(name.as_bytes()[0] - b'x');
                    bounds[axis] = Some([parsed(low, line, "a coordinate")?, parsed(high, line, "a coordinate")?]);
                }
                [a, b, c, "xy", "xz", "yz"] => refuse_tilt([a, b, c], line)?,
                [.., "avec" | "bvec" | "cvec"] => return Err(tilted(line, &self.text)),
                [number, ..] if number.starts_with(|c: char| c.is_ascii_digit() || c == '-') => {
                    // Counts of bonds and the like may stand there as zero.
                    if number != "0" {
                        return Err(format!(
                            "line {line}: \"{}\" has no meaning for spheres; remove it, or write the file from \
                             atom_style sphere",
                            self.text.trim()
                        ));
                    }
                }
                _ => {
                    section = Some(self.text.trim().to_owned());
                    break;
                }
            }
        }
        let missing = |what: &str| format!("the header has no line \"{what}\"; add it before the first section");
        let atoms: usize = atoms.ok_or_else(|| missing("N atoms"))?;
        let types: usize = types.ok_or_else(|| missing("N atom types"))?;
        let (mut low, mut sides) = ([0.0; 3], [0.0; 3]);
        for axis in 0..3 {
            let name = ["x", "y", "z"][axis];
            let [from, to] = bounds[axis].ok_or_else(|| missing(&format!("LOW HIGH {name}lo {name}hi")))?;
            low[axis] = from;
            sides[axis] = to - from;
            if !(sides[axis].is_finite() && sides[axis] > 0.0) {
                return Err(format!("the box reaches from {from} to {to} in {name}; {name}hi must exceed {name}lo"));
            }
        }
        Ok((Header { atoms, types, low, sides }, section))
    }
}

fn parsed<T: FromStr>(text: &str, line: usize, what: &str) -> Result<T, String> {
    text.parse().map_err(|_| format!("line {line}: \"{text}\" is not {what}; correct it"))
}

fn refuse_tilt(factors: [&str; 3], line: usize) -> Result<(), String> {
    for text in factors {
        if parsed::<f64>(text, line, "a tilt factor")? != 0.0 {
            return Err(tilted(line, &format!("{} xy xz yz", factors.join(" "))));
        }
    }
    Ok(())
}

fn tilted(line: usize, text: &str) -> String {
    format!(
        "line {line}: \"{}\" tilts the box, and cells are upright here; bring the box to right angles (LAMMPS: \
         `change_box all ortho`) and write the file again",
        text.trim()
    )
}

/// The atoms read so far, by id.
struct Atoms {
    header: Header,
    cell: Cell,
    /// Number of species.
    types: usize,
    rows: Vec<Option<Row>>,
    problems: Problems,
}

impl Atoms {
    /// Read as many lines as there are atoms; `each` takes one and gives what is wrong with it.
    fn read_section(
        &mut self,
        reader: &mut Reader,
        name: &str,
        each: fn(&mut Self, &str) -> Result<(), String>,
    ) -> Result<(), String> {
        let style = reader.comment.split_ascii_whitespace().next().unwrap_or("sphere");
        // LIGGGHTS calls the same style granular.
        if !matches!(style, "sphere" | "granular") {
            return Err(format!(
                "line {}: the atoms are of style {style}, and only atom_style sphere is read (id type diameter density \
                 x y z); write the file from atom_style sphere",
                reader.line
            ));
        }
        let atoms = self.header.atoms;
        for count in 0..atoms {
            let Some(text) = reader.next()? else {
                return Err(format!(
                    "section {name} ends after {count} of {atoms} atoms; the file is not complete, write it again"
                ));
            };
            if let Err(problem) = each(self, text) {
                self.problems.add(format!("line {}: {problem}", reader.line));
            }
        }
        Ok(())
    }

    /// `id type diameter density x y z`, with or without three image flags.
    fn atom(&mut self, text: &str) -> Result<(), String> {
        let mut words = text.split_ascii_whitespace();
        let columns = text.split_ascii_whitespace().count();
        if !matches!(columns, 7 | 10) {
            return Err(format!(
                "{columns} columns, where atom_style sphere has 7 (id type diameter density x y z) or 10 (and three \
                 image flags); write the file from atom_style sphere"
            ));
        }
        let index = self.index(words.next())?;
        if self.rows[index].is_some() {
            return Err(format!("atom {} stands there twice; remove one", index + 1));
        }
        let species = self.species(words.next())?;
        let [diameter, density, x, y, z] = numbers(&mut words, ["diameter", "density", "x", "y", "z"])?;
        if diameter <= 0.0 {
            return Err(format!("diameter {diameter} is none of a sphere; it must be greater than 0"));
        }
        if density <= 0.0 {
            return Err(format!("density {density} must be greater than 0"));
        }
        let low = self.header.low;
        let mut position = [x - low[0], y - low[1], z - low[2]];
        for axis in 0..3 {
            if let Some(reason) = refuse(super::Quantity::Position, position[axis], position[axis], axis, &self.cell) {
                return Err(format!("{} = {} {reason}", ["x", "y", "z"][axis], [x, y, z][axis]));
            }
            if self.cell.periodic[axis] {
                position[axis] = wrap(position[axis], self.cell.sides[axis]);
            }
        }
        self.rows[index] = Some(Row {
            species,
            position,
            radius: 0.5 * diameter,
            semi_axes: None,
            orientation: None,
            density: Some(density),
            velocity: None,
            spin: None,
        });
        Ok(())
    }

    /// `id vx vy vz wx wy wz`.
    fn velocity(&mut self, text: &str) -> Result<(), String> {
        let columns = text.split_ascii_whitespace().count();
        if columns != 7 {
            return Err(format!(
                "{columns} columns, where the velocities of spheres have 7 (id vx vy vz wx wy wz); write the file from \
                 atom_style sphere"
            ));
        }
        let mut words = text.split_ascii_whitespace();
        let index = self.index(words.next())?;
        let [vx, vy, vz, wx, wy, wz] = numbers(&mut words, ["vx", "vy", "vz", "wx", "wy", "wz"])?;
        if let Some(row) = &mut self.rows[index] {
            if row.velocity.is_some() {
                return Err(format!("atom {} has its velocities twice; remove one of the lines", index + 1));
            }
            row.velocity = Some([vx, vy, vz]);
            row.spin = Some([wx, wy, wz]);
        }
        Ok(())
    }

    fn index(&self, word: Option<&str>) -> Result<usize, String> {
        let atoms = self.header.atoms;
        let text = word.unwrap_or_default();
        match text.parse::<usize>() {
            Ok(id) if (1..=atoms).contains(&id) => Ok(id - 1),
            _ => Err(format!(
                "atom id \"{text}\" is none from 1 to {atoms}; number the atoms without gaps (LAMMPS: `reset_atoms id`)"
            )),
        }
    }

    fn species(&self, word: Option<&str>) -> Result<u32, String> {
        let text = word.unwrap_or_default();
        match text.parse::<u32>() {
            Ok(number @ 1..) if number as usize <= self.types => Ok(number - 1),
            Ok(number @ 1..) if number as usize <= self.header.types => Err(format!(
                "type {number} has no species, the input has {}; give every type a [[species]], in the order of types",
                self.types
            )),
            _ => Err(format!("type \"{text}\" is none from 1 to {}; correct it or the header", self.header.types)),
        }
    }
}

/// The next words as finite numbers.
fn numbers<const N: usize>(words: &mut SplitAsciiWhitespace, names: [&str; N]) -> Result<[f64; N], String> {
    let mut values = [0.0; N];
    for (value, name) in values.iter_mut().zip(names) {
        let text = words.next().unwrap_or_default();
        *value = text
            .parse()
            .ok()
            .filter(|number: &f64| number.is_finite())
            .ok_or_else(|| format!("{name} \"{text}\" is not a finite number; write it like 1.5e-6"))?;
    }
    Ok(values)
}

#[cfg(test)]
mod tests;
