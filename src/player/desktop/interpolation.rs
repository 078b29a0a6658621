//! Colors between pixels.

use glam::{Vec2, Vec3};

/// Bilinear interpolation of `color` at the four pixels around `at`, in pixels from the corner.
pub(super) fn between_four(at: Vec2, color: impl Fn(i32, i32) -> Vec3) -> Vec3 {
    let corner = (at - 0.5).floor();
    let part = at - 0.5 - corner;
    let [x, y] = corner.to_array().map(|v| v as i32);
    let row = |y: i32| color(x, y).lerp(color(x + 1, y), part.x);
    row(y).lerp(row(y + 1), part.y)
}
