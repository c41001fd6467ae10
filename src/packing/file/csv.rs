//! Particle tables as CSV.

use super::columns::Columns;
use super::{Problems, Table};
use std::path::Path;

/// Read the table.
///
/// # Errors
/// A text with line, column, value and remedy.
pub fn read(path: &Path) -> Result<Table, String> {
    let mut reader = csv::ReaderBuilder::new()
        .comment(Some(b'#'))
        .trim(csv::Trim::All)
        .from_path(path)
        .map_err(|error| format!("cannot be read ({error}); correct the path in the input"))?;
    let header = reader
        .headers()
        .map_err(|error| format!("the header cannot be read ({error}); write the file as UTF-8 text"))?;
    let names: Vec<String> = header.iter().map(str::to_owned).collect();
    let columns = Columns::from_names(&names)?;
    let mut problems = Problems::default();
    let mut table =
        Table { species: Vec::new(), numbers: vec![Vec::new(); columns.numbers.len()], place: Vec::new(), columns };
    for record in reader.records() {
        match record {
            Ok(record) => append(&mut table, &record, &mut problems),
            Err(error) => {
                let remedy = match error.kind() {
                    csv::ErrorKind::UnequalLengths { .. } => "give every line as many fields as the header has",
                    csv::ErrorKind::Utf8 { .. } => "write the file as UTF-8 text",
                    _ => "look at the disk, or write the file again",
                };
                problems.add(format!("{error}; {remedy}"));
                // A failing disk would go on for ever.
                if error.is_io_error() {
                    break;
                }
            }
        }
    }
    problems.into_result(table)
}

fn append(table: &mut Table, record: &csv::StringRecord, problems: &mut Problems) {
    let place = format!("line {}", record.position().map_or(0, csv::Position::line));
    let Table { columns, species, numbers, .. } = table;
    for ((column, position), list) in columns.numbers.iter().zip(&columns.positions).zip(numbers) {
        let text = &record[*position];
        let value = text.parse::<f64>();
        if value.is_err() {
            let name = &column.name;
            problems.add(format!("{place}, column {name}: \"{text}\" is not a number; write it like 1.5e-6"));
        }
        list.push(value.unwrap_or(f64::NAN));
    }
    species.push(record[columns.species].to_owned());
    table.place.push(place);
}
