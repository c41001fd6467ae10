//! HDF5 files: the only place with HDF5 calls. A file is described first ([`Layout`]), laid out by
//! rank 0, then filled by all ranks together ([`writer`]); [`reader`] reads blocks of rows. Knows
//! nothing of particles.

pub mod reader;
pub mod writer;

pub use reader::Reader;
pub use writer::{Finished, Writer};

/// Type of the numbers of a dataset.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// 64-bit float.
    F64,
    /// 32-bit float.
    F32,
    /// 64-bit signed integer.
    I64,
    /// 32-bit signed integer.
    I32,
    /// 32-bit unsigned integer.
    U32,
    /// Byte.
    U8,
}

impl Kind {
    /// Bytes per number.
    #[must_use]
    pub fn bytes(self) -> u64 {
        match self {
            Self::F64 | Self::I64 => 8,
            Self::F32 | Self::I32 | Self::U32 => 4,
            Self::U8 => 1,
        }
    }
}

/// A number that datasets hold.
pub trait Scalar: bytemuck::Pod + hdf5::H5Type {
    /// Its place among the kinds.
    const KIND: Kind;
}

macro_rules! scalars {
    ($($number:ty => $kind:ident),*) => {
        $(impl Scalar for $number { const KIND: Kind = Kind::$kind; })*
    };
}
scalars!(f64 => F64, f32 => F32, i64 => I64, i32 => I32, u32 => U32, u8 => U8);

/// A small value written by rank 0 along with the structure.
#[derive(Debug, Clone, PartialEq)]
pub enum Value {
    /// A fixed-length string.
    Text(String),
    /// Integers; one alone is still an array of length one.
    Integers(Vec<i64>),
    /// Reals.
    Reals(Vec<f64>),
}

#[derive(Debug, Clone)]
pub(super) enum Entry {
    Group { path: String },
    Dataset { path: String, kind: Kind, rows: u64, columns: Option<u64> },
    Constant { path: String, value: Value },
    Attribute { path: String, name: String, value: Value },
}

/// What a file holds: groups, datasets and small values, in the order of their creation. Parents come
/// before children. Every rank builds the same one.
#[derive(Debug, Clone, Default)]
pub struct Layout {
    pub(super) entries: Vec<Entry>,
    pub(super) user_block: u64,
}

impl Layout {
    /// Nothing yet.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Leave this many bytes (a power of two, at least 512) before the HDF5 data.
    pub fn user_block(&mut self, bytes: u64) {
        self.user_block = bytes;
    }

    /// A group.
    pub fn group(&mut self, path: &str) {
        self.entries.push(Entry::Group { path: path.to_owned() });
    }

    /// A dataset of `rows` numbers.
    pub fn dataset(&mut self, path: &str, kind: Kind, rows: u64) {
        self.entries.push(Entry::Dataset { path: path.to_owned(), kind, rows, columns: None });
    }

    /// A dataset of `rows` × `columns` numbers.
    pub fn table(&mut self, path: &str, kind: Kind, rows: u64, columns: u64) {
        self.entries.push(Entry::Dataset { path: path.to_owned(), kind, rows, columns: Some(columns) });
    }

    /// A small dataset with its contents.
    pub fn constant(&mut self, path: &str, value: Value) {
        self.entries.push(Entry::Constant { path: path.to_owned(), value });
    }

    /// An attribute of the group at `path`; below 64 KiB.
    pub fn attribute(&mut self, path: &str, name: &str, value: Value) {
        self.entries.push(Entry::Attribute { path: path.to_owned(), name: name.to_owned(), value });
    }

    /// Estimate of the file's size, a little too large \[bytes\].
    #[must_use]
    pub fn size_estimate(&self) -> u64 {
        // Object headers, symbol tables and alignment: measured below 1 KiB per object.
        let per_object = 2048;
        let data: u64 = self
            .entries
            .iter()
            .map(|entry| match entry {
                Entry::Dataset { kind, rows, columns, .. } => kind.bytes() * rows * columns.unwrap_or(1),
                Entry::Constant { value, .. } | Entry::Attribute { value, .. } => match value {
                    Value::Text(text) => text.len() as u64,
                    Value::Integers(values) => 8 * values.len() as u64,
                    Value::Reals(values) => 8 * values.len() as u64,
                },
                Entry::Group { .. } => 0,
            })
            .sum();
        self.user_block + data + per_object * (1 + self.entries.len() as u64)
    }
}
