//! The browser's clock: the standard library has none here.

use wasm_bindgen::prelude::wasm_bindgen;

#[wasm_bindgen]
extern "C" {
    #[wasm_bindgen(js_namespace = performance, js_name = now)]
    fn performance_now() -> f64;
}

/// Seconds since the page was opened.
pub(super) fn now() -> f64 {
    1e-3 * performance_now()
}
