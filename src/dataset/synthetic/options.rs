//! Options of synthetic datasets, and writing their files.

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::Path;

use crate::dataset::Error;

/// The most views of a split.
const MAX_VIEWS: u32 = 10_000;
/// The longest edge of a picture that is made.
const MAX_EDGE: u32 = 4096;

/// Options of synthetic datasets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SynthOptions {
    /// Training views, 1 to 10 000.
    pub views: u32,
    /// Test views, from other positions than the training views, 1 to 10 000; a quarter of this number is made for
    /// validation.
    pub test_views: u32,
    /// Columns and rows of the pictures, each 1 to 4096.
    pub size: [u32; 2],
    /// Seed of the cameras' positions and the textures' variations; the geometry is always the same.
    pub seed: u64,
    /// If true, also writes to a folder that is not empty, replacing files of the same names and keeping all others.
    pub force: bool,
}

impl Default for SynthOptions {
    /// 100 training and 20 test views of 200×200 pixels.
    fn default() -> Self {
        Self { views: 100, test_views: 20, size: [200, 200], seed: 0, force: false }
    }
}

/// Rejects options that are out of range.
pub(super) fn check(options: &SynthOptions) -> Result<(), Error> {
    let SynthOptions { views, test_views, size: [width, height], .. } = *options;
    for (what, limit, found) in [
        ("views", MAX_VIEWS, views),
        ("test_views", MAX_VIEWS, test_views),
        ("width", MAX_EDGE, width),
        ("height", MAX_EDGE, height),
    ] {
        if !(1..=limit).contains(&found) {
            return Err(Error::SynthOption { what, limit, found });
        }
    }
    Ok(())
}

/// Creates the folder. Rejects one that is not empty unless `force` is true.
pub(super) fn prepare(out: &Path, force: bool) -> Result<(), Error> {
    fs::create_dir_all(out).map_err(Error::write(out))?;
    let occupied = fs::read_dir(out).map_err(Error::read(out))?.next().is_some();
    if occupied && !force {
        return Err(Error::FolderNotEmpty { path: out.to_path_buf() });
    }
    Ok(())
}

/// Creates the file `path` with the bytes that `fill` writes.
pub(super) fn write(path: &Path, fill: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>) -> Result<(), Error> {
    let written = File::create(path).map(BufWriter::new).and_then(|mut file| {
        fill(&mut file)?;
        file.flush()
    });
    written.map_err(Error::write(path))
}
