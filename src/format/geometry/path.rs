//! Camera paths: interpolation between keyframes. No files and no clock.
//!
//! Positions follow a centripetal Catmull-Rom spline, which has no loops and overshoots little if keyframes are at
//! uneven distances. Rotations and the field of view are interpolated in the same way. If the times of the keyframes
//! are in proportion to the spline's own parameter, as evenly spaced keyframes at equal intervals are, the path is
//! exactly that spline. Otherwise the camera passes a keyframe at the slower of the spline's speeds before and after
//! it, so that its speed is continuous. The camera rests between two equal keyframes.

use glam::{DQuat, DVec3};

use super::Viewpoint;
use crate::Invalid;

/// The least interval between keyframes, in seconds.
const MIN_SECONDS: f64 = 1e-6;
/// The latest time of a keyframe, in seconds.
const MAX_SECONDS: f64 = 1e6;
/// The largest absolute value of a coordinate.
const LARGEST_COORDINATE: f64 = 1e12;
/// The largest deviation of a rotation's length from 1.
const TOLERANCE: f64 = 1e-6;

/// A viewpoint and its time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Keyframe {
    /// The time in seconds, from the origin of the path's clock.
    pub seconds: f64,
    /// The viewpoint at that time.
    pub viewpoint: Viewpoint,
}

/// Reasons why keyframes do not form a path.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PathError {
    /// There are no keyframes.
    #[error("a camera path must have at least one keyframe; found none")]
    Empty,
    /// An invalid keyframe.
    #[error("keyframe {index}: {invalid}")]
    Keyframe {
        /// The keyframe's index, from 0.
        index: usize,
        /// The quantity.
        invalid: Invalid,
    },
}

/// A camera path through keyframes.
#[derive(Clone, Debug, PartialEq)]
pub struct CameraPath {
    /// At least one keyframe, in ascending order of time.
    keyframes: Vec<Keyframe>,
    /// The camera's motion at each keyframe.
    passing: Vec<Motion>,
}

/// Changes per second, or between two keyframes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Motion {
    position: DVec3,
    /// Axis times radians; the axis is in the camera's own axes.
    rotation: DVec3,
    zoom: f64,
}

impl CameraPath {
    /// The path through `keyframes`.
    ///
    /// # Errors
    ///
    /// If there are no keyframes, a time is not from 0 to a million seconds or not at least a microsecond after the
    /// previous one, a coordinate is beyond 1e12, a rotation is not of length 1, or an angle is not between 0 and π.
    pub fn new(keyframes: Vec<Keyframe>) -> Result<Self, PathError> {
        if keyframes.is_empty() {
            return Err(PathError::Empty);
        }
        let mut earliest = 0.0;
        for (index, Keyframe { seconds, viewpoint }) in keyframes.iter().enumerate() {
            let check = |holds: bool, what: &str, expected: &dyn Fn() -> String, found: &dyn std::fmt::Debug| {
                let refused = || PathError::Keyframe {
                    index,
                    invalid: Invalid::new(what, expected(), format_args!("{found:?}")),
                };
                if holds { Ok(()) } else { Err(refused()) }
            };
            let times = || format!("from {earliest} (after the previous keyframe) to {MAX_SECONDS}");
            check((earliest..=MAX_SECONDS).contains(seconds), "seconds", &times, seconds)?;
            earliest = seconds + MIN_SECONDS;
            let Viewpoint { position, rotation, vertical_angle } = viewpoint;
            let within = position.is_finite() && position.abs().max_element() <= LARGEST_COORDINATE;
            check(
                within,
                "position",
                &|| format!("within ±{LARGEST_COORDINATE:e} on every axis"),
                &position.to_array(),
            )?;
            let unit = (rotation.length() - 1.0).abs() <= TOLERANCE;
            check(unit, "rotation", &|| "a unit quaternion".into(), &rotation.to_array())?;
            let angle = (1e-6..=std::f64::consts::PI - 1e-6).contains(vertical_angle);
            check(angle, "vertical angle", &|| "between 0 and π radians".into(), vertical_angle)?;
        }
        let changes: Vec<_> =
            keyframes.windows(2).map(|pair| (change(pair), pair[1].seconds - pair[0].seconds)).collect();
        let passing = (0..keyframes.len())
            .map(|n| passing(n.checked_sub(1).map(|before| changes[before]), changes.get(n).copied()))
            .collect();
        Ok(Self { keyframes, passing })
    }

    /// The keyframes: at least one, in ascending order of time.
    pub fn keyframes(&self) -> &[Keyframe] {
        &self.keyframes
    }

    /// The time of the first keyframe, in seconds.
    pub fn start(&self) -> f64 {
        self.keyframes[0].seconds
    }

