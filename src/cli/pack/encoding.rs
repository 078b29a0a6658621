//! Options of encodings.

use crate::cli::Error;
use crate::container::{self, EncodeOptions, Encoding, Filter, SceneFile};
use crate::pack;
use clap::ValueEnum;

/// Encodings that depend on the numbers alone.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum Plain {
    /// 32-bit floating point, lossless
    F32,
    /// 16-bit floating point
    F16,
    /// 16-bit integers with a step per component
    Grid16,
    /// 8-bit integers
    Grid8,
    /// 6-bit integers
    Grid6,
    /// 5-bit integers
    Grid5,
    /// 4-bit integers
    Grid4,
    /// 3-bit integers
    Grid3,
}

impl Plain {
    pub(super) fn encoding(self) -> Encoding {
        match self {
            Self::F32 => Encoding::F32,
            Self::F16 => Encoding::F16,
            Self::Grid16 => Encoding::Grid(16),
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
    /// zstd compression level, 1 to 22; 0 turns compression off, so that readers can map the file
    #[arg(long, value_name = "N", default_value_t = Self::default().level)]
    level: u8,
    /// Largest number of tensors per chunk: small chunks suit crops and range requests, large chunks give smaller files
    #[arg(long, value_name = "N", default_value_t = Self::default().chunk_tensors, value_parser = clap::value_parser!(u32).range(1..))]
    chunk_tensors: u32,
}

impl Default for LayoutArgs {
    fn default() -> Self {
        Self { level: 19, chunk_tensors: 1024 }
    }
}

impl LayoutArgs {
    /// Errors if the level is out of range.
    pub(super) fn check(&self) -> Result<(), Error> {
        if self.level > 22 {
            return Err(Error::Usage(format!("--level {}: must be from 0 to 22", self.level)));
        }
        Ok(())
    }

    /// `options` with this level and chunk size, and floats arranged for them.
    pub(super) fn apply(&self, options: EncodeOptions) -> Result<EncodeOptions, Error> {
        self.check()?;
        let zstd_level = (self.level > 0).then_some(i32::from(self.level));
        let mut options = EncodeOptions { zstd_level, chunk_tensors: self.chunk_tensors as usize, ..options };
        // Floats in the arrangement that compresses best or, without compression, that can be mapped.
        let filter = if zstd_level.is_some() { Filter::Planes } else { Filter::None };
        let factors = options.density.iter_mut().chain(&mut options.appearance).map(|factors| &mut factors.array);
        for array in factors.chain([&mut options.networks]) {
            if matches!(array.encoding, Encoding::F32 | Encoding::F16) {
                array.filter = filter;
            }
        }
        Ok(options)
    }
}

/// `encoding` for all factors, whose vectors are balanced for it, or options that lose nothing of `file`: its own where they
/// fit.
pub(super) fn options_for(encoding: Option<Plain>, file: &mut SceneFile) -> Result<EncodeOptions, container::Error> {
    let Some(encoding) = encoding.map(Plain::encoding) else { return pack::lossless(file) };
    if matches!(encoding, Encoding::Grid(_)) {
        pack::balance(&mut file.scene);
    }
    Ok(EncodeOptions::uniform(encoding))
}
