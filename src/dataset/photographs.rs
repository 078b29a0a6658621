//! Functions of all layouts: selection of views, and parallel decoding of their pictures.

use std::fs;
use std::path::Path;

use rayon::prelude::*;

use super::{Error, LoadOptions, Pixels, View, picture};
use crate::geometry::Camera;

/// The most pixels that are loaded, after downscaling. A pixel takes 4 bytes, or 16 if it was averaged or has 16-bit
/// channels.
const MAX_PIXELS: u64 = 1 << 30;

/// Indices of the views that `options` select of `count`, at least one. `path` is the file or folder that lists them.
pub(super) fn chosen(path: &Path, count: usize, options: &LoadOptions) -> Result<Vec<usize>, Error> {
    let (range, every) = (options.views.clone().unwrap_or(0..count), options.every);
    if range.is_empty() || range.end > count || every == 0 {
        return Err(Error::Views { path: path.to_path_buf(), count, range, every });
    }
    Ok(range.step_by(every).collect())
}

/// A photograph to load.
pub(super) struct Taken<'a> {
    pub(super) name: &'a str,
    pub(super) picture: &'a Path,
    /// The camera of the downscaled picture.
    pub(super) camera: Camera,
}

/// The photographs `taken`, all of `size` (columns and rows) as in the file `like`, made `downscale` times smaller.
/// `path` is the file or folder that lists them.
pub(super) fn load(
    path: &Path,
    taken: &[Taken<'_>],
    size: [u32; 2],
    like: &Path,
    downscale: u32,
) -> Result<Vec<View>, Error> {
    let pixels = |taken: &Taken<'_>| u64::from(taken.camera.width) * u64::from(taken.camera.height);
    let found = taken.iter().map(pixels).fold(0, u64::saturating_add);
    if found > MAX_PIXELS {
        let path = path.to_path_buf();
        return Err(Error::TooLarge { path, what: "pixels in all pictures", limit: MAX_PIXELS, found });
    }
    // Collected before the first error is selected, so that it does not depend on the order of threads.
    let pixels: Vec<_> = taken.par_iter().map(|taken| picture::load(taken.picture, size, like, downscale)).collect();
    let view = |(taken, pixels): (&Taken<'_>, Result<Pixels, Error>)| {
        Ok(View { name: taken.name.to_owned(), camera: taken.camera, pixels: pixels? })
    };
    taken.iter().zip(pixels).map(view).collect()
}

/// The last component of `folder`, also if it is `.` or ends in `..`.
pub(super) fn name_of(folder: &Path) -> String {
    let whole = fs::canonicalize(folder).unwrap_or_else(|_| folder.to_path_buf());
    whole.file_name().map_or_else(|| "dataset".to_owned(), |name| name.to_string_lossy().into_owned())
}
