//! Writes packings as LAMMPS data files.

use crate::error::Result;
use crate::output::files::{io_error, publish, temporary_name};
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

/// Spheres in a periodic cell, in the order of ids.
#[derive(Debug, Clone, PartialEq)]
pub struct Spheres {
    /// Sides of the cell \[m\].
    pub sides: [f64; 3],
    /// Density in motion \[kg/m³\].
    pub density: f64,
    /// Radius and centre \[m\].
    pub balls: Vec<(f64, [f64; 3])>,
}

/// Write the packing, repeated along each axis.
///
/// # Errors
/// The file cannot be written.
pub fn write(path: &Path, packing: &Spheres, copies: [usize; 3]) -> Result<()> {
    let temporary = temporary_name(path);
    let written = File::create(&temporary).and_then(|file| {
        let mut out = BufWriter::new(file);
        text(&mut out, packing, copies)?;
        out.into_inner().map_err(io::IntoInnerError::into_error)?.sync_all()
    });
    if let Err(error) = written {
        let _ = std::fs::remove_file(&temporary);
        return Err(io_error(path, "write the data file", &error));
    }
    publish(&temporary, path)
}

fn text(out: &mut impl Write, packing: &Spheres, copies: [usize; 3]) -> io::Result<()> {
    let count = packing.balls.len() * copies.iter().product::<usize>();
    writeln!(out, "periodic packing made by dem-mpi bench\n\n{count} atoms\n1 atom types\n")?;
    for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
        writeln!(out, "0.0 {:e} {name}lo {name}hi", packing.sides[axis] * copies[axis] as f64)?;
    }
    writeln!(out, "\nAtoms # sphere\n")?;
    let mut id = 0;
    for cell in cells(copies) {
        for (radius, position) in &packing.balls {
            id += 1;
            let [x, y, z] = moved(*position, cell, packing.sides);
            writeln!(out, "{id} 1 {:e} {:e} {x:e} {y:e} {z:e}", 2.0 * radius, packing.density)?;
        }
    }
    Ok(())
}

/// All copies, the first axis fastest.
pub fn cells([a, b, c]: [usize; 3]) -> impl Iterator<Item = [usize; 3]> {
    (0..a * b * c).map(move |copy| [copy % a, copy / a % b, copy / a / b])
}

/// A position in one of the copies.
pub fn moved(position: [f64; 3], cell: [usize; 3], sides: [f64; 3]) -> [f64; 3] {
    [0, 1, 2].map(|k| position[k] + cell[k] as f64 * sides[k])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::packing::file::{Region, read, species_names};

    #[test]
    fn what_is_written_is_read_back_to_the_bit() {
        let spheres = vec![(5e-6, [0.1e-5, 1.0 / 3.0 * 1e-5, 0.0]), (7.1e-6, [2e-5, 1e-5, 0.7e-5])];
        let packing = Spheres { sides: [3.1e-5, 4e-5, 5e-5], density: 5e9, balls: spheres };
        let folder = tempfile::tempdir().expect("folder");
        let path = folder.path().join("two.data");
        write(&path, &packing, [2, 1, 1]).expect("write");
        let names = species_names(&path).expect("names");
        let region = Region { sides: None, periodic: [true; 3] };
        let contents = read(&path, &[names[0].as_str()], &region).expect("read");
        assert_eq!(contents.sides, [6.2e-5, 4e-5, 5e-5]);
        let first: Vec<_> = contents.rows.iter().take(2).map(|row| (row.radius, row.position)).collect();
        assert_eq!(first, packing.balls);
        assert_eq!(contents.rows[3].position, [2e-5 + 3.1e-5, 1e-5, 0.7e-5]);
        assert_eq!((names.len(), contents.rows.len(), contents.rows[3].density), (1, 4, Some(5e9)));
    }
}
