//! The halo: copies ("ghosts") of the particles of other ranks that may touch a particle of this one.
//! Built at a list rebuild, then refreshed every step with packed, direct, non-blocking messages.
//!
//! A ghost is a distinct remote particle at its wrapped position: one ghost per remote particle, however
//! many of its periodic images matter. Image shifts belong to contacts. Own particles are never ghosts.

use super::halo_map::HaloMap;
use super::{Communicator, Decomposition, agree};
use crate::error::{Error, Result};
use crate::state::particles::{Particles, Record};
use crate::state::shape::Shape;
use bytemuck::{Pod, Zeroable};

/// What an update carries beside positions and image counters.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct HaloContent {
    /// Full-step velocities and spins, for laws that damp or rub.
    pub velocities: bool,
    /// Orientations, for contacts of ellipsoids.
    pub orientations: bool,
}

impl HaloContent {
    /// 64-bit words per particle: position, image counters and, if asked, velocity and spin, orientation.
    fn words(self) -> usize {
        self.orientation_at() + if self.orientations { 4 } else { 0 }
    }

    /// Where in an entry the orientation is.
    fn orientation_at(self) -> usize {
        if self.velocities { PLACE + MOTION } else { PLACE }
    }

    /// Bytes per particle.
    #[must_use]
    pub fn bytes(self) -> usize {
        self.words() * size_of::<u64>()
    }
}

/// Words of an entry for position and image counters.
const PLACE: usize = 4;
/// Words of an entry for velocity and spin.
const MOTION: usize = 6;

/// What a ghost is when it appears.
#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C)]
struct Arrival {
    record: Record,
    id: u32,
    species: u32,
    image: [i32; 3],
    /// Keeps the layout free of hidden padding.
    reserved: [i32; 3],
}

/// Messages to or from one rank: a run of entries of the packed buffer.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Message {
    rank: usize,
    entries: usize,
}

/// Who sends what to whom until the next rebuild.
///
/// The owned particles must keep their places as long as the plan is used.
#[derive(Debug, Default)]
pub struct HaloPlan {
    /// In order of ranks; `send_index` holds the local indices in the same order.
    sends: Vec<Message>,
    send_index: Vec<u32>,
    /// In order of ranks; ghosts follow in the same order after the owned particles.
    receives: Vec<Message>,
    border: Vec<u32>,
    inner: Vec<u32>,
    is_border: Vec<bool>,
    owned: usize,
    ghosts: usize,
    outgoing: Vec<u64>,
    incoming: Vec<u64>,
}

impl HaloPlan {
    /// Which of the owned particles other ranks need, by the rule of [`HaloPlan::build`].
    #[must_use]
    pub fn seen_elsewhere(
        comm: &Communicator,
        decomposition: &Decomposition,
        particles: &Particles,
        sides: [f64; 3],
        periodic: [bool; 3],
        reach: f64,
    ) -> Vec<bool> {
        let map = HaloMap::new(decomposition, comm.rank(), sides, periodic, reach);
        let seen = |record: &Record| {
            let mut seen = false;
            map.for_each_needing(record.position, record.radius + reach, |_| seen = true);
            seen
        };
        particles.record[..particles.owned].iter().map(seen).collect()
    }

