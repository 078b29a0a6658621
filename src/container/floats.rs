//! Arrays of f32 as little-endian bytes.

/// The bytes of `values`.
pub(super) fn write(values: &[f32]) -> impl Iterator<Item = u8> {
    values.iter().flat_map(|v| v.to_le_bytes())
}

/// The values of `bytes`, four each.
pub(super) fn read(bytes: &[u8]) -> Vec<f32> {
    bytes.as_chunks().0.iter().map(|&b| f32::from_le_bytes(b)).collect()
}
