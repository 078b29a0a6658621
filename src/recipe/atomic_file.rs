//! Atomic writing of files.
//!
//! The bytes are written to a hidden file beside the destination (`.NAME.….partial`), synced, and renamed. If the
//! process dies, the destination holds either the old or the new file, and the next run that writes the same destination
//! removes the hidden one. A process locks its hidden files, so that no other removes them while it lives.

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, SystemTime};

use strivec_format::OptionName;
use tempfile::NamedTempFile;

/// The ending of hidden files, and the random characters before it.
const PARTIAL: &str = ".partial";
const RANDOM_BYTES: usize = 6;
/// A hidden file that is younger may not be locked yet.
const LEFT_FOR: Duration = Duration::from_secs(10);
/// The ending of the empty hidden files by which runs reserve destinations, beside which they are.
const RESERVED: &str = "reserved";

/// The hidden files in folders when this process first wrote to them: a folder of many pictures is listed once.
static PARTIALS: Mutex<BTreeMap<PathBuf, Vec<OsString>>> = Mutex::new(BTreeMap::new());

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
    /// The file to read is not a regular one (the caller).
    #[error("{}: cannot be read: it is {found}, not a regular file", path.display())]
    NotReadable {
        /// The file.
        path: PathBuf,
        /// The kind of what is there.
        found: &'static str,
    },
    /// Another run writes the file (the caller).
    #[error("{}: another run writes it; wait for that one, or choose another name", path.display())]
    Reserved {
        /// The destination.
        path: PathBuf,
    },
    /// The file could not be written where it should, and is elsewhere (the system).
    #[error("{source}; the result is kept in {}", kept.display())]
    Kept {
        /// The file that has the result.
        kept: PathBuf,
        /// Why it is not where it should be.
        source: Box<FileError>,
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

    /// For `map_err` after an attempt to make a file in `folder` for the destination `path`.
    fn folder(path: &Path, folder: &Path) -> impl FnOnce(io::Error) -> Self {
        move |source| Self::Folder { path: path.to_path_buf(), folder: folder.to_path_buf(), source }
    }

    /// True if the system failed; else the caller must act.
    pub fn is_io(&self) -> bool {
        matches!(self, Self::Folder { .. } | Self::Io { .. } | Self::NotReadable { .. } | Self::Kept { .. })
    }
}

/// The bytes of the file `path`. A device, which may have no end, or a pipe, which may block, is not read.
///
/// # Errors
///
/// [`FileError::NotReadable`] if it is not a regular file, [`FileError::Io`].
pub fn read_file(path: &Path) -> Result<Vec<u8>, FileError> {
    // Before it is opened: a pipe without a writer would block.
    let metadata = fs::metadata(path).map_err(FileError::io("read", path))?;
    match not_regular(&metadata) {
        Some(found) => Err(FileError::NotReadable { path: path.to_path_buf(), found }),
        None => fs::read(path).map_err(FileError::io("read", path)),
    }
}

/// What there is instead of a regular file.
fn not_regular(metadata: &fs::Metadata) -> Option<&'static str> {
    (!metadata.is_file()).then_some(if metadata.is_dir() { "a folder" } else { "a device or a pipe" })
}

