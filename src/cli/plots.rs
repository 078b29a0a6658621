//! Shared parts of plots: a font, and a picture in memory.

use plotters::backend::BitMapBackend;
use plotters::style::{FontStyle, register_font};

/// The font's name.
pub(super) const FONT: &str = "plot";

/// Registers [`FONT`]; may be called several times.
pub(super) fn register() {
    let _ = register_font(FONT, FontStyle::Normal, epaint_default_fonts::UBUNTU_LIGHT);
}

/// The picture of `size` (columns, rows) that `draw` makes, as colors.
pub(super) fn picture<E>(
    size: (u32, u32),
    draw: impl FnOnce(BitMapBackend<'_>) -> Result<(), E>,
) -> Result<([u32; 2], Vec<[f32; 3]>), E> {
    let mut bytes = vec![0; 3 * size.0 as usize * size.1 as usize];
    draw(BitMapBackend::with_buffer(&mut bytes, size))?;
    let colors = bytes.as_chunks::<3>().0.iter().map(|rgb| rgb.map(|v| f32::from(v) / 255.0)).collect();
    Ok(([size.0, size.1], colors))
}
