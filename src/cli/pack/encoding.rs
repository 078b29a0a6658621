//! Options of encodings.

use crate::Error;
use clap::ValueEnum;
use strivec_format::container;
use strivec_format::container::{EncodeOptions, Encoding, FactorOptions, SceneFile};
use strivec_train::pack;
use strivec_train::pack::{FileLayout, arranged};

/// Encodings that depend on the numbers alone.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum Plain {
    /// As they are, without loss
    Keep,
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
    /// `None` for that which the numbers have.
    pub(super) fn encoding(self) -> Option<Encoding> {
        Some(match self {
            Self::Keep => return None,
            Self::F32 => Encoding::F32,
            Self::F16 => Encoding::F16,
            Self::Grid16 => Encoding::Grid(16),
            Self::Grid8 => Encoding::Grid(8),
            Self::Grid6 => Encoding::Grid(6),
            Self::Grid5 => Encoding::Grid(5),
            Self::Grid4 => Encoding::Grid(4),
            Self::Grid3 => Encoding::Grid(3),
        })
    }
}

/// How bodies are compressed, and scenes cut.
#[derive(Clone, Debug, Default, clap::Args)]
pub(super) struct LayoutArgs {
    /// zstd compression level, 1 to 22; 0 turns compression off, so that readers can map the file [default: 19; an edit
    /// leaves unchanged sections as they are, and a file without compression uncompressed]
    #[arg(long, value_name = "N")]
    level: Option<u8>,
    /// Largest number of tensors per chunk: small chunks suit crops and range requests, large chunks give smaller files
    /// [default: 1024; an edit keeps the file's chunks]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    chunk_tensors: Option<u32>,
}

impl LayoutArgs {
    /// Errors if the level is out of range.
    pub(super) fn check(&self) -> Result<(), Error> {
        match self.level {
            Some(level) if level > 22 => Err(Error::Usage(format!("--level {level}: must be from 0 to 22"))),
            _ => Ok(()),
        }
    }

    /// The library's options.
    pub(super) fn layout(&self) -> FileLayout {
        FileLayout { level: self.level, chunk_tensors: self.chunk_tensors }
    }
}

/// Options that write factors in `encoding`, and lose nothing of the rest of `file`. Factors that have this encoding stay as
/// they are; the factors of components of others are balanced for integers.
pub(super) fn options_for(
    encoding: Plain,
    file: &mut SceneFile,
    is_compressed: bool,
) -> Result<EncodeOptions, container::Error> {
    let mut options = pack::lossless(file)?;
    let Some(encoding) = encoding.encoding() else { return Ok(options) };
    for (s, scale) in file.scene.scales.iter_mut().enumerate() {
        let (resolution, factors) = (scale.cloud.resolution, &mut scale.factors);
        for (options, blocks) in
            [(&mut options.density[s], &mut factors.density), (&mut options.appearance[s], &mut factors.appearance)]
        {
            let is_grid = matches!(encoding, Encoding::Grid(_));
            // Floats with steps stand for chunks of several encodings.
            if options.array.encoding == encoding && options.steps.is_some() == is_grid {
                continue;
            }
            if is_grid {
                blocks.iter_mut().for_each(|block| pack::balance_block(block, resolution));
            }
            *options = FactorOptions { array: arranged(encoding, is_compressed), steps: None };
        }
    }
    Ok(options)
}
