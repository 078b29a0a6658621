//! The keys of `transforms.json` that are not read: which are refused, and which are told of.

use std::borrow::Cow;
use std::collections::BTreeSet;
use std::fmt;

use serde::de::{Deserialize, Deserializer, IgnoredAny, MapAccess, Visitor};
use serde_json::Value;
use serde_json::value::RawValue;

/// Keys whose meaning is not supported, with a remedy.
const REFUSED: [(&str, &str); 11] = [
    ("distortion_params", "write its numbers as k1, k2, k3, k4, p1 and p2"),
    ("p3", "its lens is not supported"),
    ("p4", "its lens is not supported"),
    ("s1", "thin prisms are not supported"),
    ("s2", "thin prisms are not supported"),
    ("s3", "thin prisms are not supported"),
    ("s4", "thin prisms are not supported"),
    ("sx1", "thin prisms are not supported"),
    ("sy1", "thin prisms are not supported"),
    ("rolling_shutter", "a moving camera is not supported"),
    ("skew", "skew is not supported"),
];

/// Keys that are read, at the top or in a frame.
const READ: [&str; 33] = [
    "camera_model",
    "is_fisheye",
    "camera_angle_x",
    "camera_angle_y",
    "fl_x",
    "fl_y",
    "cx",
    "cy",
    "w",
    "h",
    "k1",
    "k2",
    "k3",
    "k4",
    "k5",
    "k6",
    "p1",
    "p2",
    "frames",
    "mask_path",
    "ply_file_path",
    "integer_depth_scale",
    "aabb_scale",
    "scale",
    "offset",
    "train_filenames",
    "val_filenames",
    "test_filenames",
    "file_path",
    "transform_matrix",
    "depth_file_path",
    "depth_path",
    // Poses contain it.
    "applied_transform",
];

/// Keys that only tell where a picture comes from, or what the program that wrote the file should do.
const HARMLESS: [&str; 10] = [
    "applied_scale",
    "orientation_override",
    "auto_scale_poses_override",
    "rotation",
    "sharpness",
    "colmap_im_id",
    "camera_id",
    "image_id",
    "name",
    "index",
];

/// The most names that are kept of an object.
const MAX_NAMES: usize = 64;
/// The most bytes of a value whose meaning is looked at.
const MAX_VALUE_BYTES: usize = 1 << 12;
/// The most characters of a value that a message shows.
const SHOWN_CHARACTERS: usize = 60;

/// The keys of an object that are not read.
#[derive(Debug, Default)]
pub(super) struct OtherKeys {
    /// Their names, but for those that tell nothing.
    pub(super) names: BTreeSet<String>,
    /// The first whose meaning is not supported and whose numbers are not 0.
    pub(super) refused: Option<RefusedKey>,
}

/// A key whose meaning is not supported.
#[derive(Debug, PartialEq, Eq)]
pub(super) struct RefusedKey {
    pub(super) key: &'static str,
    pub(super) remedy: &'static str,
    /// The beginning of its value.
    pub(super) value: String,
}

impl<'de> Deserialize<'de> for OtherKeys {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_map(OtherKeysVisitor)
    }
}

struct OtherKeysVisitor;

impl<'de> Visitor<'de> for OtherKeysVisitor {
    type Value = OtherKeys;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("an object")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<OtherKeys, A::Error> {
        let mut keys = OtherKeys::default();
        while let Some(key) = map.next_key::<Cow<'_, str>>()? {
            if let Some((key, remedy)) = REFUSED.into_iter().find(|(refused, _)| *refused == key) {
                let value = map.next_value::<&RawValue>()?.get();
                if keys.refused.is_none() && !is_zero(value) {
                    let value = value.chars().take(SHOWN_CHARACTERS).collect();
                    keys.refused = Some(RefusedKey { key, remedy, value });
                }
                continue;
            }
            map.next_value::<IgnoredAny>()?;
            if keys.names.len() < MAX_NAMES && !READ.contains(&&*key) && !HARMLESS.contains(&&*key) {
                keys.names.insert(key.into_owned());
            }
        }
        Ok(keys)
    }
}

/// True if the JSON `value` has no number but 0.
fn is_zero(value: &str) -> bool {
    fn has_zeros_alone(value: &Value) -> bool {
        match value {
            Value::Null => true,
            Value::Bool(value) => !value,
            Value::Number(number) => number.as_f64() == Some(0.0),
            Value::Array(values) => values.iter().all(has_zeros_alone),
            Value::String(_) | Value::Object(_) => false,
        }
    }
    value.len() <= MAX_VALUE_BYTES && serde_json::from_str(value).is_ok_and(|value| has_zeros_alone(&value))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_are_told_of_or_refused_but_for_zeros() {
        let text = r#"{"w": 8, "name": "a", "odd": [[1]], "skew": 0, "p3": [0, 0.0], "\u0073ecret": {}}"#;
        let keys: OtherKeys = serde_json::from_str(text).unwrap();
        assert_eq!(keys.names.into_iter().collect::<Vec<_>>(), ["odd", "secret"]);
        assert_eq!(keys.refused, None);
        let keys: OtherKeys = serde_json::from_str(r#"{"skew": 0, "rolling_shutter": true, "p4": 1}"#).unwrap();
        let refused = keys.refused.unwrap();
        assert_eq!((refused.key, &*refused.value), ("rolling_shutter", "true"));
        let long = format!(r#"{{"p3": [{}0], "s1": 1}}"#, "0,".repeat(MAX_VALUE_BYTES));
        let refused = serde_json::from_str::<OtherKeys>(&long).unwrap().refused.unwrap();
        assert_eq!((refused.key, refused.value.len()), ("p3", SHOWN_CHARACTERS));
        let many: Vec<String> = (0..MAX_NAMES + 8).map(|n| format!(r#""a{n}": 1"#)).collect();
        let keys: OtherKeys = serde_json::from_str(&format!("{{{}}}", many.join(","))).unwrap();
        assert_eq!(keys.names.len(), MAX_NAMES);
    }
}
