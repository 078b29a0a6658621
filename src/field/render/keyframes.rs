//! Camera paths as JSON, as `docs/camera-paths.md` describes them.
//!
//! In: the bytes of an untrusted file. Out: a path, in the dataset's space. Opens no files.

use glam::{DQuat, DVec3};
use serde::de::{Error as _, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};

use strivec_format::geometry::{Camera, CameraPath, Keyframe, NotRigid, PathError, Viewpoint, rigid};
use strivec_format::{Invalid, Place};

/// The value of the key `format`.
const FORMAT: &str = "strivec-camera-path";
/// The only version of the format.
const VERSION: u64 = 1;
/// The most keyframes of a path.
pub const MAX_KEYFRAMES: usize = 10_000;
/// The most bytes of a file, more than [`MAX_KEYFRAMES`] keyframes need.
pub const MAX_KEYFRAMES_BYTES: u64 = 16 << 20;
/// The range of the vertical field of view, in degrees.
const FIELD_OF_VIEW: std::ops::RangeInclusive<f64> = 0.1..=170.0;

/// Reasons why bytes are not a camera path.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum KeyframesError {
    /// The file is larger than [`MAX_KEYFRAMES_BYTES`].
    #[error("a camera path has at most {MAX_KEYFRAMES_BYTES} bytes, this file has more")]
    TooLarge,
    /// Invalid JSON, or JSON of another layout. The source names line and column.
    #[error("not the JSON of a camera path: {0}")]
    Json(#[from] serde_json::Error),
    /// The key `format` has another value.
    #[error(transparent)]
    Format(Invalid),
    /// A version that this build does not support.
    #[error("this build reads version {VERSION} of camera paths, this file has version {0}")]
    Version(u64),
    /// An invalid camera of a keyframe.
    #[error("keyframe {index}: {invalid}")]
    Camera {
        /// The keyframe's index, from 0.
        index: usize,
        /// The JSON key with its value.
        invalid: Invalid,
    },
    /// Keyframes that do not form a path.
    #[error(transparent)]
    Path(#[from] PathError),
}

/// Read first, so that another version is not reported as a malformed file.
#[derive(Deserialize)]
struct KeyframesHeader {
    format: String,
    version: u64,
}

#[derive(Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct KeyframesFile {
    format: String,
    version: u64,
    #[serde(deserialize_with = "bounded_keyframes")]
    keyframes: Vec<Moment>,
}

/// One keyframe. Its camera is either a matrix, or a position, a target and an up direction.
#[derive(Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
struct Moment {
    seconds: f64,
    vertical_fov_degrees: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    position: Option<[f64; 3]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    target: Option<[f64; 3]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    up: Option<[f64; 3]>,
    /// Rows of `world_from_camera`.
    #[serde(skip_serializing_if = "Option::is_none")]
    transform_matrix: Option<[[f64; 4]; 4]>,
}

/// Reads the camera path of a file's `bytes`.
///
/// # Errors
///
/// [`KeyframesError`].
pub fn read_keyframes(bytes: &[u8]) -> Result<CameraPath, KeyframesError> {
    if bytes.len() as u64 > MAX_KEYFRAMES_BYTES {
        return Err(KeyframesError::TooLarge);
    }
    // First the head alone, so that a file of another format or version is refused as such, not for a missing key.
    let KeyframesHeader { format, version } = serde_json::from_slice(bytes)?;
    if format != FORMAT {
        let place = Place::Key("format".into());
        return Err(KeyframesError::Format(Invalid::new(
            place,
            format_args!("{FORMAT:?}"),
            format_args!("{format:?}"),
        )));
    }
    if version != VERSION {
        return Err(KeyframesError::Version(version));
    }
    let file: KeyframesFile = serde_json::from_slice(bytes)?;
    let keyframes = file.keyframes.iter().enumerate().map(|(index, moment)| moment.keyframe(index));
    Ok(CameraPath::new(keyframes.collect::<Result<_, _>>()?)?)
}

/// The file of `path`. [`read_keyframes`] accepts it if the path has at most [`MAX_KEYFRAMES`] keyframes.
pub fn write_keyframes(path: &CameraPath) -> String {
    let keyframes = path.keyframes().iter().map(Moment::from).collect();
    let file = KeyframesFile { format: FORMAT.into(), version: VERSION, keyframes };
    serde_json::to_string_pretty(&file).expect("plain data") + "\n"
}

impl From<&Keyframe> for Moment {
    fn from(keyframe: &Keyframe) -> Self {
        let Keyframe { seconds, viewpoint } = keyframe;
        let axes = glam::DMat3::from_quat(viewpoint.rotation);
        let row = |n: usize| [axes.x_axis[n], axes.y_axis[n], axes.z_axis[n], viewpoint.position[n]];
        Self {
            seconds: *seconds,
            vertical_fov_degrees: viewpoint.vertical_angle.to_degrees(),
            position: None,
            target: None,
            up: None,
            transform_matrix: Some([row(0), row(1), row(2), [0.0, 0.0, 0.0, 1.0]]),
        }
    }
}

