//! Reading `.strivec` files.

use std::fs;
use std::path::Path;

use super::Error;
use crate::container;
use crate::model::Scene;

/// The scene in the file `path`, and the file's bytes.
pub(super) fn read(path: &Path) -> Result<(Scene, Vec<u8>), Error> {
    let bytes = fs::read(path).map_err(Error::io("read", path))?;
    let scene = container::decode(&bytes).map_err(Error::malformed(path))?;
    Ok((scene, bytes))
}
