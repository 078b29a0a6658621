//! Upsampling of pictures that are rendered at a lower resolution than they are shown at.

use super::{Picture, Pixel};

/// `small` scaled to `size` pixels by bilinear interpolation.
pub fn upsample_bilinear(small: &Picture, size: [u32; 2]) -> Picture {
    let [width, height] = size;
    if [small.width, small.height] == size {
        return small.clone();
    }
    // [column or row] the two source columns or rows, and the share of the second.
    let along = |count: u32, sources: u32| -> Vec<(usize, usize, f32)> {
        let last = sources as usize - 1;
        (0..count)
            .map(|index| {
                let at =
                    ((f64::from(index) + 0.5) * f64::from(sources) / f64::from(count) - 0.5).clamp(0.0, last as f64);
                (at.floor() as usize, (at.floor() as usize + 1).min(last), at.fract() as f32)
            })
            .collect()
    };
    let (columns, rows) = (along(width, small.width), along(height, small.height));
    let mix = |a: &Pixel, b: &Pixel, share: f32| Pixel {
        color: [0, 1, 2].map(|c| a.color[c] + share * (b.color[c] - a.color[c])),
        opacity: a.opacity + share * (b.opacity - a.opacity),
        depth: a.depth + share * (b.depth - a.depth),
    };
    let pixel = |row: usize, column: usize| &small.pixels[row * small.width as usize + column];
    let pixels = rows.iter().flat_map(|&(above, below, y)| {
        columns.iter().map(move |&(left, right, x)| {
            mix(&mix(pixel(above, left), pixel(above, right), x), &mix(pixel(below, left), pixel(below, right), x), y)
        })
    });
    Picture { width, height, pixels: pixels.collect() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn upsampling_keeps_flat_parts_and_the_mean() {
        let pixel = |v: f32| Pixel { color: [v; 3], opacity: v, depth: v };
        let small = Picture { width: 2, height: 1, pixels: vec![pixel(0.0), pixel(1.0)] };
        let large = upsample_bilinear(&small, [4, 2]);
        let values: Vec<f32> = large.pixels.iter().map(|p| p.opacity).collect();
        assert_eq!(values, [0.0, 0.25, 0.75, 1.0, 0.0, 0.25, 0.75, 1.0]);
        assert_eq!(upsample_bilinear(&small, [2, 1]), small);
    }
}
