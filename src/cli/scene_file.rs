//! Reading `.strivec` files.

use std::io::Read;
use std::path::Path;
use std::{fs, io};

use super::Error;
use super::console::Console;
use strivec_format::container;
use strivec_format::container::{Limits, Metadata, SceneFile};

/// The bytes of the file `path`, or of standard input for `-`.
pub(super) fn read_bytes(path: &Path) -> Result<Vec<u8>, Error> {
    if path != Path::new("-") {
        return fs::read(path).map_err(Error::io("read", path));
    }
    let mut bytes = Vec::new();
    let read = io::stdin().lock().read_to_end(&mut bytes);
    read.map(|_| bytes).map_err(|e| Error::Io(format!("cannot read standard input: {e}")))
}

/// The scene and metadata of the file `path`, and its bytes. Warns of the sections that were skipped.
pub(super) fn read(path: &Path, console: &Console) -> Result<(SceneFile, Vec<u8>), Error> {
    let bytes = read_bytes(path)?;
    let scene_file = container::decode_scene_file(&bytes, Limits::of_file(bytes.len() as u64))
        .map_err(|e| Error::container(path, e))?;
    warn_of_skipped(path, &scene_file.metadata, console);
    Ok((scene_file, bytes))
}

/// Prints which sections of the file `path` the reader could not use, and why.
pub(super) fn warn_of_skipped(path: &Path, metadata: &Metadata, console: &Console) {
    for skipped in &metadata.skipped {
        console.say(&format!("warning: {}: {skipped}", path.display()));
    }
}

/// The mean squared error of the scene's pictures to photographs: the file's, else that of a typical scene. Errors of
/// encodings and approximations are independent of it and add to it.
pub(super) fn scene_error(metadata: &Metadata) -> f64 {
    const USUAL_PSNR: f64 = 36.0;
    let known = metadata.quality.as_ref().and_then(|q| q.test);
    10f64.powf(-known.unwrap_or(USUAL_PSNR) / 10.0)
}
