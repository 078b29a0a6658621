//! The kind of a capture: how its cameras stand to what they show.

use std::fmt;

use glam::DVec3;

use crate::prior::CameraBounds;
use strivec_format::geometry::Camera;

/// The length of the mean direction of view from which on cameras look one way: that of directions within about 35 degrees.
const ONE_WAY: f64 = 0.9;
/// The share of cameras that have one point in the middle of their pictures from which on they look at one thing.
const AT_ONE_THING: f64 = 0.4;
/// The middle of a picture, as a share of its extent.
const MIDDLE: f64 = 0.7;

/// The kind of a capture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// The photographs are transparent around a thing.
    CutOut,
    /// Around a thing before a background of one color.
    PlainBackground,
    /// All cameras look one way.
    ForwardFacing,
    /// Around a thing, with what surrounds it.
    Surrounded,
    /// Cameras among the surfaces, which look in all directions; nothing is far away.
    Room,
    /// Cameras that look in all directions, to what is far away.
    Outdoors,
}

impl Kind {
    /// The kind in a word or two.
    pub fn name(self) -> &'static str {
        match self {
            Self::CutOut => "cut-out",
            Self::PlainBackground => "plain-background",
            Self::ForwardFacing => "forward-facing",
            Self::Surrounded => "surrounded",
            Self::Room => "room",
            Self::Outdoors => "outdoors",
        }
    }
}

/// A kind and what tells it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Classified {
    /// The kind.
    pub kind: Kind,
    /// The share of the cameras that have the point nearest to all axes in the middle of their pictures.
    pub at_one_thing: f64,
    /// The length of the mean direction of view: 1 if all look one way.
    pub one_way: f64,
}

impl Classified {
    /// The kind of a capture by the cameras that do not contradict the others, the background of its photographs, and
    /// whether much is far away.
    pub(super) fn of(cameras: &[Camera], is_opaque: bool, is_plain: bool, is_wide: bool) -> Self {
        let count = cameras.len().max(1) as f64;
        let focus = CameraBounds::from_cameras(cameras.iter()).focus;
        let is_middle = |camera: &&Camera| {
            let [width, height] = [camera.width, camera.height].map(f64::from);
            camera.project(focus).is_some_and(|at| {
                (at.x / width - 0.5).abs() < 0.5 * MIDDLE && (at.y / height - 0.5).abs() < 0.5 * MIDDLE
            })
        };
        let at_one_thing = cameras.iter().filter(is_middle).count() as f64 / count;
        let one_way = cameras.iter().map(|camera| -camera.world_from_camera.z_axis).sum::<DVec3>().length() / count;
        let kind = match (is_opaque, at_one_thing >= AT_ONE_THING) {
            (false, _) => Kind::CutOut,
            (true, true) if is_plain => Kind::PlainBackground,
            _ if one_way >= ONE_WAY => Kind::ForwardFacing,
            (true, true) => Kind::Surrounded,
            (true, false) if is_wide => Kind::Outdoors,
            (true, false) => Kind::Room,
        };
        Self { kind, at_one_thing, one_way }
    }
}

impl fmt::Display for Classified {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { kind, at_one_thing, one_way } = self;
        let thing = 100.0 * at_one_thing;
        let way = 100.0 * one_way;
        match kind {
            Kind::CutOut => write!(f, "a thing without background: photographs are transparent around it"),
            Kind::PlainBackground => {
                write!(
                    f,
                    "a thing before one color, which is along the borders of the photographs; {thing:.0} % look at it"
                )
            }
            Kind::ForwardFacing => write!(f, "seen from one side: directions of view agree to {way:.0} %"),
            Kind::Surrounded => {
                write!(f, "a thing and what surrounds it: {thing:.0} % of the cameras look at one point")
            }
            Kind::Room => {
                write!(f, "a room from within: {thing:.0} % of the cameras look at one point, and nothing is far away")
            }
            Kind::Outdoors => {
                write!(f, "a place from within: {thing:.0} % of the cameras look at one point, and much is far away")
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Cameras at `positions` that look at a target each.
    fn cameras(positions: impl Iterator<Item = (DVec3, DVec3)>) -> Vec<Camera> {
        positions.map(|(at, target)| Camera::looking_at([40, 30], 40.0, at, target, DVec3::Z)).collect()
    }

    /// A place on a circle of radius `radius`, a bit above its plane.
    fn on_circle(n: u32, radius: f64) -> DVec3 {
        let angle = f64::from(n) / 12.0 * std::f64::consts::TAU;
        DVec3::new(radius * angle.cos(), radius * angle.sin(), 0.1)
    }

    #[test]
    fn cameras_and_backgrounds_tell_the_kind() {
        let around = cameras((0..12).map(|n| (on_circle(n, 4.0), DVec3::ZERO)));
        let within = cameras((0..12).map(|n| (on_circle(n, 0.3), on_circle(n, 5.0))));
        let ahead = cameras((0..12).map(|n| (on_circle(n, 0.3), on_circle(n, 0.3) + 9.0 * DVec3::X)));
        for (cameras, [is_opaque, is_plain, is_wide], expected) in [
            (&around, [false, false, false], Kind::CutOut),
            (&around, [true, true, false], Kind::PlainBackground),
            (&around, [true, false, true], Kind::Surrounded),
            (&within, [true, false, false], Kind::Room),
            (&within, [true, true, true], Kind::Outdoors),
            (&ahead, [true, false, false], Kind::ForwardFacing),
        ] {
            let found = Classified::of(cameras, is_opaque, is_plain, is_wide);
            assert_eq!(found.kind, expected, "{found:?}");
            let text = found.to_string();
            assert!(text.is_ascii() && !text.contains('\n'), "{text}");
        }
        assert!((Classified::of(&around, true, false, false).at_one_thing - 1.0).abs() < 1e-12);
        assert!((Classified::of(&ahead, true, false, false).one_way - 1.0).abs() < 1e-12);
    }
}
