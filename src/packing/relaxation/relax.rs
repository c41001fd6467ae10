//! Minimises the enthalpy of overlapping ellipsoids over positions, orientations and the size of the cell.

use super::pairs::{PairList, separation};
use super::touch::{Symmetric, overlap, squared_axes};
use crate::state::shape::{bounding_radius, normalised, product};

/// Ellipsoids in a periodic box of given proportions.
#[derive(Debug)]
pub struct System {
    /// Centres, not wrapped; only those of the box itself change with the box.
    pub positions: Vec<[f64; 3]>,
    /// Unit quaternions.
    pub orientations: Vec<[f64; 4]>,
    /// Semi-axes.
    pub semi_axes: Vec<[f64; 3]>,
    /// Sides of the box.
    pub sides: [f64; 3],
    radii: Vec<f64>,
    squares: Vec<Symmetric>,
    /// Length that turns angles into paths, per particle.
    arms: Vec<f64>,
    list: PairList,
}

/// What one look at all pairs gives.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Look {
    /// Number of overlapping pairs.
    pub overlaps: usize,
    /// Sum of 1 − μ.
    pub depth: f64,
    /// Largest 1 − μ.
    pub deepest: f64,
    /// `−dE/dε` for a uniform stretch of the cell by 1 + ε.
    pub virial: f64,
}

/// Forces per particle: on positions and on turns (per path).
#[derive(Debug, Default)]
struct Forces {
    centres: Vec<[f64; 3]>,
    turns: Vec<[f64; 3]>,
    cell: f64,
}

/// When to stop.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Goal {
    /// Pressure on the cell; `None`: the cell keeps its size and the overlaps are to vanish.
    pub pressure: Option<f64>,
    /// Residual force over mean contact force; without pressure the largest 1 − μ.
    pub tolerance: f64,
    /// Give up after so many steps.
    pub max_steps: usize,
}

/// Bitzek et al.: more steps downhill than this before the step grows.
const DELAY: u32 = 5;
const GROW: f64 = 1.1;
const SHRINK: f64 = 0.5;
const MIXING: f64 = 0.1;
const MIXING_DECAY: f64 = 0.99;
/// The stiffest modes of a packing of unit spheres oscillate with a frequency of about 2.
const MAX_STEP: f64 = 0.6;
/// Margin of the pair list over the mean radius (1).
const MARGIN: f64 = 0.35;
/// How stiff the cell is against a particle: its coordinate moves all particles together.
const CELL_WEIGHT: f64 = 1.0;

impl System {
    /// Lengths are to be in units of about the mean radius.
    #[must_use]
    pub fn new(
        positions: Vec<[f64; 3]>,
        orientations: Vec<[f64; 4]>,
        semi_axes: Vec<[f64; 3]>,
        sides: [f64; 3],
    ) -> Self {
        let radii: Vec<f64> = semi_axes.iter().map(|axes| bounding_radius(*axes)).collect();
        let arms = radii.iter().map(|radius| 0.5 * radius).collect();
        let list = PairList::new(&positions, &radii, sides, MARGIN);
        let mut system = Self { positions, orientations, semi_axes, sides, radii, squares: Vec::new(), arms, list };
        system.squares = vec![[0.0; 6]; system.positions.len()];
        system.turn_squares();
        system
    }

    /// Volume of the box.
    #[must_use]
    pub fn volume(&self) -> f64 {
        self.sides[0] * self.sides[1] * self.sides[2]
    }

    /// Stretch the box with everything in it, but not the particles.
    pub fn stretch(&mut self, factor: f64) {
        self.sides = self.sides.map(|side| factor * side);
        for position in &mut self.positions {
            *position = position.map(|x| factor * x);
        }
    }

    fn turn_squares(&mut self) {
        for ((square, axes), orientation) in self.squares.iter_mut().zip(&self.semi_axes).zip(&self.orientations) {
            *square = squared_axes(*axes, *orientation);
        }
    }

    /// Look at all pairs and sum up the forces.
    fn look(&mut self, forces: &mut Forces) -> Look {
        if self.list.is_stale(&self.positions, self.sides) {
            self.list = PairList::new(&self.positions, &self.radii, self.sides, MARGIN);
        }
        let count = self.positions.len();
        forces.centres.clear();
        forces.centres.resize(count, [0.0; 3]);
        forces.turns.clear();
        forces.turns.resize(count, [0.0; 3]);
        let mut look = Look::default();
        for pair in &mut self.list.pairs {
            let (first, second) = (pair.first as usize, pair.second as usize);
            let d = separation(&self.positions, first, second, pair.shift, self.sides);
            let reach = self.radii[first] + self.radii[second];
            if d[0] * d[0] + d[1] * d[1] + d[2] * d[2] >= reach * reach {
                continue;
            }
            let Some(found) = overlap(&self.squares[first], &self.squares[second], d, pair.place) else { continue };
            pair.place = found.place;
            let depth = 1.0 - found.scale;
            for k in 0..3 {
                forces.centres[first][k] -= depth * found.gradient[k];
                forces.centres[second][k] += depth * found.gradient[k];
                forces.turns[first][k] += depth * found.turn_first[k] / self.arms[first];
                forces.turns[second][k] += depth * found.turn_second[k] / self.arms[second];
            }
            look.overlaps += 1;
            look.depth += depth;
            look.virial += depth * found.scale;
            if depth > look.deepest {
                look.deepest = depth;
            }
        }
        look
    }

