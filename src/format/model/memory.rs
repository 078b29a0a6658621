//! The memory that what evaluates a scene may take.

/// The most bytes of memory that a field of a scene may take besides the scene itself: a file of 2 kB can describe tensors
/// whose index takes gigabytes. Scenes of files have the limit of their reader, scenes that a program makes have none.
///
/// All limits are equal. A limit belongs to where a scene is from, and two scenes of the same numbers are the same scene.
#[derive(Clone, Copy, Debug)]
pub struct MemoryLimit(pub u64);

impl MemoryLimit {
    /// No limit.
    pub const NONE: Self = Self(u64::MAX);

    /// An error unless the limit is at least `needed` bytes for `part`.
    ///
    /// # Errors
    ///
    /// [`OverMemory`].
    pub fn unless_over(self, part: &'static str, needed: u64) -> Result<(), OverMemory> {
        if needed <= self.0 { Ok(()) } else { Err(OverMemory { part, needed, limit: self.0 }) }
    }
}

impl PartialEq for MemoryLimit {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

impl Eq for MemoryLimit {}

/// What evaluates a scene takes more memory than the scene's limit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "{part} of the scene would take at least {} MiB of memory, more than the {} MiB that it may; allow more",
    needed.div_ceil(1 << 20),
    limit >> 20
)]
pub struct OverMemory {
    /// What needs the memory, as a noun phrase.
    pub part: &'static str,
    /// The least bytes that it needs.
    pub needed: u64,
    /// The most bytes that it may take.
    pub limit: u64,
}
