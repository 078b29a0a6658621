//! Rasterization of pictures and egui's triangles on the CPU, for a window without a graphics device.

use std::collections::HashMap;

use egui::epaint::{ClippedPrimitive, ImageData, ImageDelta, Mesh, Primitive, TextureId, Vertex};
use egui::{Color32, Pos2, Rect};
use glam::DVec2;

/// A rectangle of left, top, right and bottom.
pub(super) fn rectangle([left, top, right, bottom]: [f32; 4]) -> Rect {
    Rect::from_min_max(Pos2::new(left, top), Pos2::new(right, bottom))
}

/// Colors of a window, row by row from the top left.
pub(super) struct WindowPixels {
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) colors: Vec<Color32>,
}

impl WindowPixels {
    /// A canvas of one color.
    pub(super) fn new(width: usize, height: usize, color: Color32) -> Self {
        Self { width, height, colors: vec![color; width * height] }
    }

    /// Fills each pixel of `part` with `color` at its center, in parts of the size of `whole`.
    pub(super) fn fill(&mut self, part: Rect, whole: Rect, mut color: impl FnMut([f32; 2]) -> Color32) {
        let [left, right] = [part.left(), part.right()].map(|v| (v.round().max(0.0) as usize).min(self.width));
        let [top, bottom] = [part.top(), part.bottom()].map(|v| (v.round().max(0.0) as usize).min(self.height));
        for y in top..bottom {
            for x in left..right {
                let at = (Pos2::new(x as f32 + 0.5, y as f32 + 0.5) - whole.min) / whole.size();
                self.colors[y * self.width + x] = color([at.x, at.y]);
            }
        }
    }
}

impl WindowPixels {
    /// Draws a line of one pixel's width between `ends`, in pixels, within `part`.
    pub(super) fn line(&mut self, part: Rect, ends: [DVec2; 2], [r, g, b, opacity]: [f32; 4]) {
        let part = part.intersect(Rect::from_min_max(Pos2::ZERO, Pos2::new(self.width as f32, self.height as f32)));
        let Some([from, to]) = clipped(part, ends) else { return };
        // One pixel per column, or per row if the line is steep.
        let along = to - from;
        let major = usize::from(along.y.abs() > along.x.abs());
        let [first, last] = [from[major].min(to[major]), from[major].max(to[major])].map(f64::floor);
        for n in first as usize..=last as usize {
            let share = (n as f64 + 0.5 - from[major]) / along[major];
            let at = if along[major] == 0.0 { from } else { from + share.clamp(0.0, 1.0) * along };
            let [mut x, mut y] = at.to_array().map(|v| v as usize);
            *[&mut x, &mut y][major] = n;
            if x >= self.width || y >= self.height {
                continue;
            }
            let under = &mut self.colors[y * self.width + x];
            let mixed =
                |over: f32, under: u8| (opacity * 255.0 * over + (1.0 - opacity) * f32::from(under)).round() as u8;
            *under = Color32::from_rgb(mixed(r, under.r()), mixed(g, under.g()), mixed(b, under.b()));
        }
    }
}

/// The segment of a line that lies in `part`.
fn clipped(part: Rect, [from, to]: [DVec2; 2]) -> Option<[DVec2; 2]> {
    let along = to - from;
    let (mut first, mut last) = (0.0_f64, 1.0_f64);
    for (start, step, low, high) in
        [(from.x, along.x, part.left(), part.right()), (from.y, along.y, part.top(), part.bottom())]
    {
        // The far edge belongs to the next pixel.
        let [low, high] = [f64::from(low), f64::from(high) - 1e-3];
        if step == 0.0 {
            if start < low || start > high {
                return None;
            }
            continue;
        }
        let [a, b] = [(low - start) / step, (high - start) / step];
        (first, last) = (first.max(a.min(b)), last.min(a.max(b)));
    }
    (first <= last).then(|| [from + first * along, from + last * along])
}

/// egui's textures.
#[derive(Default)]
pub(super) struct Textures(HashMap<TextureId, ([usize; 2], Vec<Color32>)>);

impl Textures {
    /// Applies a change.
    pub(super) fn set(&mut self, id: TextureId, delta: &ImageDelta) {
        let ImageData::Color(image) = &delta.image;
        let [width, height] = image.size;
        match delta.pos {
            None => {
                self.0.insert(id, (image.size, image.pixels.clone()));
            }
            Some([left, top]) => {
                let Some((size, pixels)) = self.0.get_mut(&id) else { return };
                if left + width > size[0] || top + height > size[1] {
                    return;
                }
                for y in 0..height {
                    let to = (top + y) * size[0] + left;
                    pixels[to..to + width].copy_from_slice(&image.pixels[y * width..(y + 1) * width]);
                }
            }
        }
    }

