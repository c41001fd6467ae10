//! Snapshots: one VTKHDF file per time, written by all ranks together, with a time index that grows
//! beside them. Particles in id order, contacts in key order. Knows nothing of how often they come.

mod blocks;
mod dump;
mod index;
mod vtkhdf;

use super::files::{create_folder, io_error};
use crate::error::Result;
use crate::exchange::{Communicator, agree};
use crate::force::law::Column;
use crate::state::ContactKey;
use bytemuck::{Pod, Zeroable};
use std::fs;
use std::path::{Path, PathBuf};

/// What a snapshot shows of a particle.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct SnapshotParticle {
    /// Global id.
    pub id: u32,
    /// Species.
    pub species: u32,
    /// Position, wrapped into the cell \[m\].
    pub position: [f64; 3],
    /// Radius; of an ellipsoid its largest semi-axis \[m\].
    pub radius: f64,
    /// Semi-axes \[m\].
    pub semi_axes: [f64; 3],
    /// Orientation, unit quaternion (w, x, y, z).
    pub orientation: [f64; 4],
    /// Velocity at the full step \[m/s\].
    pub velocity: [f64; 3],
    /// Angular velocity at the full step \[rad/s\].
    pub angular_velocity: [f64; 3],
    /// Trace of the particle's stress, compression positive \[Pa\].
    pub stress_trace: f64,
    /// Number of contacts.
    pub coordination: u32,
    /// Keeps the layout free of hidden padding; zero.
    pub reserved: u32,
}

/// What a snapshot shows of a contact.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct SnapshotContact {
    /// Identity.
    pub key: ContactKey,
    /// Position of the particle of low id \[m\].
    pub start: [f64; 3],
    /// Branch vector from the low to the high id's centre \[m\].
    pub branch: [f64; 3],
    /// Force on the particle of low id \[N\].
    pub force: [f64; 3],
    /// Normal force, compression positive \[N\].
    pub normal_force: f64,
    /// Overlap \[m\].
    pub overlap: f64,
}

/// The contacts of one rank, each counted by the owner of its low id.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct SnapshotContacts {
    /// The contacts, in any order.
    pub contacts: Vec<SnapshotContact>,
    /// Memory columns per contact.
    pub width: usize,
    /// Row-major memory, `contacts.len() × width`.
    pub memory: Vec<f64>,
    /// Names and units of the memory columns of each pair of materials.
    pub columns: Vec<Vec<Column>>,
}

/// The moment that a snapshot shows.
#[derive(Debug, Clone, Copy, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub struct Moment {
    /// Steps done.
    pub step: u64,
    /// Time \[s\].
    pub time: f64,
    /// Cell sides \[m\].
    pub sides: [f64; 3],
}

/// What all snapshots of a run hold beside the usual arrays.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Style {
    /// Semi-axes, and the tensor that draws ellipsoids: there are some.
    pub ellipsoids: bool,
    /// A LAMMPS text dump beside each snapshot.
    pub dump: bool,
}

/// The snapshots of a run: `snapshots/` in its directory.
pub struct SnapshotSeries {
    comm: Communicator,
    folder: PathBuf,
    moments: Vec<Moment>,
    style: Style,
}

impl SnapshotSeries {
    /// A new series; the folder is made with the first snapshot and older snapshots are removed.
    /// Collective.
    ///
    /// # Errors
    /// [`crate::error::Error::File`] on every rank when old files cannot be removed.
    pub fn create(comm: &Communicator, directory: &Path, style: Style) -> Result<Self> {
        Self::resume(comm, directory, 0, style)
    }

    /// Go on after the first `count` snapshots of a run (restart), removing later ones. Collective.
    ///
    /// # Errors
    /// [`crate::error::Error::File`] on every rank when there are fewer or files cannot be removed.
    pub fn resume(comm: &Communicator, directory: &Path, count: u64, style: Style) -> Result<Self> {
        let folder = directory.join("snapshots");
        let kept = if comm.rank() == 0 { keep_first(&folder, count) } else { Ok(Vec::new()) };
        let moments = agree(comm, kept)?;
        Ok(Self { comm: comm.clone(), folder, moments: share(comm, &moments), style })
    }

    /// Number of snapshots written.
    #[must_use]
    pub fn count(&self) -> u64 {
        self.moments.len() as u64
    }

