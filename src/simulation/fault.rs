//! What went wrong on this rank, in words, and the post-mortem file with the particles concerned.

use super::Simulation;
use super::strips::PassFault;
use crate::contact::section::Partners;
use crate::error::{Error, Result};
use crate::state::ParticleState;
use serde_json::{Value, json};

impl Simulation {
    /// The error of a contact that overlaps too much or is not a number.
    pub(super) fn describe_pass_fault(&self, fault: Option<PassFault>) -> Result<()> {
        let Some(fault) = fault else { return Ok(()) };
        let key = self.contacts.key(fault.section, fault.place, &self.particles, self.model.lists.total);
        let section = &self.contacts.sections[fault.section];
        let mut local = vec![section.first_of(fault.place)];
        if section.partners != Partners::Wall {
            local.push(section.second_of(fault.place));
        }
        let owned: Vec<usize> = local.into_iter().filter(|i| *i < self.particles.owned).collect();
        self.write_post_mortem(&owned);
        Err(Error::Simulation {
            step: self.global.step,
            message: format!(
                "rank {}: the contact of particles {} and {} overlaps by {:.4} of the smaller radius, more than \
                 max_overlap_fraction = {}; use a smaller time step, a slower load or a looser packing (last states in \
                 post_mortem)",
                self.comm.rank(),
                key.low,
                key.high,
                fault.overlap_ratio,
                self.model.config.max_overlap_fraction
            ),
        })
    }

    /// The error of a particle that left through a wall or is not a number.
    pub(super) fn describe_lost(&self, lost: Option<u32>) -> Result<()> {
        let Some(index) = lost.map(|index| index as usize) else { return Ok(()) };
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
