//! Loading, common to all layouts: the choice of views, and their pictures, decoded in parallel.

use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};

use rayon::prelude::*;

use super::capture::Capture;
use super::decoding_memory::DecodingMemory;
use super::inventory_entry::{InventoryEntry, Standing, relative_to};
use super::names::NamesOfFolders;
use super::picture::{self, MAX_EDGE, PictureHeader};
use super::records::BadRecords;
use super::shot::{Shot, is_scaled, whole_scale};
use super::{Dataset, DepthMap, Error, Layout, LoadOptions, NamedCamera, Photograph, files, masks, transforms};
use strivec_format::digits::plural;
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
    let mut capture = transforms::read(json, None, options.downscale)?;
    capture.find_pictures(json.parent().unwrap_or(Path::new("")));
    cameras(&capture, "all", size, options)
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
    let (fitted, _) = existing(&capture, split, &options)?;
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
    let by_path: HashMap<&str, &DepthMap> = depth_maps.iter().map(|map| (map.shot.path.as_str(), map)).collect();
    let memory = DecodingMemory::new(LoadOptions::MAX_MEMORY);
    let read: Vec<_> = (views.par_iter_mut())
        .filter_map(|view| Some((by_path.get(view.path.as_str())?, view)))
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
    let (fitted, mut bad) = existing(&capture, split, options)?;
    let found = bytes_of(&fitted, 1);
    if found > options.max_memory {
        return Err(Error::Memory { path: capture.listing.clone(), limit: options.max_memory, found });
    }
    let left = options.max_memory - found;
    check_decoding(&fitted, left)?;
    let memory = DecodingMemory::new(left);
    let loaded: Vec<_> = fitted.par_iter().map(|fitted| fitted.view(&memory)).collect();
    let total = fitted.len() + bad.len();
    let views = loaded.into_iter().filter_map(|view| bad.keep_readable(view)).collect::<Result<Vec<_>, _>>()?;
    let unreadable = bad.tolerated(total)?.iter().map(Error::to_string).collect();
    check_masks(&fitted, &views)?;
    let Capture { lost, left_out, points, bounds, range, depth_maps, .. } = capture;
    Ok(Dataset { name, views, lost, left_out, unreadable, points, bounds, range, depth_maps })
}

