//! Bindings for a page in a browser: a player on a canvas, a file that opens while it arrives, and the help of keys.
//! Errors become exceptions with the library's text. The page itself is in `tools/web/`.

#![cfg(target_arch = "wasm32")]

mod app;
mod canvas;
mod download;
mod painter;
mod player;

pub use download::Download;
pub use player::Player;

use wasm_bindgen::prelude::wasm_bindgen;

#[wasm_bindgen]
extern "C" {
    #[wasm_bindgen(js_namespace = console, js_name = error)]
    fn console_error(text: &str);
}

/// Reports panics on the page's console. Without this a page only sees "unreachable".
#[wasm_bindgen(start)]
fn report_panics() {
    std::panic::set_hook(Box::new(|panic| console_error(&panic.to_string())));
}

/// The help of keys and pointer as JSON: pairs of input and effect.
#[wasm_bindgen]
pub fn keys() -> String {
    serde_json::json!(strivec_player::KEYS).to_string()
}
