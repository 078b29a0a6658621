//! Parts of a file that can be read alone (spec 8).

use crate::geometry::Aabb;

/// A part of a file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Part {
    /// Number of scales, coarsest first; `None` for all.
    pub scales: Option<usize>,
    /// Only the chunks that reach into this box of model space; `None` for all. The scene's bounds become the
    /// intersection of both, unless it is contracted.
    pub within: Option<Aabb>,
    /// Whether to read license, quality, views, thumbnail, probes, cameras, notes and unknown sections too.
    pub metadata: bool,
}

impl Part {
    /// A whole file.
    pub const WHOLE: Self = Self { scales: None, within: None, metadata: true };
}