/// Checks, before any work is done, that [`write_atomically`] could write `path`: its folder exists and can be
/// written, and no file would be overwritten without `force`. Reserves it for this run.
///
/// # Errors
///
/// [`FileError::Exists`] if a file would be overwritten without `force`, [`FileError::NotRegular`] if `path` is not a
/// regular file, [`FileError::Folder`] if the folder cannot be written, [`FileError::Reserved`] if another run is going to
/// write it.
pub fn check_output(path: &Path, force: bool) -> Result<Reservation, FileError> {
    Reservation::new(path, &destination(path, force)?)
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

/// Writes the result of a long run as [`write_atomically`] does or, if that fails, under a free name beside `path` or in the
/// system's folder of temporary files.
///
/// # Errors
///
/// [`FileError::Kept`], which says where it is; all errors of [`write_atomically`] if it could be written nowhere.
pub fn write_or_keep(path: &Path, bytes: &[u8], force: bool) -> Result<(), FileError> {
    write_atomically(path, bytes, force).map_err(|source| {
        let in_temporary = path.file_name().map(|name| free_name(&std::env::temp_dir().join(name)));
        let places = [Some(free_name(path)), in_temporary];
        match places.into_iter().flatten().find(|kept| write_atomically(kept, bytes, false).is_ok()) {
            Some(kept) => FileError::Kept { kept, source: source.into() },
            None => source,
        }
    })
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
    if let Some(found) = not_regular(&metadata) {
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

/// The beginning of the names of the hidden files of `destination`, which `path` names.
fn hidden_name(path: &Path, destination: &Path) -> Result<String, FileError> {
    let name = destination.file_name().ok_or_else(|| FileError::NoName { path: path.to_path_buf() })?;
    Ok(format!(".{}.", name.to_string_lossy()))
}

fn partial_file(path: &Path, destination: &Path) -> Result<NamedTempFile, FileError> {
    let folder = folder_of(destination);
    let mut builder = tempfile::Builder::new();
    let prefix = hidden_name(path, destination)?;
    remove_leftovers(folder, &prefix);
    // Opened here, not by the builder, for the permissions of any other new file.
    let open = |partial: &Path| OpenOptions::new().write(true).create_new(true).open(partial);
    let made = builder.prefix(&prefix).suffix(PARTIAL).rand_bytes(RANDOM_BYTES).make_in(folder, open);
    let partial = made.map_err(FileError::folder(path, folder))?;
    // Some file systems have no locks: their leftovers stay.
    let _ = partial.as_file().try_lock();
    Ok(partial)
}

/// Removes the hidden files in `folder` that begin with `prefix` and whose process was killed. What cannot be removed stays.
fn remove_leftovers(folder: &Path, prefix: &str) {
    let mut known = PARTIALS.lock().unwrap_or_else(PoisonError::into_inner);
    let partials = known.entry(folder.to_path_buf()).or_insert_with(|| {
        let names = fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.file_name());
        names.filter(|name| name.to_string_lossy().ends_with(PARTIAL)).collect()
    });
    let is_own = |name: &OsString| {
        let name = name.to_string_lossy();
        let random = name.strip_prefix(prefix).and_then(|rest| rest.strip_suffix(PARTIAL));
        random.is_some_and(|random| random.len() == RANDOM_BYTES && random.chars().all(|c| c.is_ascii_alphanumeric()))
    };
    for name in partials.extract_if(.., |name| is_own(name)) {
        let path = folder.join(name);
        let is_left = || -> io::Result<bool> {
            let metadata = fs::symlink_metadata(&path)?;
            let age = SystemTime::now().duration_since(metadata.modified()?).unwrap_or_default();
            // The lock of a process that was killed is gone.
            Ok(metadata.is_file() && age > LEFT_FOR && OpenOptions::new().write(true).open(&path)?.try_lock().is_ok())
        };
        if is_left().unwrap_or(false) {
            let _ = fs::remove_file(&path);
        }
    }
}

/// A destination that a run is going to write. As long as this lives, [`check_output`] refuses it to other runs, of which
/// one would lose its result.
#[derive(Debug)]
#[must_use = "the destination is reserved as long as this lives"]
pub struct Reservation {
    lock: File,
    path: PathBuf,
}

impl Reservation {
    /// Reserves `destination`, which `path` names, by a locked, hidden file beside it. A killed run gives up what it reserved.
    fn new(path: &Path, destination: &Path) -> Result<Self, FileError> {
        let folder = folder_of(destination);
        let hidden = folder.join(hidden_name(path, destination)? + RESERVED);
        let opened = OpenOptions::new().write(true).create(true).truncate(false).open(&hidden);
        let lock = opened.map_err(FileError::folder(path, folder))?;
        match lock.try_lock() {
            Err(TryLockError::WouldBlock) => Err(FileError::Reserved { path: path.to_path_buf() }),
            // Some file systems have no locks.
            Ok(()) | Err(TryLockError::Error(_)) => Ok(Self { lock, path: hidden }),
        }
    }
}

impl Drop for Reservation {
    fn drop(&mut self) {
        // Before the lock is given up, so that no other run locks a file that is then removed.
        let _ = fs::remove_file(&self.path);
        let _ = self.lock.unlock();
    }
}

/// A name beside `path` that no file has, as in `lego-2.strivec`.
fn free_name(path: &Path) -> PathBuf {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let ending = path.extension().map_or_else(String::new, |ending| format!(".{}", ending.to_string_lossy()));
    let named = |n: u32| path.with_file_name(format!("{stem}-{n}{ending}"));
    (2..).map(named).find(|path| !path.exists()).unwrap_or_else(|| named(2))
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

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let entries = fs::read_dir(folder).unwrap();
        let mut names: Vec<_> = entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    #[test]
    fn hidden_files_of_killed_processes_are_removed_and_no_others() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let make = |name: &str, age: u64| {
            let file = File::create(at(name)).unwrap();
            file.set_modified(SystemTime::now() - Duration::from_secs(age)).unwrap();
            file
        };
        make(".a.strivec.abc123.partial", 3600);
        make(".a.strivec.young1.partial", 0);
        make(".a.strivec.mine.partial", 3600);
        make(".b.strivec.abc123.partial", 3600);
        let locked = make(".a.strivec.locked.partial", 3600);
        locked.try_lock().unwrap();
        write_atomically(&at("a.strivec"), b"1", false).unwrap();
        let kept = [
            ".a.strivec.locked.partial",
            ".a.strivec.mine.partial",
            ".a.strivec.young1.partial",
            ".b.strivec.abc123.partial",
        ];
        assert_eq!(names(folder.path())[..4], kept);
        write_atomically(&at("b.strivec"), b"1", false).unwrap();
        assert!(!at(".b.strivec.abc123.partial").exists());
    }

    #[test]
    fn a_destination_is_reserved_once() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.strivec");
        let first = check_output(&path, false).unwrap();
        assert!(matches!(check_output(&path, false), Err(FileError::Reserved { .. })));
        drop(check_output(&folder.path().join("b.strivec"), false).unwrap());
        drop(first);
        drop(check_output(&path, false).unwrap());
        assert_eq!(names(folder.path()), [""; 0]);
        // What a killed run leaves reserves nothing, and the next run removes it.
        File::create(folder.path().join(".a.strivec.reserved")).unwrap();
        drop(check_output(&path, false).unwrap());
        assert_eq!(names(folder.path()), [""; 0]);
    }

    #[test]
    #[cfg(unix)]
    fn a_link_is_reserved_as_the_file_that_it_leads_to() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::write(at("a.strivec"), "").unwrap();
        std::os::unix::fs::symlink("a.strivec", at("link.strivec")).unwrap();
        let _first = check_output(&at("link.strivec"), true).unwrap();
        assert!(matches!(check_output(&at("a.strivec"), true), Err(FileError::Reserved { .. })));
    }

    #[test]
    #[cfg(unix)]
    fn devices_and_pipes_are_not_read() {
        let error = read_file(Path::new("/dev/zero")).unwrap_err();
        assert_eq!(error.to_string(), "/dev/zero: cannot be read: it is a device or a pipe, not a regular file");
        assert!(matches!(read_file(Path::new("/")), Err(FileError::NotReadable { found: "a folder", .. })));
    }

    #[test]
    fn a_result_that_cannot_be_written_is_kept_elsewhere_and_its_place_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.strivec");
        fs::write(&path, "of another run").unwrap();
        for n in [2, 3] {
            let error = write_or_keep(&path, b"result", false).unwrap_err();
            let kept = folder.path().join(format!("a-{n}.strivec"));
            assert!(error.to_string().ends_with(&format!("; the result is kept in {}", kept.display())), "{error}");
            assert!(error.is_io() && fs::read(kept).unwrap() == b"result");
        }
        assert_eq!(fs::read(&path).unwrap(), b"of another run");
        // The folder is gone: in that of temporary files.
        let gone = folder.path().join("absent/b.strivec");
        let Err(FileError::Kept { kept, .. }) = write_or_keep(&gone, b"result", false) else {
            panic!("it is not kept")
        };
        assert_eq!(fs::read(&kept).unwrap(), b"result");
        fs::remove_file(kept).unwrap();
    }
}
