//! Sines, angles, roots and random numbers from IEEE arithmetic alone, so that the same seed gives the same bytes
//! with any mathematics library of the platform.

use std::f64::consts::TAU;

use glam::DVec3;

/// Cosine and sine of `turns` full turns, within 2e-16.
pub(super) fn cos_sin(turns: f64) -> (f64, f64) {
    let quarter = (4.0 * turns).round();
    let x = TAU * (turns - 0.25 * quarter);
    let square = x * x;
    // Taylor series on ±π/4, innermost term first.
    let series = |first: u32| {
        (0..8).rev().fold(1.0, |sum, k| 1.0 - sum * square / f64::from((2 * k + first) * (2 * k + first + 1)))
    };
    let (cos, sin) = (series(1), x * series(2));
    match quarter.rem_euclid(4.0) as u32 {
        0 => (cos, sin),
        1 => (-sin, cos),
        2 => (-cos, -sin),
        _ => (sin, -cos),
    }
}

/// The angle of (x, y) in turns, in [0, 1]: increasing and continuous but for the step at 1, within 0.001 of the true
/// angle. For textures and for sorting, not for geometry.
pub(super) fn angle(x: f64, y: f64) -> f64 {
    let (across, along) = (x.abs().min(y.abs()), x.abs().max(y.abs()));
    let ratio = if along == 0.0 { 0.0 } else { across / along };
    let octant = ratio * (0.125 + 0.04345 * (1.0 - ratio));
    let quadrant = if y.abs() > x.abs() { 0.25 - octant } else { octant };
    match (x < 0.0, y < 0.0) {
        (false, false) => quadrant,
        (true, false) => 0.5 - quadrant,
        (true, true) => 0.5 + quadrant,
        (false, true) => 1.0 - quadrant,
    }
}

/// The sRGB value of a linear one, both clamped to [0, 1].
pub(super) fn srgb(linear: f64) -> f64 {
    let linear = linear.clamp(0.0, 1.0);
    if linear <= 0.003_130_8 {
        return 12.92 * linear;
    }
    // Halley's iteration for the cube root, from x^(1/4) · x^(1/16); x^(1/2.4) is the fourth root of its fifth power.
    let fourth = linear.sqrt().sqrt();
    let root = (0..3).fold(fourth * fourth.sqrt().sqrt(), |root, _| {
        let cube = root * root * root;
        root * (cube + 2.0 * linear) / (2.0 * cube + linear)
    });
    let square = root * root;
    1.055 * (square * square * root).sqrt().sqrt() - 0.055
}

/// The linear value of an sRGB one, by a cubic within 0.003.
pub(super) fn decoded(value: f64) -> f64 {
    value * (value * (value * 0.305_306_011 + 0.682_171_111) + 0.012_522_878)
}

/// The linear color of the sRGB color 0xRRGGBB, within 0.003.
pub(super) fn linear(rgb: u32) -> DVec3 {
    let channel = |shift: u32| decoded(f64::from((rgb >> shift) & 255) / 255.0);
    DVec3::new(channel(16), channel(8), channel(0))
}

/// A pseudorandom number that depends on all bits of `seed` and `counter`: SplitMix64's output function.
pub(super) fn hash(seed: u64, counter: u64) -> u64 {
    let mut z = seed.wrapping_add(counter.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15));
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// The `counter`-th number in [0, 1) of the stream `seed`.
pub(super) fn uniform(seed: u64, counter: u64) -> f64 {
    (hash(seed, counter) >> 11) as f64 / (1_u64 << 53) as f64
}

/// A number in [0, 1) for the integers (x, y, z).
pub(super) fn uniform_at(seed: u64, x: i64, y: i64, z: i64) -> f64 {
    let key = (x as u64).wrapping_mul(0x8da6_b343_d816_3841)
        ^ (y as u64).wrapping_mul(0xcb1a_b31f_165b_ab5d)
        ^ (z as u64).wrapping_mul(0xd8bd_5fc9_6e1e_3f01);
    uniform(seed, key)
}

/// Smooth noise in [0, 1] with features of size 1.
pub(super) fn noise(seed: u64, p: DVec3) -> f64 {
    let cell = p.floor();
    let t = p - cell;
    let t = t * t * (DVec3::splat(3.0) - 2.0 * t);
    let [x, y, z] = cell.to_array().map(|v| v as i64);
    let mix = |a: f64, b: f64, t: f64| a + (b - a) * t;
    let row = |dy, dz| mix(uniform_at(seed, x, y + dy, z + dz), uniform_at(seed, x + 1, y + dy, z + dz), t.x);
    mix(mix(row(0, 0), row(1, 0), t.y), mix(row(0, 1), row(1, 1), t.y), t.z)
}

/// Four octaves of [`noise`], in [0, 1]: features of sizes 1 to 1/8.
pub(super) fn fractal_noise(seed: u64, p: DVec3) -> f64 {
    let octave = |k: u32| noise(seed.wrapping_add(u64::from(k)), p * f64::from(1 << k)) / f64::from(1 << k);
    (0..4).map(octave).sum::<f64>() / 1.875
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sines_and_roots_are_those_of_the_library_and_angles_nearly() {
        for i in -400..400 {
            let turns = f64::from(i) / 97.0;
            let (cos, sin) = cos_sin(turns);
            assert!((cos - (TAU * turns).cos()).abs() < 5e-15 && (sin - (TAU * turns).sin()).abs() < 5e-15, "{turns}");
            assert!((cos * cos + sin * sin - 1.0).abs() < 4e-16, "{turns}");
            let difference = angle(cos, sin) - turns.rem_euclid(1.0);
            assert!((difference - difference.round()).abs() < 1e-3, "{turns}: {difference}");
        }
        for i in 1..=1000 {
            let x = f64::from(i) / 1000.0;
            let expected = if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 };
            assert!((srgb(x) - expected).abs() < 1e-14, "{x}");
        }
    }

    #[test]
    fn noise_is_continuous_and_fills_its_range() {
        let at = |x: f64| fractal_noise(7, DVec3::new(x, 0.4 * x, 1.0 - x));
        let values: Vec<f64> = (0..20_000).map(|i| at(f64::from(i) * 1e-3)).collect();
        assert!(values.iter().all(|v| (0.0..=1.0).contains(v)));
        assert!(values.windows(2).all(|w| (w[0] - w[1]).abs() < 0.02));
        let spread = values.iter().fold((1.0_f64, 0.0_f64), |(lo, hi), &v| (lo.min(v), hi.max(v)));
        assert!(spread.0 < 0.3 && spread.1 > 0.7, "{spread:?}");
    }
}
