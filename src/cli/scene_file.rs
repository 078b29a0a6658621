//! Reading `.strivec` files.

use std::fs;
use std::path::Path;

use super::Error;
use crate::container::{self, Limits, Metadata, SceneFile};
use crate::model::Scene;
use crate::render::Approximation;

/// The scene in the file `path`, and the file's bytes.
pub(super) fn read(path: &Path) -> Result<(Scene, Vec<u8>), Error> {
    let bytes = fs::read(path).map_err(Error::io("read", path))?;
    let scene = container::decode(&bytes).map_err(Error::malformed(path))?;
    Ok((scene, bytes))
}

/// All that is in the file `path`, and its bytes.
pub(super) fn read_scene_file(path: &Path) -> Result<(SceneFile, Vec<u8>), Error> {
    let bytes = fs::read(path).map_err(Error::io("read", path))?;
    let document = container::decode_scene_file(&bytes, Limits::default()).map_err(|e| Error::container(path, e))?;
    Ok((document, bytes))
}

/// The mean squared error of the scene's pictures to photographs: as the file says, else a usual scene's. Those of encodings and
/// of approximations add to it, being independent.
pub(super) fn scene_error(metadata: &Metadata) -> f64 {
    const USUAL_PSNR: f64 = 36.0;
    let known = metadata.quality.as_ref().and_then(|q| q.test);
    10f64.powf(-known.unwrap_or(USUAL_PSNR) / 10.0)
}

/// The scene without the scales that `approximation` leaves out, corrected where the file says how.
pub(super) fn with_scales_of(document: SceneFile, approximation: &Approximation) -> Scene {
    container::first_scales(document.scene, &document.metadata.prefixes, approximation.scales)
}
