//! Versions of the format (spec 9).

use std::fmt;

/// The version that this crate writes. It reads every minor version of the same major one.
pub const VERSION: Version = Version { major: 1, minor: 0 };

/// A version of the format.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Version {
    /// Changes when older readers would misread a file.
    pub major: u16,
    /// Changes when something is added that older readers can skip or refuse by name.
    pub minor: u16,
}

impl fmt::Display for Version {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}.{}", self.major, self.minor)
    }
}
