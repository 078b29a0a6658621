//! Errors of preparing a renderer.

use strivec_format::Invalid;
use strivec_format::model::OverMemory;

/// Why a scene has no renderer, by who must act.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum RendererError {
    /// An approximation that is invalid for the scene (caller).
    #[error(transparent)]
    Approximation(#[from] Invalid),
    /// The scene takes more memory than it may (policy).
    #[error(transparent)]
    Memory(#[from] OverMemory),
    /// A picture takes more memory than there is (caller).
    #[error(
        "a picture of {}x{} pixels needs {} MiB of memory, and {} MiB are available; render a smaller one",
        size[0], size[1], needed.div_ceil(1 << 20), available >> 20
    )]
    Picture {
        /// Columns and rows.
        size: [u32; 2],
        /// The bytes that it needs.
        needed: u64,
        /// The bytes that are available.
        available: u64,
    },
}