/// Refuses masks that leave no pixel of any photograph.
fn check_masks(fitted: &[Fitted<'_>], views: &[Photograph]) -> Result<(), Error> {
    let Some(first) = fitted.iter().find_map(|fitted| fitted.shot.mask.as_ref()) else { return Ok(()) };
    if views.iter().any(|view| view.mask.as_ref().is_none_or(|mask| mask.contains(&true))) {
        return Ok(());
    }
    let found = match views.len() {
        1 => "black alone".into(),
        count => format!("black alone, as are the masks of all {count} photographs"),
    };
    Err(Error::text(first, "the mask", "white where the photograph counts", found))
}

/// The cameras of the split `split` of `capture` that `options` select. `size` (columns and rows) is for pictures that do
/// not exist and whose size is not in the layout's files.
pub(super) fn cameras(
    capture: &Capture,
    split: &str,
    size: Option<[u32; 2]>,
    options: &LoadOptions,
) -> Result<Vec<NamedCamera>, Error> {
    let (fitted, bad) = fitted(&selected(capture, split, options)?, &capture.listing, size, options)?;
    bad.tolerated_beside(fitted.len())?;
    Ok(fitted.iter().map(Fitted::named_camera).collect())
}

/// The name of a split, and its cameras.
pub(super) type SplitCameras = (&'static str, Vec<NamedCamera>);

/// The cameras of the splits `names` of `capture`, and entries on pictures that cannot be decoded, and on sizes that are not as
/// expected.
pub(super) fn described(
    capture: &Capture,
    names: &[&'static str],
    folder: &Path,
    options: &LoadOptions,
) -> Result<(Vec<SplitCameras>, Vec<InventoryEntry>), Error> {
    let (mut splits, mut all, mut unreadable) = (Vec::new(), Vec::new(), Vec::new());
    for &name in names {
        let (fitted, bad) = fitted(&selected(capture, name, options)?, &capture.listing, None, options)?;
        unreadable.extend(bad.tolerated_beside(fitted.len())?);
        splits.push((name, fitted.iter().map(Fitted::named_camera).collect()));
        all.extend(fitted);
    }
    let mut entries = odd_sizes(&all, folder);
    if let Some(first) = unreadable.first() {
        let (what, count) = (format!("{} left out: {first}", plural(unreadable.len(), "picture")), unreadable.len());
        entries.push(InventoryEntry::new(Standing::Unused, relative_to(folder, first.path()), count, what));
    }
    Ok((splits, entries))
}

/// Entries on pictures whose size is no whole fraction of their camera's, or not what the name of their folder says.
fn odd_sizes(fitted: &[Fitted<'_>], folder: &Path) -> Vec<InventoryEntry> {
    let mut odd: BTreeMap<(PathBuf, String), usize> = BTreeMap::new();
    for Fitted { shot, size, .. } in fitted {
        let Some(declared) = shot.intrinsics.size else { continue };
        let [[width, height], [columns, rows]] = [*size, declared];
        let what = match (whole_scale(*size, declared), shot.reduced) {
            (None, _) => format!(
                "of {width}x{height} pixels, no whole fraction of their camera's {columns}x{rows}: cropped pictures need \
                 cameras of their own"
            ),
            (Some((1, _)), reduced) if reduced > 1 => {
                format!(
                    "as large as the photographs ({width}x{height}), not {reduced} times smaller; they are averaged"
                )
            }
            (Some((factor, _)), reduced) if reduced > 1 && factor != reduced => {
                format!("{factor} times smaller than the photographs, not {reduced} times")
            }
            _ => continue,
        };
        *odd.entry((shot.picture.parent().unwrap_or(folder).to_path_buf(), what)).or_default() += 1;
    }
    let entry = |((parent, what), count): ((PathBuf, String), usize)| {
        let what = format!("{} {what}", plural(count, "picture"));
        InventoryEntry::new(Standing::Doubtful, relative_to(folder, &parent), count, what)
    };
    odd.into_iter().map(entry).collect()
}

/// The shots of the split `split` that `options` select.
fn selected<'a>(capture: &'a Capture, split: &str, options: &LoadOptions) -> Result<Vec<&'a Shot>, Error> {
    let shots = capture.split(split, &options.holdout)?;
    Ok(chosen(&capture.listing, shots.len(), options)?.into_iter().map(|n| shots[n]).collect())
}

/// Photographs with the cameras of their pictures, and those whose pictures cannot be decoded.
type FittedAndBad<'a> = (Vec<Fitted<'a>>, BadRecords);

/// The photographs that `options` select, all of whose pictures exist.
fn existing<'a>(capture: &'a Capture, split: &str, options: &LoadOptions) -> Result<FittedAndBad<'a>, Error> {
    let shots = selected(capture, split, options)?;
    let missing: Vec<_> = shots.iter().map(|shot| &shot.picture).filter(|picture| !picture.is_file()).collect();
    if let Some(first) = missing.first() {
        let (path, picture) = (capture.listing.clone(), first.to_path_buf());
        let instead = NamesOfFolders::default().instead_of(&picture);
        return Err(Error::MissingPictures { path, picture, instead, count: missing.len(), of: shots.len() });
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
) -> Result<FittedAndBad<'a>, Error> {
    // Collected before the first error is picked, so that it does not depend on which thread was faster.
    let headers: Vec<_> = (shots.par_iter())
        .map(|shot| shot.picture.is_file().then(|| picture::header(&shot.picture)).transpose())
        .collect();
    let mut bad = BadRecords::default();
    let mut readable = Vec::with_capacity(shots.len());
    for (shot, header) in shots.iter().zip(headers) {
        if let Some(header) = bad.keep_readable(header) {
            readable.push((*shot, header?));
        }
    }
    if readable.is_empty() {
        // Also of the only photograph that is selected.
        bad.tolerated(shots.len())?;
        bad = BadRecords::default();
    }
    check_sizes(readable.iter().filter_map(|(shot, header)| Some((*shot, (*header)?))))?;
    let like = readable.iter().find_map(|(_, header)| *header).map(|header| header.turned_size()).or(size);
    let fitted = readable.into_iter().map(|(shot, header)| {
        let header = header.or(shot.intrinsics.size.or(like).map(PictureHeader::upright));
        let header = header.ok_or_else(|| Error::UnknownSize { path: listing.to_path_buf() })?;
        Fitted::new(shot, header, listing, options.downscale)
    });
    Ok((fitted.collect::<Result<_, _>>()?, bad))
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
        let factor = match (shot.reduced, shot.intrinsics.size) {
            (1, _) => downscale,
            // The folder's name may promise smaller pictures than it has.
            (reduced, Some(declared)) => match whole_scale(size, declared) {
                Some((found, false)) if reduced.is_multiple_of(found) => reduced / found,
                _ => 1,
            },
            (_, None) => 1,
        };
        let camera = downscaled(shot.camera(size), factor, listing)?;
        let PictureHeader { is_deep, decoding_bytes, .. } = header;
        Ok(Self { shot, is_turned, is_deep, decoding_bytes, size, factor, camera })
    }

    fn named_camera(&self) -> NamedCamera {
        NamedCamera { name: self.shot.name.clone(), path: self.shot.path.clone(), camera: self.camera }
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
        let load_mask = |mask: &PathBuf| masks::load(mask, is_turned, size, factor, memory);
        let mask = shot.mask.as_ref().map(load_mask).transpose()?;
        let mask = match (mask, camera.seen_pixels()) {
            (Some(mask), Some(seen)) => Some(mask.into_iter().zip(seen).map(|(a, b)| a && b).collect()),
            (mask, seen) => mask.or(seen),
        };
        let (name, path) = (shot.name.clone(), shot.path.clone());
        Ok(Photograph { name, path, camera, pixels, mask, distances: Vec::new() })
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
