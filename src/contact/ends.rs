//! The ends of contacts as the sums read them, without looking twice whether they are there.

use super::list::{CHUNK, Run, Strip};

/// Up to so many ends of one kind the sums have a loop of their own for each number.
pub const MOST_WRITTEN_OUT: usize = 8;

/// One end of a contact as its particle sees it: a number and the side. The number is where the strip's buffer holds the
/// output line for the sums, counted in pairs of `f64`; of a ghost, which nobody sums here, the line's own.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct End(u32);

impl End {
    /// The largest number.
    pub const MAX: usize = u32::MAX as usize >> 1;

    /// `second`: the particle is the contact's second.
    pub(super) fn new(number: usize, second: bool) -> Self {
        Self((number as u32) << 1 | u32::from(second))
    }
    /// Place in pairs of `f64`, or line.
    #[inline(always)]
    #[must_use]
    pub fn number(self) -> usize {
        (self.0 >> 1) as usize
    }
    /// Place of the output line in the buffer, in `f64`, of an end on the side that `SECOND` says.
    #[inline(always)]
    #[must_use]
    pub fn place<const SECOND: bool>(self) -> usize {
        // Twice the number; so written it costs no instruction.
        (self.0 as usize).wrapping_sub(usize::from(SECOND))
    }
    /// The particle is the contact's second.
    #[inline(always)]
    #[must_use]
    pub fn is_second(self) -> bool {
        self.0 & 1 != 0
    }
}

/// The order in which a chunk's particles are visited to sum over the ends of one side: by how many they have, so that
/// the length of the loop over them changes a few times only.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Visits {
    /// Places within the chunk, each less than the number of its particles.
    places: [u8; CHUNK],
    /// How many particles have no end, one, two …; the last counts all above [`MOST_WRITTEN_OUT`].
    groups: [u8; MOST_WRITTEN_OUT + 2],
}

impl Visits {
    /// From the number of ends of each of the chunk's particles.
    pub(super) fn new(counts: &[usize]) -> Self {
        let group = |count: usize| count.min(MOST_WRITTEN_OUT + 1);
        let mut visits = Self { places: [0; CHUNK], groups: [0; MOST_WRITTEN_OUT + 2] };
        for count in counts {
            visits.groups[group(*count)] += 1;
        }
        let mut next = [0; MOST_WRITTEN_OUT + 2];
        for number in 1..next.len() {
            next[number] = next[number - 1] + usize::from(visits.groups[number - 1]);
        }
        for (place, count) in (0..).zip(counts) {
            let next = &mut next[group(*count)];
            visits.places[*next] = place;
            *next += 1;
        }
        visits
    }

    /// The groups in the order of their numbers of ends, the last with all above [`MOST_WRITTEN_OUT`].
    #[inline(always)]
    pub fn groups(&self) -> impl Iterator<Item = &[u8]> {
        let mut rest = self.places.as_slice();
        self.groups.iter().map(move |count| {
            let (group, others) = rest.split_at(usize::from(*count).min(rest.len()));
            rest = others;
            group
        })
    }
}

/// The ends of the particles of one chunk.
#[derive(Debug, Clone, Copy)]
pub struct ChunkEnds<'a> {
    /// Of the chunk's particles and one more, rising, none beyond `ends`.
    offsets: &'a [u32],
    /// Of each particle first those of contacts of which it is the second.
    ends: &'a [End],
    /// For the ends of firsts and of seconds.
    visits: &'a [Visits; 2],
    room: usize,
}

impl<'a> ChunkEnds<'a> {
    /// The ends of the particle at this place of the chunk.
    #[inline(always)]
    #[must_use]
    pub fn of(&self, place: usize) -> &'a [End] {
        &self.ends[self.offsets[place] as usize..self.offsets[place + 1] as usize]
    }

    /// The ends of one side of the particle at this place of the chunk.
    #[must_use]
    pub fn of_side(&self, place: usize, second: bool) -> &'a [End] {
        let ends = self.of(place);
        let (seconds, firsts) = ends.split_at(ends.partition_point(|end| end.is_second()));
        if second { seconds } else { firsts }
    }

    /// How to visit the particles for the ends of one side.
    #[inline(always)]
    #[must_use]
    pub fn visits(&self, second: bool) -> &'a Visits {
        &self.visits[usize::from(second)]
    }

    /// The ends of the side that `SECOND` says of a particle that has `COUNT` of them.
    ///
    /// # Safety
    /// The place comes from that group of [`Self::visits`].
    #[inline(always)]
    #[must_use]
    pub unsafe fn written_out<const SECOND: bool, const COUNT: usize>(&self, place: usize) -> &'a [End; COUNT] {
        // SAFETY: a place of a group is one of the chunk's particles, of which each has a number in `offsets`, and one
        // follows the last; that many ends lie from the first number or before the second (`ContactList::index`; the
        // arrays are private to this module's parent, and strips are not changed between two calls of it).
        unsafe {
            let start = if SECOND {
                *self.offsets.get_unchecked(place) as usize
            } else {
                *self.offsets.get_unchecked(place + 1) as usize - COUNT
            };
            &*self.ends.as_ptr().add(start).cast()
        }
    }

    /// No line of any of the ends reaches beyond so many `f64` of the buffer, see [`Strip::room`].
    #[must_use]
    pub fn room(&self) -> usize {
        self.room
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
            visits: &strip.visits[chunk],
            room: strip.room(),
        }
    }

    /// The offsets of all particles and their ends.
    #[must_use]
    pub fn arrays(&self) -> (&'a [u32], &'a [End]) {
        (self.offsets, self.ends)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn visits_go_through_all_places_by_the_number_of_ends() {
        let counts: Vec<usize> = (0..100).map(|place| place * 7 % 12).collect();
        let visits = Visits::new(&counts);
        let mut seen = Vec::new();
        for (number, group) in visits.groups().enumerate() {
            for place in group {
                let count = counts[usize::from(*place)];
                assert!(count == number || number > MOST_WRITTEN_OUT && count > MOST_WRITTEN_OUT, "{number}: {count}");
                seen.push(*place);
            }
        }
        seen.sort_unstable();
        assert_eq!(seen, (0..100).collect::<Vec<u8>>());
        assert_eq!(Visits::new(&[]).groups().map(<[u8]>::len).sum::<usize>(), 0);
        assert_eq!(Visits::new(&[9; CHUNK]).groups().last().map(<[u8]>::len), Some(CHUNK));
    }

    #[test]
    fn an_end_gives_its_number_place_and_side() {
        for number in [0, 3, End::MAX] {
            let [first, second] = [End::new(number, false), End::new(number, true)];
            assert_eq!((first.number(), second.number()), (number, number));
            assert_eq!((first.place::<false>(), second.place::<true>()), (2 * number, 2 * number));
            assert!(second.is_second() && !first.is_second());
        }
    }
}
