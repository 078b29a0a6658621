//! Morton codes: numbers of cells whose order keeps nearby cells close to each other.

use glam::UVec3;

/// The Morton code of `cell` in base 2^`digit_bits`, from its lowest `digits` digits.
///
/// The code has 3·`digit_bits` bits for each digit, the highest digit first: those of z, then y, then x. With
/// `digit_bits` = 1 it is the usual interleaving of bits. Digits · `digit_bits` must be at most 32.
pub fn encode(cell: UVec3, digit_bits: u32, digits: u32) -> u128 {
    let mask = (1 << digit_bits) - 1;
    (0..digits).fold(0, |code, level| {
        let digit = |axis: usize| u128::from(cell[axis] >> (digit_bits * level) & mask);
        let of_level = digit(2) << (2 * digit_bits) | digit(1) << digit_bits | digit(0);
        code | of_level << (3 * digit_bits * level)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_of_x_y_and_z_alternate() {
        assert_eq!(encode(UVec3::new(0b01, 0b11, 0b10), 1, 2), 0b110_011);
        assert_eq!(encode(UVec3::new(1, 2, 3), 2, 1), 0b11_10_01);
        assert_eq!(encode(UVec3::new(4, 0, 1), 2, 2), 0b000001_010000);
        assert_eq!(encode(UVec3::splat(u32::MAX), 1, 10), (1 << 30) - 1, "higher digits are ignored");
    }
}