    /// Removes a texture.
    pub(super) fn free(&mut self, id: TextureId) {
        self.0.remove(&id);
    }

    /// Draws `primitives`, whose places are in points of `pixels_per_point` pixels.
    pub(super) fn paint(&self, canvas: &mut WindowPixels, primitives: &[ClippedPrimitive], pixels_per_point: f32) {
        for ClippedPrimitive { clip_rect, primitive } in primitives {
            if let Primitive::Mesh(mesh) = primitive
                && let Some(texture) = self.0.get(&mesh.texture_id)
            {
                paint_mesh(canvas, mesh, *clip_rect, texture, pixels_per_point);
            }
        }
    }
}

fn paint_mesh(canvas: &mut WindowPixels, mesh: &Mesh, clip: Rect, texture: &([usize; 2], Vec<Color32>), scale: f32) {
    let clip = Rect::from_min_max((clip.min.to_vec2() * scale).to_pos2(), (clip.max.to_vec2() * scale).to_pos2());
    let clip = clip.intersect(Rect::from_min_max(Pos2::ZERO, Pos2::new(canvas.width as f32, canvas.height as f32)));
    for triangle in mesh.indices.as_chunks::<3>().0 {
        let corners = triangle.map(|n| mesh.vertices.get(n as usize).copied().unwrap_or_default());
        paint_triangle(canvas, corners, clip, texture, scale);
    }
}

/// Paints the pixels whose centers are inside. Colors and texture coordinates are interpolated between the corners.
fn paint_triangle(
    canvas: &mut WindowPixels,
    corners: [Vertex; 3],
    clip: Rect,
    texture: &([usize; 2], Vec<Color32>),
    scale: f32,
) {
    let cross = |p: egui::Vec2, q: egui::Vec2| p.x * q.y - p.y * q.x;
    let mut corners = corners;
    let places = |corners: &[Vertex; 3]| corners.map(|v| v.pos.to_vec2() * scale);
    let [a, b, c] = places(&corners);
    let area = cross(b - a, c - a);
    if area == 0.0 || !area.is_finite() {
        return;
    }
    if area < 0.0 {
        corners.swap(1, 2);
    }
    let [a, b, c] = places(&corners);
    let area = area.abs();
    // A pixel on the edge of two triangles belongs to the one whose left or top edge it is.
    let owned = [c - b, a - c, b - a].map(|edge| edge.y < 0.0 || (edge.y == 0.0 && edge.x > 0.0));
    let low = a.min(b).min(c).max(clip.min.to_vec2());
    let high = a.max(b).max(c).min(clip.max.to_vec2());
    for y in low.y.floor() as i32..high.y.ceil() as i32 {
        for x in low.x.floor() as i32..high.x.ceil() as i32 {
            let p = egui::Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
            if !clip.contains(p.to_pos2()) {
                continue;
            }
            let weights = [cross(b - p, c - p), cross(c - p, a - p), cross(a - p, b - p)].map(|w| w / area);
            if weights.iter().zip(owned).any(|(w, is_owned)| *w < 0.0 || (*w == 0.0 && !is_owned)) {
                continue;
            }
            let mix = |of: &dyn Fn(&Vertex) -> f32| (0..3).map(|n| weights[n] * of(&corners[n])).sum::<f32>();
            let texel = texel(texture, mix(&|v| v.uv.x), mix(&|v| v.uv.y));
            let source = [0, 1, 2, 3].map(|n| mix(&|v| f32::from(v.color[n])) * f32::from(texel[n]) / 255.0);
            let to = &mut canvas.colors[y as usize * canvas.width + x as usize];
            let under = 1.0 - source[3] / 255.0;
            let [r, g, b] = [0, 1, 2].map(|n| (source[n] + under * f32::from(to[n])).round().clamp(0.0, 255.0) as u8);
            *to = Color32::from_rgb(r, g, b);
        }
    }
}

