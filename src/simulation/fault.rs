//! What went wrong on this rank, in words, and the post-mortem file with the particles concerned.

use super::Simulation;
use super::strips::PassFault;
use crate::contact::section::Partners;
use crate::error::{Error, Result};
use crate::exchange::agree;
use crate::force::observe::Wanted;
use crate::state::ParticleState;
use serde_json::{Value, json};

/// A contact that overlaps too much or is not a number.
#[derive(Debug, Clone, Copy)]
struct Excess {
    /// The two ids, low first.
    ids: [u32; 2],
    /// Overlap over the smaller radius.
    ratio: f64,
    section: usize,
    place: usize,
}

impl Simulation {
    /// The error of what went wrong in the last step on any rank, the same on every rank: of all contacts that overlap
    /// too much that of the lowest ids, else the particle that is lost. Collective.
    pub(super) fn refuse(&mut self, fault: Option<PassFault>, lost: Option<u32>) -> Result<()> {
        let mut overlaps = [f64::from(u8::from(fault.is_some()))];
        self.comm.max_f64(&mut overlaps);
        if overlaps[0] == 0.0 {
            let found = lost.map(|index| (u64::from(self.particles.id[index as usize]), index));
            let first = self.is_lowest(found.map(|(id, _)| id));
            return agree(&self.comm, found.filter(|_| first).map_or(Ok(()), |(_, index)| self.describe_lost(index)));
        }
        // Seen from where the step has led, as no rank knows the positions before any more.
        let seen = self.lowest_excess();
        let mut some = [f64::from(u8::from(seen.is_some()))];
        self.comm.max_f64(&mut some);
        let own = if some[0] > 0.0 { seen } else { fault.map(|fault| self.excess_of(&fault)) };
        let first = self.is_lowest(own.map(|excess| u64::from(excess.ids[0]) << 32 | u64::from(excess.ids[1])));
        agree(&self.comm, own.filter(|_| first).map_or(Ok(()), |excess| self.describe_excess(&excess)))
    }

    /// Whether this rank has the lowest number of all ranks, and is the first that has it. Collective.
    fn is_lowest(&self, number: Option<u64>) -> bool {
        let own = number.and_then(|number| i64::try_from(number).ok());
        let mut lowest = [own.map_or(i64::MIN, |number| -number)];
        self.comm.max_i64(&mut lowest);
        let mut rank =
            [if own.map(|number| -number) == Some(lowest[0]) { -(self.comm.rank() as i64) } else { i64::MIN }];
        self.comm.max_i64(&mut rank);
        rank[0] == -(self.comm.rank() as i64)
    }

    /// Of the contacts of this rank that overlap too much now that of the lowest ids.
    fn lowest_excess(&mut self) -> Option<Excess> {
        self.update_ghosts();
        let observation = self.observe_contacts(Wanted { sums: false, samples: true }, true);
        let excess = observation.samples.iter().map(|sample| {
            let (section, place) = self.contacts.locate(sample.line);
            self.excess_of(&PassFault { section, place, overlap_ratio: sample.overlap_ratio })
        });
        excess.min_by_key(|excess| excess.ids)
    }

    fn excess_of(&self, fault: &PassFault) -> Excess {
        let PassFault { section, place, overlap_ratio: ratio } = *fault;
        let key = self.contacts.key(section, place, &self.particles, self.model.lists.total);
        Excess { ids: [key.low, key.high], ratio, section, place }
    }

    /// The error of a contact that overlaps too much or is not a number.
    fn describe_excess(&self, excess: &Excess) -> Result<()> {
        let Excess { ids: [low, high], ratio, section, place } = *excess;
        let section = &self.contacts.sections[section];
        let mut local = vec![section.first_of(place)];
        let partners = if section.partners == Partners::Wall {
            let wall = section.wall_of(place) as usize;
            let (end, axis) = (["low", "high"][wall % 2], ["x", "y", "z"][wall / 2]);
            format!("particle {low} with the wall at the {end} end of {axis}")
        } else {
            local.push(section.second_of(place));
            format!("particles {low} and {high}")
        };
        let owned: Vec<usize> = local.into_iter().filter(|i| *i < self.particles.owned).collect();
        self.write_post_mortem(&owned);
        Err(Error::Simulation {
            step: self.global.step,
            message: format!(
                "rank {}: the contact of {partners} overlaps by {ratio:.3e} of the smaller radius, more than \
                 max_overlap_fraction = {}; use a smaller time step, a slower load or a looser packing (last states in \
                 post_mortem)",
                self.comm.rank(),
                self.model.config.max_overlap_fraction
            ),
        })
    }

    /// The error of a particle that left through a wall or is not a number.
    fn describe_lost(&self, index: u32) -> Result<()> {
        let index = index as usize;
        self.write_post_mortem(&[index]);
        let state = self.particles.state(index);
        let remedy = if self.particles.record[index].inverse_mass == 0.0 {
            "its motion is prescribed: end the stage before, lower the velocity of its species or enlarge the cell"
        } else {
            "use a smaller time step or a slower load"
        };
        Err(Error::Simulation {
            step: self.global.step,
            message: format!(
                "rank {}: particle {} left the cell or is not a number: position {:?} m, velocity {:?} m/s, cell {:?} m; \
                 {remedy} (last states in post_mortem)",
                self.comm.rank(),
                state.id,
                state.position,
                state.velocity,
                self.global.sides
            ),
        })
    }

    /// The particles concerned with their contacts, as JSON in the run directory. Failing to write it must
    /// not hide the fault itself.
    fn write_post_mortem(&self, particles: &[usize]) {
        let rows: Vec<Value> = particles.iter().map(|index| self.particle_json(*index)).collect();
        let text = json!({ "global": self.global, "particles": rows });
        let name = format!("post_mortem-rank{}.json", self.comm.rank());
        let path = self.model.config.output.directory.join(name);
        if let Err(error) = std::fs::write(&path, format!("{text:#}\n")) {
            eprintln!("dem-mpi: {}: cannot write the post-mortem file: {error}", path.display());
        }
    }

    fn particle_json(&self, index: usize) -> Value {
        let state = self.particles.state(index);
        let ParticleState { id, species, position, radius, velocity, full_velocity, spin, .. } = state;
        let contacts: Vec<Value> = self
            .contacts
            .lines_of(index)
            .map(|(line, _)| {
                let (number, place) = self.contacts.locate(line);
                let section = &self.contacts.sections[number];
                let key = self.contacts.key(number, place, &self.particles, self.model.lists.total);
                let mut memory = vec![0.0; section.columns];
                section.read_memory(place, &mut memory);
                json!({ "low": key.low, "high": key.high, "shift": &key.shift[..3], "memory": memory })
            })
            .collect();
        json!({ "id": id, "species": species, "position_m": position, "radius_m": radius,
            "semi_axes_m": state.semi_axes, "orientation": state.orientation, "velocity_m_per_s": velocity,
            "full_step_velocity_m_per_s": full_velocity, "spin_rad_per_s": spin, "contacts": contacts })
    }
}
