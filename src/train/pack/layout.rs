//! Compression and division into chunks of a file that is written.

use strivec_format::container::{ArrayOptions, EncodeOptions, Encoding, Filter};

/// The level at which data is compressed if no other is set.
const LEVEL: u8 = 19;

/// Compression and chunks of a file, as far as the caller sets them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FileLayout {
    /// zstd compression level, 1 to 22; 0 turns compression off. `None`: 19, or none for a file that had none.
    pub level: Option<u8>,
    /// The most tensors of a chunk; `None`: 1024, or the file's own chunks.
    pub chunk_tensors: Option<u32>,
}

impl FileLayout {
    /// True if every section is compressed anew.
    pub fn recompresses(&self) -> bool {
        self.level.is_some()
    }

    /// `options` for a new file: compressed by default, in chunks of the default size.
    pub fn for_new(&self, options: EncodeOptions) -> EncodeOptions {
        let layout = Self { level: self.level.or(Some(LEVEL)), ..*self };
        layout.apply(EncodeOptions { chunks: Vec::new(), ..options }, true)
    }

    /// `options` with this level and chunk size. By default a file is compressed if it was, and keeps its chunks.
    pub fn apply(&self, options: EncodeOptions, was_compressed: bool) -> EncodeOptions {
        let level = self.level.unwrap_or(if was_compressed { LEVEL } else { 0 });
        let mut options = EncodeOptions { zstd_level: (level > 0).then_some(i32::from(level)), ..options };
        if let Some(tensors) = self.chunk_tensors {
            options.chunks.clear();
            options.chunk_tensors = tensors as usize;
        }
        if self.recompresses() {
            let factors = options.density.iter_mut().chain(&mut options.appearance).map(|factors| &mut factors.array);
            for array in factors.chain([&mut options.networks]) {
                *array = arranged(array.encoding, level > 0);
            }
        }
        options
    }
}

/// An array in `encoding`, its floats in the arrangement that compresses best or, without compression, that can be mapped.
pub fn arranged(encoding: Encoding, is_compressed: bool) -> ArrayOptions {
    let best = ArrayOptions::best(encoding);
    if is_compressed { best } else { ArrayOptions { filter: Filter::None, ..best } }
}
