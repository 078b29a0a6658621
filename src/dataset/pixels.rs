//! A photograph's colors in memory, in 8 bits if its file allows; composited on a background on request.

/// \[height\]\[width\] sRGB colors with alpha, row-major from the top left.
#[derive(Clone, Debug, PartialEq)]
pub enum Pixels {
    /// Red, green, blue and straight alpha, 255 standing for 1: exact, for 8-bit files at full size.
    Rgba8(Vec<[u8; 4]>),
    /// Premultiplied red, green, blue and alpha in [0, 1]: for all other pictures.
    Premultiplied(Vec<[f32; 4]>),
}

impl Pixels {
    /// `colors` without transparency.
    pub fn opaque(colors: impl IntoIterator<Item = [f32; 3]>) -> Self {
        Self::Premultiplied(colors.into_iter().map(|[r, g, b]| [r, g, b, 1.0]).collect())
    }

    /// Number of pixels.
    pub fn len(&self) -> usize {
        match self {
            Self::Rgba8(pixels) => pixels.len(),
            Self::Premultiplied(pixels) => pixels.len(),
        }
    }

    /// True if there are no pixels.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// True if all pixels are opaque.
    pub fn is_opaque(&self) -> bool {
        match self {
            Self::Rgba8(pixels) => pixels.iter().all(|p| p[3] == u8::MAX),
            Self::Premultiplied(pixels) => pixels.iter().all(|p| p[3] == 1.0),
        }
    }

    /// Number of pixels through which more than half of what is behind them shows.
    pub fn count_transparent(&self) -> usize {
        match self {
            Self::Rgba8(pixels) => pixels.iter().filter(|p| p[3] < 128).count(),
            Self::Premultiplied(pixels) => pixels.iter().filter(|p| p[3] < 0.5).count(),
        }
    }

    /// The color, in \[0, 1\], of pixel number `pixel` on `background`.
    #[inline]
    pub fn color(&self, pixel: usize, background: [f32; 3]) -> [f32; 3] {
        match self {
            Self::Rgba8(pixels) => {
                let rgba = pixels[pixel].map(u32::from);
                let through = f64::from(255 - rgba[3]) / 255.0;
                [0, 1, 2].map(|c| {
                    let premultiplied = f64::from(rgba[c] * rgba[3]) / f64::from(255 * 255);
                    (premultiplied + through * f64::from(background[c])) as f32
                })
            }
            Self::Premultiplied(pixels) => {
                let rgba = pixels[pixel].map(f64::from);
                [0, 1, 2].map(|c| (rgba[c] + (1.0 - rgba[3]) * f64::from(background[c])) as f32)
            }
        }
    }

    /// \[pixel\] opacities from 0 to 1.
    pub fn opacities(&self) -> Vec<f32> {
        match self {
            Self::Rgba8(pixels) => pixels.iter().map(|p| f32::from(p[3]) / 255.0).collect(),
            Self::Premultiplied(pixels) => pixels.iter().map(|p| p[3]).collect(),
        }
    }

    /// All colors on `background`.
    pub fn colors(&self, background: [f32; 3]) -> Vec<[f32; 3]> {
        (0..self.len()).map(|pixel| self.color(pixel, background)).collect()
    }

    /// The bytes in memory, for checksums.
    pub fn bytes(&self) -> &[u8] {
        match self {
            Self::Rgba8(pixels) => pixels.as_flattened(),
            Self::Premultiplied(pixels) => bytemuck::cast_slice(pixels),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn straight_and_premultiplied_alpha_mean_the_same_colors() {
        let straight = Pixels::Rgba8(vec![[255, 51, 0, 102], [9, 8, 7, 0], [1, 2, 3, 255]]);
        let premultiplied = Pixels::Premultiplied(vec![
            [0.4, 0.08, 0.0, 0.4],
            [0.0, 0.0, 0.0, 0.0],
            [1.0 / 255.0, 2.0 / 255.0, 3.0 / 255.0, 1.0],
        ]);
        let background = [0.5, 1.0, 0.25];
        let expected = [[0.7, 0.68, 0.15], background, [1.0 / 255.0, 2.0 / 255.0, 3.0 / 255.0]];
        for pixels in [straight, premultiplied] {
            let found = pixels.colors(background);
            let far = found.iter().flatten().zip(expected.iter().flatten()).any(|(a, b)| (a - b).abs() > 1e-7);
            assert!(!far && found[1..] == expected[1..], "{found:?}");
            assert!(!pixels.is_opaque());
            let opacities = [0.4, 0.0, 1.0f32];
            assert!(pixels.opacities().iter().zip(opacities).all(|(a, b)| (a - b).abs() < 1e-7));
        }
    }

    #[test]
    fn opaque_colors_are_the_same_on_every_background() {
        let colors = vec![[0.1, 0.7, 0.3], [0.0, 1.0, 0.5]];
        let pixels = Pixels::opaque(colors.clone());
        assert!(pixels.is_opaque());
        assert_eq!(pixels.colors([0.3; 3]), colors);
        assert_eq!(pixels.colors([1.0; 3]), colors);
    }
}
