//! Particle tables as one-dimensional datasets in the root group of an HDF5 file.

use super::Table;
use super::columns::Columns;
use hdf5::types::{FixedAscii, FixedUnicode, TypeDescriptor, VarLenAscii, VarLenUnicode};
use hdf5::{Dataset, File};
use std::path::Path;

/// Fixed-length names may have so many bytes.
const MAX_NAME: usize = 256;

/// Read the table.
///
/// # Errors
/// A text with dataset, value and remedy.
pub fn read(path: &Path) -> Result<Table, String> {
    std::fs::metadata(path).map_err(|error| format!("cannot be read ({error}); correct the path in the input"))?;
    let file = File::open(path)
        .map_err(|error| format!("is not a readable HDF5 file ({error}); write it anew or give a .csv file"))?;
    let datasets = file.datasets().map_err(|error| format!("its datasets cannot be listed: {error}"))?;
    let names: Vec<String> = datasets.iter().map(|dataset| dataset.name().trim_start_matches('/').to_owned()).collect();
    let columns = Columns::from_names(&names)?;
    let species = read_names(&datasets[columns.species])?;
    let mut numbers = Vec::with_capacity(columns.numbers.len());
    for (column, position) in columns.numbers.iter().zip(&columns.positions) {
        let values = read_numbers(&datasets[*position], &column.name)?;
        if values.len() != species.len() {
            return Err(format!(
                "dataset {} has {} values, species has {}; give all datasets the same length",
                column.name,
                values.len(),
                species.len()
            ));
        }
        numbers.push(values);
    }
    let place = (0..species.len()).map(|row| format!("row {row}")).collect();
    Ok(Table { columns, species, numbers, place })
}

fn read_numbers(dataset: &Dataset, name: &str) -> Result<Vec<f64>, String> {
    dataset
        .read_raw::<f64>()
        .map_err(|error| format!("dataset {name} is not a list of numbers ({error}); write it as floating point"))
}

/// Species names from any of the four kinds of HDF5 strings.
fn read_names(dataset: &Dataset) -> Result<Vec<String>, String> {
    let descriptor = dataset.dtype().and_then(|datatype| datatype.to_descriptor());
    let names = match descriptor {
        Ok(TypeDescriptor::VarLenUnicode) => strings(dataset.read_raw::<VarLenUnicode>()),
        Ok(TypeDescriptor::VarLenAscii) => strings(dataset.read_raw::<VarLenAscii>()),
        Ok(TypeDescriptor::FixedUnicode(length)) if length <= MAX_NAME => {
            strings(dataset.read_raw::<FixedUnicode<MAX_NAME>>())
        }
        Ok(TypeDescriptor::FixedAscii(length)) if length <= MAX_NAME => {
            strings(dataset.read_raw::<FixedAscii<MAX_NAME>>())
        }
        Ok(other) => Err(format!("its type is {other}")),
        Err(error) => Err(error.to_string()),
    };
    names.map_err(|reason| format!("dataset species is not a list of names ({reason}); write it as strings"))
}

fn strings<T: ToString>(values: hdf5::Result<Vec<T>>) -> Result<Vec<String>, String> {
    values.map(|values| values.iter().map(ToString::to_string).collect()).map_err(|error| error.to_string())
}
