//! Results that are kept between runs, in files named by all that they depend on.

use std::fs;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use super::write_atomically;

/// The environment variable that names the folder; empty, nothing is kept.
const VARIABLE: &str = "STRIVEC_CACHE";
/// The most bytes of all files; the oldest ones are removed.
const MAX_BYTES: u64 = 2_000_000_000;

/// A folder of results that take long to compute. What cannot be read or written there is computed again.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Cache {
    folder: PathBuf,
}

impl Cache {
    /// A cache in `folder`, which is made when something is kept.
    pub fn new(folder: impl Into<PathBuf>) -> Self {
        Self { folder: folder.into() }
    }

    /// The user's cache: the folder that the environment variable STRIVEC_CACHE names, else `strivec` in the system's folder
    /// for caches. `None` if the variable is empty, or there is no such folder.
    pub fn of_user() -> Option<Self> {
        if let Some(folder) = std::env::var_os(VARIABLE) {
            return (!folder.is_empty()).then(|| Self::new(folder));
        }
        let named = |name| std::env::var_os(name).map(PathBuf::from).filter(|path| path.is_absolute());
        let folder = if cfg!(windows) {
            named("LOCALAPPDATA")
        } else if cfg!(target_os = "macos") {
            std::env::home_dir().map(|home| home.join("Library/Caches"))
        } else {
            named("XDG_CACHE_HOME").or_else(|| std::env::home_dir().map(|home| home.join(".cache")))
        };
        folder.filter(|folder| folder.is_absolute()).map(|folder| Self::new(folder.join("strivec")))
    }

    /// The bytes that are kept under `name`, if there are any.
    pub fn read(&self, name: &str) -> Option<Vec<u8>> {
        let file = fs::File::open(self.folder.join(name)).ok()?;
        let size = file.metadata().ok().filter(|file| file.is_file() && file.len() <= MAX_BYTES)?.len();
        let mut bytes = Vec::new();
        file.take(size).read_to_end(&mut bytes).ok()?;
        Some(bytes)
    }

    /// Keeps `bytes` under `name`, which is a file name, if that is possible.
    pub fn write(&self, name: &str, bytes: &[u8]) {
        let written = fs::create_dir_all(&self.folder).is_ok() && bytes.len() as u64 <= MAX_BYTES;
        if written && write_atomically(&self.folder.join(name), bytes, true).is_ok() {
            self.trim(name);
        }
    }

    /// Removes the oldest files until the rest is small enough, but not `newest`.
    fn trim(&self, newest: &str) {
        let Ok(files) = fs::read_dir(&self.folder) else { return };
        let described = files.flatten().filter_map(|entry| {
            let file = entry.metadata().ok().filter(fs::Metadata::is_file)?;
            Some((file.modified().unwrap_or(SystemTime::UNIX_EPOCH), file.len(), entry.path()))
        });
        let mut files: Vec<(SystemTime, u64, PathBuf)> = described.collect();
        files.sort();
        let mut bytes: u64 = files.iter().map(|(_, bytes, _)| bytes).sum();
        let is_newest = |path: &Path| path.file_name().is_some_and(|name| name == newest);
        for (_, size, path) in files.iter().filter(|(_, _, path)| !is_newest(path)) {
            if bytes <= MAX_BYTES {
                return;
            }
            if fs::remove_file(path).is_ok() {
                bytes -= size;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_kept_is_read_again_and_the_oldest_goes_first() {
        let folder = tempfile::tempdir().unwrap();
        let cache = Cache::new(folder.path().join("made/when/needed"));
        assert_eq!(cache.read("a"), None);
        cache.write("a", b"first");
        cache.write("a", b"second");
        assert_eq!(cache.read("a").as_deref(), Some(&b"second"[..]));
        // Holes take no room on the disk.
        for (name, seconds) in [("old", 1), ("young", 2)] {
            let file = fs::File::create(folder.path().join("made/when/needed").join(name)).unwrap();
            file.set_len(MAX_BYTES / 2).unwrap();
            file.set_modified(SystemTime::UNIX_EPOCH + std::time::Duration::from_secs(seconds)).unwrap();
        }
        cache.write("b", b"third");
        let mut names: Vec<_> =
            fs::read_dir(folder.path().join("made/when/needed")).unwrap().map(|e| e.unwrap().file_name()).collect();
        names.sort();
        assert_eq!(names, ["a", "b", "young"]);
    }

    #[test]
    fn a_cache_that_cannot_be_written_keeps_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("file");
        fs::write(&file, b"").unwrap();
        let cache = Cache::new(&file);
        cache.write("a", b"lost");
        assert_eq!(cache.read("a"), None);
    }
}
