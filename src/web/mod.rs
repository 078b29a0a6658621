//! What a page in a browser calls: a player on a canvas, and a file that opens while it arrives. Errors become exceptions with
//! the library's own text. What a page looks like is left to the page (`tools/web/`).

mod app;
mod canvas;
mod clock;
mod download;
mod player;
mod scene_slot;

pub use download::Download;
pub use player::Player;

use wasm_bindgen::prelude::wasm_bindgen;

#[wasm_bindgen]
extern "C" {
    #[wasm_bindgen(js_namespace = console, js_name = error)]
    fn console_error(text: &str);
}

/// Has a panic say on the page's console what went wrong: all else of it that a page sees is "unreachable".
#[wasm_bindgen(start)]
fn report_panics() {
    std::panic::set_hook(Box::new(|panic| console_error(&panic.to_string())));
}
