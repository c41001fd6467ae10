//! Migration and redistribution against what every rank can work out for itself.

use crate::scene::{ALL, SCENES, SPECIES, Scene, random};
use dem_mpi::exchange::redistribute::{block_start, memory_to_id_blocks, to_id_blocks};
use dem_mpi::exchange::{Communicator, Decomposition, distribute, migrate};
use dem_mpi::state::particles::Particles;
use dem_mpi::state::{ContactKey, ContactMemory};

const ROUNDS: u64 = 5;

pub fn check(comm: &Communicator) {
    for scene in &SCENES {
        for decomposition in scene.grids(comm.size()) {
            check_scene(comm, scene, &decomposition);
        }
    }
    check_faults(comm, &SCENES[1]);
}

fn check_scene(comm: &Communicator, scene: &Scene, decomposition: &Decomposition) {
    let setting = scene.setting(decomposition);
    let all = contacts(scene);
    let mut share = ContactMemory::new(all.width);
    for index in (0..all.keys.len()).filter(|index| index % comm.size() == comm.rank()) {
        share.push(all.keys[index], all.row(index));
    }
    let (mut particles, mut memory) =
        distribute(comm, &setting, &scene.share(comm, 0), &share).expect("the distribution succeeds");
    check_holdings(comm, scene, decomposition, &particles, &memory, 0);

    for time in 1..=ROUNDS {
        let states: Vec<_> = particles.id[..particles.owned].iter().map(|&id| scene.state(id, time)).collect();
        let leaving = states.iter().filter(|s| decomposition.owner(s.position, scene.sides) != comm.rank()).count();
        particles = Particles::from_states(&states, &SPECIES, ALL);
        let moved = migrate(comm, &setting, &mut particles, &mut memory).expect("the migration succeeds");
        let mut expected = [leaving as i64];
        comm.sum_i64(&mut expected);
        assert_eq!(moved as i64, expected[0]);
        check_holdings(comm, scene, decomposition, &particles, &memory, time);
    }
    check_blocks(comm, scene, &particles, &memory);
}

/// Contacts between random pairs, with walls and with own images; four columns.
fn contacts(scene: &Scene) -> ContactMemory {
    let mut memory = ContactMemory::new(4);
    for low in 0..scene.particles {
        for offset in 0..4 {
            let high = low + offset * offset * 5;
            let wall = high >= scene.particles;
            let high = if wall { scene.particles + high % 2 } else { high };
            let shift = if wall { [0; 4] } else { [1, offset as i32 - 1, 0, 0] };
            let key = ContactKey { low, high, shift };
            if memory.keys.last() == Some(&key) {
                continue;
            }
            let row = [0, 1, 2, 3].map(|column| random([u64::from(low), u64::from(offset), column]) - 0.5);
            memory.push(key, &row);
        }
    }
    let mut order: Vec<usize> = (0..memory.keys.len()).collect();
    order.sort_by_key(|&index| memory.keys[index]);
    order.dedup_by_key(|index| memory.keys[*index]);
    select(&memory, order)
}

fn select(memory: &ContactMemory, indices: impl IntoIterator<Item = usize>) -> ContactMemory {
    let mut selected = ContactMemory::new(memory.width);
    for index in indices {
        selected.push(memory.keys[index], memory.row(index));
    }
    selected
}

fn sorted(memory: &ContactMemory) -> ContactMemory {
    let mut order: Vec<usize> = (0..memory.keys.len()).collect();
    order.sort_by_key(|&index| memory.keys[index]);
    select(memory, order)
}

/// This rank holds exactly the particles in its box and the rows with an end among them.
fn check_holdings(
    comm: &Communicator,
    scene: &Scene,
    decomposition: &Decomposition,
    particles: &Particles,
    memory: &ContactMemory,
    time: u64,
) {
    let owned = |id: u32| {
        id < scene.particles && decomposition.owner(scene.state(id, time).position, scene.sides) == comm.rank()
    };
    let mut states = particles.states();
    states.sort_by_key(|state| state.id);
    let expected: Vec<_> = (0..scene.particles).filter(|&id| owned(id)).map(|id| scene.state(id, time)).collect();
    assert_eq!(states, expected);
    let rebuilt = Particles::from_states(&particles.states(), &SPECIES, ALL);
    assert_eq!(particles.record, rebuilt.record);

    let all = contacts(scene);
    let here = (0..all.keys.len()).filter(|&index| owned(all.keys[index].low) || owned(all.keys[index].high));
    assert_eq!(sorted(memory), select(&all, here));
}

fn check_blocks(comm: &Communicator, scene: &Scene, particles: &Particles, memory: &ContactMemory) {
    let total = u64::from(scene.particles);
    let (start, block) = to_id_blocks(comm, total, particles.states(), 0).expect("all particles are there");
    let range = block_start(comm.rank(), total, comm.size())..block_start(comm.rank() + 1, total, comm.size());
    assert_eq!(start, range.start);
    let expected: Vec<_> = range.clone().map(|id| scene.state(id as u32, ROUNDS)).collect();
    assert_eq!(block, expected);

    let rows = memory_to_id_blocks(comm, total, memory, 0).expect("copies are the same");
    let all = contacts(scene);
    let here = (0..all.keys.len()).filter(|&index| range.contains(&u64::from(all.keys[index].low)));
    assert_eq!(rows, select(&all, here));
}

/// Faults on one rank are errors on all of them.
fn check_faults(comm: &Communicator, scene: &Scene) {
    let decomposition = scene.grids(comm.size())[0];
    let setting = scene.setting(&decomposition);
    let none = ContactMemory::new(2);
    let share = scene.share(comm, 0);
    let (particles, memory) = distribute(comm, &setting, &share, &none).expect("the distribution succeeds");

    let mut broken = particles.clone();
    if comm.rank() == comm.size() - 1 {
        broken.record[0].position[1] = f64::NAN;
    }
    let error = migrate(comm, &setting, &mut broken, &mut memory.clone()).expect_err("a position is NaN");
    assert!(error.to_string().contains("NaN") && error.to_string().contains("unstable"), "{error}");

    let mut doubled = share.clone();
    if comm.rank() == 0 {
        doubled.push(scene.state(5, 0));
    }
    let error = distribute(comm, &setting, &doubled, &none).expect_err("particle 5 is there twice");
    assert!(error.to_string().contains("particle 5 is given twice"), "{error}");

    if comm.size() > 1 {
        let mut lost = Particles::from_states(&particles.states()[1..], &SPECIES, ALL);
        let error = migrate(comm, &setting, &mut lost, &mut memory.clone()).expect_err("particles are missing");
        assert!(error.to_string().contains("lost particles"), "{error}");
    }
    let missing = particles.states()[1..].to_vec();
    let error = to_id_blocks(comm, setting.particles_total, missing, 0).expect_err("particles are missing");
    assert!(error.to_string().contains("was lost"), "{error}");
}
