//! A clock for measuring how long pictures take, on desktops and in browsers.

#[cfg(target_arch = "wasm32")]
mod performance {
    use wasm_bindgen::prelude::wasm_bindgen;

    #[wasm_bindgen]
    extern "C" {
        #[wasm_bindgen(js_namespace = performance, js_name = now)]
        pub fn now() -> f64;
    }
}

/// Seconds since the page was opened: the standard library has no clock in browsers.
#[cfg(target_arch = "wasm32")]
pub fn now() -> f64 {
    1e-3 * performance::now()
}

/// Seconds since the first call.
#[cfg(not(target_arch = "wasm32"))]
pub fn now() -> f64 {
    static START: std::sync::LazyLock<std::time::Instant> = std::sync::LazyLock::new(std::time::Instant::now);
    START.elapsed().as_secs_f64()
}