    /// The time of the last keyframe, in seconds.
    pub fn end(&self) -> f64 {
        self.keyframes[self.keyframes.len() - 1].seconds
    }

    /// The viewpoint at `seconds`; before the first keyframe that of the first, after the last that of the last.
    pub fn at(&self, seconds: f64) -> Viewpoint {
        let reached = self.keyframes.partition_point(|keyframe| keyframe.seconds <= seconds);
        let Some(next) = self.keyframes.get(reached) else { return self.keyframes[reached - 1].viewpoint };
        let Some(last) = reached.checked_sub(1) else { return next.viewpoint };
        let (a, b) = (&self.keyframes[last].viewpoint, &next.viewpoint);
        let span = next.seconds - self.keyframes[last].seconds;
        let along = (seconds - self.keyframes[last].seconds) / span;
        let (leaving, coming) = (&self.passing[last], &self.passing[reached]);
        let turned = |from: DQuat, by: DVec3| from * DQuat::from_scaled_axis(span / 3.0 * by);
        let moved = |from: DVec3, by: DVec3| from + span / 3.0 * by;
        let zoomed = |from: f64, by: f64| from + span / 3.0 * by;
        let position =
            [a.position, moved(a.position, leaving.position), moved(b.position, -coming.position), b.position];
        let rotation =
            [a.rotation, turned(a.rotation, leaving.rotation), turned(b.rotation, -coming.rotation), b.rotation];
        let zoom = [a.zoom(), zoomed(a.zoom(), leaving.zoom), zoomed(b.zoom(), -coming.zoom), b.zoom()];
        Viewpoint {
            position: bezier(position, |a, b| a.lerp(b, along)),
            rotation: bezier(rotation, |a, b| a.slerp(b, along)).normalize(),
            vertical_angle: 2.0 * (-bezier(zoom, |a, b| a + along * (b - a))).exp().atan(),
        }
    }
}

/// The change from one keyframe to the next, with the rotation by the shorter way.
fn change(pair: &[Keyframe]) -> Motion {
    let [a, b] = [&pair[0].viewpoint, &pair[1].viewpoint];
    let turn = a.rotation.conjugate() * b.rotation;
    let shorter = if turn.w < 0.0 { -turn } else { turn };
    Motion { position: b.position - a.position, rotation: shorter.to_scaled_axis(), zoom: b.zoom() - a.zoom() }
}

/// The motion at a keyframe between the changes `before` and `after` it, each with its duration in seconds.
fn passing(before: Option<(Motion, f64)>, after: Option<(Motion, f64)>) -> Motion {
    let speed = |of: fn(&Motion) -> DVec3| {
        let part = |change: (Motion, f64)| (of(&change.0), change.1);
        passing_speed(before.map(part), after.map(part))
    };
    let zoom = speed(|motion| DVec3::new(motion.zoom, 0.0, 0.0)).x;
    Motion { position: speed(|motion| motion.position), rotation: speed(|motion| motion.rotation), zoom }
}

fn passing_speed(before: Option<(DVec3, f64)>, after: Option<(DVec3, f64)>) -> DVec3 {
    match (before, after) {
        (Some((a, a_seconds)), Some((b, b_seconds))) => {
            // Steps of the centripetal spline's parameter: square roots of distances.
            let (h, k) = (a.length().sqrt(), b.length().sqrt());
            if h == 0.0 || k == 0.0 {
                return DVec3::ZERO;
            }
            (a / h + b / k - (a + b) / (h + k)) * (h / a_seconds).min(k / b_seconds)
        }
        (Some((change, seconds)), None) | (None, Some((change, seconds))) => change / seconds,
        (None, None) => DVec3::ZERO,
    }
}

