//! Loading, common to all layouts: the choice of views, and their pictures, decoded in parallel.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use rayon::prelude::*;

use super::capture::Capture;
use super::decoding_memory::DecodingMemory;
use super::picture::{self, MAX_EDGE, PictureHeader};
use super::shot::{Shot, is_scaled};
use super::{Dataset, DepthMap, Error, Layout, LoadOptions, NamedCamera, Photograph, files, transforms};
use strivec_format::geometry::Camera;
use strivec_format::{Invalid, Place};

/// Bytes of a pixel in memory: as stored, and averaged or of more than 8 bits.
const PIXEL_BYTES: (u64, u64) = (4, 16);

/// A photograph that fits its camera.
struct Fitted<'a> {
    shot: &'a Shot,
    is_turned: bool,
    /// The picture has more than 8 bits per channel.
    is_deep: bool,
    /// Bytes that decoding takes besides the pixels.
    decoding_bytes: u64,
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

/// The cameras of the same photographs in the same order; no picture is decoded. `size` (columns and rows, before
/// downscaling) is for datasets without the size of their pictures.
///
/// # Errors
///
/// The errors of [`load`], but for pictures; and if no size is known.
pub fn load_cameras(
    folder: &Path,
    split: &str,
    size: Option<[u32; 2]>,
    options: &LoadOptions,
) -> Result<Vec<NamedCamera>, Error> {
    cameras(&capture(folder, split, options)?, split, size, options)
}

/// The cameras of all frames of one `transforms.json` file, which need not be in a dataset; else as [`load_cameras`].
///
/// # Errors
///
/// The errors of [`load_cameras`].
pub fn load_transforms_cameras(
    json: &Path,
    size: Option<[u32; 2]>,
    options: &LoadOptions,
) -> Result<Vec<NamedCamera>, Error> {
    cameras(&transforms::read(json, None, options.downscale)?, "all", size, options)
}

/// How many times smaller the photographs of the split must be made to fit into `options.max_memory` while the largest is
/// decoded, and their bytes at full size. `options.downscale` does not count; no picture is decoded.
///
/// # Errors
///
/// The errors of [`load`], but for pictures.
pub fn fitting_downscale(folder: &Path, split: &str, options: &LoadOptions) -> Result<(u32, u64), Error> {
    let options = LoadOptions { downscale: 1, ..options.clone() };
    let capture = capture(folder, split, &options)?;
    let fitted = existing(&capture, split, &options)?;
    let memory = options.max_memory.saturating_sub(check_decoding(&fitted, options.max_memory)?);
    let fits = |factor: &u32| bytes_of(&fitted, *factor) <= memory;
    // Loading refuses factors that leave no pixel.
    Ok(((1..MAX_EDGE).find(fits).unwrap_or(MAX_EDGE), bytes_of(&fitted, 1)))
}

/// Checks that `limit` bytes are enough to decode each of `photographs`. Returns how many are.
fn check_decoding(photographs: &[Fitted<'_>], limit: u64) -> Result<u64, Error> {
    let Some(largest) = photographs.iter().max_by_key(|fitted| fitted.decoding_bytes) else { return Ok(0) };
    DecodingMemory::new(limit).check(&largest.shot.picture, largest.decoding_bytes)?;
    Ok(largest.decoding_bytes)
}

/// Bytes of `photographs` in memory if they are made `more` times smaller still.
fn bytes_of(photographs: &[Fitted<'_>], more: u32) -> u64 {
    photographs.iter().map(|fitted| fitted.bytes(more)).fold(0, u64::saturating_add)
}

/// Sets the distances of the views of `dataset` that have a depth map. Returns the number of these views.
///
/// # Errors
///
/// If a map cannot be read or has another shape than its photograph.
pub fn read_distances(dataset: &mut Dataset) -> Result<usize, Error> {
    let Dataset { views, depth_maps, .. } = dataset;
    let by_name: HashMap<&str, &DepthMap> = depth_maps.iter().map(|map| (map.shot.name.as_str(), map)).collect();
    let memory = DecodingMemory::new(LoadOptions::MAX_MEMORY);
    let read: Vec<_> = (views.par_iter_mut())
        .filter_map(|view| Some((by_name.get(view.name.as_str())?, view)))
        .map(|(map, view)| map.distances(&view.camera, &memory).map(|distances| view.distances = distances))
        .collect();
    let count = read.len();
    read.into_iter().collect::<Result<Vec<_>, _>>()?;
    Ok(count)
}

/// The dataset in `folder`, as far as the split `split` needs it.
pub(super) fn capture(folder: &Path, split: &str, options: &LoadOptions) -> Result<Capture, Error> {
    let layout = options.layout.map_or_else(|| Layout::of(folder), Ok)?;
    let mut capture = layout.read(folder, split, options.downscale)?;
    if options.skip_missing {
        capture.leave_out_missing();
    }
    if options.turn_degrees != 0.0 {
        capture.turn(options.turn_degrees);
    }
    Ok(capture)
}

/// The photographs of the split `split` of `capture` that `options` select.
fn loaded(name: String, capture: Capture, split: &str, options: &LoadOptions) -> Result<Dataset, Error> {
    let fitted = existing(&capture, split, options)?;
    let found = bytes_of(&fitted, 1);
    if found > options.max_memory {
        return Err(Error::Memory { path: capture.listing.clone(), limit: options.max_memory, found });
    }
    let left = options.max_memory - found;
    check_decoding(&fitted, left)?;
    let memory = DecodingMemory::new(left);
    let views: Vec<_> = fitted.par_iter().map(|fitted| fitted.view(&memory)).collect();
    let views = views.into_iter().collect::<Result<_, _>>()?;
    let Capture { lost, left_out, points, bounds, depth_maps, .. } = capture;
    Ok(Dataset { name, views, lost, left_out, points, bounds, depth_maps })
}

/// The cameras of the split `split` of `capture` that `options` select. `size` (columns and rows) is for pictures that do
/// not exist and whose size is not in the layout's files.
pub(super) fn cameras(
    capture: &Capture,
    split: &str,
    size: Option<[u32; 2]>,
    options: &LoadOptions,
) -> Result<Vec<NamedCamera>, Error> {
    let fitted = fitted(&selected(capture, split, options)?, &capture.listing, size, options)?;
    Ok(fitted.into_iter().map(|Fitted { shot, camera, .. }| NamedCamera { name: shot.name.clone(), camera }).collect())
}

/// The shots of the split `split` that `options` select.
fn selected<'a>(capture: &'a Capture, split: &str, options: &LoadOptions) -> Result<Vec<&'a Shot>, Error> {
    let shots = capture.split(split, &options.holdout)?;
    Ok(chosen(&capture.listing, shots.len(), options)?.into_iter().map(|n| shots[n]).collect())
}

