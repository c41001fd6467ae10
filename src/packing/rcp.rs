//! Random close packing after Jodrey and Tory: random points whose worst overlap is pushed apart, again
//! and again, while the size at which overlaps count shrinks. Serial, hence the same bits on any machine.

use super::grid::{Ball, Cell, Grid, size_class};
use super::random::{Draws, Purpose};
use super::tournament::Tournament;
use crate::error::{Error, Result};

/// What to pack, and how.
#[derive(Debug, Clone)]
pub struct Request<'a> {
    /// Radius of every particle \[m\], by id.
    pub radii: &'a [f64],
    /// Proportions of the cell, and which axes are periodic.
    pub shape: Cell,
    /// Solid fraction at which to stop; `None`: go on until the spheres just touch.
    pub solid_fraction: Option<f64>,
    /// Seed of the initial points.
    pub seed: u64,
    /// Contraction rate k of the outer diameter; smaller is slower and denser (equal spheres: 0.02 gives
    /// a solid fraction of 0.53, 0.002 0.62, 0.0005 0.635, 0.000125 0.643).
    pub contraction_rate: f64,
    /// Give up after this many moves per particle.
    pub max_moves_per_particle: f64,
}

/// A packing of non-overlapping spheres.
#[derive(Debug, Clone, PartialEq)]
pub struct RandomPacking {
    /// Sides of the cell \[m\], in the proportions asked for.
    pub sides: [f64; 3],
    /// Centres within the cell \[m\], by id.
    pub positions: Vec<[f64; 3]>,
    /// Volume of the spheres over that of the cell.
    pub solid_fraction: f64,
    /// Pairs pushed apart on the way.
    pub moves: u64,
}

/// Pack spheres at random, as densely as the contraction rate makes them, or to a given fraction.
///
/// The radii are multiplied by a common factor λ. The outer factor starts at 1, where the spheres
/// would fill the cell (less if a sphere could not fit beside its own image). In each move the pair
/// with the smallest distance over sum of radii (the inner factor) is pushed apart symmetrically to
/// the outer one, and the outer one shrinks by `λ₀ (k/N) (1/2)^j`, `j = ⌊−log₁₀(λ_out³ − λ_in³)⌋`. It
/// ends when outer ≤ inner (or when the inner factor reaches the one asked for); the cell is then
/// enlarged by 1/λ so that the spheres have their own radii. A fraction asked for that is narrowly
/// missed is tried again at slower rates. On walled axes centres keep λ_out R from
/// the walls.
///
/// # Errors
/// [`Error::Packing`] if the fraction asked for is not reached, or too many moves are needed.
///
/// # Source
/// Jodrey and Tory 1985, doi:10.1103/PhysRevA.32.2347; W Sec. 2.1.
pub fn pack(request: &Request) -> Result<RandomPacking> {
    let magnification = libm::cbrt(solid_volume(request.radii) / request.shape.volume());
    let cell = Cell { sides: request.shape.sides.map(|side| side * magnification), ..request.shape };
    let target = request.solid_fraction.map(libm::cbrt);
    let mut moves_left = (request.max_moves_per_particle * request.radii.len() as f64).max(1.0) as u64;
    let mut best: f64 = 0.0;
    let mut rate = request.contraction_rate;
    for _ in 0..ATTEMPTS {
        let mut packer = Packer::new(request, cell, rate);
        if let Some(target) = target.filter(|target| *target > packer.outer) {
            return Err(too_large(target, packer.outer));
        }
        let Some(attained) = packer.run(target, moves_left) else { break };
        let goal = target.unwrap_or(attained);
        if attained >= goal {
            return Ok(packer.finish(goal));
        }
        moves_left -= packer.moves;
        best = best.max(attained);
        if cube(goal) - cube(best) > GAIN_OF_SLOWER_RATE {
            break;
        }
        rate *= 0.25;
    }
    Err(match target {
        Some(target) if best > 0.0 => not_reached(target, best, request.contraction_rate),
        _ => too_many_moves(request),
    })
}

/// A solid fraction just above what the given contraction rate attains is tried again at a quarter of
/// the rate, in so many attempts altogether …
const ATTEMPTS: usize = 3;
/// … as long as no more than this is lacking, about what a quarter of the rate adds.
const GAIN_OF_SLOWER_RATE: f64 = 0.01;

/// Volume of all spheres \[m³\].
#[must_use]
pub fn solid_volume(radii: &[f64]) -> f64 {
    radii.iter().map(|radius| 4.0 / 3.0 * std::f64::consts::PI * cube(*radius)).sum()
}

fn cube(value: f64) -> f64 {
    value * value * value
}

fn too_large(target: f64, limit: f64) -> Error {
    Error::Packing(format!(
        "solid fraction {:.4} is out of reach: above {:.4} the largest particle would not fit into the cell beside \
         its own image or between the walls; ask for less, use more particles or other proportions of the cell",
        cube(target),
        cube(limit)
    ))
}

