//! A file that is downloaded.

use std::ops::Range;

use wasm_bindgen::prelude::{JsError, wasm_bindgen};

use strivec_player::{Step, Stream};

/// A file that a page loads in pieces, the coarse scale first. Load the `wanted` ranges and `add` them until none is
/// wanted, call the player's `take`, and repeat until it returns true.
#[wasm_bindgen]
#[derive(Debug, Default)]
pub struct Download {
    stream: Stream,
    /// True if a scene of it is shown.
    pub(super) is_shown: bool,
}

#[wasm_bindgen]
impl Download {
    /// An empty download.
    #[wasm_bindgen(constructor)]
    pub fn new() -> Self {
        Self::default()
    }

    /// The ranges of bytes to load now: start and end of each.
    ///
    /// # Errors
    ///
    /// If the bytes are not those of a `.strivec` file.
    pub fn wanted(&mut self) -> Result<Vec<f64>, JsError> {
        Ok(self.stream.wanted()?.into_iter().flat_map(|range| [range.start as f64, range.end as f64]).collect())
    }

    /// Adds the bytes from `start` to `end`; if they are fewer, the file ends with them.
    pub fn add(&mut self, start: f64, end: f64, bytes: Vec<u8>) {
        self.stream.add(Range { start: start as u64, end: end as u64 }, bytes);
    }

    /// Adds the bytes of the whole file.
    pub fn add_whole(&mut self, bytes: Vec<u8>) {
        self.stream.add(0..u64::MAX, bytes);
    }

    /// True if `take` has shown a scene of it.
    #[wasm_bindgen(getter)]
    pub fn has_scene(&self) -> bool {
        self.is_shown
    }

    /// Number of bytes that have arrived, and the file's length once it is known.
    #[wasm_bindgen(getter)]
    pub fn progress(&self) -> Vec<f64> {
        let all = self.stream.contents().map(|contents| contents.file_length);
        [Some(self.stream.bytes()), all].into_iter().flatten().map(|v| v as f64).collect()
    }
}

impl Download {
    /// The next scene, if one can be shown, and whether it was the last step.
    pub(super) fn step(&mut self) -> Result<(Option<Step>, bool), strivec_format::container::Error> {
        let step = self.stream.step()?;
        Ok((step, self.stream.is_done()))
    }
}