/// Bilinear interpolation of the four nearest texels.
fn texel(([width, height], pixels): &([usize; 2], Vec<Color32>), u: f32, v: f32) -> [u8; 4] {
    let at = [u * *width as f32 - 0.5, v * *height as f32 - 0.5];
    let [x, y] = at.map(f32::floor);
    let [fx, fy] = [at[0] - x, at[1] - y];
    let pixel = |dx: f32, dy: f32| {
        let column = (x + dx).clamp(0.0, *width as f32 - 1.0) as usize;
        let row = (y + dy).clamp(0.0, *height as f32 - 1.0) as usize;
        pixels.get(row * width + column).map_or([0; 4], |c| c.to_array())
    };
    let [a, b, c, d] = [pixel(0.0, 0.0), pixel(1.0, 0.0), pixel(0.0, 1.0), pixel(1.0, 1.0)];
    [0, 1, 2, 3].map(|n| {
        let row = |l: [u8; 4], r: [u8; 4]| f32::from(l[n]) * (1.0 - fx) + f32::from(r[n]) * fx;
        (row(a, b) * (1.0 - fy) + row(c, d) * fy).round() as u8
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn vertex(x: f32, y: f32, color: Color32) -> Vertex {
        Vertex { pos: Pos2::new(x, y), uv: Pos2::new(0.5, 0.5), color }
    }

    #[test]
    fn a_rectangle_of_two_triangles_covers_each_pixel_once() {
        let half = Color32::from_rgba_premultiplied(100, 0, 0, 128);
        let corners = [vertex(1.0, 1.0, half), vertex(5.0, 1.0, half), vertex(5.0, 4.0, half), vertex(1.0, 4.0, half)];
        let mesh = Mesh { indices: vec![0, 1, 2, 0, 2, 3], vertices: corners.into(), texture_id: TextureId::default() };
        let mut canvas = WindowPixels::new(8, 6, Color32::from_rgb(0, 0, 200));
        let everywhere = Rect::from_min_max(Pos2::ZERO, Pos2::new(4.25, 100.0));
        paint_mesh(&mut canvas, &mesh, everywhere, &([1, 1], vec![Color32::WHITE]), 1.0);
        let painted: Vec<_> = (0..48).filter(|n| canvas.colors[*n] != Color32::from_rgb(0, 0, 200)).collect();
        assert_eq!(painted, [9, 10, 11, 17, 18, 19, 25, 26, 27], "the clip rectangle ends in pixel 4");
        assert!(painted.iter().all(|n| canvas.colors[*n] == Color32::from_rgb(100, 0, 100)), "{:?}", canvas.colors[9]);
    }

    #[test]
    fn lines_end_where_their_part_does() {
        let part = Rect::from_min_max(Pos2::new(2.0, 1.0), Pos2::new(6.0, 5.0));
        let mut canvas = WindowPixels::new(8, 6, Color32::BLACK);
        canvas.line(part, [DVec2::new(-100.0, 2.5), DVec2::new(100.0, 2.5)], [1.0, 0.0, 0.0, 0.5]);
        canvas.line(part, [DVec2::new(-100.0, 5.5), DVec2::new(100.0, 5.5)], [1.0, 0.0, 0.0, 0.5]);
        canvas.line(part, [DVec2::new(4.5, -1e9), DVec2::new(4.5, 1e9)], [0.0, 1.0, 0.0, 1.0]);
        let painted: Vec<_> = (0..48).filter(|n| canvas.colors[*n] != Color32::BLACK).collect();
        assert_eq!(painted, [12, 18, 19, 20, 21, 28, 36], "{painted:?}");
        assert_eq!((canvas.colors[18].r(), canvas.colors[28].g()), (128, 255));
    }

    #[test]
    fn textures_change_in_part() {
        let mut textures = Textures::default();
        let id = TextureId::default();
        let image =
            |size: [usize; 2], color| ImageData::Color(std::sync::Arc::new(egui::ColorImage::filled(size, color)));
        let options = egui::TextureOptions::default();
        textures.set(id, &ImageDelta { image: image([3, 2], Color32::BLACK), options, pos: None });
        textures.set(id, &ImageDelta { image: image([1, 1], Color32::WHITE), options, pos: Some([2, 1]) });
        textures.set(id, &ImageDelta { image: image([9, 9], Color32::RED), options, pos: Some([2, 1]) });
        let found: Vec<_> = textures.0[&id].1.iter().map(|c| c.r()).collect();
        assert_eq!(found, [0, 0, 0, 0, 0, 255]);
        textures.free(id);
        assert!(textures.0.is_empty());
    }
}
