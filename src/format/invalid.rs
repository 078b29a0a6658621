//! Invalid values: one error, with one wording, for all crates.
//!
//! In: the place of a value, the valid values and the value found. Out: a sentence. The error of each crate has [`Invalid`] in
//! it, and adds the file's path where there is one. Messages name options of the library as [`OptionName`]s, so that a program
//! can show its own names for them without a look into the text ([`named_by`]).

use std::borrow::Cow;
use std::cell::Cell;
use std::fmt;

/// A value that is not valid.
///
/// ```
/// use strivec_format::{Invalid, Place};
///
/// let invalid = Invalid::new(Place::Option("voxel".into()), "a positive number", -1.0);
/// assert_eq!(invalid.to_string(), "`voxel` must be a positive number; found -1");
/// ```
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{place} must be {expected}; found {found}")]
pub struct Invalid {
    /// The place of the value.
    pub place: Place,
    /// The valid values.
    pub expected: String,
    /// The value found.
    pub found: String,
}

impl Invalid {
    /// An invalid value at `place`.
    pub fn new(place: impl Into<Place>, expected: impl fmt::Display, found: impl fmt::Display) -> Self {
        Self { place: place.into(), expected: expected.to_string(), found: found.to_string() }
    }

    /// An error unless both are equal.
    pub(crate) fn unless_equal<T: PartialEq + fmt::Display>(
        place: impl FnOnce() -> String,
        expected: T,
        found: T,
    ) -> Result<(), Self> {
        if expected == found { Ok(()) } else { Err(Self::new(place(), expected, found)) }
    }

    /// An error unless all `values` are finite.
    pub(crate) fn unless_finite(place: impl FnOnce() -> String, values: &[f32]) -> Result<(), Self> {
        // In vector registers, which a search that may end at each value is not.
        if values.iter().fold(true, |all, v| all & v.is_finite()) {
            return Ok(());
        }
        match values.iter().position(|v| !v.is_finite()) {
            None => Ok(()),
            Some(i) => Err(Self::new(format!("{} entry {i}", place()), "a finite number", values[i])),
        }
    }
}

/// The place of a value.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Place {
    /// An option: a field of a struct of settings, or its path in one. Shown as an [`OptionName`].
    Option(Cow<'static, str>),
    /// A key of JSON, TOML or another text. Shown in backticks.
    Key(String),
    /// A byte of a file, from 0.
    Offset(u64),
    /// A line of a file, from 1.
    Line(u64),
    /// A part of a file, of a scene or of another whole, as a noun phrase.
    Part(String),
}

impl Place {
    /// The option of a constant name.
    pub const fn option(name: &'static str) -> Self {
        Self::Option(Cow::Borrowed(name))
    }
}

impl fmt::Display for Place {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Option(name) => OptionName(name).fmt(f),
            Self::Key(key) => write!(f, "`{key}`"),
            Self::Offset(byte) => write!(f, "byte {byte}"),
            Self::Line(line) => write!(f, "line {line}"),
            Self::Part(part) => f.write_str(part),
        }
    }
}

impl From<&str> for Place {
    fn from(part: &str) -> Self {
        Self::Part(part.to_owned())
    }
}

impl From<String> for Place {
    fn from(part: String) -> Self {
        Self::Part(part)
    }
}

impl From<&String> for Place {
    fn from(part: &String) -> Self {
        Self::Part(part.clone())
    }
}

/// The name of an option in a message: `` `name` ``, or its name within [`named_by`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OptionName<'a>(pub &'a str);

/// The name of an option, if a program has its own.
type Names = fn(&str) -> Option<String>;

thread_local! {
    /// The names of options in messages of this thread.
    static NAMES: Cell<Option<Names>> = const { Cell::new(None) };
}

impl fmt::Display for OptionName<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match NAMES.get().and_then(|names| names(self.0)) {
            Some(name) => f.write_str(&name),
            None => write!(f, "`{}`", self.0),
        }
    }
}

/// The text of `message`, in which each option has the name that `names` gives, if it gives one. Other text stays as it is,
/// also in backticks.
///
/// Options are deep inside of errors, whose [`Display`](fmt::Display) has no parameters; so the names are those of the thread
/// while it writes this text.
///
/// ```
/// use strivec_format::{OptionName, named_by};
///
/// let message = format_args!("the key `voxel` is missing; set {}", OptionName("voxel")).to_string();
/// assert_eq!(message, "the key `voxel` is missing; set `voxel`");
/// let flag = |option: &str| Some(format!("--{option}"));
/// let message = named_by(flag, &format_args!("the key `voxel` is missing; set {}", OptionName("voxel")));
/// assert_eq!(message, "the key `voxel` is missing; set --voxel");
/// ```
pub fn named_by(names: Names, message: &dyn fmt::Display) -> String {
    let before = NAMES.replace(Some(names));
    let text = message.to_string();
    NAMES.set(before);
    text
}
