//! Files of a dataset: read within limits, and looked for by name.

use std::ffi::OsStr;
use std::fs::{self, File};
use std::io;
use std::io::Read;
use std::path::{Component, Path, PathBuf};

use super::Error;

/// The most bytes that a file of a dataset may have.
const MAX_FILE_BYTES: u64 = 512 << 20;
/// The most bytes of a file of a few numbers.
const MAX_TEXT_BYTES: u64 = 1 << 20;
/// The bytes before a text in UTF-8 that some programs write.
pub const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";
/// Endings of pictures, in lower case.
pub const PICTURES: [&str; 7] = ["png", "jpg", "jpeg", "webp", "tif", "tiff", "bmp"];

/// The bytes of a regular file of at most `MAX_FILE_BYTES`.
pub fn read(path: &Path) -> Result<Vec<u8>, Error> {
    read_at_most(path, MAX_FILE_BYTES)
}

fn read_at_most(path: &Path, limit: u64) -> Result<Vec<u8>, Error> {
    // Before it is opened: a pipe without a writer would block. A folder has an error of its own.
    let metadata = fs::metadata(path).map_err(Error::read(path))?;
    if !metadata.is_file() && !metadata.is_dir() {
        let error = io::Error::new(io::ErrorKind::InvalidInput, "it is a device or a pipe, not a regular file");
        return Err(Error::read(path)(error));
    }
    let file = File::open(path).map_err(Error::read(path))?;
    let mut bytes = Vec::new();
    // The file may grow meanwhile.
    file.take(limit + 1).read_to_end(&mut bytes).map_err(Error::read(path))?;
    let found = bytes.len() as u64;
    if found > limit {
        return Err(Error::TooLarge { path: path.to_path_buf(), what: "bytes", limit, found });
    }
    Ok(bytes)
}

/// The text of a file, which may be as large as any file.
pub fn read_listing(path: &Path) -> Result<String, Error> {
    text(path, read(path)?)
}

/// The text of a file of a few numbers.
pub fn read_text(path: &Path) -> Result<String, Error> {
    text(path, read_at_most(path, MAX_TEXT_BYTES)?)
}

fn text(path: &Path, mut bytes: Vec<u8>) -> Result<String, Error> {
    if bytes.starts_with(BYTE_ORDER_MARK) {
        bytes.drain(..BYTE_ORDER_MARK.len());
    }
    String::from_utf8(bytes).map_err(|error| {
        let place = format!("byte {}", error.utf8_error().valid_up_to());
        Error::text(path, place, "UTF-8 text", "other bytes")
    })
}

/// `path` without `.` components. `None` if it is empty, absolute or has `..`, and so may leave the dataset's folder.
/// Backslashes, which programs on Windows write, separate components too.
pub fn inside(path: &str) -> Option<PathBuf> {
    let mut inside = PathBuf::new();
    for component in Path::new(&path.replace('\\', "/")).components() {
        match component {
            Component::Normal(name) => inside.push(name),
            Component::CurDir => {}
            Component::ParentDir | Component::RootDir | Component::Prefix(_) => return None,
        }
    }
    (!inside.as_os_str().is_empty()).then_some(inside)
}

/// True for names that begin with a dot, as those that macOS leaves beside pictures (`._a.png`).
pub fn is_hidden(name: &OsStr) -> bool {
    name.as_encoded_bytes().starts_with(b".")
}

/// True if the name of `path` ends as a picture's.
pub fn is_picture(path: &Path) -> bool {
    let ending = path.extension().and_then(|ending| ending.to_str()).unwrap_or_default();
    PICTURES.iter().any(|known| ending.eq_ignore_ascii_case(known))
}

/// `path` without the ending of a picture.
pub fn without_ending(path: &Path) -> PathBuf {
    if is_picture(path) { path.with_extension("") } else { path.to_path_buf() }
}

/// The picture `path`, which lacks its ending: the one that exists, else that of the first of [`PICTURES`].
pub fn with_ending(path: &Path) -> PathBuf {
    let with = |ending: &str| {
        let mut path = path.to_path_buf();
        path.as_mut_os_string().push(format!(".{ending}"));
        path
    };
    PICTURES.iter().map(|ending| with(ending)).find(|path| path.is_file()).unwrap_or_else(|| with(PICTURES[0]))
}

/// The pictures in `folder` but hidden ones, ascending by name.
pub fn pictures_in(folder: &Path) -> Result<Vec<PathBuf>, Error> {
    let mut pictures = Vec::new();
    for entry in fs::read_dir(folder).map_err(Error::read(folder))? {
        let path = entry.map_err(Error::read(folder))?.path();
        if is_picture(&path) && !path.file_name().is_some_and(is_hidden) {
            pictures.push(path);
        }
    }
    pictures.sort();
    Ok(pictures)
}

/// The folder of the pictures of `folder` made `downscale` times smaller, named `FOLDER_N`, if there is one.
pub fn smaller(folder: &Path, downscale: u32) -> Option<PathBuf> {
    let mut smaller = folder.to_path_buf();
    smaller.as_mut_os_string().push(format!("_{downscale}"));
    (downscale > 1 && smaller.is_dir()).then_some(smaller)
}

/// The last component of `folder`, also where it is written as `.` or ends in `..`.
pub fn name_of(folder: &Path) -> String {
    let whole = fs::canonicalize(folder).unwrap_or_else(|_| folder.to_path_buf());
    whole.file_name().map_or_else(|| "dataset".to_owned(), |name| name.to_string_lossy().into_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_that_may_leave_the_folder_are_none() {
        assert_eq!(inside("./images\\0001.jpg"), Some(PathBuf::from("images/0001.jpg")));
        for path in ["", ".", "/etc/passwd", "../a.png", "images/../../a.png", "\\\\host\\a.png"] {
            assert_eq!(inside(path), None, "{path}");
        }
    }

    #[test]
    fn endings_are_those_of_pictures_only() {
        assert_eq!(without_ending(Path::new("a/r_0.5")), Path::new("a/r_0.5"));
        assert_eq!(without_ending(Path::new("a/r_0.5.JPG")), Path::new("a/r_0.5"));
    }

    #[test]
    fn smaller_pictures_are_used_for_their_factor_only() {
        let folder = tempfile::tempdir().unwrap();
        let images = folder.path().join("images");
        fs::create_dir(folder.path().join("images_4")).unwrap();
        assert_eq!(smaller(&images, 4), Some(folder.path().join("images_4")));
        assert_eq!([smaller(&images, 2), smaller(&images, 1)], [None, None]);
    }
}