    /// Write the next snapshot. Collective; every rank passes its owned particles (of `total` over all
    /// ranks) and, if contacts are wanted, those whose low id it owns, in any order.
    ///
    /// # Errors
    /// [`crate::error::Error::File`] on every rank when the disk has no room or cannot be written; no
    /// partial file remains under a final name.
    pub fn write(
        &mut self,
        moment: &Moment,
        total: u64,
        particles: Vec<SnapshotParticle>,
        contacts: Option<SnapshotContacts>,
    ) -> Result<PathBuf> {
        let number = self.moments.len();
        let (first, particles) = blocks::particles_by_id(&self.comm, total, particles);
        let path = self.folder.join(index::particle_file(number));
        let block = vtkhdf::Block { total, first, particles: &particles, ellipsoids: self.style.ellipsoids };
        vtkhdf::write_particles(&self.comm, &path, moment, &block)?;
        if self.style.dump {
            dump::write(&self.comm, &self.folder.join(index::dump_file(number)), moment, total, &particles)?;
        }
        if let Some(contacts) = contacts {
            let contacts = blocks::contacts_by_key(&self.comm, total, contacts);
            vtkhdf::write_contacts(&self.comm, &self.folder.join(index::contact_file(number)), moment, &contacts)?;
        }
        self.moments.push(*moment);
        let indexed = if self.comm.rank() == 0 { self.write_index(total) } else { Ok(()) };
        agree(&self.comm, indexed)?;
        Ok(path)
    }

    fn write_index(&self, total: u64) -> Result<()> {
        let times = index::times(&self.moments);
        index::write_series(&self.folder, "particles", &times, index::particle_file)?;
        if self.folder.join(index::contact_file(times.len() - 1)).exists() {
            index::write_series(&self.folder, "contacts", &times, index::contact_file)?;
        }
        index::write_xdmf(&self.folder, &times, total, self.style.ellipsoids)
    }
}

/// That a run directory holds the first `count` snapshots. Rank 0.
///
/// # Errors
/// [`crate::error::Error::File`] when it does not.
pub fn check(directory: &Path, count: u64) -> Result<()> {
    moments_of(&directory.join("snapshots"), count).map(|_| ())
}

/// Remove all snapshots of a run directory but the first `count`; none if those are not there. Rank 0.
///
/// # Errors
/// [`crate::error::Error::File`] when one cannot be removed.
pub fn discard_after(directory: &Path, count: u64) -> Result<()> {
    let folder = directory.join("snapshots");
    if moments_of(&folder, count).is_err() { Ok(()) } else { keep_first(&folder, count).map(|_| ()) }
}

/// The moments of the first `count` snapshots.
fn moments_of(folder: &Path, count: u64) -> Result<Vec<Moment>> {
    let count = usize::try_from(count).unwrap_or(usize::MAX);
    index::check_length(folder, count)?;
    (0..count).map(|number| vtkhdf::read_moment(&folder.join(index::particle_file(number)))).collect()
}

/// Remove all snapshots but the first `count` and return the moments of those. Rank 0.
fn keep_first(folder: &Path, count: u64) -> Result<Vec<Moment>> {
    if !folder.exists() && count == 0 {
        return Ok(Vec::new());
    }
    create_folder(folder)?;
    let moments = moments_of(folder, count)?;
    let count = moments.len();
    let entries = fs::read_dir(folder).map_err(|error| io_error(folder, "read the folder", &error))?;
    for entry in entries.flatten() {
        let name = entry.file_name();
        let later = name.to_str().and_then(index::number_of).is_some_and(|number| number >= count);
        if later {
            fs::remove_file(entry.path())
                .map_err(|error| io_error(&entry.path(), "delete the old snapshot", &error))?;
        }
    }
    index::keep_first(folder, &index::times(&moments))?;
    Ok(moments)
}

/// The moments that rank 0 knows, on all ranks.
fn share(comm: &Communicator, moments: &[Moment]) -> Vec<Moment> {
    let mut bytes = bytemuck::cast_slice::<Moment, u8>(moments).to_vec();
    comm.broadcast(0, &mut bytes);
    bytemuck::pod_collect_to_vec(&bytes)
}

#[cfg(test)]
mod tests;