/// The cubic Bézier curve of four points; `between` interpolates between two points at the curve's parameter.
fn bezier<T: Copy>([a, b, c, d]: [T; 4], between: impl Fn(T, T) -> T) -> T {
    let middle = between(b, c);
    between(between(between(a, b), middle), between(middle, between(c, d)))
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;
    use crate::geometry::Camera;

    fn viewpoint(position: [f64; 3], rotation: DQuat) -> Viewpoint {
        Viewpoint { position: DVec3::from_array(position), rotation, vertical_angle: 0.7 }
    }

    fn path(viewpoints: &[(f64, Viewpoint)]) -> CameraPath {
        let keyframe = |&(seconds, viewpoint)| Keyframe { seconds, viewpoint };
        CameraPath::new(viewpoints.iter().map(keyframe).collect()).unwrap()
    }

    /// Keyframes at uneven distances, times, rotations and zooms.
    fn winding() -> CameraPath {
        let at = |position, axis: DVec3, angle, vertical_angle| {
            let rotation = DQuat::from_axis_angle(axis.normalize(), angle);
            Viewpoint { vertical_angle, ..viewpoint(position, rotation) }
        };
        path(&[
            (1.0, at([0.0, 0.0, 0.0], DVec3::Z, 0.1, 0.5)),
            (1.5, at([1.0, 0.2, 0.0], DVec3::X, 1.4, 0.9)),
            (4.0, at([1.1, 5.0, -1.0], DVec3::ONE, 3.0, 0.9)),
            (4.1, at([1.1, 5.0, -1.0], DVec3::ONE, 3.0, 0.2)),
            (9.0, at([-3.0, 2.0, 2.0], DVec3::new(0.0, 1.0, 2.0), -2.0, 1.5)),
        ])
    }

    fn apart(a: &Viewpoint, b: &Viewpoint) -> f64 {
        let turn = 2.0 * (1.0 - a.rotation.dot(b.rotation).abs()).max(0.0).sqrt();
        (a.position - b.position).length() + turn + (a.vertical_angle - b.vertical_angle).abs()
    }

    #[test]
    fn a_path_passes_through_its_keyframes_and_stands_at_its_ends() {
        let path = winding();
        for keyframe in path.keyframes() {
            for seconds in [keyframe.seconds, keyframe.seconds - 1e-9, keyframe.seconds + 1e-9] {
                assert!(apart(&path.at(seconds), &keyframe.viewpoint) < 1e-6, "{seconds}");
            }
        }
        assert_eq!((path.start(), path.end()), (1.0, 9.0));
        assert_eq!(path.at(-5.0), path.keyframes()[0].viewpoint);
        assert_eq!(path.at(1e9), path.keyframes()[4].viewpoint);
    }

    #[test]
    fn neither_place_nor_speed_jumps() {
        let path = winding();
        let speed = |seconds: f64| {
            let (a, b) = (path.at(seconds - 1e-5), path.at(seconds + 1e-5));
            let turn = (a.rotation.conjugate() * b.rotation).xyz() * (a.rotation.dot(b.rotation)).signum();
            ((b.position - a.position) / 2e-5, turn / 1e-5, (b.vertical_angle - a.vertical_angle) / 2e-5)
        };
        for n in 1..4 {
            let at = path.keyframes()[n].seconds;
            let (before, after) = (speed(at - 2e-5), speed(at + 2e-5));
            let jump = (before.0 - after.0).length() + (before.1 - after.1).length() + (before.2 - after.2).abs();
            assert!(jump < 0.02, "{n}: {before:?}, {after:?}");
        }
        let rests = (0..=10).map(|n| path.at(4.0 + 0.01 * f64::from(n)));
        assert!(rests.into_iter().all(|v| (v.position - path.at(4.0).position).length() < 1e-12));
    }

    #[test]
    fn between_equal_keyframes_the_speed_is_one() {
        let turned = |n: f64| viewpoint([n, -2.0 * n, 0.5 * n], DQuat::from_rotation_z(0.8 * n));
        let path = path(&[0.0, 1.0, 2.0, 3.0].map(|n| (2.0 * n, turned(n))));
        for n in 0..=60 {
            let seconds = 0.1 * f64::from(n);
            assert!(apart(&path.at(seconds), &turned(0.5 * seconds)) < 1e-7, "{seconds}: {:?}", path.at(seconds));
        }
    }

    #[test]
    fn a_line_at_uneven_times_is_never_gone_back_or_left() {
        let along = |x: f64| viewpoint([x, 0.0, 0.0], DQuat::IDENTITY);
        let path =
            path(&[(0.0, along(0.0)), (1.0, along(0.01)), (1.2, along(9.0)), (8.0, along(9.1)), (9.0, along(50.0))]);
        let places: Vec<DVec3> = (0..=9000).map(|n| path.at(1e-3 * f64::from(n)).position).collect();
        assert!(places.windows(2).all(|pair| pair[0].x <= pair[1].x + 1e-12));
        assert!(places.iter().all(|place| place.y == 0.0 && place.z == 0.0));
    }

    #[test]
    fn one_keyframe_is_a_standing_camera_and_two_are_a_straight_way() {
        let a = viewpoint([1.0, 2.0, 3.0], DQuat::from_rotation_x(0.3));
        let one = path(&[(2.0, a)]);
        assert!([0.0, 2.0, 3.0, f64::INFINITY, f64::NAN].iter().all(|&seconds| one.at(seconds) == a));
        let b = Viewpoint { vertical_angle: 1.4, ..viewpoint([3.0, 2.0, 3.0], DQuat::from_rotation_x(-0.5)) };
        let middle = path(&[(0.0, a), (4.0, b)]).at(2.0);
        assert!((middle.position - DVec3::new(2.0, 2.0, 3.0)).length() < 1e-12);
        assert!(middle.rotation.angle_between(DQuat::from_rotation_x(-0.1)) < 1e-6);
        let (tan, zoom) = (|angle: f64| (0.5 * angle).tan(), (0.5 * middle.vertical_angle).tan());
        assert!((zoom * zoom - tan(0.7) * tan(1.4)).abs() < 1e-12, "as many times wider as the other is wider still");
    }

    #[test]
    fn opposite_directions_are_turned_between_in_the_level() {
        // Cameras that look along x and along −x, z upwards; the same rotations with either sign.
        let level = |towards: DVec3| {
            let camera = Camera::looking_at([2, 2], 1.0, DVec3::ZERO, towards, DVec3::Z);
            Viewpoint::from_camera(&camera)
        };
        let (a, b) = (level(DVec3::X), level(-DVec3::X));
        for b in [b, Viewpoint { rotation: -b.rotation, ..b }] {
            let path = path(&[(0.0, a), (1.0, b), (2.0, a)]);
            for n in 0..=40 {
                let viewpoint = path.at(0.05 * f64::from(n));
                let (back, up) = (viewpoint.rotation * DVec3::Z, viewpoint.rotation * DVec3::Y);
                assert!((viewpoint.rotation.length() - 1.0).abs() < 1e-12);
                assert!(back.z.abs() < 1e-7 && up.z > 1.0 - 1e-7, "{n}: {viewpoint:?}");
            }
            assert!((path.at(0.5).rotation * DVec3::Z).x.abs() < 0.5, "half-way it looks aside");
        }
    }

    #[test]
    fn a_quaternions_sign_changes_nothing_and_identical_ones_stay() {
        let a = viewpoint([0.0; 3], DQuat::from_rotation_y(1.0));
        let negative = Viewpoint { rotation: -a.rotation, ..a };
        let path = path(&[(0.0, a), (1.0, negative), (2.0, a), (3.0, a)]);
        for n in 0..=30 {
            assert!(apart(&path.at(0.1 * f64::from(n)), &a) < 1e-7, "{n}");
        }
    }

    #[test]
    fn what_makes_no_path_is_refused_by_name() {
        let good = Keyframe { seconds: 1.0, viewpoint: viewpoint([0.0; 3], DQuat::IDENTITY) };
        let with = |change: fn(&mut Keyframe)| {
            let mut second = Keyframe { seconds: 2.0, ..good };
            change(&mut second);
            CameraPath::new(vec![good, second]).map(drop)
        };
        assert_eq!(with(|_| ()), Ok(()));
        assert_eq!(CameraPath::new(Vec::new()), Err(PathError::Empty));
        type Change = fn(&mut Keyframe);
        let cases: [(&str, Change); 10] = [
            ("seconds", |k| k.seconds = 1.0),
            ("seconds", |k| k.seconds = 0.5),
            ("seconds", |k| k.seconds = f64::NAN),
            ("seconds", |k| k.seconds = 1e7),
            ("position", |k| k.viewpoint.position.y = f64::NAN),
            ("position", |k| k.viewpoint.position.z = -1e13),
            ("rotation", |k| k.viewpoint.rotation.w = 2.0),
            ("rotation", |k| k.viewpoint.rotation.x = f64::NAN),
            ("vertical angle", |k| k.viewpoint.vertical_angle = 0.0),
            ("vertical angle", |k| k.viewpoint.vertical_angle = PI),
        ];
        for (what, change) in cases {
            let message = with(change).unwrap_err().to_string();
            assert!(message.starts_with(&format!("keyframe 1: {what} must be ")), "{message}");
        }
    }

    #[test]
    fn extreme_keyframes_give_finite_viewpoints() {
        let far = LARGEST_COORDINATE;
        let at = |x: f64, vertical_angle| Viewpoint { vertical_angle, ..viewpoint([x, -x, 1e-300], DQuat::IDENTITY) };
        let path = path(&[
            (0.0, at(far, 1e-6)),
            (1e-6, at(-far, PI - 1e-3)),
            (2e-6, at(5e-324, 1.0)),
            (MAX_SECONDS, at(0.0, 1.0)),
        ]);
        for n in 0..=200 {
            for scale in [1e-8, 5e3] {
                let viewpoint = path.at(scale * f64::from(n));
                assert!(viewpoint.position.is_finite() && viewpoint.rotation.is_normalized(), "{viewpoint:?}");
                assert!(viewpoint.vertical_angle > 0.0 && viewpoint.vertical_angle < PI, "{viewpoint:?}");
            }
        }
    }
}
