//! Particles as a LAMMPS text dump, which OVITO reads: in id order, the same bytes for any number of ranks.

use super::{Moment, SnapshotParticle};
use crate::error::Result;
use crate::exchange::{Communicator, agree};
use crate::output::files::write_atomically;
use std::fmt::Write;
use std::path::Path;

/// Columns; `shapex` … are the diameters along the body's axes, as LAMMPS has them.
const COLUMNS: &str = "id type x y z radius shapex shapey shapez quatw quati quatj quatk vx vy vz omegax omegay omegaz";

/// Write one file. Collective; each rank passes its block of ids. SI units; ids and types count from 1.
///
/// # Errors
/// [`crate::error::Error::File`] on every rank when it cannot be written.
pub(super) fn write(
    comm: &Communicator,
    path: &Path,
    moment: &Moment,
    total: u64,
    particles: &[SnapshotParticle],
) -> Result<()> {
    let mut sends = vec![Vec::new(); comm.size()];
    sends[0] = rows(particles).into_bytes();
    let parts = comm.all_to_all(sends);
    let written = if comm.rank() == 0 {
        write_atomically(path, &[header(moment, total).into_bytes(), parts.concat()].concat())
    } else {
        Ok(())
    };
    agree(comm, written)
}

fn header(moment: &Moment, total: u64) -> String {
    let [x, y, z] = moment.sides;
    // Faces are drawn as periodic: dumps know positions inside the cell only.
    format!(
        "ITEM: UNITS\nsi\nITEM: TIME\n{:e}\nITEM: TIMESTEP\n{}\nITEM: NUMBER OF ATOMS\n{total}\nITEM: BOX BOUNDS pp pp \
         pp\n0 {x:e}\n0 {y:e}\n0 {z:e}\nITEM: ATOMS {COLUMNS}\n",
        moment.time, moment.step
    )
}

fn rows(particles: &[SnapshotParticle]) -> String {
    let mut text = String::new();
    for particle in particles {
        let shape = particle.semi_axes.map(|axis| 2.0 * axis);
        // Writing to a string cannot fail.
        let _ = write!(text, "{} {}", particle.id + 1, particle.species + 1);
        let numbers = particle.position.into_iter().chain([particle.radius]).chain(shape).chain(particle.orientation);
        for number in numbers.chain(particle.velocity).chain(particle.angular_velocity) {
            let _ = write!(text, " {number:e}");
        }
        text.push('\n');
    }
    text
}
