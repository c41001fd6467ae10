//! Counter-based random numbers: every draw is a pure function of the seed, its purpose, a particle
//! id and its place in the sequence, so that no rank, thread or order of evaluation can change it.

use rand_chacha::ChaCha8Rng;
use rand_core::{RngCore, SeedableRng};

/// What a random number is for; streams of different purposes are independent of each other.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(u64)]
pub enum Purpose {
    /// Particle radii.
    Radius = 1,
    /// Initial positions.
    Position = 2,
    /// Initial velocities.
    Velocity = 3,
    /// Displacements of a replicated packing.
    Perturbation = 4,
    /// Ratios of semi-axes.
    Shape = 7,
    /// Initial orientations.
    Orientation = 6,
    /// The order in which spheres are dropped.
    DropOrder = 5,
}

/// The sequence of random numbers of one particle for one purpose.
///
/// ChaCha with 8 rounds; seed and purpose form the key, the particle id is the stream and the number
/// of draws taken so far the counter.
#[derive(Debug, Clone)]
pub struct Draws {
    generator: ChaCha8Rng,
}

impl Draws {
    /// The sequence of `particle` from its first draw.
    #[must_use]
    pub fn new(seed: u64, purpose: Purpose, particle: u64) -> Self {
        let mut key = [0; 32];
        key[..8].copy_from_slice(&seed.to_le_bytes());
        key[8..16].copy_from_slice(&(purpose as u64).to_le_bytes());
        let mut generator = ChaCha8Rng::from_seed(key);
        generator.set_stream(particle);
        Self { generator }
    }

    /// The same sequence from draw number `draw` on (0 is the first uniform number; a normal one
    /// takes two).
    #[must_use]
    pub fn starting_at(mut self, draw: u64) -> Self {
        self.generator.set_word_pos(2 * u128::from(draw));
        self
    }

    /// The next number of the uniform distribution on [0, 1), a multiple of 2⁻⁵³.
    pub fn uniform(&mut self) -> f64 {
        const STEP: f64 = 1.0 / (1_u64 << 53) as f64;
        (self.generator.next_u64() >> 11) as f64 * STEP
    }

    /// The next rotation, uniform over all of them, as a unit quaternion (w, x, y, z); takes three draws
    /// (Shoemake 1992).
    pub fn rotation(&mut self) -> [f64; 4] {
        let share = self.uniform();
        let [first, second] = [0; 2].map(|_| 2.0 * std::f64::consts::PI * self.uniform());
        let (low, high) = ((1.0 - share).sqrt(), share.sqrt());
        let (sin, cos) = (libm::sin, libm::cos);
        crate::state::shape::normalised([low * sin(first), low * cos(first), high * sin(second), high * cos(second)])
    }

    /// The next number of the standard normal distribution (Box–Muller, the cosine branch).
    pub fn normal(&mut self) -> f64 {
        // 1 − u lies in (0, 1], so the logarithm is finite.
        let radius = (-2.0 * libm::log(1.0 - self.uniform())).sqrt();
        radius * libm::cos(2.0 * std::f64::consts::PI * self.uniform())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn streams_differ_by_seed_purpose_and_particle() {
        let first = |seed, purpose, particle| Draws::new(seed, purpose, particle).uniform();
        let reference = first(1, Purpose::Radius, 0);
        assert_eq!(reference, first(1, Purpose::Radius, 0));
        for other in [first(2, Purpose::Radius, 0), first(1, Purpose::Position, 0), first(1, Purpose::Radius, 1)] {
            assert_ne!(reference, other);
        }
    }

    #[test]
    fn a_sequence_can_be_entered_at_any_draw() {
        let mut whole = Draws::new(7, Purpose::Velocity, 3);
        let numbers: Vec<f64> = (0..100).map(|_| whole.uniform()).collect();
        for (draw, number) in numbers.iter().enumerate() {
            assert_eq!(Draws::new(7, Purpose::Velocity, 3).starting_at(draw as u64).uniform(), *number);
        }
    }

    #[test]
    fn bits_are_pinned() {
        let mut draws = Draws::new(42, Purpose::Position, 5);
        let bits = [draws.uniform().to_bits(), draws.normal().to_bits()];
        assert_eq!(bits, PINNED, "the generator or libm changed: packings of old inputs would change too");
    }

    const PINNED: [u64; 2] = [4577349290146149760, 4603907389369265599];

    #[test]
    fn moments_are_those_of_the_distributions() {
        let count = 100_000;
        let (mut uniform, mut normal) = ([0.0; 2], [0.0; 2]);
        for particle in 0..count {
            let mut draws = Draws::new(1, Purpose::Radius, particle);
            let (u, n) = (draws.uniform(), draws.normal());
            assert!((0.0..1.0).contains(&u));
            for (power, (u, n)) in [(u, n), (u * u, n * n)].into_iter().enumerate() {
                uniform[power] += u / count as f64;
                normal[power] += n / count as f64;
            }
        }
        assert!((uniform[0] - 0.5).abs() < 0.005 && (uniform[1] - 1.0 / 3.0).abs() < 0.005, "{uniform:?}");
        assert!(normal[0].abs() < 0.02 && (normal[1] - 1.0).abs() < 0.02, "{normal:?}");
    }
}
