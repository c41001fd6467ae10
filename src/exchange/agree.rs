//! Agreement on errors: a fault on one rank becomes the same fault on all of them.

use super::Communicator;
use crate::error::{Error, Result};
use std::path::{Path, PathBuf};

/// Every rank passes its own result; if any failed, all return the error of the lowest failing rank,
/// of the same kind and with the same text. Collective.
///
/// # Errors
/// That error.
pub fn agree<T>(comm: &Communicator, result: Result<T>) -> Result<T> {
    if comm.size() == 1 {
        return result;
    }
    let own = if result.is_err() { comm.rank() } else { comm.size() };
    let mut lowest = [-(own as i64)];
    comm.max_i64(&mut lowest);
    let lowest = (-lowest[0]) as usize;
    if lowest == comm.size() {
        return result;
    }
    let mut bytes = match &result {
        Err(error) if lowest == comm.rank() => encode(error),
        _ => Vec::new(),
    };
    comm.broadcast(lowest, &mut bytes);
    match result {
        Err(error) if lowest == comm.rank() => Err(error),
        _ => Err(decode(&bytes)),
    }
}

/// Kind as one byte, a number (step), the length of the path, path and message.
fn encode(error: &Error) -> Vec<u8> {
    let none = Path::new("");
    let (kind, number, path, message): (u8, u64, &Path, &str) = match error {
        Error::Input(message) => (0, 0, none, message),
        Error::File { path, message } => (1, 0, path, message),
        Error::Checkpoint { path, message } => (2, 0, path, message),
        Error::Simulation { step, message } => (3, *step, none, message),
        Error::Packing(message) => (4, 0, none, message),
        Error::Layout(message) => (5, 0, none, message),
    };
    let path = path.to_string_lossy();
    let mut bytes = vec![kind];
    bytes.extend_from_slice(&number.to_le_bytes());
    bytes.extend_from_slice(&(path.len() as u64).to_le_bytes());
    bytes.extend_from_slice(path.as_bytes());
    bytes.extend_from_slice(message.as_bytes());
    bytes
}

fn decode(bytes: &[u8]) -> Error {
    let word = |start: usize| u64::from_le_bytes(std::array::from_fn(|k| bytes[start + k]));
    let step = word(1);
    let (path, message) = bytes[17..].split_at(word(9) as usize);
    let message = String::from_utf8_lossy(message).into_owned();
    let path = PathBuf::from(String::from_utf8_lossy(path).into_owned());
    match bytes[0] {
        0 => Error::Input(message),
        1 => Error::File { path, message },
        2 => Error::Checkpoint { path, message },
        3 => Error::Simulation { step, message },
        4 => Error::Packing(message),
        _ => Error::Layout(message),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_kind_of_error_survives_the_journey() {
        let errors = [
            Error::Input("line 3: radius".into()),
            Error::File { path: "run/a b.h5".into(), message: "disk full".into() },
            Error::Checkpoint { path: "c.h5".into(), message: "truncated".into() },
            Error::Simulation { step: 1 << 40, message: "rank 1: particle 7 at NaN µm".into() },
            Error::Packing("no room".into()),
            Error::Layout("grid".into()),
        ];
        for error in errors {
            assert_eq!(format!("{:?}", decode(&encode(&error))), format!("{error:?}"));
        }
    }

    #[test]
    fn one_process_keeps_its_result() {
        let comm = Communicator::single();
        assert_eq!(agree(&comm, Ok(5)).ok(), Some(5));
        assert!(agree::<()>(&comm, Err(Error::Packing("x".into()))).is_err());
    }
}