/// The photographs that `options` select, all of whose pictures exist.
fn existing<'a>(capture: &'a Capture, split: &str, options: &LoadOptions) -> Result<Vec<Fitted<'a>>, Error> {
    let shots = selected(capture, split, options)?;
    let missing: Vec<_> = shots.iter().map(|shot| &shot.picture).filter(|picture| !picture.is_file()).collect();
    if let Some(first) = missing.first() {
        let (path, picture) = (capture.listing.clone(), first.to_path_buf());
        return Err(Error::MissingPictures { path, picture, count: missing.len(), of: shots.len() });
    }
    fitted(&shots, &capture.listing, None, options)
}

/// `shots` with the cameras of their pictures. Pictures that do not exist are as large as in the layout's files, else
/// as those that do, else of `size`.
fn fitted<'a>(
    shots: &[&'a Shot],
    listing: &Path,
    size: Option<[u32; 2]>,
    options: &LoadOptions,
) -> Result<Vec<Fitted<'a>>, Error> {
    // Collected before the first error is picked, so that it does not depend on which thread was faster.
    let headers: Vec<_> = (shots.par_iter())
        .map(|shot| shot.picture.is_file().then(|| picture::header(&shot.picture)).transpose())
        .collect();
    let headers = headers.into_iter().collect::<Result<Vec<_>, _>>()?;
    check_sizes(shots.iter().zip(&headers).filter_map(|(shot, header)| Some((*shot, (*header)?))))?;
    let like = headers.iter().flatten().next().map(PictureHeader::turned_size).or(size);
    (shots.iter().zip(headers))
        .map(|(shot, header)| {
            let header = header.or(shot.intrinsics.size.or(like).map(PictureHeader::upright));
            let header = header.ok_or_else(|| Error::UnknownSize { path: listing.to_path_buf() })?;
            Fitted::new(shot, header, listing, options.downscale)
        })
        .collect()
}

/// Checks that pictures whose size is not in the layout's files have one size.
fn check_sizes<'a>(pictures: impl Iterator<Item = (&'a Shot, PictureHeader)>) -> Result<(), Error> {
    let mut unsized_pictures = pictures.filter(|(shot, _)| shot.intrinsics.size.is_none());
    let Some((first, PictureHeader { size: expected, .. })) = unsized_pictures.next() else { return Ok(()) };
    match unsized_pictures.find(|(_, header)| header.size != expected) {
        Some((shot, PictureHeader { size: found, .. })) => {
            let (path, like) = (shot.picture.clone(), first.picture.clone());
            Err(Error::PictureSize { path, expected, like, found })
        }
        None => Ok(()),
    }
}

impl<'a> Fitted<'a> {
    fn new(shot: &'a Shot, header: PictureHeader, listing: &Path, downscale: u32) -> Result<Self, Error> {
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
        let PictureHeader { is_deep, decoding_bytes, .. } = header;
        Ok(Self { shot, is_turned, is_deep, decoding_bytes, size, factor, camera })
    }

    /// Bytes of the pixels, if the picture is made `more` times smaller still.
    fn bytes(&self, more: u32) -> u64 {
        let pixels = self.size.map(|extent| u64::from(extent / (self.factor * more))).iter().product::<u64>();
        let is_exact = self.factor * more == 1 && !self.is_deep;
        pixels * if is_exact { PIXEL_BYTES.0 } else { PIXEL_BYTES.1 }
    }

    /// The photograph, decoded within `memory`.
    fn view(&self, memory: &DecodingMemory) -> Result<Photograph, Error> {
        let &Self { shot, is_turned, size, factor, camera, .. } = self;
        let pixels = picture::load(&shot.picture, is_turned, factor, memory)?;
        let load_mask = |mask: &PathBuf| picture::load_mask(mask, is_turned, size, factor, memory);
        let mask = shot.mask.as_ref().map(load_mask).transpose()?;
        let mask = match (mask, camera.seen_pixels()) {
            (Some(mask), Some(seen)) => Some(mask.into_iter().zip(seen).map(|(a, b)| a && b).collect()),
            (mask, seen) => mask.or(seen),
        };
        Ok(Photograph { name: shot.name.clone(), camera, pixels, mask, distances: Vec::new() })
    }
}

/// `camera` in a picture `factor` times smaller.
fn downscaled(camera: Camera, factor: u32, listing: &Path) -> Result<Camera, Error> {
    let size = [camera.width, camera.height];
    if factor == 0 || size.iter().any(|&extent| extent < factor) {
        let expected = format_args!("1 to {}", size[0].min(size[1]));
        let invalid = Invalid::new(Place::option("downscale"), expected, factor);
        return Err(Error::Downscale { path: listing.to_path_buf(), invalid });
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