    /// Go down to the minimum of `H = Σ ½ (1 − μ)² + P V`, μ of [`overlap`], over all positions and
    /// orientations and, if there is a pressure P, the size of the box (lengths in units of the mean
    /// radius). Returns the last look and whether the goal was met.
    ///
    /// The fast inertial relaxation engine: the motion of masses that are stopped whenever they go uphill.
    ///
    /// # Source
    /// Bitzek, Koskinen, Gähler, Moseler, Gumbsch 2006 (doi:10.1103/PhysRevLett.97.170201).
    pub fn relax(&mut self, goal: Goal) -> (Look, bool) {
        let count = self.positions.len();
        let weight = CELL_WEIGHT * (count as f64).sqrt();
        let (mut forces, mut motion) = (Forces::default(), Forces::default());
        motion.centres.resize(count, [0.0; 3]);
        motion.turns.resize(count, [0.0; 3]);
        let (mut step, mut mixing, mut downhill) = (0.1, MIXING, 0);
        let mut look = Look::default();
        for _ in 0..goal.max_steps {
            look = self.look(&mut forces);
            let load = goal.pressure.map(|pressure| 3.0 * pressure * self.volume());
            forces.cell = load.map_or(0.0, |load| (look.virial - load) / weight);
            if self.is_met(goal, &look, &forces, load) {
                return (look, true);
            }
            let (power, speed, force) = products(&motion, &forces);
            if power > 0.0 {
                downhill += 1;
                if downhill > DELAY {
                    step = (GROW * step).min(MAX_STEP);
                    mixing *= MIXING_DECAY;
                }
                let pull = if force > 0.0 { mixing * (speed / force).sqrt() } else { 0.0 };
                combine(&mut motion, 1.0 - mixing, &forces, pull + step);
            } else {
                downhill = 0;
                mixing = MIXING;
                step = if power < 0.0 { SHRINK * step } else { step };
                combine(&mut motion, 0.0, &forces, step);
            }
            self.advance(&motion, step, weight);
        }
        (look, false)
    }

    fn is_met(&self, goal: Goal, look: &Look, forces: &Forces, load: Option<f64>) -> bool {
        let Some(load) = load else { return look.deepest <= goal.tolerance };
        if look.overlaps == 0 {
            return false;
        }
        let mean = 0.5 * look.depth / look.overlaps as f64;
        let sum = |list: &[[f64; 3]]| list.iter().flatten().map(|x| x * x).sum::<f64>();
        let residual = ((sum(&forces.centres) + sum(&forces.turns)) / self.positions.len() as f64).sqrt();
        residual <= goal.tolerance * mean && (look.virial / load - 1.0).abs() <= goal.tolerance
    }

    fn advance(&mut self, motion: &Forces, step: f64, weight: f64) {
        // However hard it is pressed, the box does not fold.
        let stretch = 1.0 + (step * motion.cell / weight).clamp(-0.02, 0.02);
        if motion.cell != 0.0 {
            self.stretch(stretch);
        }
        for (index, position) in self.positions.iter_mut().enumerate() {
            for (x, speed) in position.iter_mut().zip(motion.centres[index]) {
                *x += step * speed;
            }
            let half = 0.5 * step / self.arms[index];
            let [x, y, z] = motion.turns[index].map(|path| half * path);
            let turned = product([1.0, x, y, z], self.orientations[index]);
            self.orientations[index] = normalised(turned);
        }
        self.turn_squares();
    }
}

/// v·F, v·v and F·F over all coordinates.
fn products(motion: &Forces, forces: &Forces) -> (f64, f64, f64) {
    let lists = [(&motion.centres, &forces.centres), (&motion.turns, &forces.turns)];
    let (v, f) = (motion.cell, forces.cell);
    let mut sums = (v * f, v * v, f * f);
    for (v, f) in lists.into_iter().flat_map(|(a, b)| a.iter().flatten().zip(b.iter().flatten())) {
        sums = (sums.0 + v * f, sums.1 + v * v, sums.2 + f * f);
    }
    sums
}

/// v ← keep · v + add · F.
fn combine(motion: &mut Forces, keep: f64, forces: &Forces, add: f64) {
    motion.cell = keep * motion.cell + add * forces.cell;
    let positions = motion.centres.iter_mut().flatten().zip(forces.centres.iter().flatten());
    let turns = motion.turns.iter_mut().flatten().zip(forces.turns.iter().flatten());
    for (v, f) in positions.chain(turns) {
        *v = keep * *v + add * f;
    }
}
