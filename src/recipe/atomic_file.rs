//! Atomic writing of files.
//!
//! The bytes are written to a hidden file beside the destination (`.NAME.….partial`), synced, and renamed. If the
//! process dies, the destination holds either the old or the new file.

use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use strivec_format::OptionName;
use tempfile::NamedTempFile;

/// A file that cannot be read, written or removed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FileError {
    /// A file exists that would be overwritten (the caller).
    #[error("{}: the file exists; {} overwrites it", path.display(), OptionName("force"))]
    Exists {
        /// The file.
        path: PathBuf,
    },
    /// The checkpoint of an interrupted run exists (the caller).
    #[error(
        "{}: the checkpoint of an interrupted run exists; {} continues it, {} starts anew",
        path.display(), OptionName("resume"), OptionName("force")
    )]
    CheckpointExists {
        /// The checkpoint.
        path: PathBuf,
    },
    /// The destination is not a regular file (the caller).
    #[error("{}: cannot be overwritten: it is {found}, not a regular file", path.display())]
    NotRegular {
        /// The destination.
        path: PathBuf,
        /// The kind of what is there.
        found: &'static str,
    },
    /// The destination has no file name (the caller).
    #[error("{}: not the name of a file", path.display())]
    NoName {
        /// The destination.
        path: PathBuf,
    },
    /// The destination's folder cannot be written (the system).
    #[error("{}: cannot write to the folder {}: {source}", path.display(), folder.display())]
    Folder {
        /// The destination.
        path: PathBuf,
        /// The folder of the destination.
        folder: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// The system failed.
    #[error("{}: cannot {verb} it: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// The attempted operation, as in "write".
        verb: &'static str,
        /// The system's error.
        source: io::Error,
    },
}

impl FileError {
    /// For `map_err` after an attempt to `verb` `path`.
    pub(super) fn io(verb: &'static str, path: &Path) -> impl FnOnce(io::Error) -> Self {
        move |source| Self::Io { path: path.to_path_buf(), verb, source }
    }

    /// True if the system failed; else the caller must act.
    pub fn is_io(&self) -> bool {
        matches!(self, Self::Folder { .. } | Self::Io { .. })
    }
}

/// Checks, before any work is done, that [`write_atomically`] could write `path`: its folder exists and can be
/// written, and no file would be overwritten without `force`.
///
/// # Errors
///
/// [`FileError::Exists`] if a file would be overwritten without `force`, [`FileError::NotRegular`] if `path` is not a
/// regular file, [`FileError::Folder`] if the folder cannot be written.
pub fn check_output(path: &Path, force: bool) -> Result<(), FileError> {
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
/// All errors of [`check_output`]; [`FileError::Io`] if the disk is full or fails, which leaves the destination unchanged.
pub fn write_atomically(path: &Path, bytes: &[u8], force: bool) -> Result<(), FileError> {
    write_atomically_with(path, force, |file| file.write_all(bytes).map_err(FileError::io("write", path)))
}

/// Writes a file as [`write_atomically`] does, for content that `write` writes part by part.
///
/// # Errors
///
/// All errors of [`write_atomically`] and of `write`.
pub fn write_atomically_with<E: From<FileError>>(
    path: &Path,
    force: bool,
    write: impl FnOnce(&mut BufWriter<&mut File>) -> Result<(), E>,
) -> Result<(), E> {
    let destination = destination(path, force)?;
    let mut partial = partial_file(path, &destination)?;
    let failed = || FileError::io("write", path);
    let mut buffered = BufWriter::new(partial.as_file_mut());
    write(&mut buffered)?;
    buffered.flush().map_err(failed())?;
    drop(buffered);
    partial.as_file().sync_all().map_err(failed())?;
    let persisted = if force { partial.persist(&destination) } else { partial.persist_noclobber(&destination) };
    persisted.map_err(|error| match error.error.kind() {
        io::ErrorKind::AlreadyExists => FileError::Exists { path: path.to_path_buf() },
        _ => failed()(error.error),
    })?;
    Ok(sync_folder(folder_of(&destination)).map_err(failed())?)
}

/// Removes the file `path`, if it exists.
///
/// # Errors
///
/// [`FileError::Io`] if the system refuses.
pub fn remove_file(path: &Path) -> Result<(), FileError> {
    match fs::remove_file(path) {
        Err(e) if e.kind() != io::ErrorKind::NotFound => Err(FileError::io("remove", path)(e)),
        _ => Ok(()),
    }
}

/// The path of `output` with `ending` appended to its name, as in `lego.strivec.state`.
pub fn beside(output: &Path, ending: &str) -> PathBuf {
    let mut name = output.as_os_str().to_owned();
    name.push(ending);
    name.into()
}

/// `path` with links followed, if it may be written.
fn destination(path: &Path, force: bool) -> Result<PathBuf, FileError> {
    let metadata = match fs::symlink_metadata(path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(path.to_path_buf()),
        other => other.map_err(FileError::io("write", path))?,
    };
    if metadata.is_symlink() {
        // Renaming over a link would replace the link, not its target.
        return destination(&fs::canonicalize(path).map_err(FileError::io("follow", path))?, force);
    }
    if !metadata.is_file() {
        let found = if metadata.is_dir() { "a folder" } else { "a device or a pipe" };
        return Err(FileError::NotRegular { path: path.to_path_buf(), found });
    }
    if force { Ok(path.to_path_buf()) } else { Err(FileError::Exists { path: path.to_path_buf() }) }
}

fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if folder != Path::new("") => folder,
        _ => Path::new("."),
    }
}

fn partial_file(path: &Path, destination: &Path) -> Result<NamedTempFile, FileError> {
    let Some(name) = destination.file_name() else {
        return Err(FileError::NoName { path: path.to_path_buf() });
    };
    let folder = folder_of(destination);
    let mut builder = tempfile::Builder::new();
    let prefix = format!(".{}.", name.to_string_lossy());
    // Opened here, not by the builder, for the permissions of any other new file.
    let open = |partial: &Path| OpenOptions::new().write(true).create_new(true).open(partial);
    builder.prefix(&prefix).suffix(".partial").make_in(folder, open).map_err(|source| FileError::Folder {
        path: path.to_path_buf(),
        folder: folder.to_path_buf(),
        source,
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
