//! A file that arrives.

use std::ops::Range;

use wasm_bindgen::prelude::{JsError, wasm_bindgen};

use crate::player::{Step, Stream};

/// A file that a page loads in pieces, the coarse scale first: load what is `wanted` and `add` it, until nothing is; then
/// give this to a player's `take`; and again, until that says that all is there.
#[wasm_bindgen]
#[derive(Default)]
pub struct Download {
    stream: Stream,
    /// Whether a scene of it is shown.
    pub(super) is_shown: bool,
}

#[wasm_bindgen]
impl Download {
    /// Nothing has arrived.
    #[wasm_bindgen(constructor)]
    pub fn new() -> Self {
        Self::default()
    }

    /// The ranges of bytes to load now: where each begins, and where it ends.
    ///
    /// # Errors
    ///
    /// Where what has arrived is no such file.
    pub fn wanted(&mut self) -> Result<Vec<f64>, JsError> {
        Ok(self.stream.wanted()?.into_iter().flat_map(|range| [range.start as f64, range.end as f64]).collect())
    }

    /// Takes the bytes from `start` to `end`; where they are fewer, the file ends with them.
    pub fn add(&mut self, start: f64, end: f64, bytes: Vec<u8>) {
        self.stream.add(Range { start: start as u64, end: end as u64 }, bytes);
    }

    /// Takes the bytes of the whole file.
    pub fn add_whole(&mut self, bytes: Vec<u8>) {
        self.stream.add(0..u64::MAX, bytes);
    }

    /// Whether a scene of it is shown: as `take` has found one to show.
    #[wasm_bindgen(getter)]
    pub fn has_scene(&self) -> bool {
        self.is_shown
    }

    /// Bytes that have arrived, and, once it is known, those of the whole file.
    #[wasm_bindgen(getter)]
    pub fn progress(&self) -> Vec<f64> {
        let all = self.stream.contents().map(|contents| contents.file_length);
        [Some(self.stream.bytes()), all].into_iter().flatten().map(|v| v as f64).collect()
    }
}

impl Download {
    /// The next scene, where there is one to show, and whether it was the last.
    pub(super) fn step(&mut self) -> Result<(Option<Step>, bool), crate::container::Error> {
        let step = self.stream.step()?;
        Ok((step, self.stream.is_done()))
    }
}
