//! Codecs of the bodies of sections (spec 2.2).

pub(super) mod adaptive;
#[cfg(not(target_arch = "wasm32"))]
mod libzstd;
#[cfg(any(test, target_arch = "wasm32"))]
mod ruzstd;

use std::fmt;

use super::error::Error;

#[cfg(not(target_arch = "wasm32"))]
pub(super) use libzstd::{compress, decompress};
#[cfg(target_arch = "wasm32")]
pub(super) use ruzstd::{compress, decompress};

/// The largest window of a zstd frame, in bytes, unless the frame is a single segment (spec 2.2).
const MAX_WINDOW: u64 = 1 << 27;

/// [`Error::Malformed`] if the `frame`, which begins with its magic number, declares a larger window than
/// [`MAX_WINDOW`].
fn check_window(place: &dyn fmt::Display, frame: &[u8]) -> Result<(), Error> {
    let (Some(descriptor), Some(&window)) = (frame.get(4), frame.get(5)) else { return Ok(()) };
    let is_single_segment = descriptor & 0x20 != 0;
    let size = (8 + u64::from(window & 7)) << (7 + (window >> 3));
    if is_single_segment || size <= MAX_WINDOW {
        return Ok(());
    }
    Err(Error::malformed(format!("{place} zstd window"), format!("at most {MAX_WINDOW} bytes"), size))
}

/// The encoding of a section's body.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Codec {
    /// As it is.
    Stored,
    /// One zstd frame that declares its content's size and uses no dictionary.
    Zstd,
    /// Bits with probabilities that adapt.
    Adaptive,
    /// A code that this version does not define.
    Other(u16),
}

impl Codec {
    pub(super) fn from_code(code: u16) -> Self {
        match code {
            0 => Self::Stored,
            1 => Self::Zstd,
            2 => Self::Adaptive,
            other => Self::Other(other),
        }
    }

    pub(super) fn code(self) -> u16 {
        match self {
            Self::Stored => 0,
            Self::Zstd => 1,
            Self::Adaptive => 2,
            Self::Other(code) => code,
        }
    }
}

impl fmt::Display for Codec {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Stored => f.write_str("stored"),
            Self::Zstd => f.write_str("zstd"),
            Self::Adaptive => f.write_str("adaptive"),
            Self::Other(code) => write!(f, "codec {code}"),
        }
    }
}
