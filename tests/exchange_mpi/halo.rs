//! The halo against brute force over all particles, ranks and images.

use crate::scene::{ALL, SCENES, SPECIES, Scene};
use dem_mpi::exchange::{Communicator, Decomposition, HaloContent, HaloPlan, distribute};
use dem_mpi::state::ContactMemory;
use dem_mpi::state::particles::Particles;
use std::collections::{BTreeMap, BTreeSet};

pub fn check(comm: &Communicator) {
    for scene in &SCENES {
        for decomposition in scene.grids(comm.size()) {
            check_scene(comm, scene, &decomposition);
        }
    }
}

fn check_scene(comm: &Communicator, scene: &Scene, decomposition: &Decomposition) {
    let setting = scene.setting(decomposition);
    let share = scene.share(comm, 0);
    let (mut particles, _) =
        distribute(comm, &setting, &share, &ContactMemory::new(0)).expect("the distribution succeeds");
    let reach = scene.max_radius + scene.skin;
    let mut plan = HaloPlan::build(comm, decomposition, &mut particles, scene.sides, scene.periodic, reach)
        .expect("the halo can be built");
    let place = format!("rank {} of {decomposition:?}, {scene:?}", comm.rank());

    check_ghosts(scene, &particles, 0, 0, &place);
    check_order(scene, decomposition, &particles, &place);
    check_completeness(scene, &plan, &particles, &place);
    let border = (0..particles.owned).filter(|&index| plan.is_border(index)).count();
    assert_eq!((plan.border().len(), plan.inner().len()), (border, particles.owned - border), "{place}");

    check_update(comm, scene, &mut plan, &mut particles, 1, true, &place);
    check_update(comm, scene, &mut plan, &mut particles, 2, false, &place);
}

/// Ghosts are as their owners have them: positions of `time`, velocities and orientations of
/// `velocity_time`.
fn check_ghosts(scene: &Scene, particles: &Particles, time: u64, velocity_time: u64, place: &str) {
    for ghost in particles.owned..particles.len() {
        let id = particles.id[ghost];
        let states = [scene.state(id, time), scene.state(id, velocity_time)];
        let [now, before] = states.map(|state| Particles::from_states(&[state], &SPECIES, ALL));
        let mut expected = now.record[0];
        expected.velocity = before.record[0].velocity;
        expected.spin = before.record[0].spin;
        assert_eq!(particles.record[ghost], expected, "{place}");
        assert_eq!(particles.shape[ghost], before.shape[0], "{place}");
        assert_eq!((particles.species[ghost], particles.image[ghost]), (now.species[0], now.image[0]), "{place}");
    }
}

/// Ghosts follow in order of the rank that sends them.
fn check_order(scene: &Scene, decomposition: &Decomposition, particles: &Particles, place: &str) {
    let ghosts = &particles.record[particles.owned..];
    let senders = ghosts.iter().map(|ghost| decomposition.owner(ghost.position, scene.sides));
    assert!(senders.is_sorted(), "{place}");
}

/// Every pair within the skin of touching has both ends here, each particle once, and the own end of a
/// pair with a ghost is a border particle.
fn check_completeness(scene: &Scene, plan: &HaloPlan, particles: &Particles, place: &str) {
    let here: BTreeMap<u32, usize> = particles.id.iter().enumerate().map(|(index, &id)| (id, index)).collect();
    assert_eq!(here.len(), particles.len(), "{place}: a particle is here twice");
    let images = scene.periodic.map(|periodic| if periodic { 3 } else { 0 });
    for own in 0..particles.owned {
        let a = &particles.record[own];
        for id in 0..scene.particles {
            let b = scene.state(id, 0);
            let distance = a.radius + b.radius + scene.skin;
            let touches = shifts(images).any(|shift| {
                let square: f64 = (0..3)
                    .map(|k| b.position[k] + f64::from(shift[k]) * scene.sides[k] - a.position[k])
                    .map(|d| d * d)
                    .sum();
                square < distance * distance
            });
            if touches {
                let other = here.get(&id).unwrap_or_else(|| panic!("{place}: particle {id} is missing"));
                assert!(*other < particles.owned || plan.is_border(own), "{place}");
            }
        }
    }
}

fn shifts(images: [i32; 3]) -> impl Iterator<Item = [i32; 3]> {
    let [x, y, z] = images;
    (-x..=x).flat_map(move |i| (-y..=y).flat_map(move |j| (-z..=z).map(move |k| [i, j, k])))
}

fn check_update(
    comm: &Communicator,
    scene: &Scene,
    plan: &mut HaloPlan,
    particles: &mut Particles,
    time: u64,
    velocities: bool,
    place: &str,
) {
    for own in 0..particles.owned {
        let state = scene.state(particles.id[own], time);
        let moved = Particles::from_states(&[state], &SPECIES, ALL);
        particles.record[own] = moved.record[0];
        particles.image[own] = moved.image[0];
        particles.shape[own] = moved.shape[0];
    }
    let expected: BTreeSet<(u32, [i32; 3])> = (particles.owned..particles.len())
        .map(|ghost| {
            let (new, old) = (scene.state(particles.id[ghost], time).image, particles.image[ghost]);
            (ghost as u32, [0, 1, 2].map(|k| new[k] - old[k]))
        })
        .filter(|(_, change)| *change != [0; 3])
        .collect();
    let mut wrapped = vec![(7, [7; 3])];
    let content = HaloContent { velocities, orientations: velocities };
    let seen = plan.update(comm, particles, content, &mut wrapped, |particles| particles.len());
    assert_eq!(seen, particles.len());
    assert_eq!(wrapped.into_iter().collect::<BTreeSet<_>>(), expected, "{place}");
    check_ghosts(scene, particles, time, if velocities { time } else { time - 1 }, place);
}
