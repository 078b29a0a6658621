//! Numbers of 16 bits (IEEE 754 binary16), as files hold them (spec 1).

/// The largest finite number of 16 bits.
pub(crate) const LARGEST: f32 = 65504.0;

/// The sign, and the bits of infinity.
const SIGN: u32 = 0x8000;
const INFINITE: u32 = 0x7c00;
/// The bits of the least exponent, and the least positive number, 2⁻²⁴.
const LEAST_EXPONENT: u32 = 1 << 10;
const LEAST: f32 = 1.0 / 16_777_216.0;
/// The bits of the mantissa that 32 bits have more, and the difference of the exponents' biases.
const MORE_BITS: u32 = 13;
const BIAS: u32 = 127 - 15;
/// Half the distance of two numbers of 16 bits, in those of 32 bits, less one: with a last bit of 1, a half is rounded up.
const ALMOST_HALF: u32 = 0xfff;
/// The bits of 2⁻¹⁴ and 65536: below the first, numbers of 16 bits are equally far apart; from the second on, they are infinite.
const LEAST_NORMAL: u32 = 0x3880_0000;
const TOO_LARGE: u32 = 0x4780_0000;

/// The bits of the number of 16 bits that is nearest to `value`; of two, the even one. What is larger than [`LARGEST`] by half
/// a step is infinite.
pub(crate) fn bits_of(value: f32) -> u16 {
    let sign = (value.to_bits() >> 16) & SIGN;
    let bits = value.abs().to_bits();
    let half = if value.is_nan() {
        INFINITE | 1 << 9
    } else if bits >= TOO_LARGE {
        INFINITE
    } else if bits >= LEAST_NORMAL {
        // The carry of the mantissa goes into the exponent, also up to infinity.
        (bits + ALMOST_HALF + (bits >> MORE_BITS & 1) - (BIAS << 23)) >> MORE_BITS
    } else {
        // Between 0.5 and 1, numbers of 32 bits are as far apart as these of 16 bits.
        (value.abs() + 0.5).to_bits() - 0.5_f32.to_bits()
    };
    (sign | half) as u16
}

/// The number whose 16 bits are `half`.
pub(crate) fn value_of(half: u16) -> f32 {
    let half = u32::from(half);
    let (exponent, mantissa) = (half & INFINITE, half & (LEAST_EXPONENT - 1));
    let magnitude = if exponent == 0 {
        (mantissa as f32 * LEAST).to_bits()
    } else if exponent == INFINITE {
        0xff << 23 | mantissa << MORE_BITS
    } else {
        ((half & !SIGN) << MORE_BITS) + (BIAS << 23)
    };
    f32::from_bits((half & SIGN) << 16 | magnitude)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_numbers_of_16_bits_are_read_and_written_as_the_crate_half_does() {
        for bits in 0..=u16::MAX {
            let (ours, theirs) = (value_of(bits), half::f16::from_bits(bits).to_f32());
            assert!(
                ours.to_bits() == theirs.to_bits() || ours.is_nan() && theirs.is_nan(),
                "{bits:#x}: {ours}, {theirs}"
            );
            if ours.is_nan() {
                assert_eq!(bits_of(ours) & 0x7c00, 0x7c00, "{bits:#x}");
                assert!(value_of(bits_of(ours)).is_nan(), "{bits:#x}");
            } else {
                assert_eq!(bits_of(ours), bits, "{ours}");
            }
        }
        assert_eq!(value_of(0x7bff), LARGEST);
    }

    #[test]
    fn numbers_between_those_of_16_bits_are_rounded_as_by_the_crate_half() {
        for bits in (0..=u32::MAX).step_by(997).chain((0x3300_0000..0x3300_2000).chain(0x477f_c000..0x4780_0010)) {
            let value = f32::from_bits(bits);
            let (ours, theirs) = (bits_of(value), half::f16::from_f32(value));
            assert!(ours == theirs.to_bits() || value.is_nan() && theirs.is_nan(), "{value:e}: {ours:#x}, {theirs}");
        }
        // Exactly between two numbers.
        for bits in 0..0x7bff_u16 {
            let between = 0.5 * (value_of(bits) + value_of(bits + 1));
            assert_eq!(bits_of(between), half::f16::from_f32(between).to_bits(), "{between:e}");
        }
    }
}
