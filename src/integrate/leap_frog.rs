//! Leap-frog motion of spheres, W (2.1)–(2.4), in a periodic cell that deforms.
//!
//! Velocities are kept at half steps and, extrapolated, at full steps; positions at full steps. With a changing time step (2.3) takes
//! half the old one and (2.4) half the new one.

use super::displacement::{StepResult, Watch};
use super::gather::Lines;
use super::rotation::{Body, Rotation, Spins};
use super::wrapping::wrap;
use crate::config::Velocities;
use crate::contact::ends::ChunkEnds;
use crate::contact::list::CHUNK;
use crate::contact::section::BLOCK;
use crate::force::lane::portable::Portable;
use crate::force::lane::{Lane, SHAPE, align_stack, prefetch};
#[cfg(target_arch = "x86_64")]
use crate::force::lane::{avx2::F64x4, avx512::F64x8};
use crate::force::simd::Simd;
use crate::state::LEDGER;
use crate::state::particles::{Particles, RECORD, Record, trimmed};
use crate::state::shape::Shape;
use std::ops::Range;

/// How many particles ahead velocities, spins and, where they are looked at, reference positions are asked for.
const AHEAD: usize = 128;

/// What is the same for all particles in one step.
#[derive(Debug, Clone, Copy)]
pub struct StepMotion {
    /// Step that led to the present positions \[s\].
    pub previous_time_step: f64,
    /// Step from here to the next positions \[s\].
    pub time_step: f64,
    /// Gravity \[m/s²\].
    pub gravity: [f64; 3],
    /// Affine factor of the positions per axis (BCT; 1 in BC).
    pub scale: [f64; 3],
    /// Cell sides before the step \[m\].
    pub previous_sides: [f64; 3],
    /// Cell sides after the step \[m\].
    pub sides: [f64; 3],
    /// Cell sides when the reference positions were taken \[m\].
    pub reference_sides: [f64; 3],
    /// Velocity of the high faces (BC; zero in BCT): change of velocity of a particle that wraps \[m/s\].
    pub face_velocity: [f64; 3],
    /// Periodic axes.
    pub periodic: [bool; 3],
    /// Particles turn: integrate spins and orientations.
    pub rotation: bool,
    /// Keep the energy ledger.
    pub ledger: bool,
    /// Follow orientations.
    pub orientation: bool,
    /// What velocities records have.
    pub velocities: Velocities,
    /// What to look at to learn how far particles have moved.
    pub watch: Watch,
    /// Instructions to use.
    pub simd: Simd,
}

impl StepMotion {
    /// Change of position over half-step velocity per axis, `½ (1 + scale) Δt` \[s\].
    #[inline]
    #[must_use]
    pub fn drift(&self) -> [f64; 3] {
        self.scale.map(|scale| 0.5 * (1.0 + scale) * self.time_step)
    }
}

/// Owned particles `start ..` as slices that threads can split.
#[derive(Debug)]
pub struct Slice<'a> {
    /// Local index of the first.
    pub start: usize,
    /// Their records.
    pub record: &'a mut [Record],
    image: &'a mut [[i32; 3]],
    velocity: &'a mut [[f64; 4]],
    spin: &'a mut [[f64; 4]],
    orientation: &'a mut [[f64; 4]],
    /// Their shapes; empty when every particle of all ranks is a sphere.
    pub shape: &'a mut [Shape],
    ledger: &'a mut [[f64; LEDGER.len()]],
    reference: &'a mut [[f64; 3]],
    crossed: &'a mut [[i8; 4]],
}

impl<'a> Slice<'a> {
    /// All owned particles.
    pub fn new(particles: &'a mut Particles, reference: &'a mut Reference) -> Self {
        let owned = particles.owned;
        Self {
            start: 0,
            record: &mut particles.record[..owned],
            image: &mut particles.image[..owned],
            velocity: &mut particles.velocity,
            spin: &mut particles.spin,
            orientation: &mut particles.orientation,
            shape: if particles.extras.ellipsoids { &mut particles.shape[..owned] } else { &mut [] },
            ledger: &mut particles.ledger,
            reference: &mut reference.position,
            crossed: &mut reference.crossed[..owned],
        }
    }

