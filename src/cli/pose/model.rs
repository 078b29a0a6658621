//! COLMAP's models: which pictures are registered, the points' errors, the largest model first.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use super::super::Error;
use super::folder::{SPARSE, UNSORTED, remove};

/// A model.
#[derive(Debug, PartialEq)]
pub(super) struct Model {
    /// The registered pictures.
    pub(super) names: BTreeSet<String>,
    pub(super) points: u64,
    /// Mean over the points of their mean distance between projection and feature, in pixels, as COLMAP reports it.
    pub(super) reprojection_error: Option<f64>,
}

/// Moves the models from [`UNSORTED`] to [`SPARSE`] in `capture`, the one of the most pictures first. Returns false if
/// there is none.
pub(super) fn sort(capture: &Path) -> Result<bool, Error> {
    let unsorted = capture.join(UNSORTED);
    let mut found: Vec<(usize, PathBuf)> = Vec::new();
    for entry in fs::read_dir(&unsorted).map_err(Error::io("read", &unsorted))? {
        let folder = entry.map_err(Error::io("read", &unsorted))?.path();
        if folder.join("images.bin").is_file() {
            found.push((read_names(&folder)?.len(), folder));
        }
    }
    found.sort_by(|(a, first), (b, second)| b.cmp(a).then_with(|| first.cmp(second)));
    if found.is_empty() {
        return Ok(false);
    }
    let sorted = unsorted.join("sorted");
    fs::create_dir(&sorted).map_err(Error::io("make", &sorted))?;
    for (n, (_, folder)) in found.iter().enumerate() {
        fs::rename(folder, sorted.join(n.to_string())).map_err(Error::io("move", folder))?;
    }
    let sparse = capture.join(SPARSE);
    remove(&sparse, |path| fs::remove_dir_all(path))?;
    fs::rename(&sorted, &sparse).map_err(Error::io("write", &sparse))?;
    remove(&unsorted, |path| fs::remove_dir_all(path))?;
    Ok(true)
}

/// The models in `capture`, in order.
pub(super) fn read_all(capture: &Path) -> Result<Vec<Model>, Error> {
    let folders = (0..).map(|n: usize| capture.join(SPARSE).join(n.to_string())).take_while(|folder| folder.is_dir());
    folders.map(|folder| read(&folder)).collect()
}

fn read(folder: &Path) -> Result<Model, Error> {
    let names = read_names(folder)?;
    let path = folder.join("points3D.bin");
    let (points, sum) = parse(&path, |bytes| {
        let (mut points, mut sum) = (0_u64, 0.0);
        for _ in 0..bytes.u64()? {
            // Number, position, color, error, track.
            bytes.skip(8 + 24 + 3)?;
            sum += f64::from_bits(bytes.u64()?);
            let track = bytes.u64()?;
            bytes.skip(track.checked_mul(8)?)?;
            points += 1;
        }
        Some((points, sum))
    })?;
    let reprojection_error = Some(sum / points as f64).filter(|error| error.is_finite() && *error >= 0.0);
    Ok(Model { names, points, reprojection_error })
}

/// The names in `images.bin`.
fn read_names(folder: &Path) -> Result<BTreeSet<String>, Error> {
    parse(&folder.join("images.bin"), |bytes| {
        let mut names = BTreeSet::new();
        for _ in 0..bytes.u64()? {
            // Number, rotation, translation, camera; then the name, a zero, and the features.
            bytes.skip(4 + 32 + 24 + 4)?;
            let length = bytes.0.iter().position(|byte| *byte == 0)?;
            names.insert(String::from_utf8_lossy(&bytes.0[..length]).into_owned());
            bytes.skip(length as u64 + 1)?;
            let features = bytes.u64()?;
            bytes.skip(features.checked_mul(24)?)?;
        }
        Some(names)
    })
}

fn parse<T>(path: &Path, read: impl FnOnce(&mut Bytes<'_>) -> Option<T>) -> Result<T, Error> {
    let bytes = fs::read(path).map_err(Error::io("read", path))?;
    let mut bytes = Bytes(&bytes);
    let parsed = read(&mut bytes).filter(|_| bytes.0.is_empty());
    parsed.ok_or_else(|| Error::Malformed(format!("{}: not a whole file of COLMAP", path.display())))
}

/// The bytes that are left.
struct Bytes<'a>(&'a [u8]);

impl Bytes<'_> {
    fn u64(&mut self) -> Option<u64> {
        let (first, rest) = self.0.split_first_chunk()?;
        self.0 = rest;
        Some(u64::from_le_bytes(*first))
    }

    fn skip(&mut self, count: u64) -> Option<()> {
        self.0 = self.0.get(usize::try_from(count).ok()?..)?;
        Some(())
    }
}
