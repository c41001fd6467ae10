//! The ends of contacts as the sums read them, without looking twice whether they are there.

use super::list::{Run, Strip};

/// Most output lines of a rank: what fits beside the side in an [`End`].
pub const MAX_LINES: usize = 1 << 29;

/// One end of a contact as its particle sees it: a number and the side. The number is the slot of the strip's buffer
/// where the sums find the output line; of a ghost, which nobody sums here, the line's own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct End(u32);

impl End {
    /// `second`: the particle is the contact's second.
    pub(super) fn new(number: usize, second: bool) -> Self {
        Self((number as u32) << 3 | u32::from(second) << 2)
    }
    /// Slot or line.
    #[inline(always)]
    #[must_use]
    pub fn number(self) -> usize {
        (self.0 >> 3) as usize
    }
    /// 0 at the contact's first, 4 at its second: in a line the torque on the second follows four places after that
    /// on the first.
    #[inline(always)]
    #[must_use]
    pub fn side(self) -> usize {
        (self.0 & 4) as usize
    }
    /// The particle is the contact's second.
    #[inline(always)]
    #[must_use]
    pub fn is_second(self) -> bool {
        self.side() != 0
    }
}

/// The ends of the particles of one chunk.
#[derive(Debug, Clone, Copy)]
pub struct ChunkEnds<'a> {
    /// Of the chunk's particles and one more, rising, none beyond `ends`.
    offsets: &'a [u32],
    ends: &'a [End],
    /// Places within the chunk, each less than the number of its particles.
    summing: &'a [u8],
    slots: usize,
}

impl<'a> ChunkEnds<'a> {
    /// The ends of the particle at this place of the chunk.
    #[inline(always)]
    #[must_use]
    pub fn of(&self, place: usize) -> &'a [End] {
        &self.ends[self.offsets[place] as usize..self.offsets[place + 1] as usize]
    }

    /// The chunk's places in the order of summing, each with its ends.
    #[inline(always)]
    pub fn in_order(self) -> impl Iterator<Item = (usize, &'a [End])> {
        self.summing.iter().map(move |place| {
            let place = usize::from(*place);
            // SAFETY: `ContactList::index` makes what the fields promise; the arrays are private to this module's parent,
            // and strips are not changed between two calls of it.
            let ends = unsafe {
                let (from, to) = (self.offsets.get_unchecked(place), self.offsets.get_unchecked(place + 1));
                self.ends.get_unchecked(*from as usize..*to as usize)
            };
            (place, ends)
        })
    }

    /// More than the number of any of the ends, see [`Strip::slots`].
    #[must_use]
    pub fn slots(&self) -> usize {
        self.slots
    }
}

/// What a step reads of a contact list.
#[derive(Debug, Clone, Copy)]
pub struct Reading<'a> {
    /// The list's strips.
    pub strips: &'a [Strip],
    /// Its runs.
    pub runs: &'a [Run],
    pub(super) offsets: &'a [u32],
    pub(super) ends: &'a [End],
    pub(super) summing: &'a [u8],
}

impl<'a> Reading<'a> {
    /// The ends of the particles of a strip's chunk.
    #[must_use]
    pub fn ends_of(&self, strip: usize, chunk: usize) -> ChunkEnds<'a> {
        let strip = &self.strips[strip];
        let particles = strip.chunk(chunk);
        ChunkEnds {
            offsets: &self.offsets[particles.start..=particles.end],
            ends: self.ends,
            summing: &self.summing[particles],
            slots: strip.slots,
        }
    }

    /// The offsets of all particles, their ends, and the places of the owned ones in the order of summing.
    #[must_use]
    pub fn arrays(&self) -> (&'a [u32], &'a [End], &'a [u8]) {
        (self.offsets, self.ends, self.summing)
    }
}
