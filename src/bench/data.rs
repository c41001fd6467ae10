//! Writes packings: of spheres as LAMMPS data files, of ellipsoids as CSV.

use crate::error::Result;
use crate::output::files::{io_error, publish, temporary_name};
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

/// Particles in a periodic cell, in the order of ids.
#[derive(Debug, Clone, PartialEq)]
pub struct Packing {
    /// Sides of the cell \[m\].
    pub sides: [f64; 3],
    /// Density in motion \[kg/m³\].
    pub density: f64,
    /// The particles.
    pub bodies: Vec<Body>,
    /// Not all are spheres.
    pub ellipsoids: bool,
}

/// A particle of a packing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Body {
    /// Centre \[m\].
    pub position: [f64; 3],
    /// Semi-axes \[m\].
    pub semi_axes: [f64; 3],
    /// Unit quaternion.
    pub orientation: [f64; 4],
}

/// Write the packing, repeated along each axis.
///
/// # Errors
/// The file cannot be written.
pub fn write(path: &Path, packing: &Packing, copies: [usize; 3]) -> Result<()> {
    let temporary = temporary_name(path);
    let written = File::create(&temporary).and_then(|file| {
        let mut out = BufWriter::new(file);
        if packing.ellipsoids {
            table(&mut out, packing, copies)?;
        } else {
            text(&mut out, packing, copies)?;
        }
        out.into_inner().map_err(io::IntoInnerError::into_error)?.sync_all()
    });
    if let Err(error) = written {
        let _ = std::fs::remove_file(&temporary);
        return Err(io_error(path, "write the data file", &error));
    }
    publish(&temporary, path)
}

fn text(out: &mut impl Write, packing: &Packing, copies: [usize; 3]) -> io::Result<()> {
    let count = packing.bodies.len() * copies.iter().product::<usize>();
    writeln!(out, "periodic packing made by dem-mpi bench\n\n{count} atoms\n1 atom types\n")?;
    for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
        writeln!(out, "0.0 {:e} {name}lo {name}hi", packing.sides[axis] * copies[axis] as f64)?;
    }
    writeln!(out, "\nAtoms # sphere\n")?;
    let mut id = 0;
    for cell in cells(copies) {
        for body in &packing.bodies {
            id += 1;
            let [x, y, z] = moved(body.position, cell, packing.sides);
            writeln!(out, "{id} 1 {:e} {:e} {x:e} {y:e} {z:e}", 2.0 * body.semi_axes[0], packing.density)?;
        }
    }
    Ok(())
}

fn table(out: &mut impl Write, packing: &Packing, copies: [usize; 3]) -> io::Result<()> {
    let [x, y, z] = [0, 1, 2].map(|axis| packing.sides[axis] * copies[axis] as f64);
    writeln!(out, "# periodic packing made by dem-mpi bench; sides {x:e} {y:e} {z:e} m")?;
    writeln!(out, "species,x_m,y_m,z_m,a_m,b_m,c_m,qw,qx,qy,qz")?;
    for cell in cells(copies) {
        for body in &packing.bodies {
            let numbers = moved(body.position, cell, packing.sides).into_iter().chain(body.semi_axes);
            let numbers: Vec<String> = numbers.chain(body.orientation).map(|number| format!("{number:e}")).collect();
            writeln!(out, "1,{}", numbers.join(","))?;
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

    const fn ball(radius: f64, position: [f64; 3]) -> Body {
        Body { position, semi_axes: [radius; 3], orientation: [1.0, 0.0, 0.0, 0.0] }
    }

    #[test]
    fn what_is_written_is_read_back_to_the_bit() {
        let bodies = vec![ball(5e-6, [0.1e-5, 1.0 / 3.0 * 1e-5, 0.0]), ball(7.1e-6, [2e-5, 1e-5, 0.7e-5])];
        let packing = Packing { sides: [3.1e-5, 4e-5, 5e-5], density: 5e9, bodies, ellipsoids: false };
        let folder = tempfile::tempdir().expect("folder");
        let path = folder.path().join("two.data");
        write(&path, &packing, [2, 1, 1]).expect("write");
        let names = species_names(&path).expect("names");
        let region = Region { sides: None, periodic: [true; 3] };
        let contents = read(&path, &[names[0].as_str()], &region).expect("read");
        assert_eq!(contents.sides, [6.2e-5, 4e-5, 5e-5]);
        for (row, body) in contents.rows.iter().zip(&packing.bodies) {
            assert_eq!((row.radius, row.position), (body.semi_axes[0], body.position));
        }
        assert_eq!(contents.rows[3].position, [2e-5 + 3.1e-5, 1e-5, 0.7e-5]);
        assert_eq!((names.len(), contents.rows.len(), contents.rows[3].density), (1, 4, Some(5e9)));
    }

    #[test]
    fn ellipsoids_are_read_back_with_axes_and_orientation() {
        let body = Body { position: [1e-5; 3], semi_axes: [6e-6, 5e-6, 4e-6], orientation: [0.5, 0.5, -0.5, 0.5] };
        let packing = Packing { sides: [3e-5; 3], density: 5e9, bodies: vec![body], ellipsoids: true };
        let folder = tempfile::tempdir().expect("folder");
        let path = folder.path().join("one.csv");
        write(&path, &packing, [1, 2, 1]).expect("write");
        let region = Region { sides: Some([3e-5, 6e-5, 3e-5]), periodic: [true; 3] };
        let contents = read(&path, &["1"], &region).expect("read");
        let row = &contents.rows[1];
        assert_eq!((row.position, row.semi_axes), ([1e-5, 1e-5 + 3e-5, 1e-5], Some(body.semi_axes)));
        assert_eq!(row.orientation, Some(body.orientation));
    }
}
