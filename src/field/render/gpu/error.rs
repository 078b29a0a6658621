//! Errors of rendering on a graphics device.

use crate::render::RendererError;
use strivec_format::Invalid;
use strivec_format::model::OverMemory;

/// Errors of a graphics device, by who must act.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum GpuError {
    /// No device, not even a software one (system).
    #[error("no graphics adapter was found: {0}")]
    NoAdapter(String),
    /// The device failed, or was lost (system).
    #[error("the graphics device failed: {0}")]
    Device(String),
    /// The scene or the picture exceeds a limit of the device (caller).
    #[error("this graphics device supports at most {limit} {what}; found {found}")]
    TooLarge {
        /// The limited quantity, a plural.
        what: &'static str,
        /// The amount needed.
        found: u64,
        /// The device's limit.
        limit: u64,
    },
    /// An approximation that is invalid for the scene or the device (caller).
    #[error(transparent)]
    Approximation(#[from] Invalid),
    /// The scene takes more memory than it may (policy).
    #[error(transparent)]
    Memory(#[from] OverMemory),
}

impl From<RendererError> for GpuError {
    fn from(error: RendererError) -> Self {
        match error {
            RendererError::Approximation(error) => error.into(),
            RendererError::Memory(error) => error.into(),
            RendererError::Picture { needed: found, available: limit, .. } => {
                Self::TooLarge { what: "bytes of a picture", found, limit }
            }
        }
    }
}
