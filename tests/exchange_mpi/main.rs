//! The exchange between ranks, checked against brute force under `mpirun`. The tests below start this
//! same program on several ranks, where it runs `on_each_rank` alone.
#![cfg(feature = "mpi")]

mod halo;
mod launch;
mod messages;
mod migration;
mod scene;

use dem_mpi::exchange::Communicator;

/// What each rank does; the environment variable chooses the check.
#[test]
#[ignore = "started by the other tests under mpirun"]
fn on_each_rank() {
    let comm = Communicator::world().expect("MPI starts");
    match std::env::var(launch::CHECK).as_deref() {
        Ok("messages") => messages::check(&comm),
        Ok("sums") => messages::print_sums(&comm),
        Ok("halo") => halo::check(&comm),
        Ok("migration") => migration::check(&comm),
        Ok("panic") => {
            assert!(comm.rank() != comm.size() - 1, "a panic on one rank");
            comm.barrier();
        }
        Ok("abort") => {
            if comm.rank() == comm.size() - 1 {
                comm.abort(9);
            }
            comm.sleep_until_all();
        }
        other => panic!("unknown check {other:?}"),
    }
}

const RANKS: [usize; 5] = [1, 2, 3, 5, 8];

#[test]
fn messages_and_agreement_work_on_any_number_of_ranks() {
    RANKS.iter().for_each(|&ranks| launch::succeeds("messages", ranks));
}

#[test]
fn exact_sums_have_the_same_bits_on_any_number_of_ranks() {
    let outputs = RANKS.map(|ranks| launch::run("sums", ranks).marked_lines());
    assert_eq!(outputs[0].len(), 4, "{outputs:?}");
    for (output, ranks) in outputs.iter().zip(RANKS) {
        assert_eq!(output, &outputs[0], "{ranks} ranks");
    }
}

#[test]
fn the_halo_is_complete_in_thick_thin_and_tiny_cells() {
    RANKS.iter().for_each(|&ranks| launch::succeeds("halo", ranks));
}

#[test]
fn migration_keeps_every_particle_and_every_row_of_memory() {
    RANKS.iter().for_each(|&ranks| launch::succeeds("migration", ranks));
}

#[test]
fn a_panic_or_an_abort_of_one_rank_ends_all_of_them() {
    for check in ["panic", "abort"] {
        assert!(!launch::run(check, 3).success, "{check}");
    }
    assert_eq!(launch::run("abort", 2).code, Some(9));
}
