//! Files that another file names: buffers of glTF, pictures of SOG. A file from anyone must not choose what is read.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use super::Fault;
use super::error::excerpt;

/// Bytes of the separate files that a file names, of one and of all together.
pub(super) const MAX_BESIDE: u64 = 8 << 30;

/// The bytes of the file `name` in the folder of the file `path` that names it.
///
/// # Errors
///
/// If the file cannot be read or lies outside the folder.
pub fn beside(path: &Path, name: &str) -> Result<Vec<u8>, Fault> {
    check_name(name)?;
    let wrong = |problem: &str| Fault::broken(format!("the separate file \"{name}\""), problem);
    let unreadable = |error: std::io::Error| wrong(&format!("cannot read it: {error}"));
    let path = path.parent().unwrap_or(Path::new("")).join(name);
    // Check that it is a file before opening it: opening a pipe would block.
    let metadata = path.metadata().map_err(unreadable)?;
    if !metadata.is_file() {
        return Err(wrong("it is not a regular file"));
    }
    Fault::unless_within("bytes of a separate file", MAX_BESIDE, metadata.len())?;
    let mut bytes = Vec::with_capacity(metadata.len() as usize);
    File::open(path).map_err(unreadable)?.take(MAX_BESIDE).read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// Checks that `name` is relative and stays in its folder on every system.
pub(super) fn check_name(name: &str) -> Result<(), Fault> {
    let leaves = name.starts_with('/') || name.contains(['\\', ':', '\0']) || name.split('/').any(|part| part == "..");
    if name.is_empty() || leaves {
        let what = format!("a separate file at {}", excerpt(name.as_bytes()));
        return Err(Fault::unsupported(
            what,
            "move it into the folder of the file that names it, and name it by a relative path",
        ));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_beside_are_read_from_the_folder_only() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir(folder.path().join("parts")).unwrap();
        std::fs::write(folder.path().join("parts/a.bin"), b"abc").unwrap();
        let model = folder.path().join("model.gltf");
        assert_eq!(beside(&model, "parts/a.bin").unwrap(), b"abc");
        let fault = |name| beside(&model, name).unwrap_err().to_string();
        assert!(fault("none.bin").starts_with("the separate file \"none.bin\": cannot read it: "));
        assert_eq!(fault("parts"), "the separate file \"parts\": it is not a regular file");
        assert!(fault("../model.gltf").starts_with("a separate file at \"../model.gltf\" is not supported"));
    }
}