    /// Work out who needs which particle and exchange the ghosts. Collective.
    ///
    /// On entry `particles` holds owned particles only, each inside this rank's box (right after
    /// [`super::migrate`]); the ghosts are appended, in order of sender rank. A rank receives each remote
    /// particle of which some periodic image lies in its box grown by the particle's radius plus `reach`
    /// (largest radius plus skin \[m\]), which may be many boxes or several cells away.
    ///
    /// Who sends to whom follows from the grid: partners tell each other a number of particles, possibly
    /// zero, in one direct message; nothing grows with the number of all ranks.
    ///
    /// # Errors
    /// [`Error::Layout`], on all ranks, if a particle is not in its rank's box or larger than `reach`.
    pub fn build(
        comm: &Communicator,
        decomposition: &Decomposition,
        particles: &mut Particles,
        sides: [f64; 3],
        periodic: [bool; 3],
        reach: f64,
    ) -> Result<Self> {
        let owned = particles.owned;
        let map = HaloMap::new(decomposition, comm.rank(), sides, periodic, reach);
        agree(comm, check(comm.rank(), &map, particles, reach))?;

        let mut lists = vec![Vec::new(); map.partners().len()];
        let mut is_border = vec![false; owned];
        for (index, record) in particles.record[..owned].iter().enumerate() {
            map.for_each_needing(record.position, record.radius + reach, |partner| {
                lists[partner].push(index as u32);
                is_border[index] = true;
            });
        }
        let (border, inner) = (0..owned as u32).partition(|&index| is_border[index as usize]);

        let own: Vec<u64> = lists.iter().map(|list| list.len() as u64).collect();
        let mut theirs = vec![0_u64; own.len()];
        comm.exchange_each(
            map.partners().iter().zip(&own).map(|(&rank, number)| (rank, bytemuck::bytes_of(number))),
            map.partners().iter().zip(&mut theirs).map(|(&rank, number)| (rank, bytemuck::bytes_of_mut(number))),
            || (),
        );
        let sends = messages(map.partners(), &own);
        let receives = messages(map.partners(), &theirs);
        let ghosts = theirs.iter().sum::<u64>() as usize;
        let mut plan = Self {
            sends,
            send_index: lists.concat(),
            receives,
            border,
            inner,
            is_border,
            owned,
            ghosts,
            outgoing: Vec::new(),
            incoming: Vec::new(),
        };
        plan.bring_ghosts(comm, particles);
        Ok(plan)
    }

    fn bring_ghosts(&mut self, comm: &Communicator, particles: &mut Particles) {
        let leaving: Vec<Arrival> = self
            .send_index
            .iter()
            .map(|&index| {
                let index = index as usize;
                Arrival {
                    record: particles.record[index],
                    id: particles.id[index],
                    species: particles.species[index],
                    image: particles.image[index],
                    reserved: [0; 3],
                }
            })
            .collect();
        let mut arriving = vec![Arrival::zeroed(); self.ghosts];
        comm.exchange_each(outgoing(&self.sends, &leaving, 1), incoming(&self.receives, &mut arriving, 1), || ());
        for ghost in &arriving {
            particles.id.push(ghost.id);
            particles.species.push(ghost.species);
            particles.record.push(ghost.record);
            particles.image.push(ghost.image);
        }
        if particles.extras.ellipsoids {
            self.bring_shapes(comm, particles);
        }
    }

    /// Semi-axes and orientations of the ghosts.
    fn bring_shapes(&mut self, comm: &Communicator, particles: &mut Particles) {
        let leaving: Vec<Shape> = self.send_index.iter().map(|&index| particles.shape[index as usize]).collect();
        let mut arriving = vec![Shape::zeroed(); self.ghosts];
        comm.exchange_each(outgoing(&self.sends, &leaving, 1), incoming(&self.receives, &mut arriving, 1), || ());
        particles.shape.extend(arriving);
    }

    /// Refresh the ghosts; `meanwhile` runs on the particles while the messages fly (it sees the ghosts as
    /// they were; what is sent was taken before it). All ranks call it, with the same content.
    ///
    /// Position and image counters always come, full-step velocity and spin and the orientation if asked;
    /// what is not asked keeps its old value. Orientations may be asked only if there are ellipsoids. `wrapped` is replaced by the ghosts that crossed a periodic face since the last
    /// update: local index and the change of the image counters.
    pub fn update<R>(
        &mut self,
        comm: &Communicator,
        particles: &mut Particles,
        content: HaloContent,
        wrapped: &mut Vec<(u32, [i32; 3])>,
        meanwhile: impl FnOnce(&mut Particles) -> R,
    ) -> R {
        let words = content.words();
        self.outgoing.resize(self.send_index.len() * words, 0);
        self.incoming.resize(self.ghosts * words, 0);
        for (&index, entry) in self.send_index.iter().zip(self.outgoing.chunks_exact_mut(words)) {
            let index = index as usize;
            pack(&particles.record[index], particles.image[index], content.velocities, entry);
            if content.orientations {
                let orientation = particles.shape[index].orientation.map(f64::to_bits);
                entry[content.orientation_at()..].copy_from_slice(&orientation);
            }
        }
        let result = comm.exchange_each(
            outgoing(&self.sends, &self.outgoing, words),
            incoming(&self.receives, &mut self.incoming, words),
            || meanwhile(particles),
        );
        wrapped.clear();
        for (ghost, entry) in (self.owned..).zip(self.incoming.chunks_exact(words)) {
            let images = unpack(entry, &mut particles.record[ghost], content.velocities);
            if content.orientations {
                let at = content.orientation_at();
                particles.shape[ghost].orientation = [0, 1, 2, 3].map(|k| f64::from_bits(entry[at + k]));
            }
            let image = &mut particles.image[ghost];
            if images != packed_images(*image) {
                let change = change_of_images(images, packed_images(*image));
                *image = [0, 1, 2].map(|k| image[k] + change[k]);
                wrapped.push((ghost as u32, change));
            }
        }
        result
    }