    /// The first `count` particles and the others.
    #[must_use]
    pub fn split(self, count: usize) -> (Self, Self) {
        let (record, record_high) = self.record.split_at_mut(count);
        let (image, image_high) = self.image.split_at_mut(count);
        let (velocity, velocity_high) = self.velocity.split_at_mut(count);
        let (spin, spin_high) = self.spin.split_at_mut(count);
        let (orientation, orientation_high) = self.orientation.split_at_mut(count.min(self.orientation.len()));
        let (shape, shape_high) = self.shape.split_at_mut(count.min(self.shape.len()));
        let (ledger, ledger_high) = self.ledger.split_at_mut(count.min(self.ledger.len()));
        let (reference, reference_high) = self.reference.split_at_mut(count);
        let (crossed, crossed_high) = self.crossed.split_at_mut(count);
        let low =
            Self { start: self.start, record, image, velocity, spin, orientation, shape, ledger, reference, crossed };
        let high = Self {
            start: self.start + count,
            record: record_high,
            image: image_high,
            velocity: velocity_high,
            spin: spin_high,
            orientation: orientation_high,
            shape: shape_high,
            ledger: ledger_high,
            reference: reference_high,
            crossed: crossed_high,
        };
        (low, high)
    }
}

/// Positions at the last list rebuild and the images crossed since the last Verlet list.
#[derive(Debug, Clone, Default)]
pub struct Reference {
    /// Positions then, seen from the image in which the particle is now \[m\].
    pub position: Vec<[f64; 3]>,
    /// Images crossed since the last Verlet list, of owned particles and ghosts; the fourth is 0.
    pub crossed: Vec<[i8; 4]>,
}

impl Reference {
    /// Nobody has crossed anything: there is a new Verlet list.
    pub fn reset(&mut self, particles: &Particles) {
        self.crossed.clear();
        self.crossed.resize(particles.len(), [0; 4]);
    }

    /// Take the present positions of the owned particles.
    pub fn take(&mut self, particles: &Particles) {
        self.position.clear();
        self.position.extend(particles.record[..particles.owned].iter().map(|record| record.position));
    }

    /// A particle crossed periodic faces.
    pub fn cross(&mut self, particle: usize, wraps: [i32; 3]) {
        cross(&mut self.crossed[particle], wraps);
    }
}

fn cross(crossed: &mut [i8; 4], wraps: [i32; 3]) {
    for (count, wrap) in crossed.iter_mut().zip(wraps) {
        *count += wrap as i8;
    }
}

/// Particles of a slice to move, and what moves them.
#[derive(Debug)]
pub struct Batch<'a> {
    /// Places in the slice.
    pub range: Range<usize>,
    /// Their contacts.
    pub chunk: ChunkEnds<'a>,
    /// Output lines.
    pub lines: Lines<'a>,
    /// Room for their forces and torques.
    pub loads: &'a mut [[f64; 8]; CHUNK],
    /// What is the same for all.
    pub motion: &'a StepMotion,
}

/// Sum the forces on some particles of a slice and move them one step.
pub fn advance(slice: &mut Slice, batch: Batch, result: &mut StepResult) {
    match batch.motion.velocities {
        Velocities::FullStep => advance_seen::<false>(slice, batch, result),
        Velocities::HalfStep => advance_seen::<true>(slice, batch, result),
    }
}

