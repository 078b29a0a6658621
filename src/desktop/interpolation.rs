//! Colors between pixels.

use glam::{Vec2, Vec3};

/// The number of the pixel at `column` and `row` of a picture of `size`, row by row; the nearest one of the picture.
pub(super) fn pixel_at(size: [u32; 2], column: i32, row: i32) -> usize {
    let [column, row] = [(column, size[0]), (row, size[1])].map(|(at, count)| at.clamp(0, count as i32 - 1) as usize);
    row * size[0] as usize + column
}

/// Bilinear interpolation of the four pixels around `at`, in pixels from the corner of a picture of `size` whose pixel of
/// a number has the color `color`.
pub(super) fn between_four(size: [u32; 2], at: Vec2, color: impl Fn(usize) -> Vec3) -> Vec3 {
    let corner = (at - 0.5).floor();
    let part = at - 0.5 - corner;
    let [x, y] = corner.to_array().map(|v| v as i32);
    let pixel = |x: i32, y: i32| color(pixel_at(size, x, y));
    let row = |y: i32| pixel(x, y).lerp(pixel(x + 1, y), part.x);
    row(y).lerp(row(y + 1), part.y)
}
