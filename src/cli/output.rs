//! Output files of commands; [`strivec_recipe::write_atomically`] says how they are written.

use std::collections::HashSet;
use std::fs::{self, File};
use std::io::BufWriter;
use std::path::{Path, PathBuf};

use super::Error;
use strivec_recipe as recipe;
use strivec_recipe::Reservation;

/// Checks, before any work is done, that [`write_atomically`] could write `path`: its folder exists and can be
/// written, and no file would be overwritten without `force`. Reserves it for this run.
///
/// # Errors
///
/// [`Error::Usage`] if a file would be overwritten without `force`, `path` is not a regular file, or another run reserved
/// it; [`Error::Io`] if the folder cannot be written.
pub fn check_output(path: &Path, force: bool) -> Result<Reservation, Error> {
    Ok(recipe::check_output(path, force)?)
}

/// Writes `bytes` as the whole content of `path`, durably ([`recipe::write_atomically`]).
///
/// # Errors
///
/// The errors of [`check_output`]; [`Error::Io`] if the disk is full or fails, which leaves the destination unchanged.
pub fn write_atomically(path: &Path, bytes: &[u8], force: bool) -> Result<(), Error> {
    Ok(recipe::write_atomically(path, bytes, force)?)
}

/// Writes the result of a long run durably, elsewhere if `path` cannot be written ([`recipe::write_or_keep`]).
pub(super) fn write_or_keep(path: &Path, bytes: &[u8], force: bool) -> Result<(), Error> {
    Ok(recipe::write_or_keep(path, bytes, force)?)
}

/// Writes the file `path` like [`write_atomically`], with content that `write` writes part by part.
pub(super) fn write_atomically_with(
    path: &Path,
    force: bool,
    write: impl FnOnce(&mut BufWriter<&mut File>) -> Result<(), Error>,
) -> Result<(), Error> {
    recipe::write_atomically_with(path, force, write)
}

/// [`check_output`] of each of `paths`, which must differ. Only the first stays reserved, for all of them: a system limits
/// the number of open files.
pub(super) fn check_outputs<'a>(
    paths: impl IntoIterator<Item = &'a PathBuf>,
    force: bool,
) -> Result<Option<Reservation>, Error> {
    let (mut seen, mut first) = (HashSet::new(), None);
    for path in paths {
        if !seen.insert(path) {
            let message = format!("{}: two pictures would have this name", path.display());
            return Err(Error::Malformed(message));
        }
        let reserved = check_output(path, force)?;
        first.get_or_insert(reserved);
    }
    Ok(first)
}

/// Errors if `path` has the extension of a known format other than `.strivec`.
pub(super) fn check_scene_name(path: &Path) -> Result<(), Error> {
    let extension = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
    let instead = match extension.as_str() {
        "npy" | "npz" => "`strivec-pack extract` writes NumPy arrays",
        "png" | "jpg" | "jpeg" | "webp" | "mp4" => "`strivec render` writes pictures and videos",
        "json" => "`strivec info --json` prints a description",
        "ply" | "spz" | "splat" | "ksplat" | "sog" | "obj" | "glb" | "gltf" | "stl" | "usdz" => {
            "`strivec export` writes meshes, points and splats"
        }
        _ => return Ok(()),
    };
    let path = path.display();
    Err(Error::Usage(format!("{path}: the output is a .strivec file, not a .{extension} file; {instead}")))
}

/// Creates the folder `path` and its parents if absent.
pub(super) fn make_folder(path: &Path) -> Result<(), Error> {
    fs::create_dir_all(path).map_err(Error::io("make", path))
}