impl Moment {
    fn keyframe(&self, index: usize) -> Result<Keyframe, KeyframesError> {
        let refused = |key: &str, expected: &str, found: String| KeyframesError::Camera {
            index,
            invalid: Invalid::new(Place::Key(key.into()), expected, found),
        };
        let degrees = self.vertical_fov_degrees;
        if !FIELD_OF_VIEW.contains(&degrees) {
            let expected = format!("{} to {} degrees", FIELD_OF_VIEW.start(), FIELD_OF_VIEW.end());
            return Err(refused("vertical_fov_degrees", &expected, degrees.to_string()));
        }
        let (axes, position) = match (self.transform_matrix, self.position, self.target, self.up) {
            (Some(rows), None, None, None) => {
                rigid(&rows).map_err(|NotRigid { expected, found }| refused("transform_matrix", expected, found))?
            }
            (None, Some(position), Some(target), Some(up)) => {
                let [position, target, up] = [position, target, up].map(DVec3::from_array);
                let back = (position - target).try_normalize();
                let back =
                    back.ok_or_else(|| refused("target", "another point than `position`", target.to_string()))?;
                let right = up.try_normalize().map(|up| up.cross(back)).filter(|right| right.length() > 1e-6);
                if right.is_none() {
                    return Err(refused("up", "a direction that is not along the line of sight", up.to_string()));
                }
                let up = up.normalize();
                (Camera::looking_at([1, 1], 1.0, position, position - back, up).world_from_camera, position)
            }
            _ => {
                let given = [
                    ("transform_matrix", self.transform_matrix.is_some()),
                    ("position", self.position.is_some()),
                    ("target", self.target.is_some()),
                    ("up", self.up.is_some()),
                ];
                let given: Vec<_> = given.iter().filter(|(_, given)| *given).map(|(key, _)| *key).collect();
                let found = if given.is_empty() { "none of them".into() } else { given.join(", ") };
                return Err(refused(
                    "camera",
                    "given by `transform_matrix`, or by `position`, `target` and `up`",
                    found,
                ));
            }
        };
        let rotation = DQuat::from_mat3(&axes).normalize();
        let viewpoint = Viewpoint { position, rotation, vertical_angle: degrees.to_radians() };
        Ok(Keyframe { seconds: self.seconds, viewpoint })
    }
}

/// Reads a list of at most [`MAX_KEYFRAMES`] keyframes and stops at the first one too many, which bounds the memory
/// used.
fn bounded_keyframes<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<Moment>, D::Error> {
    struct Bounded;
    impl<'de> Visitor<'de> for Bounded {
        type Value = Vec<Moment>;

        fn expecting(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
            write!(formatter, "a list of at most {MAX_KEYFRAMES} keyframes")
        }

        fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Self::Value, A::Error> {
            let mut moments = Vec::new();
            while let Some(moment) = list.next_element()? {
                if moments.len() == MAX_KEYFRAMES {
                    return Err(A::Error::custom(format_args!(
                        "a path has at most {MAX_KEYFRAMES} keyframes, this file has more"
                    )));
                }
                moments.push(moment);
            }
            Ok(moments)
        }
    }
    deserializer.deserialize_seq(Bounded)
}

#[cfg(test)]
mod tests {
    use super::*;

    const LOOKING: &str = r#""vertical_fov_degrees": 40, "position": [4, 0, 1], "target": [0, 0, 1], "up": [0, 0, 2]"#;

