//! The communicator's calls, agreement and exact sums.

use crate::launch::MARK;
use crate::scene::random;
use dem_mpi::error::Error;
use dem_mpi::exchange::{Communicator, ExactSum, agree, exact_sum};

pub fn check(comm: &Communicator) {
    reductions(comm);
    gathers(comm);
    exchanges(comm);
    agreement(comm);
    part_of_the_ranks(comm);
}

fn reductions(comm: &Communicator) {
    let (rank, size) = (comm.rank() as f64, comm.size() as f64);
    let last_is_nan = if comm.rank() == comm.size() - 1 { f64::NAN } else { 1.0 };
    let signed_zero = if comm.rank() == 0 { 0.0 } else { -0.0 };
    let own = [rank, -rank, last_is_nan, signed_zero];
    let mut greatest = own;
    comm.max_f64(&mut greatest);
    assert_eq!(greatest[..2], [size - 1.0, 0.0]);
    assert!(greatest[2].is_nan());
    assert_eq!(greatest[3].to_bits(), 0.0_f64.to_bits());
    let mut least = own;
    comm.min_f64(&mut least);
    assert_eq!(least[..2], [0.0, 1.0 - size]);
    assert!(least[2].is_nan());
    assert_eq!(least[3].is_sign_negative(), comm.size() > 1);

    let mut many: Vec<i64> = (0..5000).map(|k| k + comm.rank() as i64).collect();
    comm.sum_i64(&mut many);
    let n = comm.size() as i64;
    assert!(many.iter().zip(0..).all(|(&sum, k)| sum == n * k + n * (n - 1) / 2));
    assert_eq!(comm.exclusive_sum(comm.rank() as u64 + 1), (comm.rank() * (comm.rank() + 1) / 2) as u64);
}

fn gathers(comm: &Communicator) {
    let of = |rank: usize| vec![rank as u8; rank * 3 % 7];
    let expected: Vec<_> = (0..comm.size()).map(of).collect();
    assert_eq!(comm.all_gather(&of(comm.rank())), expected);
    let root = comm.size() - 1;
    let mut bytes = vec![comm.rank() as u8; comm.rank() + 2];
    comm.broadcast(root, &mut bytes);
    assert_eq!(bytes, vec![root as u8; root + 2]);
    let parcel = |from: usize, to: usize| vec![(from * 16 + to) as u8; (from * 5 + to * 3) % 4];
    let received = comm.all_to_all((0..comm.size()).map(|to| parcel(comm.rank(), to)).collect());
    assert_eq!(received, (0..comm.size()).map(|from| parcel(from, comm.rank())).collect::<Vec<_>>());
}

/// Two messages to each rank, itself included, the second empty to some.
fn exchanges(comm: &Communicator) {
    let first = |from: usize, to: usize| vec![(from + 10 * to) as u8; 4];
    let second = |from: usize, to: usize| vec![(from + 10 * to + 1) as u8; (from + to) % 3];
    let ranks = 0..comm.size();
    let out: Vec<_> =
        ranks.clone().flat_map(|to| [(to, first(comm.rank(), to)), (to, second(comm.rank(), to))]).collect();
    let expected: Vec<_> =
        ranks.flat_map(|from| [(from, first(from, comm.rank())), (from, second(from, comm.rank()))]).collect();
    let mut landed: Vec<_> = expected.iter().map(|(from, bytes)| (*from, vec![0_u8; bytes.len()])).collect();
    let sends: Vec<_> = out.iter().map(|(to, bytes)| (*to, bytes.as_slice())).collect();
    let mut receives: Vec<_> = landed.iter_mut().map(|(from, bytes)| (*from, bytes.as_mut_slice())).collect();
    assert_eq!(comm.exchange(&sends, &mut receives, || "meanwhile"), "meanwhile");
    assert_eq!(landed, expected);
}

fn agreement(comm: &Communicator) {
    assert_eq!(agree(comm, Ok(comm.rank())).ok(), Some(comm.rank()));
    // Ranks from the middle on fail; the lowest of them is heard.
    let lowest = comm.size() / 2;
    let own = if comm.rank() < lowest {
        Ok(())
    } else {
        Err(Error::Simulation { step: comm.rank() as u64, message: format!("fault on rank {}", comm.rank()) })
    };
    match agree(comm, own) {
        Err(Error::Simulation { step, message }) => {
            assert_eq!((step, message), (lowest as u64, format!("fault on rank {lowest}")));
        }
        other => panic!("{other:?}"),
    }
}

fn part_of_the_ranks(comm: &Communicator) {
    let used = comm.size().div_ceil(2);
    let part = comm.first(used);
    assert_eq!(part.is_some(), comm.rank() < used);
    if let Some(part) = part {
        assert_eq!((part.rank(), part.size()), (comm.rank(), used));
        let mut ones = [1];
        part.sum_i64(&mut ones);
        assert_eq!(ones, [used as i64]);
    }
    comm.sleep_until_all();
}

/// Prints the bits of sums over terms that are spread over the ranks, once in order of ids and once
/// against it.
pub fn print_sums(comm: &Communicator) {
    const TERMS: u64 = 10_000;
    let mut sums = vec![ExactSum::new(); 4];
    let mine: Vec<u64> = (0..TERMS).filter(|id| id % comm.size() as u64 == comm.rank() as u64).collect();
    for (&id, &reversed) in mine.iter().zip(mine.iter().rev()) {
        let scale = |id: u64| f64::from_bits(((random([id, 0, 2]) * 2046.0) as u64 + 1) << 52);
        sums[0].add(random([id, 0, 0]) - 0.5);
        sums[1].add(random([reversed, 0, 0]) - 0.5);
        sums[2].add((random([id, 0, 1]) - 0.5) * scale(id) * 1e-6);
        sums[3].add(if id == 17 { f64::NAN } else { 1.0 });
    }
    exact_sum::reduce(comm, &mut sums);
    assert_eq!(sums[0].value().to_bits(), sums[1].value().to_bits());
    let mut same = [0, 1, 2].map(|k| sums[k].value().to_bits() as i64);
    let own = same;
    comm.max_i64(&mut same);
    assert_eq!(same, own, "all ranks hold the same");
    if comm.rank() == 0 {
        for sum in &sums {
            println!("\n{MARK}{:x} {}", sum.value().to_bits(), sum.value().is_nan());
        }
    }
}
