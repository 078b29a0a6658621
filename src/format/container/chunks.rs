//! Chunks: groups of nearby tensors that a reader can fetch alone (spec 3.7).

use std::collections::BTreeMap;

use glam::{DVec3, UVec3};

use crate::geometry::morton;
use crate::model::TensorCloud;

/// The tensors of each chunk, \[chunk\], where `chunk_of` is \[tensor\] the chunk of each; numbers without tensors are left
/// out.
pub(super) fn chunks_from(chunk_of: &[u32]) -> BTreeMap<u32, Vec<u32>> {
    let mut chunks = BTreeMap::<u32, Vec<u32>>::new();
    for (n, &chunk) in (0..).zip(chunk_of) {
        chunks.entry(chunk).or_default().push(n);
    }
    chunks
}

/// Cuts `cloud` into chunks of at most `max_tensors` tensors that lie near each other: \[chunk\] the numbers of its
/// tensors, ascending.
pub(super) fn chunks_of(cloud: &TensorCloud, max_tensors: usize) -> Vec<Vec<u32>> {
    let bounds = cloud.bounds();
    let size = bounds.size().max(DVec3::splat(f64::MIN_POSITIVE));
    let key = |n: u32| {
        let at = ((cloud.center(n as usize) - bounds.min) / size * 1023.0).as_uvec3().min(UVec3::splat(1023));
        morton::encode(at, 1, 10)
    };
    let mut order: Vec<(u128, u32)> = (0..cloud.len() as u32).map(|n| (key(n), n)).collect();
    order.sort_unstable();
    let count = cloud.len().div_ceil(max_tensors.max(1));
    let each = cloud.len().div_ceil(count.max(1)).max(1);
    let mut chunks: Vec<Vec<u32>> = order.chunks(each).map(|part| part.iter().map(|o| o.1).collect()).collect();
    chunks.iter_mut().for_each(|chunk| chunk.sort_unstable());
    chunks
}
