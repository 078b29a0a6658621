//! Atomic writing of files.
//!
//! The bytes are written to a hidden file beside the destination (`.NAME.….partial`), synced, and renamed. If the
//! process dies, the destination holds either the old or the new file.

use std::collections::HashSet;
use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use tempfile::NamedTempFile;

use super::Error;

/// Checks, before any work is done, that [`write_atomically`] could write `path`: its folder exists and can be
/// written, and no file would be overwritten without `force`.
///
/// # Errors
///
/// [`Error::Usage`] if a file would be overwritten without `force`, or `path` is not a regular file; [`Error::Io`] if
/// the folder cannot be written.
pub fn check_output(path: &Path, force: bool) -> Result<(), Error> {
    let destination = destination(path, force)?;
    partial_file(path, &destination).map(drop)
}

/// Writes `bytes` as the whole content of `path`, durably; see the module's description.
///
/// A symbolic link is followed and kept. Without `force` a file that exists is left alone, also one that appeared
/// since the check.
///
/// # Errors
///
/// The errors of [`check_output`]; [`Error::Io`] if the disk is full or fails, which leaves the destination unchanged.
pub fn write_atomically(path: &Path, bytes: &[u8], force: bool) -> Result<(), Error> {
    write_atomically_with(path, force, |file| file.write_all(bytes).map_err(Error::io("write", path)))
}

/// Writes the file `path` like [`write_atomically`], with content that `write` writes part by part.
pub(super) fn write_atomically_with(
    path: &Path,
    force: bool,
    write: impl FnOnce(&mut BufWriter<&mut File>) -> Result<(), Error>,
) -> Result<(), Error> {
    let destination = destination(path, force)?;
    let mut partial = partial_file(path, &destination)?;
    let failed = || Error::io("write", path);
    let mut buffered = BufWriter::new(partial.as_file_mut());
    write(&mut buffered)?;
    buffered.flush().map_err(failed())?;
    drop(buffered);
    partial.as_file().sync_all().map_err(failed())?;
    let persisted = if force { partial.persist(&destination) } else { partial.persist_noclobber(&destination) };
    persisted.map_err(|error| match error.error.kind() {
        io::ErrorKind::AlreadyExists => would_overwrite(path),
        _ => failed()(error.error),
    })?;
    sync_folder(folder_of(&destination)).map_err(failed())
}

/// [`check_output`] of each of `paths`, which must differ.
pub(super) fn check_outputs<'a>(paths: impl IntoIterator<Item = &'a PathBuf>, force: bool) -> Result<(), Error> {
    let mut seen = HashSet::new();
    for path in paths {
        if !seen.insert(path) {
            let message = format!("{}: two pictures would have this name", path.display());
            return Err(Error::Malformed(message));
        }
        check_output(path, force)?;
    }
    Ok(())
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

/// Removes the file `path`, if it is there.
pub(super) fn remove_file(path: &Path) -> Result<(), Error> {
    match fs::remove_file(path) {
        Err(e) if e.kind() != io::ErrorKind::NotFound => Err(Error::io("remove", path)(e)),
        _ => Ok(()),
    }
}

/// Creates the folder `path` and its parents if absent.
pub(super) fn make_folder(path: &Path) -> Result<(), Error> {
    fs::create_dir_all(path).map_err(Error::io("make", path))
}

fn would_overwrite(path: &Path) -> Error {
    Error::Usage(format!("{}: the file exists; --force overwrites it", path.display()))
}

/// `path` with links followed, if it may be written.
fn destination(path: &Path, force: bool) -> Result<PathBuf, Error> {
    let metadata = match fs::symlink_metadata(path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(path.to_path_buf()),
        other => other.map_err(Error::io("write", path))?,
    };
    if metadata.is_symlink() {
        // Renaming over a link would replace the link, not its target.
        return destination(&fs::canonicalize(path).map_err(Error::io("follow", path))?, force);
    }
    if !metadata.is_file() {
        let found = if metadata.is_dir() { "a folder" } else { "a device or a pipe" };
        return Err(Error::Usage(format!(
            "{}: cannot be overwritten: it is {found}, not a regular file",
            path.display()
        )));
    }
    if force { Ok(path.to_path_buf()) } else { Err(would_overwrite(path)) }
}

fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if folder != Path::new("") => folder,
        _ => Path::new("."),
    }
}

fn partial_file(path: &Path, destination: &Path) -> Result<NamedTempFile, Error> {
    let Some(name) = destination.file_name() else {
        return Err(Error::Usage(format!("{}: not the name of a file", path.display())));
    };
    let folder = folder_of(destination);
    let mut builder = tempfile::Builder::new();
    let prefix = format!(".{}.", name.to_string_lossy());
    // Opened here, not by the builder, for the permissions of any other new file.
    let open = |partial: &Path| OpenOptions::new().write(true).create_new(true).open(partial);
    builder.prefix(&prefix).suffix(".partial").make_in(folder, open).map_err(|source| {
        Error::Io(format!("{}: cannot write to the folder {}: {source}", path.display(), folder.display()))
    })
}

/// Makes a rename in `folder` durable, if the system can.
fn sync_folder(folder: &Path) -> io::Result<()> {
    if cfg!(not(unix)) {
        return Ok(());
    }
    match File::open(folder).and_then(|folder| folder.sync_all()) {
        // Some file systems cannot; the file itself is on the disk already.
        Err(e) if matches!(e.kind(), io::ErrorKind::InvalidInput | io::ErrorKind::Unsupported) => Ok(()),
        other => other,
    }
}
