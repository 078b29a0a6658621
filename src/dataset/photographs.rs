//! Loading, common to all layouts: the choice of views, and their pictures, decoded in parallel.

use std::path::Path;

use rayon::prelude::*;

use super::capture::Capture;
use super::picture::{self, Header};
use super::shot::{Shot, is_scaled};
use super::{Dataset, Error, Layout, LoadOptions, NamedCamera, View, files, transforms};
use crate::geometry::Camera;

/// The most pixels of what is loaded, after downscaling; they take 4 bytes each, 16 where they were averaged or are deep.
const MAX_PIXELS: u64 = 1 << 30;

/// A photograph that fits its camera.
struct Fitted<'a> {
    shot: &'a Shot,
    is_turned: bool,
    /// Columns and rows of the picture.
    size: [u32; 2],
    /// How many times smaller the picture is made.
    factor: u32,
    /// The camera of the picture once it is made smaller.
    camera: Camera,
}

/// The split `split` (`train`, `val`, `test` or `all`) of the dataset in `folder`.
///
/// # Errors
///
/// On everything [`Error`] lists but writing.
pub fn load(folder: &Path, split: &str, options: &LoadOptions) -> Result<Dataset, Error> {
    let capture = capture(folder, split, options)?;
    loaded(files::name_of(folder), capture, split, options)
}

/// The cameras of the same split in the same order; no picture is decoded. `size` (columns and rows, before downscaling)
/// is for datasets that do not say how large their pictures are.
///
/// # Errors
///
/// As [`load`]'s, but for pictures; and if no size is known.
pub fn load_cameras(
    folder: &Path,
    split: &str,
    size: Option<[u32; 2]>,
    options: &LoadOptions,
) -> Result<Vec<NamedCamera>, Error> {
    cameras(capture(folder, split, options)?, split, size, options)
}

/// The cameras of all frames of one `transforms.json` file, which need not be in a dataset; else as [`load_cameras`].
///
/// # Errors
///
/// As [`load_cameras`]'.
pub fn load_transforms_cameras(
    json: &Path,
    size: Option<[u32; 2]>,
    options: &LoadOptions,
) -> Result<Vec<NamedCamera>, Error> {
    cameras(transforms::read(json, None, options.downscale)?, "all", size, options)
}

fn capture(folder: &Path, split: &str, options: &LoadOptions) -> Result<Capture, Error> {
    let layout = options.layout.map_or_else(|| Layout::of(folder), Ok)?;
    layout.read(folder, split, options.downscale)
}

/// The photographs of the split `split` of `capture` that `options` select.
fn loaded(name: String, mut capture: Capture, split: &str, options: &LoadOptions) -> Result<Dataset, Error> {
    if options.skip_missing {
        capture.leave_out_missing();
    }
    let shots = capture.split(split, &options.holdout)?;
    let chosen = chosen(&capture.listing, shots.len(), options)?;
    let shots: Vec<&Shot> = chosen.into_iter().map(|n| shots[n]).collect();
    let missing: Vec<_> = shots.iter().map(|shot| &shot.picture).filter(|picture| !picture.is_file()).collect();
    if let Some(first) = missing.first() {
        let (path, picture) = (capture.listing.clone(), first.to_path_buf());
        return Err(Error::MissingPictures { path, picture, count: missing.len(), of: shots.len() });
    }
    // Collected before the first error is picked, so that it does not depend on which thread was faster.
    let headers: Vec<_> = shots.par_iter().map(|shot| picture::header(&shot.picture)).collect();
    let headers = headers.into_iter().collect::<Result<Vec<_>, _>>()?;
    check_sizes(shots.iter().copied().zip(headers.iter().copied()))?;
    let fitted = (shots.iter().zip(headers))
        .map(|(shot, header)| Fitted::new(shot, header, &capture.listing, options.downscale))
        .collect::<Result<Vec<_>, _>>()?;
    let pixels = |fitted: &Fitted<'_>| u64::from(fitted.camera.width) * u64::from(fitted.camera.height);
    let found = fitted.iter().map(pixels).fold(0, u64::saturating_add);
    if found > MAX_PIXELS {
        let path = capture.listing.clone();
        return Err(Error::TooLarge { path, what: "pixels of all pictures", limit: MAX_PIXELS, found });
    }
    let views: Vec<_> = fitted.par_iter().map(Fitted::view).collect();
    let views = views.into_iter().collect::<Result<_, _>>()?;
    let Capture { lost, left_out, points, bounds, .. } = capture;
    Ok(Dataset { name, views, lost, left_out, points, bounds })
}