    /// Whether owned particle `index` is a ghost somewhere. Only such particles can touch ghosts, so that
    /// the others may move before the ghosts are there.
    #[must_use]
    pub fn is_border(&self, index: usize) -> bool {
        self.is_border[index]
    }

    /// Owned particles that are ghosts somewhere, ascending.
    #[must_use]
    pub fn border(&self) -> &[u32] {
        &self.border
    }

    /// Owned particles that no other rank sees, ascending.
    #[must_use]
    pub fn inner(&self) -> &[u32] {
        &self.inner
    }

    /// Number of ghosts on this rank.
    #[must_use]
    pub fn ghosts(&self) -> usize {
        self.ghosts
    }

    /// Messages that this rank sends per update.
    #[must_use]
    pub fn messages(&self) -> usize {
        self.sends.len()
    }

    /// Bytes that this rank sends per update.
    #[must_use]
    pub fn bytes(&self, content: HaloContent) -> usize {
        self.send_index.len() * content.words() * size_of::<u64>()
    }
}

fn check(rank: usize, map: &HaloMap, particles: &Particles, reach: f64) -> Result<()> {
    for (record, id) in particles.record[..particles.owned].iter().zip(&particles.id) {
        if !map.owns(record.position) {
            return Err(Error::Layout(format!(
                "rank {rank}: particle {id} at {:?} m is outside this rank's box while the halo is built; particles \
                 migrate first, so this is an error of the program: report it",
                record.position
            )));
        }
        if record.radius > reach {
            return Err(Error::Layout(format!(
                "rank {rank}: particle {id} with radius {:e} m exceeds the halo's reach {reach:e} m; the reach is the \
                 largest radius plus the skin, so this is an error of the program: report it",
                record.radius
            )));
        }
    }
    Ok(())
}

/// The partners with a message that is not empty.
fn messages(partners: &[usize], numbers: &[u64]) -> Vec<Message> {
    let all = partners.iter().zip(numbers).map(|(&rank, &entries)| Message { rank, entries: entries as usize });
    all.filter(|message| message.entries > 0).collect()
}

/// Cut a packed buffer, `words` items per entry, into the messages to send.
fn outgoing<'a, T: Pod>(
    messages: &'a [Message],
    buffer: &'a [T],
    words: usize,
) -> impl Iterator<Item = (usize, &'a [u8])> {
    messages.iter().scan(buffer, move |rest, message| {
        let (part, next) = rest.split_at(message.entries * words);
        *rest = next;
        Some((message.rank, bytemuck::cast_slice(part)))
    })
}

/// Cut a packed buffer into the places of the messages to come.
fn incoming<'a, T: Pod>(
    messages: &'a [Message],
    buffer: &'a mut [T],
    words: usize,
) -> impl Iterator<Item = (usize, &'a mut [u8])> {
    messages.iter().scan(buffer, move |rest, message| {
        let (part, next) = std::mem::take(rest).split_at_mut(message.entries * words);
        *rest = next;
        Some((message.rank, bytemuck::cast_slice_mut(part)))
    })
}

/// Bits of an image counter in an entry: the lowest ones, as only its change counts.
const IMAGE_BITS: u32 = 21;

/// The three image counters in one word.
#[inline]
fn packed_images(image: [i32; 3]) -> u64 {
    let [x, y, z] = image.map(|count| u64::from(count as u32 & ((1 << IMAGE_BITS) - 1)));
    x | y << IMAGE_BITS | z << (2 * IMAGE_BITS)
}