fn too_many_moves(request: &Request) -> Error {
    Error::Packing(format!(
        "random close packing of {} particles did not end within {} moves per particle; raise the limit of moves or \
         the contraction rate (now {})",
        request.radii.len(),
        request.max_moves_per_particle,
        request.contraction_rate
    ))
}

fn not_reached(target: f64, attained: f64, rate: f64) -> Error {
    Error::Packing(format!(
        "solid fraction {:.4} was asked for, random close packing attained {:.4}; ask for less (larger cell sides, \
         fewer particles), or lower the contraction rate (now {rate}) for a slightly denser packing",
        cube(target),
        cube(attained)
    ))
}

/// The partner nearest to a ball, relative to the sum of radii.
#[derive(Debug, Clone, Copy)]
struct Nearest {
    partner: u32,
    shift: [i8; 3],
}

/// State of the iteration. Balls are numbered by size class, then along the grid; a pair is kept by
/// the ball with the higher number (so by the smaller one, whose neighbourhood is small).
struct Packer {
    cell: Cell,
    contraction: f64,
    /// Id of each ball.
    id: Vec<u32>,
    balls: Vec<Ball>,
    grid: Grid,
    /// Outer factor at which the grid was made.
    grid_scale: f64,
    outer: f64,
    nearest: Vec<Nearest>,
    /// Lower bounds of the squared relative distance of each ball's nearest pair, as far as it is
    /// below the outer factor. They are stale when the partner has moved away.
    keys: Tournament,
    moves: u64,
}

impl Packer {
    fn new(request: &Request, cell: Cell, contraction_rate: f64) -> Self {
        let largest = request.radii.iter().copied().fold(0.0, f64::max);
        let outer = cell.sides.iter().fold(1.0, |outer: f64, side| outer.min(side / (2.0 * largest)));
        let scattered = scatter(request, &cell, outer);
        let grid = Grid::new(cell, &scattered, outer);
        let mut id: Vec<u32> = (0..scattered.len() as u32).collect();
        id.sort_by_key(|index| {
            let index = *index as usize;
            (size_class(scattered[index].radius, largest), grid.place(index), index)
        });
        let balls: Vec<Ball> = id.iter().map(|index| scattered[*index as usize]).collect();
        let mut packer = Self {
            cell,
            contraction: outer * contraction_rate / balls.len() as f64,
            grid: Grid::new(cell, &balls, outer),
            grid_scale: outer,
            outer,
            nearest: vec![Nearest { partner: 0, shift: [0; 3] }; balls.len()],
            keys: Tournament::new(balls.len()),
            moves: 0,
            id,
            balls,
        };
        for index in 0..packer.balls.len() {
            packer.find_nearest(index);
        }
        packer
    }

    /// Push pairs apart until outer ≤ inner or inner ≥ `target`; returns the inner factor, `None` if
    /// the moves allowed do not suffice.
    fn run(&mut self, target: Option<f64>, moves_allowed: u64) -> Option<f64> {
        let goal = target.map_or(f64::INFINITY, |target| target * target);
        loop {
            let (ball, key) = self.keys.smallest();
            if key >= self.outer * self.outer {
                return Some(self.inner());
            }
            let separation = self.separation(ball);
            if relative_square(&separation, self.sum_of_radii(ball)) > key * (1.0 + 1e-12) {
                self.find_nearest(ball);
                continue;
            }
            if key >= goal {
                return Some(key.sqrt());
            }
            if self.moves == moves_allowed {
                return None;
            }
            self.push_apart(ball, separation);
            self.contract(key.sqrt());
        }
    }

    /// The smallest distance over sum of radii once no pair is below the outer factor, which it
    /// exceeds by less than the last contraction; the outer factor itself if no pair is near.
    fn inner(&self) -> f64 {
        let reach = 1.001 * self.outer;
        let mut smallest = reach * reach;
        for (index, ball) in self.balls.iter().enumerate() {
            self.grid.visit_near(index, ball, reach, true, |other, image| {
                if other < index {
                    let partner = &self.balls[other];
                    let square = relative_square(&image.separation(ball, partner), ball.radius + partner.radius);
                    smallest = smallest.min(square);
                }
            });
        }
        if smallest < reach * reach { smallest.sqrt() } else { self.outer }
    }

    /// From a ball to the image of its nearest partner \[m\].
    fn separation(&self, ball: usize) -> [f64; 3] {
        let Nearest { partner, shift } = self.nearest[ball];
        let (from, to) = (&self.balls[ball], &self.balls[partner as usize]);
        [0, 1, 2].map(|k| to.position[k] + f64::from(shift[k]) * self.cell.sides[k] - from.position[k])
    }

    fn sum_of_radii(&self, ball: usize) -> f64 {
        self.balls[ball].radius + self.balls[self.nearest[ball].partner as usize].radius
    }

