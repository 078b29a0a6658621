//! A dataset as its files describe it, before a picture is opened: its photographs, their split, and what is known of the
//! scene's place.

use std::path::{Path, PathBuf};

use glam::DMat3;

use super::shot::{Shot, Split};
use super::{DepthMap, Error, files};
use strivec_format::geometry::Aabb;

/// The content of a dataset's files but for pictures.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Capture {
    /// The file or folder that lists the photographs.
    pub(super) listing: PathBuf,
    pub(super) shots: Vec<Shot>,
    /// Frames without a known pose.
    pub(super) lost: usize,
    /// Pictures that do not exist, which were left out.
    pub(super) left_out: Vec<PathBuf>,
    /// A file of points on the scene's surfaces, in the dataset's space.
    pub(super) points: Option<PathBuf>,
    /// The box of the scene, in the dataset's space.
    pub(super) bounds: Option<Aabb>,
    /// The depth maps of photographs.
    pub(super) depth_maps: Vec<DepthMap>,
}

/// The interval of test views unless another is chosen.
pub const TEST_EVERY: usize = 8;

/// The choice of test views in a dataset without splits of its own.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Holdout {
    /// The interval of test views among the photographs ascending by name, from the first on; 0 for none.
    pub every: usize,
    /// A text file of their names, one a line, with or without folder and ending; replaces `every`.
    pub names: Option<PathBuf>,
}

impl Default for Holdout {
    /// Every eighth, as in LLFF and mip-NeRF 360.
    fn default() -> Self {
        Self { every: TEST_EVERY, names: None }
    }
}

impl Capture {
    /// The capture of `shots` that the file or folder `listing` names.
    pub(super) fn new(listing: &Path, shots: Vec<Shot>) -> Self {
        Self {
            listing: listing.to_path_buf(),
            shots,
            lost: 0,
            left_out: Vec::new(),
            points: None,
            bounds: None,
            depth_maps: Vec::new(),
        }
    }

    /// Leaves out the photographs whose pictures do not exist.
    pub(super) fn leave_out_missing(&mut self) {
        let (there, missing) = std::mem::take(&mut self.shots).into_iter().partition(|shot| shot.picture.is_file());
        self.shots = there;
        self.left_out.extend(missing.into_iter().map(|shot: Shot| shot.picture));
    }

    /// Turns all cameras about the z axis by so many degrees, counterclockwise seen from above, and leaves out the dataset's
    /// data on the scene's place.
    pub(super) fn turn(&mut self, degrees: f64) {
        let turn = DMat3::from_rotation_z(degrees.to_radians());
        for shot in self.shots.iter_mut().chain(self.depth_maps.iter_mut().map(|map| &mut map.shot)) {
            shot.world_from_camera = turn * shot.world_from_camera;
            shot.position = turn * shot.position;
        }
        (self.points, self.bounds) = (None, None);
    }

    /// The photographs of the split `name`: `train`, `val`, `test`, or `all`. `test` is `val` in datasets that have only
    /// that.
    pub(super) fn split(&self, name: &str, holdout: &Holdout) -> Result<Vec<&Shot>, Error> {
        let of = |split| -> Vec<&Shot> { self.shots.iter().filter(|shot| shot.split == Some(split)).collect() };
        let has_splits = self.shots.iter().any(|shot| shot.split.is_some());
        let chosen = match name {
            "all" => self.shots.iter().collect(),
            "train" if has_splits => of(Split::Train),
            "val" if has_splits => of(Split::Validation),
            "test" if has_splits => {
                Some(of(Split::Test)).filter(|t| !t.is_empty()).unwrap_or_else(|| of(Split::Validation))
            }
            "train" | "test" => self
                .held_out(holdout)?
                .into_iter()
                .filter(|(_, out)| *out == (name == "test"))
                .map(|(shot, _)| shot)
                .collect(),
            _ => return Err(Error::Split { path: self.listing.clone(), found: name.into() }),
        };
        if chosen.is_empty() {
            let path = self.listing.clone();
            return Err(match self.left_out.first() {
                Some(picture) => {
                    let count = self.left_out.len();
                    Error::MissingPictures { path, picture: picture.clone(), count, of: count + self.shots.len() }
                }
                None => Error::NoFrames { path, lost: self.lost },
            });
        }
        Ok(chosen)
    }

    /// The photographs ascending by name, and whether each is a test view.
    fn held_out(&self, holdout: &Holdout) -> Result<Vec<(&Shot, bool)>, Error> {
        let mut shots: Vec<&Shot> = self.shots.iter().collect();
        shots.sort_by(|a, b| a.picture.cmp(&b.picture));
        let Some(list) = &holdout.names else {
            let is_out = |n: usize| holdout.every > 0 && n.is_multiple_of(holdout.every);
            return Ok(shots.into_iter().enumerate().map(|(n, shot)| (shot, is_out(n))).collect());
        };
        let text = files::read_listing(list)?;
        let wanted: Vec<PathBuf> = (text.lines().map(str::trim).filter(|line| !line.is_empty()))
            .map(|line| files::without_ending(Path::new(&line.replace('\\', "/"))))
            .collect();
        let mut is_found = vec![false; wanted.len()];
        let mut held_out = Vec::with_capacity(shots.len());
        for shot in shots {
            let picture = files::without_ending(&shot.picture);
            let mut is_out = false;
            for (name, is_found) in wanted.iter().zip(&mut is_found) {
                if picture.ends_with(name) {
                    (is_out, *is_found) = (true, true);
                }
            }
            held_out.push((shot, is_out));
        }
        match is_found.iter().position(|found| !found) {
            Some(n) => {
                let place = format!("the name {:?}", wanted[n].display().to_string());
                Err(Error::text(list, place, "that of a photograph", "no such photograph"))
            }
            None => Ok(held_out),
        }
    }
}