/// By how much each counter has changed, less than 2^20 either way.
fn change_of_images(new: u64, old: u64) -> [i32; 3] {
    [0, 1, 2].map(|k| {
        let [new, old] = [new, old].map(|word| (word >> (k * IMAGE_BITS)) as u32);
        (new.wrapping_sub(old) << (32 - IMAGE_BITS)).cast_signed() >> (32 - IMAGE_BITS)
    })
}

/// One entry of an update but for the orientation.
#[inline]
fn pack(record: &Record, image: [i32; 3], velocities: bool, entry: &mut [u64]) {
    let [x, y, z] = record.position.map(f64::to_bits);
    entry[..PLACE].copy_from_slice(&[x, y, z, packed_images(image)]);
    if velocities {
        let [[u, v, w], [p, q, r]] = [record.velocity, record.spin].map(|vector| vector.map(f64::to_bits));
        entry[PLACE..PLACE + MOTION].copy_from_slice(&[u, v, w, p, q, r]);
    }
}

/// The reverse of [`pack`]; returns the packed image counters.
#[inline]
fn unpack(entry: &[u64], record: &mut Record, velocities: bool) -> u64 {
    let vector = |words: &[u64]| [0, 1, 2].map(|k| f64::from_bits(words[k]));
    let place: &[u64; PLACE] = entry[..PLACE].try_into().expect("an entry begins with its place");
    record.position = vector(place);
    if velocities {
        let motion: &[u64; MOTION] = entry[PLACE..PLACE + MOTION].try_into().expect("then comes its motion");
        record.velocity = vector(&motion[..3]);
        record.spin = vector(&motion[3..]);
    }
    place[3]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_entry_comes_back_as_packed() {
        let record = Record {
            position: [1.0, -0.0, 3e-7],
            velocity: [4.0, 5.0, -6.0],
            spin: [7.0, 8.0, 9.0],
            ..Record::zeroed()
        };
        for velocities in [false, true] {
            let mut entry = vec![0; HaloContent { velocities, orientations: false }.words()];
            pack(&record, [-1, 2, i32::MIN], velocities, &mut entry);
            let mut copy = Record::zeroed();
            assert_eq!(unpack(&entry, &mut copy, velocities), packed_images([-1, 2, i32::MIN]));
            assert_eq!(copy.position.map(f64::to_bits), record.position.map(f64::to_bits));
            assert_eq!(copy.velocity == record.velocity && copy.spin == record.spin, velocities);
        }
    }

    #[test]
    fn the_change_of_image_counters_comes_through_whatever_they_are() {
        for count in [0, 1, -1, (1 << 20) - 1, 1 << 20, -(1 << 20), i32::MAX - 2, i32::MIN + 2] {
            for change in [[0, 1, -1], [1, -1, 0], [-2, 0, 2]] {
                let old = [count, -1, 1 << 21];
                let new = [0, 1, 2].map(|k| old[k] + change[k]);
                assert_eq!(change_of_images(packed_images(new), packed_images(old)), change, "from {old:?}");
                assert_ne!(packed_images(new), packed_images(old));
            }
        }
    }

    #[test]
    fn one_rank_has_no_ghosts_and_no_border() {
        let comm = Communicator::single();
        let grid = Decomposition { grid: [1; 3] };
        let mut particles = Particles { owned: 1, ..Particles::default() };
        particles.id.push(0);
        particles.species.push(0);
        particles.image.push([0; 3]);
        particles.record.push(Record { position: [0.01; 3], radius: 0.4, ..Record::zeroed() });
        let mut plan = HaloPlan::build(&comm, &grid, &mut particles, [1.0; 3], [true; 3], 0.5).expect("valid");
        assert_eq!((plan.ghosts(), plan.messages(), plan.inner()), (0, 0, [0].as_slice()));
        assert!(!plan.is_border(0));
        let mut wrapped = vec![(1, [0; 3])];
        let content = HaloContent { velocities: true, orientations: false };
        assert_eq!(plan.update(&comm, &mut particles, content, &mut wrapped, |p| p.len()), 1);
        assert!(wrapped.is_empty());
    }
}
