//! An entry of the inventory of a dataset's folder.

use std::path::Path;

use strivec_format::escape::escaped;

strivec_format::named! {
    /// The use of a dataset's files.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
    pub enum Standing {
        /// Named by the dataset's files, but not there.
        Absent = "absent",
        /// There and used, but not as its name or size lets expect.
        Doubtful = "doubtful",
        /// There, but not used.
        Unused = "unused",
        /// There and used.
        Used = "used",
    }
}

/// Files of a dataset, or keys of one of its files, of which the same is true.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct InventoryEntry {
    /// The use of the files or keys.
    pub standing: Standing,
    /// The file or folder, in the dataset's folder, with `/` between folders.
    pub path: String,
    /// Number of files, or of records of the file.
    pub count: usize,
    /// The reason, or what they are, as the rest of a line.
    pub what: String,
}

impl InventoryEntry {
    pub(super) fn new(standing: Standing, path: impl Into<String>, count: usize, what: impl Into<String>) -> Self {
        Self { standing, path: path.into(), count, what: what.into() }
    }

    /// The entry as the rest of a line.
    pub(super) fn line(&self) -> String {
        escaped(&format!("{}: {}", self.path, self.what))
    }
}

/// `path` in `folder`, with `/` between folders.
pub(super) fn relative_to(folder: &Path, path: &Path) -> String {
    let inside = path.strip_prefix(folder).unwrap_or(path);
    let parts: Vec<_> = inside.components().map(|part| part.as_os_str().to_string_lossy()).collect();
    if parts.is_empty() { ".".into() } else { parts.join("/") }
}
