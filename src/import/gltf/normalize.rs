//! The entries of a document as the types of `gltf` read them. The format allows more than these types: `extras` of any
//! type, and whole numbers written as floats. Of extensions, those of [`DECODED`] are kept.

use std::fmt;
use std::marker::PhantomData;

use serde::de::{DeserializeSeed, Error as _, IgnoredAny, MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer};
use serde_json::{Map, Value};

use super::{draco, meshopt, splats};

/// Entries of one list, and values of one entry. Two characters of JSON may become hundreds of bytes in memory.
const MAX_ENTRIES: usize = 1 << 20;
/// The extensions whose contents are read; those of others are dropped.
pub(super) const DECODED: [&str; 6] =
    [draco::NAME, meshopt::NAMES[0], meshopt::NAMES[1], splats::NAME, splats::SPZ_NAMES[0], splats::SPZ_NAMES[1]];
/// 2^53: larger whole numbers are not exact as floats.
const MAX_WHOLE: f64 = 9007199254740992.0;

/// A list of at most [`MAX_ENTRIES`].
pub(super) fn few<'de, D: Deserializer<'de>, T: Deserialize<'de>>(list: D) -> Result<Vec<T>, D::Error> {
    few_of(list, |_| {})
}

/// A list of at most [`MAX_ENTRIES`] meshes. The attributes of splats, whose names the types do not know, become a part
/// of the extension.
pub(super) fn meshes<'de, D: Deserializer<'de>, T: Deserialize<'de>>(list: D) -> Result<Vec<T>, D::Error> {
    few_of(list, |mesh| {
        let primitives = mesh.get_mut("primitives").and_then(Value::as_array_mut);
        primitives.into_iter().flatten().for_each(splats::move_attributes);
    })
}

fn few_of<'de, D: Deserializer<'de>, T: Deserialize<'de>>(list: D, adjust: fn(&mut Value)) -> Result<Vec<T>, D::Error> {
    struct Few<T>(fn(&mut Value), PhantomData<T>);
    impl<'de, T: Deserialize<'de>> Visitor<'de> for Few<T> {
        type Value = Vec<T>;

        fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
            write!(formatter, "a list of at most {MAX_ENTRIES}")
        }

        fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Vec<T>, A::Error> {
            let mut entries = Vec::new();
            while let Some(mut entry) = list.next_element_seed(Normal { left: &mut MAX_ENTRIES.clone() })? {
                if entries.len() == MAX_ENTRIES {
                    return Err(A::Error::invalid_length(MAX_ENTRIES + 1, &self));
                }
                (self.0)(&mut entry);
                entries.push(T::deserialize(entry).map_err(A::Error::custom)?);
            }
            Ok(entries)
        }
    }
    list.deserialize_seq(Few(adjust, PhantomData))
}

/// One entry.
pub(super) fn one<'de, D: Deserializer<'de>, T: Deserialize<'de>>(entry: D) -> Result<T, D::Error> {
    T::deserialize(Normal { left: &mut MAX_ENTRIES.clone() }.deserialize(entry)?).map_err(D::Error::custom)
}

/// Reads a value without `extras`, and with whole numbers as integers.
struct Normal<'a> {
    /// Values that may still be read.
    left: &'a mut usize,
}

impl<'de> DeserializeSeed<'de> for Normal<'_> {
    type Value = Value;

    fn deserialize<D: Deserializer<'de>>(self, value: D) -> Result<Value, D::Error> {
        let left = self.left.checked_sub(1);
        *self.left = left.ok_or_else(|| D::Error::custom(format!("an entry has more than {MAX_ENTRIES} values")))?;
        value.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for Normal<'_> {
    type Value = Value;

    fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("a JSON value")
    }

    fn visit_unit<E>(self) -> Result<Value, E> {
        Ok(Value::Null)
    }

    fn visit_bool<E>(self, value: bool) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_u64<E>(self, value: u64) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_i64<E>(self, value: i64) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_f64<E>(self, value: f64) -> Result<Value, E> {
        let whole = value.fract() == 0.0 && (0.0..=MAX_WHOLE).contains(&value);
        Ok(if whole { (value as u64).into() } else { value.into() })
    }

    fn visit_str<E>(self, value: &str) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Value, A::Error> {
        let mut values = Vec::new();
        while let Some(value) = list.next_element_seed(Normal { left: self.left })? {
            values.push(value);
        }
        Ok(Value::Array(values))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Value, A::Error> {
        let mut values = Map::new();
        while let Some(key) = map.next_key::<String>()? {
            if key == "extras" {
                map.next_value::<IgnoredAny>()?;
            } else {
                let mut value = map.next_value_seed(Normal { left: self.left })?;
                if let (true, Value::Object(extensions)) = (key == "extensions", &mut value) {
                    extensions.retain(|name, _| DECODED.contains(&name.as_str()));
                }
                values.insert(key, value);
            }
        }
        Ok(Value::Object(values))
    }
}