/// The cameras of the same split in the same order; no picture is decoded. `size` (columns and rows) is for pictures that
/// do not exist and whose size the layout does not say.
pub(super) fn cameras(
    mut capture: Capture,
    split: &str,
    size: Option<[u32; 2]>,
    options: &LoadOptions,
) -> Result<Vec<NamedCamera>, Error> {
    if options.skip_missing {
        capture.leave_out_missing();
    }
    let shots = capture.split(split, &options.holdout)?;
    let headers: Vec<_> = (shots.par_iter())
        .map(|shot| shot.picture.is_file().then(|| picture::header(&shot.picture)).transpose())
        .collect();
    let headers = headers.into_iter().collect::<Result<Vec<_>, _>>()?;
    check_sizes(shots.iter().zip(&headers).filter_map(|(shot, header)| Some((*shot, (*header)?))))?;
    // Pictures that do not exist are as large as the layout says, else as those that do, else as the caller says.
    let like = headers.iter().flatten().next().map(Header::turned_size).or(size);
    (shots.iter().zip(headers))
        .map(|(shot, header)| {
            let size = shot.intrinsics.size.or(like);
            let header = header.or(size.map(Header::upright));
            let header = header.ok_or_else(|| Error::UnknownSize { path: capture.listing.clone() })?;
            let camera = Fitted::new(shot, header, &capture.listing, options.downscale)?.camera;
            Ok(NamedCamera { name: shot.name.clone(), camera })
        })
        .collect()
}

/// Checks that pictures whose size the layout does not say have one size.
fn check_sizes<'a>(pictures: impl Iterator<Item = (&'a Shot, Header)>) -> Result<(), Error> {
    let mut unsized_pictures = pictures.filter(|(shot, _)| shot.intrinsics.size.is_none());
    let Some((first, Header { size: expected, .. })) = unsized_pictures.next() else { return Ok(()) };
    match unsized_pictures.find(|(_, header)| header.size != expected) {
        Some((shot, Header { size: found, .. })) => {
            let (path, like) = (shot.picture.clone(), first.picture.clone());
            Err(Error::PictureSize { path, expected, like, found })
        }
        None => Ok(()),
    }
}

impl<'a> Fitted<'a> {
    fn new(shot: &'a Shot, header: Header, listing: &Path, downscale: u32) -> Result<Self, Error> {
        let (stored, turned) = (header.size, header.turned_size());
        // Intrinsics of some programs are for the picture as stored, of others for the turned one.
        let (is_turned, size) = match shot.intrinsics.size {
            None => (true, turned),
            Some(declared) if is_scaled(stored, declared) => (false, stored),
            Some(declared) if is_scaled(turned, declared) => (true, turned),
            Some(expected) => {
                let (path, like) = (shot.picture.clone(), listing.to_path_buf());
                return Err(Error::PictureSize { path, expected, like, found: stored });
            }
        };
        shot.intrinsics.check_principal(size, listing)?;
        let factor = if shot.reduced == downscale { 1 } else { downscale };
        let camera = downscaled(shot.camera(size), factor, listing)?;
        Ok(Self { shot, is_turned, size, factor, camera })
    }

    fn view(&self) -> Result<View, Error> {
        let &Self { shot, is_turned, size, factor, camera } = self;
        let pixels = picture::load(&shot.picture, is_turned, factor)?;
        let mask = shot.mask.as_ref().map(|mask| picture::load_mask(mask, is_turned, size, factor)).transpose()?;
        let mask = match (mask, camera.seen_pixels()) {
            (Some(mask), Some(seen)) => Some(mask.into_iter().zip(seen).map(|(a, b)| a && b).collect()),
            (mask, seen) => mask.or(seen),
        };
        Ok(View { name: shot.name.clone(), camera, pixels, mask })
    }
}

/// `camera` in a picture `factor` times smaller.
fn downscaled(camera: Camera, factor: u32, listing: &Path) -> Result<Camera, Error> {
    let size = [camera.width, camera.height];
    if factor == 0 || size.iter().any(|&extent| extent < factor) {
        return Err(Error::Downscale { path: listing.to_path_buf(), factor, size });
    }
    Ok(camera.downscaled(factor))
}

/// Numbers of the views that `options` select of `count`, at least one. `path` is the file or folder that lists them.
fn chosen(path: &Path, count: usize, options: &LoadOptions) -> Result<Vec<usize>, Error> {
    let (range, every) = (options.views.clone().unwrap_or(0..count), options.every);
    if range.is_empty() || range.end > count || every == 0 {
        return Err(Error::Views { path: path.to_path_buf(), count, range, every });
    }
    Ok(range.step_by(every).collect())
}
