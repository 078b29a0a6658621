//! The native half of the Python package `strivec`; `strivec/_strivec.pyi` describes it. It keeps to what Python cannot do:
//! scenes and their arrays, queries and pictures, training, and the commands. All else is Python's.

mod arrays;
mod commands;
mod errors;
mod following;
mod renderer;
mod scene;
mod train;
mod work;

/// The module `strivec._strivec`.
#[pyo3::pymodule]
mod _strivec {
    use pyo3::prelude::*;

    #[pymodule_export]
    use super::commands::{command, settings_of_toml, toml_of_settings};
    #[pymodule_export]
    use super::renderer::NativeRenderer;
    #[pymodule_export]
    use super::scene::NativeScene;
    #[pymodule_export]
    use super::train::train;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("VERSION", strivec::version::version())
    }
}
