//! 3D Gaussian splats (Kerbl et al., "3D Gaussian Splatting for Real-Time Radiance Field Rendering", 2023): SPZ, SOG, and
//! the 32-byte records of `.splat`. Splats in PLY files are read by `ply`, those in glTF by `gltf`.
//!
//! A splat is passed on with its extent. Its opacity is its confidence; splats below [`ReadOptions::min_opacity`] are
//! left out and counted. Its color is that of degree 0 of the spherical harmonics.

mod records;
mod sog;
mod spz;
#[cfg(test)]
mod tests;

use glam::{DQuat, DVec3};

pub use records::read as read_records;
pub(super) use sog::META as SOG_META;
pub use sog::{read as read_sog, read_meta as read_sog_meta};
pub(super) use spz::SpzSplats;
pub use spz::read as read_spz;

use super::{Fault, LeftOut, Point, ReadOptions, Visitor};
use strivec_format::color::byte;

/// Value of the spherical harmonic of degree 0.
const HARMONIC: f64 = 0.28209479177387814;
/// Standard deviations in an axis that is passed on.
const DEVIATIONS: f64 = 2.0;
/// Largest standard deviation, so that sums stay finite.
const MAX_DEVIATION: f64 = 1e30;

/// A splat.
#[derive(Clone, Copy, Debug)]
pub(super) struct Splat {
    pub(super) center: DVec3,
    /// Standard deviations along its axes.
    pub(super) deviations: [f64; 3],
    /// Rotation of its axes as a quaternion w, x, y, z of any length; 0 does not rotate.
    pub(super) rotation: [f64; 4],
    /// 0 to 1.
    pub(super) opacity: f64,
    pub(super) color: Option<[u8; 3]>,
}

impl Splat {
    /// Passes the splat to `visitor`, unless `options` leave it out.
    pub(super) fn pass(
        &self,
        options: &ReadOptions,
        visitor: &mut dyn Visitor,
        place: impl FnOnce() -> String,
    ) -> Result<(), Fault> {
        let center = match Point::new(self.center, self.color, place) {
            Ok(center) => center,
            Err(fault) => return fault.pass(visitor),
        };
        // NaN is an unknown opacity.
        if self.opacity < options.min_opacity || (self.opacity.is_nan() && options.min_opacity > 0.0) {
            visitor.left_out(LeftOut::Transparent);
            return Ok(());
        }
        if self.opacity < options.min_confidence {
            return Ok(());
        }
        if options.vertices {
            return visitor.point(center);
        }
        let [w, x, y, z] = self.rotation;
        let rotation = DQuat::from_xyzw(x, y, z, w);
        let length = rotation.length();
        let rotation = if length.is_normal() { rotation / length } else { DQuat::IDENTITY };
        // NaN is 0.
        let bounded = |value: f64| if value > 0.0 { value.min(MAX_DEVIATION) } else { 0.0 };
        let deviation = |n: usize| DEVIATIONS * bounded(self.deviations[n]);
        let axes = [DVec3::X, DVec3::Y, DVec3::Z];
        visitor.splat(center, [0, 1, 2].map(|n| rotation * (deviation(n) * axes[n])))
    }
}

/// Reports progress at every 65536th splat: `n` of `count` are passed on, of a file of `bytes` bytes.
pub(super) fn report(n: u64, count: u64, bytes: u64, visitor: &mut dyn Visitor) -> Result<(), Fault> {
    if !n.is_multiple_of(1 << 16) {
        return Ok(());
    }
    visitor.progress((bytes as f64 * n as f64 / count as f64) as u64, bytes)
}

/// The opacity of an unbounded number.
pub(super) fn sigmoid(value: f64) -> f64 {
    1.0 / (1.0 + (-value).exp())
}

/// The channels of a color, mostly in \[0, 1\], of coefficients of degree 0.
pub(super) fn channels_of(coefficients: [f64; 3]) -> [f64; 3] {
    coefficients.map(|value| 0.5 + HARMONIC * value)
}

/// The sRGB color of coefficients of degree 0.
pub(super) fn color_of(coefficients: [f64; 3]) -> [u8; 3] {
    channels_of(coefficients).map(byte)
}

/// The unit quaternion w, x, y, z without its component `largest`, 0 to 3, which is positive; `others` has the rest in
/// their order.
pub(super) fn with_largest(largest: usize, others: [f64; 3]) -> [f64; 4] {
    let rest = (1.0 - others.iter().map(|value| value * value).sum::<f64>()).max(0.0).sqrt();
    let mut others = others.into_iter();
    std::array::from_fn(|n| if n == largest { rest } else { others.next().unwrap_or_default() })
}
