//! The arguments that choose an encoding.

use clap::ValueEnum;

use crate::cli::Error;
use crate::container::{ArrayOptions, EncodeOptions, Encoding, Filter};

/// Encodings that need nothing but the numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum Plain {
    /// 32-bit floating point: loses nothing
    F32,
    /// 16-bit floating point
    F16,
    /// Integers of 8 bits, a step a vector
    Grid8,
    /// Integers of 6 bits
    Grid6,
    /// Integers of 5 bits
    Grid5,
    /// Integers of 4 bits
    Grid4,
    /// Integers of 3 bits
    Grid3,
}

impl Plain {
    pub(super) fn encoding(self) -> Encoding {
        match self {
            Self::F32 => Encoding::F32,
            Self::F16 => Encoding::F16,
            Self::Grid8 => Encoding::Grid(8),
            Self::Grid6 => Encoding::Grid(6),
            Self::Grid5 => Encoding::Grid(5),
            Self::Grid4 => Encoding::Grid(4),
            Self::Grid3 => Encoding::Grid(3),
        }
    }
}

/// How bodies are compressed, and scenes cut.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct LayoutArgs {
    /// zstd's level, 1 to 22; 0 compresses nothing, so that a reader can map numbers from the file
    #[arg(long, value_name = "N", default_value_t = 19)]
    level: u8,
    /// Tensors of a chunk, at most: small chunks make good crops and range requests, large ones small files
    #[arg(long, value_name = "N", default_value_t = 1024, value_parser = clap::value_parser!(u32).range(1..))]
    chunk_tensors: u32,
}

impl LayoutArgs {
    /// `options` with these.
    pub(super) fn apply(&self, options: EncodeOptions) -> Result<EncodeOptions, Error> {
        if self.level > 22 {
            return Err(Error::Usage(format!("--level: expected 0 to 22, found {}", self.level)));
        }
        let zstd_level = (self.level > 0).then_some(i32::from(self.level));
        Ok(EncodeOptions { zstd_level, chunk_tensors: self.chunk_tensors as usize, ..options })
    }
}

/// Everything as it is, in the arrangement that compresses best; or, uncompressed, that can be mapped.
pub(super) fn lossless(layout: &LayoutArgs) -> EncodeOptions {
    let filter = if layout.level > 0 { Filter::Planes } else { Filter::None };
    let array = ArrayOptions { encoding: Encoding::F32, filter };
    let mut options = EncodeOptions { networks: array, ..EncodeOptions::uniform(Encoding::F32) };
    options.density.iter_mut().chain(&mut options.appearance).for_each(|factors| factors.array = array);
    options
}
