//! Integer image shifts of contacts, packed into nine bits.

/// Largest shift per axis that a contact can carry.
pub const MAX_SHIFT: i32 = 3;

/// Pack a shift: three bits per axis, offset by 4.
#[inline(always)]
#[must_use]
pub fn encode(shift: [i32; 3]) -> u16 {
    debug_assert!(shift.iter().all(|s| s.abs() <= MAX_SHIFT), "image shift {shift:?} out of range");
    let [x, y, z] = shift.map(|s| ((s + 4) & 7) as u16);
    x | (y << 3) | (z << 6)
}

/// Unpack a shift.
#[inline(always)]
#[must_use]
pub fn decode(code: u16) -> [i32; 3] {
    [0, 3, 6].map(|bits| i32::from((code >> bits) & 7) - 4)
}

/// Whether all these codes (1, 4 or 8 of them) mean no shift at all.
#[inline(always)]
#[must_use]
pub fn all_here(codes: &[u16]) -> bool {
    /// Code of no shift, in each of the eight places.
    const HERE: u128 = 0x0124_0124_0124_0124_0124_0124_0124_0124;
    match codes.len() {
        8 => bytemuck::pod_read_unaligned::<u128>(bytemuck::cast_slice(codes)) == HERE,
        4 => bytemuck::pod_read_unaligned::<u64>(bytemuck::cast_slice(codes)) == HERE as u64,
        _ => codes.iter().all(|code| *code == HERE as u16),
    }
}

/// Values of `shift · factor` per axis for the eight codes: what the pass adds to a pair vector.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ShiftTable {
    /// Entry `s + 4` of an axis.
    pub axes: [[f64; 8]; 3],
}

impl ShiftTable {
    /// Table of `s · factor[axis]` for s = −4 … 3; 0, never −0, for s = 0.
    #[must_use]
    pub fn new(factor: [f64; 3]) -> Self {
        Self { axes: factor.map(|f| std::array::from_fn(|s| (s as f64 - 4.0) * f + 0.0)) }
    }

    /// The vector of a packed shift.
    #[inline(always)]
    #[must_use]
    pub fn vector(&self, code: u16) -> [f64; 3] {
        let code = usize::from(code);
        [self.axes[0][code & 7], self.axes[1][(code >> 3) & 7], self.axes[2][(code >> 6) & 7]]
    }
}

/// The first non-zero entry is positive: the half of the shifts that own-image contacts use.
#[must_use]
pub fn lexicographically_positive(shift: [i32; 3]) -> bool {
    shift.iter().find(|s| **s != 0).is_some_and(|s| *s > 0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_round_trip_and_give_the_shift_vector() {
        let table = ShiftTable::new([2.0, 3.0, 5.0]);
        assert!(all_here(&[encode([0; 3]); 8]) && all_here(&[encode([0; 3]); 4]) && all_here(&[encode([0; 3])]));
        assert_eq!(ShiftTable::new([-1.0; 3]).vector(encode([0; 3])).map(f64::to_bits), [0; 3]);
        for x in -3..=3 {
            for y in -3..=3 {
                for z in -3..=3 {
                    let code = encode([x, y, z]);
                    assert_eq!(decode(code), [x, y, z]);
                    let (mut codes, here) = ([encode([0; 3]); 8], [x, y, z] == [0; 3]);
                    for place in [7, 3, 0] {
                        codes[place] = code;
                        assert_eq!(all_here(&codes), here);
                        assert_eq!(all_here(&codes[..4]), here || place == 7);
                    }
                    assert_eq!(all_here(&[code]), here);
                    assert_eq!(table.vector(code), [2.0 * f64::from(x), 3.0 * f64::from(y), 5.0 * f64::from(z)]);
                }
            }
        }
    }
}