    /// Move a ball and its nearest partner, by the same way each, until they are at the outer distance.
    fn push_apart(&mut self, ball: usize, separation: [f64; 3]) {
        let distance = norm_square(&separation).sqrt();
        let direction = if distance > 0.0 { separation.map(|d| d / distance) } else { [1.0, 0.0, 0.0] };
        let way = 0.5 * (self.outer * self.sum_of_radii(ball) - distance);
        let partner = self.nearest[ball].partner as usize;
        self.displace(ball, direction.map(|n| -n * way));
        self.displace(partner, direction.map(|n| n * way));
        self.find_nearest(ball);
        self.find_nearest(partner);
        self.moves += 1;
    }

    fn displace(&mut self, index: usize, way: [f64; 3]) {
        let ball = &mut self.balls[index];
        for (k, way) in way.into_iter().enumerate() {
            let side = self.cell.sides[k];
            ball.position[k] = if self.cell.periodic[k] {
                wrap(ball.position[k] + way, side)
            } else {
                keep_from_walls(ball.position[k] + way, self.outer * ball.radius, side)
            };
        }
        let position = ball.position;
        self.grid.update(index, position);
    }

    /// Shrink the outer factor after a move that began at this inner one.
    fn contract(&mut self, inner: f64) {
        let mut step = self.contraction;
        let difference = cube(self.outer) - cube(inner);
        let mut decade = 0.1;
        while difference <= decade && decade > 1e-16 {
            step *= 0.5;
            decade *= 0.1;
        }
        self.outer = (self.outer - step).max(0.0);
        if self.outer < 0.96 * self.grid_scale {
            self.grid = Grid::new(self.cell, &self.balls, self.outer);
            self.grid_scale = self.outer;
        }
    }

    /// Search the partners of a ball: keep the nearest of lower number as its own, and tell those of
    /// higher number for which this ball is nearer than what they know.
    fn find_nearest(&mut self, index: usize) {
        let Self { balls, grid, nearest, keys, outer, .. } = self;
        let ball = balls[index];
        let cut = *outer * *outer;
        let mut best = f64::INFINITY;
        grid.visit_near(index, &ball, *outer, false, |other, image| {
            let partner = &balls[other];
            let separation = image.separation(&ball, partner);
            let sum = ball.radius + partner.radius;
            if norm_square(&separation) >= cut * (sum * sum) || other == index {
                return;
            }
            let square = relative_square(&separation, sum);
            if other < index {
                if square < best {
                    best = square;
                    nearest[index] = Nearest { partner: other as u32, shift: image.shift };
                }
            } else if square < keys.key(other) {
                nearest[other] = Nearest { partner: index as u32, shift: image.shift.map(|shift| -shift) };
                keys.set(other, square);
            }
        });
        keys.set(index, best);
    }

    /// Positions by id in a cell enlarged so that `factor` becomes 1.
    fn finish(self, factor: f64) -> RandomPacking {
        let sides = self.cell.sides.map(|side| side / factor);
        let mut positions = vec![[0.0; 3]; self.balls.len()];
        for (id, ball) in self.id.iter().zip(&self.balls) {
            positions[*id as usize] = [0, 1, 2].map(|k| wrap(ball.position[k] / factor, sides[k]));
        }
        RandomPacking { sides, positions, solid_fraction: cube(factor), moves: self.moves }
    }
}

/// Random points, away from walls by `outer` times the radius.
fn scatter(request: &Request, cell: &Cell, outer: f64) -> Vec<Ball> {
    let place = |(id, radius): (usize, &f64)| {
        let mut draws = Draws::new(request.seed, Purpose::Position, id as u64);
        let position = [0, 1, 2].map(|k| {
            let (side, uniform) = (cell.sides[k], draws.uniform());
            if cell.periodic[k] {
                wrap(uniform * side, side)
            } else {
                let gap = outer * radius;
                keep_from_walls(gap + uniform * (side - 2.0 * gap), gap, side)
            }
        });
        Ball { position, radius: *radius }
    };
    request.radii.iter().enumerate().map(place).collect()
}

/// The periodic image of a coordinate in [0, side).
#[must_use]
pub fn wrap(coordinate: f64, side: f64) -> f64 {
    let mut wrapped = coordinate;
    if wrapped < 0.0 {
        wrapped += side;
    } else if wrapped >= side {
        wrapped -= side;
    }
    if wrapped >= 0.0 && wrapped < side {
        return wrapped;
    }
    // Far outside, or so little below zero that adding the side rounds to the side itself.
    let remainder = coordinate - (coordinate / side).floor() * side;
    if remainder >= 0.0 && remainder < side { remainder } else { 0.0 }
}

fn keep_from_walls(coordinate: f64, gap: f64, side: f64) -> f64 {
    coordinate.min(side - gap).max(gap)
}

#[inline]
fn norm_square(vector: &[f64; 3]) -> f64 {
    vector[0] * vector[0] + vector[1] * vector[1] + vector[2] * vector[2]
}

#[inline]
fn relative_square(separation: &[f64; 3], sum_of_radii: f64) -> f64 {
    norm_square(separation) / (sum_of_radii * sum_of_radii)
}

#[cfg(test)]
mod tests;
