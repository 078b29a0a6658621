//! Gaussian splats in PLY files: the properties of their training program, or packed in chunks of 256.

use glam::DVec3;

use super::super::splats::{Splat, color_of, sigmoid, with_largest};
use super::super::{Fault, ReadOptions, Visitor};
use super::body::BodyReader;
use super::header::{Kind, PlyElement};

/// Splats that share the ranges of a chunk.
const CHUNK: usize = 256;

/// Indices of the scalar properties `names`, if all exist.
fn all_of(element: &PlyElement, names: &[&str]) -> Option<Vec<usize>> {
    let of = |name: &&str| {
        let property = element.property(name)?;
        matches!(element.properties[property].kind, Kind::Scalar(_)).then_some(property)
    };
    names.iter().map(of).collect()
}

/// The used properties of splats as their training writes them: logarithms of standard deviations, opacity before the
/// sigmoid, coefficients of degree 0.
pub(super) struct SplatProperties {
    wanted: Vec<usize>,
    has_third_scale: bool,
    has_color: bool,
}

impl SplatProperties {
    /// The columns of `element`; `None` if its vertices are no splats.
    pub(super) fn of(element: &PlyElement) -> Option<Self> {
        let names = ["x", "y", "z", "opacity", "rot_0", "rot_1", "rot_2", "rot_3", "scale_0", "scale_1"];
        let mut wanted = all_of(element, &names)?;
        let third = all_of(element, &["scale_2"]);
        let color = all_of(element, &["f_dc_0", "f_dc_1", "f_dc_2"]);
        let (has_third_scale, has_color) = (third.is_some(), color.is_some());
        wanted.extend(third.into_iter().chain(color).flatten());
        Some(Self { wanted, has_third_scale, has_color })
    }

    pub(super) fn read(
        &self,
        body: &mut BodyReader<'_, '_>,
        element: &PlyElement,
        options: &ReadOptions,
        visitor: &mut dyn Visitor,
    ) -> Result<(), Fault> {
        let color_at = if self.has_third_scale { 11 } else { 10 };
        body.records(element, &self.wanted, visitor, |visitor, v, place| {
            let splat = Splat {
                center: DVec3::new(v[0], v[1], v[2]),
                // Splats of two dimensions are flat.
                deviations: [v[8].exp(), v[9].exp(), if self.has_third_scale { v[10].exp() } else { 0.0 }],
                rotation: [v[4], v[5], v[6], v[7]],
                opacity: sigmoid(v[3]),
                color: self.has_color.then(|| color_of([v[color_at], v[color_at + 1], v[color_at + 2]])),
            };
            splat.pass(options, visitor, || place.to_string())
        })
    }
}

/// Splats packed into four integers each (PlayCanvas's `.compressed.ply`), relative to the ranges of a chunk.
pub(super) struct PackedSplats {
    wanted: Vec<usize>,
    ranges: Vec<usize>,
}

impl PackedSplats {
    /// The columns of `vertex` and `chunk`; `None` if the vertices are not packed.
    pub(super) fn of(vertex: &PlyElement, chunk: Option<&PlyElement>) -> Option<Self> {
        let wanted = all_of(vertex, &["packed_position", "packed_rotation", "packed_scale", "packed_color"])?;
        let names = ["min_x", "min_y", "min_z", "max_x", "max_y", "max_z", "min_scale_x", "min_scale_y", "min_scale_z"];
        let chunk = chunk?;
        let mut ranges = all_of(chunk, &names)?;
        ranges.extend(all_of(chunk, &["max_scale_x", "max_scale_y", "max_scale_z"])?);
        // Earlier versions have no ranges of colors.
        let colors = all_of(chunk, &["min_r", "min_g", "min_b", "max_r", "max_g", "max_b"]);
        ranges.extend(colors.into_iter().flatten());
        Some(Self { wanted, ranges })
    }

    /// The ranges of all chunks, one after the other.
    pub(super) fn read_ranges(
        &self,
        body: &mut BodyReader<'_, '_>,
        chunk: &PlyElement,
        visitor: &mut dyn Visitor,
    ) -> Result<Vec<Vec<f64>>, Fault> {
        let mut all = Vec::new();
        body.records(chunk, &self.ranges, visitor, |_, values, _| {
            all.push(values.to_vec());
            Ok(())
        })?;
        Ok(all)
    }

    pub(super) fn read(
        &self,
        body: &mut BodyReader<'_, '_>,
        element: &PlyElement,
        ranges: &[Vec<f64>],
        options: &ReadOptions,
        visitor: &mut dyn Visitor,
    ) -> Result<(), Fault> {
        let mut n = 0;
        body.records(element, &self.wanted, visitor, |visitor, values, place| {
            let [position, rotation, scale, color] = [0, 1, 2, 3].map(|k| values[k] as u32);
            let range = ranges.get(n / CHUNK);
            let range = range.ok_or_else(|| Fault::broken(place.to_string(), "the splat has no chunk"))?;
            n += 1;
            let mixed = |at: usize, share: f64| range[at] + share * (range[at + 3] - range[at]);
            let [x, y, z] = eleven_ten_eleven(position);
            let scales = eleven_ten_eleven(scale);
            let share = |shift: u32| f64::from(color >> shift & 255) / 255.0;
            let rgb = [0, 1, 2].map(|axis| {
                let share = share(24 - 8 * axis as u32);
                strivec_format::color::byte(if range.len() > 12 { mixed(12 + axis, share) } else { share })
            });
            let splat = Splat {
                center: DVec3::new(mixed(0, x), mixed(1, y), mixed(2, z)),
                deviations: [0, 1, 2].map(|axis| mixed(6 + axis, scales[axis]).exp()),
                rotation: smallest_three(rotation),
                opacity: share(0),
                color: Some(rgb),
            };
            splat.pass(options, visitor, || place.to_string())
        })
    }
}

/// Shares of 11, 10 and 11 bits.
fn eleven_ten_eleven(bits: u32) -> [f64; 3] {
    let share = |value: u32, bits: u32| f64::from(value & ((1 << bits) - 1)) / f64::from((1_u32 << bits) - 1);
    [share(bits >> 21, 11), share(bits >> 11, 10), share(bits, 11)]
}

/// The quaternion w, x, y, z of three components of ten bits, without the largest one, which the highest two bits
/// number.
fn smallest_three(bits: u32) -> [f64; 4] {
    let component = |shift: u32| (f64::from(bits >> shift & 1023) / 1023.0 - 0.5) * std::f64::consts::SQRT_2;
    with_largest((bits >> 30) as usize, [component(20), component(10), component(0)])
}
