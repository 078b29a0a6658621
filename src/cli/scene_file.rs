//! Reading `.strivec` files.

use std::io;
use std::path::Path;

use super::Error;
use super::console::Console;
use strivec_field::Field;
use strivec_format::container;
use strivec_format::container::{Limits, Metadata, SceneFile};
use strivec_format::model::{ReferenceField, Scene};
use strivec_recipe::read_file;

/// The bytes of the file `path`, or of standard input for `-`, which may have no end.
pub(super) fn read_bytes(path: &Path) -> Result<Vec<u8>, Error> {
    if path != Path::new("-") {
        return Ok(read_file(path)?);
    }
    container::read_all(&mut io::stdin().lock()).map_err(|error| match error {
        container::Error::Source { message, .. } => Error::Io(format!("cannot read standard input: {message}")),
        error => Error::container(path, error),
    })
}

/// The scene and metadata of the file `path`, and its bytes. Warns of the sections that were skipped.
pub(super) fn read(path: &Path, console: &Console) -> Result<(SceneFile, Vec<u8>), Error> {
    let bytes = read_bytes(path)?;
    let scene_file = container::decode_scene_file(&bytes, Limits::of_file(bytes.len() as u64))
        .map_err(|e| Error::container(path, e))?;
    warn_of_skipped(path, &scene_file.metadata, console);
    Ok((scene_file, bytes))
}

/// Checks that pictures of the `scene` of the file `path` take at most the memory that its size allows, for what compares
/// pictures without a renderer of its own.
pub(super) fn check_memory(path: &Path, scene: &Scene) -> Result<(), Error> {
    let checked = Field::<f32>::check_memory(scene).and_then(|()| ReferenceField::check_memory(scene));
    checked.map_err(Error::memory(path))
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
