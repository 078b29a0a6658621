//! From components to gray or RGB, as libjpeg converts them (`jdcolor.c`) and its program `djpeg` shows CMYK.

use super::Segments;
use super::frame::Frame;
use super::upsample::Upsampler;

/// The meaning of the components.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Transform {
    Gray,
    YCbCr,
    Rgb,
    /// Cyan, magenta, yellow and black, inverted, as Adobe's programs store them.
    Cmyk,
    /// Cyan, magenta and yellow as YCbCr, and black.
    Ycck,
}

impl Transform {
    /// The meaning of the components of `frame` in a file with `segments`: libjpeg's rules (`jdapimin.c`).
    pub(super) fn of(frame: &Frame, segments: Segments) -> Self {
        let identifiers: Vec<u8> = frame.components.iter().map(|component| component.identifier).collect();
        match (frame.components.len(), segments.adobe_transform) {
            (1, _) => Self::Gray,
            (3, _) if segments.is_jfif => Self::YCbCr,
            (3, Some(0)) => Self::Rgb,
            (3, None) if identifiers == *b"RGB" => Self::Rgb,
            (3, _) => Self::YCbCr,
            (_, None | Some(0)) => Self::Cmyk,
            _ => Self::Ycck,
        }
    }
}

/// Fraction bits of the factors.
const BITS: u32 = 16;
const HALF: i32 = 1 << (BITS - 1);
/// The factors of the standard's annex to RGB, in these fractions: red of Cr, blue of Cb, green of both.
const RED: i32 = 91_881;
const BLUE: i32 = 116_130;
const GREEN: [i32; 2] = [22_554, 46_802];

/// Gray or RGB of the color `[y, cb, cr]`.
#[inline]
fn rgb([y, cb, cr]: [u8; 3]) -> [u8; 3] {
    let (y, cb, cr) = (i32::from(y), i32::from(cb) - 128, i32::from(cr) - 128);
    let red = y + ((RED * cr + HALF) >> BITS);
    let green = y + ((-GREEN[0] * cb - GREEN[1] * cr + HALF) >> BITS);
    let blue = y + ((BLUE * cb + HALF) >> BITS);
    [red, green, blue].map(|value| value.clamp(0, 255) as u8)
}

/// The light that passes both one ink and black, each given as the light that it lets through, rounded.
#[inline]
fn under(ink: u8, black: u8) -> u8 {
    ((u32::from(ink) * u32::from(black) * 2 + 255) / 510) as u8
}

/// \[row\]\[column\] gray or RGB of the picture whose components have `planes` of samples.
pub(super) fn interleaved(frame: &Frame, planes: &[Vec<u8>], transform: Transform) -> Vec<u8> {
    let [width, height] = frame.size.map(|extent| extent as usize);
    let components = frame.components.iter().zip(planes);
    let upsamplers: Vec<_> = components.map(|(component, plane)| Upsampler::new(frame, component, plane)).collect();
    let mut lines = vec![vec![0; width]; upsamplers.len()];
    let channels = if transform == Transform::Gray { 1 } else { 3 };
    let mut picture = vec![0; width * height * channels];
    for (row, output) in picture.chunks_exact_mut(width * channels).enumerate() {
        for (upsampler, line) in upsamplers.iter().zip(&mut lines) {
            upsampler.write_row(row, line);
        }
        let colors = output.as_chunks_mut::<3>().0.iter_mut();
        match (&lines[..], transform) {
            ([gray], _) => output.copy_from_slice(gray),
            ([a, b, c], _) => {
                for (((to, &a), &b), &c) in colors.zip(a).zip(b).zip(c) {
                    *to = if transform == Transform::Rgb { [a, b, c] } else { rgb([a, b, c]) };
                }
            }
            ([a, b, c, black], _) => {
                for ((((to, &a), &b), &c), &black) in colors.zip(a).zip(b).zip(c).zip(black) {
                    let inks = if transform == Transform::Cmyk { [a, b, c] } else { rgb([a, b, c]).map(|v| 255 - v) };
                    *to = inks.map(|ink| under(ink, black));
                }
            }
            _ => {}
        }
    }
    picture
}
