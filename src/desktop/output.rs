//! Files that the player writes to the current folder.

use std::fs::File;
use std::io::{ErrorKind, Write as _};
use std::path::PathBuf;

/// A file that was written.
#[derive(Debug)]
pub(super) struct Saved {
    /// Absolute path.
    pub(super) path: PathBuf,
}

/// Writes `bytes` to STEM-001.EXTENSION, or to the first following number that is free.
///
/// # Errors
///
/// If the file cannot be written.
pub(super) fn save_new(stem: &str, extension: &str, bytes: &[u8]) -> Result<Saved, String> {
    for n in 1..=9999 {
        let name = format!("{stem}-{n:03}.{extension}");
        let path = std::path::absolute(&name).unwrap_or_else(|_| name.into());
        match File::create_new(&path) {
            Ok(mut file) => {
                return file.write_all(bytes).map_err(|e| format!("{}: {e}", path.display())).map(|()| Saved { path });
            }
            Err(e) if e.kind() == ErrorKind::AlreadyExists => {}
            Err(e) => return Err(format!("{}: {e}", path.display())),
        }
    }
    Err(format!("{stem}-001.{extension} to {stem}-9999.{extension} exist; delete some of them"))
}