    fn file(keyframes: &str) -> String {
        format!(r#"{{"format": "strivec-camera-path", "version": 1, "keyframes": [{keyframes}]}}"#)
    }

    fn refused(text: &str) -> String {
        read_keyframes(text.as_bytes()).map(drop).unwrap_err().to_string()
    }

    #[test]
    fn both_ways_to_write_a_camera_are_the_same_camera() {
        let matrix = r#""vertical_fov_degrees": 40,
            "transform_matrix": [[0, 0, 1, 4], [1, 0, 0, 0], [0, 1, 0, 1], [0, 0, 0, 1]]"#;
        let path =
            read_keyframes(file(&format!("{{\"seconds\": 0, {LOOKING}}}, {{\"seconds\": 2.5, {matrix}}}")).as_bytes());
        let path = path.unwrap();
        let [a, b] = [path.keyframes()[0], path.keyframes()[1]];
        assert_eq!((a.seconds, b.seconds, path.keyframes().len()), (0.0, 2.5, 2));
        assert_eq!(a.viewpoint.position, DVec3::new(4.0, 0.0, 1.0));
        assert!((a.viewpoint.rotation * DVec3::NEG_Z - DVec3::NEG_X).length() < 1e-12);
        assert!(a.viewpoint.rotation.angle_between(b.viewpoint.rotation) < 1e-7);
        assert!((a.viewpoint.vertical_angle - 40f64.to_radians()).abs() < 1e-15);
    }

    #[test]
    fn what_is_written_is_read() {
        let viewpoint = |x: f64| Viewpoint {
            position: DVec3::new(x, 0.1, -1e6),
            rotation: DQuat::from_rotation_y(x).normalize(),
            vertical_angle: 0.3 + 0.1 * x,
        };
        let keyframes = (0..5).map(|n| Keyframe { seconds: 0.1 * f64::from(n), viewpoint: viewpoint(f64::from(n)) });
        let path = CameraPath::new(keyframes.collect()).unwrap();
        let again = read_keyframes(write_keyframes(&path).as_bytes()).unwrap();
        for (a, b) in path.keyframes().iter().zip(again.keyframes()) {
            assert_eq!((a.seconds, a.viewpoint.position), (b.seconds, b.viewpoint.position));
            assert!(a.viewpoint.rotation.angle_between(b.viewpoint.rotation) < 1e-7);
            assert!((a.viewpoint.vertical_angle - b.viewpoint.vertical_angle).abs() < 1e-12);
        }
    }

    #[test]
    fn what_is_no_camera_path_is_refused_with_its_place() {
        let one = |keyframe: &str| file(&format!("{{{keyframe}}}"));
        let looking = |from: &str, to: &str| one(&format!("\"seconds\": 0, {}", LOOKING.replace(from, to)));
        for (text, expected) in [
            (String::new(), "line 1 column 0"),
            ("[]".into(), "not the JSON of a camera path"),
            (
                file("").replace("strivec-camera-path", "gltf"),
                "`format` must be \"strivec-camera-path\"; found \"gltf\"",
            ),
            (file("").replace("1,", "2,"), "this build reads version 1 of camera paths, this file has version 2"),
            (file("").replace("1,", "-1,"), "expected u64 at line 1"),
            (file(""), "a camera path must have at least one keyframe; found none"),
            (file("{}"), "missing field `seconds` at line 1"),
            (one(&format!("\"seconds\": NaN, {LOOKING}")), "expected value at line 1"),
            (one(&format!("\"seconds\": 1e999, {LOOKING}")), "number out of range at line 1"),
            (
                one(&format!("\"seconds\": -1, {LOOKING}")),
                "keyframe 0: seconds must be from 0 (after the previous keyframe) to 1000000; found -1",
            ),
            (one(&format!("\"seconds\": 0, \"fov\": 3, {LOOKING}")), "unknown field `fov`"),
            (
                one("\"seconds\": 0, \"vertical_fov_degrees\": 40"),
                "by `transform_matrix`, or by `position`, `target` and `up`; found none of them",
            ),
            (
                looking("\"up\": [0, 0, 2]", "\"up\": null"),
                "keyframe 0: `camera` must be given by `transform_matrix`, or by `position`, `target`",
            ),
            (looking("40", "180"), "keyframe 0: `vertical_fov_degrees` must be 0.1 to 170 degrees; found 180"),
            (looking("[4, 0, 1]", "[0, 0, 1]"), "keyframe 0: `target` must be another point than `position`"),
            (looking("[4, 0, 1]", "[1e300, 0, 1]"), "keyframe 0: `target` must be another point than `position`"),
            (looking("[4, 0, 1]", "[4e12, 0, 1]"), "keyframe 0: position must be within ±1e12 on every axis"),
            (
                looking("[0, 0, 2]", "[1, 0, 0]"),
                "keyframe 0: `up` must be a direction that is not along the line of sight",
            ),
            (
                looking("[0, 0, 2]", "[0, 0, 0]"),
                "keyframe 0: `up` must be a direction that is not along the line of sight",
            ),
            (looking("[0, 0, 2]", "[0, 0]"), "invalid length 2"),
            (
                one(
                    r#""seconds": 0, "vertical_fov_degrees": 9, "transform_matrix": [[2,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]"#,
                ),
                "keyframe 0: `transform_matrix` must be an orthonormal rotation within 0.001",
            ),
            (
                file(&["3", "2"].map(|n| format!("{{\"seconds\": {n}, {LOOKING}}}")).join(",")),
                "keyframe 1: seconds must be from 3.000001 (after the previous keyframe) to 1000000; found 2",
            ),
            (format!("{}{}", file(""), "x"), "trailing characters"),
            (format!("{{\"format\": {}", "[".repeat(100_000)), "at line 1"),
        ] {
            let message = refused(&text);
            assert!(message.contains(expected), "{expected}: {message}");
            assert!(message.lines().count() == 1 && message.len() < 300, "{message}");
        }
    }

    #[test]
    fn a_million_keyframes_are_refused_early() {
        let one = format!("{{\"seconds\": 0, {LOOKING}}}");
        let many = file(&vec![one; MAX_KEYFRAMES + 1].join(","));
        assert!(refused(&many).contains("a path has at most 10000 keyframes, this file has more at line 1 column"));
        assert_eq!(
            refused(&" ".repeat(MAX_KEYFRAMES_BYTES as usize + 1)),
            "a camera path has at most 16777216 bytes, this file has more"
        );
        let million = file(&vec!["{}"; 1_000_000].join(","));
        assert!(refused(&million).contains("missing field"));
    }
}
