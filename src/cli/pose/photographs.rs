//! The photographs of a folder: which of its files are pictures, and their copies in the capture.

use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use super::super::Error;
use super::super::progress::Progress;
use super::folder::remove;
use super::process::stopped;
use strivec_capture::dataset::{self, PictureFormat};
use strivec_format::escape::escaped;

/// A photograph.
#[derive(Debug)]
pub(super) struct ListedPhotograph {
    /// File name of the photograph in the folder.
    pub(super) name: String,
    path: PathBuf,
    bytes: u64,
    /// Seconds since 1970, or 0 if unknown.
    modified: u64,
    format: PictureFormat,
    /// Columns and rows.
    size: [u32; 2],
}

/// The photographs of a folder.
#[derive(Debug)]
pub(super) struct Photographs {
    folder: PathBuf,
    /// The photographs, in the order of their names.
    pub(super) pictures: Vec<ListedPhotograph>,
    /// Files that are not used, with the reason.
    pub(super) skipped: Vec<String>,
}

impl Photographs {
    /// The photographs in `folder`, not in its subfolders. Hidden files are passed over.
    ///
    /// # Errors
    ///
    /// If the folder cannot be read.
    pub(super) fn list(folder: &Path) -> Result<Self, Error> {
        let (mut pictures, mut skipped) = (Vec::new(), Vec::new());
        for entry in fs::read_dir(folder).map_err(Error::io("read", folder))? {
            let entry = entry.map_err(Error::io("read", folder))?;
            let file_name = entry.file_name();
            if file_name.as_encoded_bytes().starts_with(b".") {
                continue;
            }
            match photograph(&entry.path(), file_name.to_str()) {
                Ok(picture) => pictures.push(picture),
                Err(why) => skipped.push(format!("{}: {why}", escaped(&file_name.to_string_lossy()))),
            }
        }
        pictures.sort_by(|a, b| a.name.cmp(&b.name));
        skipped.sort();
        Ok(Self { folder: folder.to_path_buf(), pictures, skipped })
    }

    /// Skips WebP pictures, which the COLMAP `program` does not read.
    pub(super) fn skip_webp(&mut self, program: &str) {
        let is_webp = |picture: &mut ListedPhotograph| picture.format == PictureFormat::WebP;
        for ListedPhotograph { name, .. } in self.pictures.extract_if(.., is_webp) {
            let why = format!("a WebP picture, which {program} does not read; convert it to JPEG or PNG");
            self.skipped.push(format!("{}: {why}", escaped(&name)));
        }
        self.skipped.sort();
    }

    /// A text that changes if a photograph does.
    pub(super) fn fingerprint(&self) -> String {
        let mut hasher = crc32fast::Hasher::new();
        for ListedPhotograph { name, bytes, modified, .. } in &self.pictures {
            hasher.update(format!("{name}\n{bytes} {modified}\n").as_bytes());
        }
        format!("{} files (checksum {:08x})", self.pictures.len(), hasher.finalize())
    }

    /// Errors if two photographs differ in size, which one camera cannot have.
    pub(super) fn check_one_size(&self) -> Result<(), Error> {
        let Some(first) = self.pictures.first() else { return Ok(()) };
        let Some(other) = self.pictures.iter().find(|picture| picture.size != first.size) else { return Ok(()) };
        Err(Error::Usage(format!(
            "{}: {} has {}x{} pixels and {} has {}x{}, but one camera is shared; give pictures of one size, or --camera-each",
            self.folder.display(),
            escaped(&first.name),
            first.size[0],
            first.size[1],
            escaped(&other.name),
            other.size[0],
            other.size[1]
        )))
    }

    /// True if the photographs are already in `images`.
    pub(super) fn are_in(&self, images: &Path) -> bool {
        fs::canonicalize(images).is_ok_and(|images| fs::canonicalize(&self.folder).is_ok_and(|own| own == images))
    }

    /// Copies the photographs into `images`; with `link` as hard links if the file system can.
    pub(super) fn place(
        &self,
        images: &Path,
        link: bool,
        progress: &Progress<'_>,
        interrupted: &AtomicBool,
    ) -> Result<(), Error> {
        for (done, picture) in self.pictures.iter().enumerate() {
            if interrupted.load(Ordering::SeqCst) {
                return Err(stopped("pictures"));
            }
            let to = images.join(&picture.name);
            // A hard link to a symbolic link would depend on its target.
            let from = fs::canonicalize(&picture.path).map_err(Error::io("read", &picture.path))?;
            let is_there = fs::canonicalize(&to).is_ok_and(|there| there == from);
            if !is_there {
                // A picture of an interrupted run; a copy over a hard link would write into the original.
                remove(&to, |path| fs::remove_file(path))?;
                if !link || fs::hard_link(&from, &to).is_err() {
                    copy(&from, &to)?;
                }
            }
            progress.set(done as u64 + 1, String::new);
        }
        Ok(())
    }
}

/// Copies the content, not the permissions: a copy of a read-only file can be removed and replaced.
fn copy(from: &Path, to: &Path) -> Result<(), Error> {
    let mut source = File::open(from).map_err(Error::io("read", from))?;
    let mut copy = File::create_new(to).map_err(Error::io("write", to))?;
    io::copy(&mut source, &mut copy).map(drop).map_err(Error::io("write", to))
}

/// The photograph in the file `path`, else why it is none.
fn photograph(path: &Path, name: Option<&str>) -> Result<ListedPhotograph, String> {
    let Some(name) = name else { return Err("the name is not UTF-8".into()) };
    if name.contains(['\n', '\r']) || name.trim() != name {
        return Err("the name has a line feed, or a blank at an end".into());
    }
    // Follows symbolic links.
    let metadata = fs::metadata(path).map_err(|error| format!("cannot be read: {error}"))?;
    if metadata.is_dir() {
        return Err("a folder; its pictures are not used".into());
    }
    if !metadata.is_file() {
        return Err("a device or a pipe".into());
    }
    let (format, size) = dataset::picture_size(path).map_err(|error| match error {
        dataset::Error::Read { source, .. } => format!("cannot be read: {source}"),
        dataset::Error::Picture { found, .. } => format!("cannot be decoded: {found}"),
        dataset::Error::PictureFormat { found, .. } => found,
        other => format!("cannot be decoded: {other}"),
    })?;
    let modified = metadata.modified().ok().and_then(|time| time.duration_since(std::time::UNIX_EPOCH).ok());
    Ok(ListedPhotograph {
        name: name.to_owned(),
        path: path.to_path_buf(),
        bytes: metadata.len(),
        modified: modified.map_or(0, |since| since.as_secs()),
        format,
        size,
    })
}
