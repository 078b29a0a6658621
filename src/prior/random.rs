//! Random numbers that depend on nothing but a key, so that threads and order do not matter.

/// A uniform 64-bit number for (`seed`, `step`, `ray`): SplitMix64's finaliser over each part in turn.
#[inline]
pub(super) fn keyed(seed: u64, step: u64, ray: u64) -> u64 {
    mix(mix(mix(seed).wrapping_add(step)).wrapping_add(ray))
}

/// Maps a uniform 64-bit number to [0, `end`), uniform to within 2^-64·`end`.
#[inline]
pub(super) fn below(uniform: u64, end: u64) -> u64 {
    ((u128::from(uniform) * u128::from(end)) >> 64) as u64
}

#[inline]
fn mix(mut z: u64) -> u64 {
    z = z.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn first_number_is_splitmix64s() {
        assert_eq!(mix(0), 0xe220_a839_7b1d_cdaf, "the published first output of SplitMix64 seeded with 0");
    }

    #[test]
    fn rays_of_a_step_spread_evenly_and_differ_between_steps_and_seeds() {
        let mut counts = [0_u32; 10];
        for ray in 0..10_000 {
            counts[below(keyed(7, 3, ray), 10) as usize] += 1;
        }
        assert!(counts.iter().all(|c| (880..1120).contains(c)), "{counts:?}");
        assert_ne!(keyed(7, 3, 0), keyed(7, 2, 1), "(step, ray) pairs of the same sum do not collide");
        assert_ne!(keyed(7, 3, 0), keyed(8, 3, 0));
    }
}