/// As [`advance`]. `HALF`: records have the velocities of the half step.
fn advance_seen<const HALF: bool>(slice: &mut Slice, batch: Batch, result: &mut StepResult) {
    match batch.motion.simd {
        // SAFETY: a level is chosen only if the processor has it (`Simd::is_available`).
        #[cfg(target_arch = "x86_64")]
        Simd::Avx512 => unsafe { advance_avx512::<HALF>(slice, batch, result) },
        // SAFETY: as above.
        #[cfg(target_arch = "x86_64")]
        Simd::Avx2 => unsafe { advance_avx2::<HALF>(slice, batch, result) },
        _ => advance_range::<Portable<4>, f64, HALF>(slice, batch, result),
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn advance_avx2<const HALF: bool>(slice: &mut Slice, batch: Batch, result: &mut StepResult) {
    advance_range::<F64x4, F64x4, HALF>(slice, batch, result);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512vl")]
fn advance_avx512<const HALF: bool>(slice: &mut Slice, batch: Batch, result: &mut StepResult) {
    advance_range::<F64x4, F64x8, HALF>(slice, batch, result);
}

/// Sums first, then the motion, a particle at a time in lanes (x, y, z, not used). A position shares its lanes
/// and the velocity with the radius, the spin with 1/m; constants that are 0 or 1 in the fourth lane leave them.
/// Ellipsoids turn before, in the lanes `W` side by side.
#[inline(always)]
fn advance_range<L: Lane, W: Lane, const HALF: bool>(slice: &mut Slice, batch: Batch, result: &mut StepResult) {
    const { assert!(L::WIDTH == 4) };
    align_stack();
    let Batch { range, chunk, mut lines, loads, motion } = batch;
    lines.sum_all::<L>(&chunk, loads);
    if motion.ledger {
        for (place, (index, load)) in range.clone().zip(&*loads).enumerate() {
            lines.add_ledger(chunk.of(place), &mut slice.ledger[index]);
            let velocity = if HALF { trimmed(slice.velocity[index]) } else { slice.record[index].velocity };
            add_external_work(&mut slice.ledger[index], &slice.record[index], velocity, load, motion);
        }
    }
    if !slice.shape.is_empty() {
        turn_all::<W, HALF>(slice, range.clone(), loads, motion);
    }
    match (motion.rotation && slice.shape.is_empty(), motion.watch == Watch::Displacements) {
        (true, true) => move_all::<L, HALF, true, true>(slice, range, loads, motion, result),
        (true, false) => move_all::<L, HALF, true, false>(slice, range, loads, motion, result),
        (false, true) => move_all::<L, HALF, false, true>(slice, range, loads, motion, result),
        (false, false) => move_all::<L, HALF, false, false>(slice, range, loads, motion, result),
    }
}

/// The motion of particles under these forces and torques. `TURN`: as spheres also their rotation. `MEASURE`: looking at displacements, not at speeds.
#[inline(always)]
fn move_all<L: Lane, const HALF: bool, const TURN: bool, const MEASURE: bool>(
    slice: &mut Slice,
    range: Range<usize>,
    loads: &[[f64; 8]],
    motion: &StepMotion,
    result: &mut StepResult,
) {
    let zero = L::splat(0.0);
    let three = |v: [f64; 3], fourth: f64| L::load(&[v[0], v[1], v[2], fourth]);
    let vector = three([1.0; 3], 0.0).greater(zero);
    let (old, new) = (motion.previous_time_step, motion.time_step);
    let (kick, half) = (three([0.5 * (old + new); 3], 0.0), three([0.5 * new; 3], 0.0));
    let drift = three(motion.drift(), 0.0);
    let scale = three(motion.scale, 1.0);
    let (gravity, falls) = (three(motion.gravity, 0.0), motion.gravity != [0.0; 3]);
    let sides = three(motion.sides, f64::INFINITY);
    let stretch = three([0, 1, 2].map(|k| motion.sides[k] / motion.reference_sides[k]), 0.0);
    let bodies = slice.record[range.clone()].iter_mut().zip(&mut slice.velocity[range.clone()]);
    let turning = slice.spin[range.clone()].iter_mut().zip(&mut slice.reference[range.clone()]);
    let mut farthest = result.max_displacement_squared;
    let (mut swiftest, mut sum) = (zero, zero);
    for ((((record, velocity), (spin, reference)), load), index) in bodies.zip(turning).zip(loads).zip(range.clone()) {
        // What a later chunk needs and no contact has touched.
        prefetch(std::slice::from_ref(velocity), AHEAD, 1);
        prefetch(std::slice::from_ref(spin), AHEAD, 1);
        if MEASURE {
            prefetch(std::slice::from_ref(reference), AHEAD, 1);
        }
        let (force, torque) = (L::load(&load[..4]), L::load(&load[4..]));
        let numbers: &mut [f64; RECORD] = bytemuck::cast_mut(record);
        let inverse_mass = L::splat(numbers[11]);
        let mut acceleration = force * inverse_mass;
        if falls {
            acceleration = acceleration + gravity.only(inverse_mass.greater(zero));
        }
        let mut half_velocity = (if HALF { L::load(&numbers[4..8]) } else { L::load(velocity) }) + kick * acceleration;
        let mut position = scale * L::load(&numbers[..4]) + drift * half_velocity;
        if !MEASURE {
            let squares = half_velocity * half_velocity;
            (swiftest, sum) = (swiftest.max(squares), sum + squares);
        }
        // The fourth numbers come from splats: stores of some lanes only are slow.
        if TURN {
            let angular = torque * L::splat(spin[3]);
            let half_spin = (if HALF { L::load(&numbers[8..]) } else { L::load(spin) }) + kick * angular;
            let full_spin = half_spin + half * angular;
            if HALF {
                half_spin.store(&mut numbers[8..]);
                L::select(vector, full_spin, L::splat(spin[3])).store(spin);
            } else {
                half_spin.store(spin);
                L::select(vector, full_spin, inverse_mass).store(&mut numbers[8..]);
            }
            if motion.orientation {
                let half_spin = if HALF { [numbers[8], numbers[9], numbers[10]] } else { trimmed(*spin) };
                slice.orientation[index] = turned(slice.orientation[index], half_spin, new);
            }
        }
        position.store(&mut numbers[..4]);
        if L::any(zero.greater(position) | position.at_least(sides)) {
            let mut carried = [0.0; 4];
            half_velocity.store(&mut carried);
            let particle = (slice.start + index) as u32;
            let crossed = wrap(record, &mut carried, reference, motion);
            if crossed.lost {
                result.lost = Some(particle);
            }
            if crossed.wraps != [0; 3] {
                for (image, wrap) in slice.image[index].iter_mut().zip(crossed.wraps) {
                    *image += wrap;
                }
                cross(&mut slice.crossed[index], crossed.wraps);
                result.wrapped.push((particle, crossed.wraps));
            }
            half_velocity = L::load(&carried);
            position = L::load(&bytemuck::cast_ref::<_, [f64; RECORD]>(record)[..4]);
        }
        let numbers: &mut [f64; RECORD] = bytemuck::cast_mut(record);
        let full_velocity = half_velocity + half * acceleration;
        if HALF {
            half_velocity.store(&mut numbers[4..8]);
            full_velocity.only(vector).store(velocity);
        } else {
            half_velocity.store(velocity);
            L::select(vector, full_velocity, L::splat(numbers[3])).store(&mut numbers[4..8]);
        }
        if !MEASURE {
            continue;
        }
        let moved = position - stretch * three(*reference, 0.0);
        let [x, y, z] = leading(moved * moved);
        let squared = x + y + z;
        // So that NaN is found.
        let nearer = squared <= farthest;
        if !nearer {
            farthest = result.take_displacement(squared, (slice.start + index) as u32);
        }
    }
    if !MEASURE {
        result.take_velocities(leading(swiftest));
        // Largest values may leave out NaN, sums do not.
        if leading(sum).iter().any(|sum| sum.is_nan()) {
            let stray = range.clone().find(|&index| slice.velocity[index].iter().any(|number| number.is_nan()));
            result.lost = Some((slice.start + stray.unwrap_or(range.start)) as u32);
        }
    }
}

/// The first three of four lanes.
#[inline(always)]
fn leading<L: Lane>(lanes: L) -> [f64; 3] {
    let mut values = [0.0; 4];
    lanes.store(&mut values);
    [values[0], values[1], values[2]]
}

/// Turn ellipsoids, as many side by side as there are lanes where that many free ones follow each other.
#[inline(always)]
fn turn_all<W: Lane, const HALF: bool>(
    slice: &mut Slice,
    range: Range<usize>,
    loads: &[[f64; 8]],
    motion: &StepMotion,
) {
    let times = Rotation { kick: 0.5 * (motion.previous_time_step + motion.time_step), time_step: motion.time_step };
    let mut place = 0;
    while place < range.len() {
        let index = range.start + place;
        let group = index..(index + W::WIDTH).min(range.end);
        let loads = &loads[place..];
        place += group.len();
        if group.len() == W::WIDTH && slice.record[group.clone()].iter().all(|record| record.inverse_mass > 0.0) {
            turn_free::<W, HALF>(slice, index, loads, &times);
            continue;
        }
        for (index, load) in group.zip(loads) {
            let (record, shape) = (&slice.record[index], &mut slice.shape[index]);
            if record.inverse_mass > 0.0 {
                turn_free::<f64, HALF>(slice, index, std::slice::from_ref(load), &times);
            } else {
                shape.orientation = times.advance_driven(shape.orientation, record.spin);
            }
        }
    }
}

/// Turn the free ellipsoids from `index` on.
#[inline(always)]
fn turn_free<W: Lane, const HALF: bool>(slice: &mut Slice, index: usize, loads: &[[f64; 8]], times: &Rotation) {
    let mut offsets = [0; BLOCK];
    let (mut spin, mut torque) = ([[0.0; BLOCK]; 3], [[0.0; BLOCK]; 3]);
    for lane in 0..W::WIDTH {
        offsets[lane] = (lane * RECORD) as u32;
        for axis in 0..3 {
            spin[axis][lane] = slice.spin[index + lane][axis];
            torque[axis][lane] = loads[lane][4 + axis];
        }
    }
    let [a, b, c, _, w, x, y, z] = W::gather_shapes(&slice.shape[index..], &offsets);
    let record = W::gather(&slice.record[index..], &offsets);
    let of_record = [record[8], record[9], record[10]];
    let spin = if HALF { of_record } else { [W::load(&spin[0]), W::load(&spin[1]), W::load(&spin[2])] };
    let body = Body {
        semi_axes: [a, b, c],
        inverse_mass: record[11],
        orientation: [w, x, y, z],
        spin,
        torque: [W::load(&torque[0]), W::load(&torque[1]), W::load(&torque[2])],
    };
    let (orientation, Spins { half, full }) = times.advance(&body);
    let shapes: &mut [f64] = bytemuck::cast_slice_mut(&mut slice.shape[index..]);
    W::scatter(orientation, shapes, SHAPE, 4);
    let (seen, other) = if HALF { (half, full) } else { (full, half) };
    W::scatter([other[0], other[1], other[2], W::splat(0.0)], slice.spin[index..].as_flattened_mut(), 4, 0);
    let records: &mut [f64] = bytemuck::cast_slice_mut(&mut slice.record[index..]);
    W::scatter([seen[0], seen[1], seen[2], record[11]], records, RECORD, 8);
}

/// Work of gravity and of what drives a driven particle, `F·v` at the full step times half of the steps before and after
/// it (trapezoidal rule). What the first half adds to a state is in [`crate::simulation::Report`] before it is here.
#[inline(always)]
fn add_external_work(
    ledger: &mut [f64; LEDGER.len()],
    record: &Record,
    velocity: [f64; 3],
    load: &[f64; 8],
    motion: &StepMotion,
) {
    let dot = |a: [f64; 3], b: [f64; 3]| a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
    let time = 0.5 * (motion.previous_time_step + motion.time_step);
    if record.inverse_mass > 0.0 {
        ledger[1] += dot(motion.gravity, velocity) / record.inverse_mass * time;
    } else {
        let (force, torque) = ([load[0], load[1], load[2]], [load[4], load[5], load[6]]);
        ledger[2] -= (dot(force, velocity) + dot(torque, record.spin)) * time;
    }
}

/// Orientation after turning with an angular velocity for one step: `q + ½ Δt ω q`, normalised.
#[inline(always)]
fn turned(q: [f64; 4], spin: [f64; 3], time_step: f64) -> [f64; 4] {
    let h = 0.5 * time_step;
    let [x, y, z] = spin.map(|w| w * h);
    let turned = [
        q[0] - (x * q[1] + y * q[2] + z * q[3]),
        q[1] + (x * q[0] + y * q[3] - z * q[2]),
        q[2] + (y * q[0] + z * q[1] - x * q[3]),
        q[3] + (z * q[0] + x * q[2] - y * q[1]),
    ];
    let norm = (turned[0] * turned[0] + turned[1] * turned[1] + turned[2] * turned[2] + turned[3] * turned[3]).sqrt();
    turned.map(|c| c / norm)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn turning_about_z_by_small_steps_gives_the_angle() {
        let (mut q, steps) = ([1.0, 0.0, 0.0, 0.0], 1000);
        for _ in 0..steps {
            q = turned(q, [0.0, 0.0, 1.0], 0.5 / f64::from(steps));
        }
        assert!((q[0] - libm::cos(0.25)).abs() < 1e-7 && (q[3] - libm::sin(0.25)).abs() < 1e-7, "{q:?}");
    }
}
