//! Cameras grouped for people: those of the same lens and size in one line, with the range of their focal lengths.

use std::collections::BTreeSet;
use std::fmt;

use strivec_format::digits::{grouped, plural};
use strivec_format::geometry::Camera;

/// Photographs whose cameras have the same lens and the same size.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraGroup {
    /// Number of photographs.
    pub photographs: usize,
    /// Number of different cameras, without their places.
    pub cameras: usize,
    /// Columns and rows.
    pub size: [u32; 2],
    /// The lens's name.
    pub lens: String,
    /// The least and the largest focal length along columns and rows, in pixels.
    pub focal: [f64; 2],
}

/// The groups of `cameras`, those of the most photographs first.
pub fn group_cameras(cameras: &[Camera]) -> Vec<CameraGroup> {
    let mut groups: Vec<(CameraGroup, BTreeSet<Vec<u64>>)> = Vec::new();
    for camera in cameras {
        let (size, lens) = ([camera.width, camera.height], camera.lens.name());
        let numbers = camera.focal.iter().chain(&camera.principal).map(|value| value.to_bits());
        let distortion = format!("{:?}", camera.lens).into_bytes().into_iter().map(u64::from);
        let own: Vec<u64> = numbers.chain(distortion).collect();
        let place = groups.iter().position(|(group, _)| group.size == size && group.lens == lens);
        let place = place.unwrap_or_else(|| {
            let focal = [f64::INFINITY, 0.0];
            groups.push((CameraGroup { photographs: 0, cameras: 0, size, lens, focal }, BTreeSet::new()));
            groups.len() - 1
        });
        let (group, different) = &mut groups[place];
        different.insert(own);
        group.photographs += 1;
        group.cameras = different.len();
        for focal in camera.focal {
            group.focal = [group.focal[0].min(focal), group.focal[1].max(focal)];
        }
    }
    let mut groups: Vec<_> = groups.into_iter().map(|(group, _)| group).collect();
    groups.sort_by_key(|group| std::cmp::Reverse(group.photographs));
    groups
}

impl fmt::Display for CameraGroup {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { photographs, cameras, size: [width, height], lens, focal: [least, most] } = self;
        write!(f, "{}, {}", plural(*photographs, "photograph"), grouped(*cameras as u64))?;
        write!(f, " camera{} of {width}x{height}: {lens}, focal length ", if *cameras == 1 { "" } else { "s" })?;
        // Four digits, or all of whole pixels.
        let digits = |value: f64| (3 - value.abs().max(1.0).log10().floor() as i32).max(0) as usize;
        let [from, to] = [least, most].map(|value| format!("{value:.*}", digits(*value)));
        if from == to { write!(f, "{from} pixels") } else { write!(f, "{from} to {to} pixels") }
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    #[test]
    fn cameras_of_one_size_are_one_line_with_their_range() {
        let camera = |n: u32, focal: f64| {
            let size = if n == 9 { [64, 48] } else { [720, 1280] };
            Camera::looking_at(size, focal, DVec3::new(3.0, f64::from(n), 1.0), DVec3::ZERO, DVec3::Z)
        };
        let mut cameras: Vec<Camera> = (0..9).map(|n| camera(n, 1102.0 + f64::from(n.min(7)))).collect();
        cameras.push(camera(9, 80.0));
        let lines: Vec<String> = group_cameras(&cameras).iter().map(CameraGroup::to_string).collect();
        assert_eq!(
            lines,
            [
                "9 photographs, 8 cameras of 720x1280: perspective, focal length 1102 to 1109 pixels",
                "1 photograph, 1 camera of 64x48: perspective, focal length 80.00 pixels",
            ]
        );
    }
}
