//! What a snapshot shows of this rank's particles and contacts.

use super::Simulation;
use crate::force::observe::Sample;
use crate::output::snapshot::{SnapshotContact, SnapshotContacts, SnapshotParticle};
use crate::state::shape::ellipsoid_volume;

impl Simulation {
    /// Owned particles with stress trace and coordination. The trace is that of the mean stress in the
    /// particle, `(1/V) Σ arm·F_n` over its contacts \[Pa\], compression positive.
    #[must_use]
    pub fn snapshot_particles(&self, samples: &[Sample]) -> Vec<SnapshotParticle> {
        let mut virials = vec![[0.0; 2]; self.contacts.lines];
        for sample in samples {
            virials[sample.line] = sample.virials;
        }
        (0..self.particles.owned)
            .map(|index| {
                let record = &self.particles.record[index];
                let [_, (velocity, angular_velocity)] = self.particles.velocities(index);
                let volume = ellipsoid_volume(self.particles.semi_axes(index));
                let lines = self.contacts.lines_of(index);
                let virial = lines.fold(0.0, |sum, (line, is_second)| sum + virials[line][usize::from(is_second)]);
                SnapshotParticle {
                    id: self.particles.id[index],
                    species: self.particles.species[index],
                    position: record.position,
                    radius: record.radius,
                    semi_axes: self.particles.semi_axes(index),
                    orientation: self.particles.orientation_of(index),
                    velocity,
                    angular_velocity,
                    stress_trace: virial / volume,
                    coordination: self.touching(index),
                    reserved: 0,
                }
            })
            .collect()
    }

    /// Touching contacts whose lower id this rank owns, with their memory.
    #[must_use]
    pub fn snapshot_contacts(&self, samples: &[Sample]) -> SnapshotContacts {
        let width = self.model.lists.memory_width();
        let mut shown =
            SnapshotContacts { contacts: Vec::new(), width, memory: Vec::new(), columns: self.model.columns() };
        let mut row = vec![0.0; width];
        for sample in samples.iter().filter(|sample| sample.counted) {
            let (number, place) = self.contacts.locate(sample.line);
            let section = &self.contacts.sections[number];
            row.fill(0.0);
            section.read_memory(place, &mut row);
            shown.memory.extend_from_slice(&row);
            shown.contacts.push(SnapshotContact {
                key: self.contacts.key(number, place, &self.particles, self.model.lists.total),
                start: self.particles.record[section.first_of(place)].position,
                branch: sample.branch,
                force: sample.force.map(|f| -f),
                normal_force: sample.normal_force,
                overlap: sample.overlap,
            });
        }
        shown
    }
}
