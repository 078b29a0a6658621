//! A dataset as its files describe it, before a picture is opened: its photographs, their split, and what is known of the
//! scene's place.

use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};

use glam::DMat3;

use super::inventory_entry::{InventoryEntry, Standing, relative_to};
use super::names::{NamesOfFolders, normal};
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
    /// The range of distances from the cameras at which the scene is.
    pub(super) range: Option<[f64; 2]>,
    /// The depth maps of photographs.
    pub(super) depth_maps: Vec<DepthMap>,
    /// Files that were read beside the listing and the points.
    pub(super) inputs: Vec<PathBuf>,
    /// Files that the layout's reader does not use, or that do not exist.
    pub(super) entries: Vec<InventoryEntry>,
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
            range: None,
            depth_maps: Vec::new(),
            inputs: Vec::new(),
            entries: Vec::new(),
        }
    }

    /// Adds an entry on the file or folder `path` of the dataset.
    pub(super) fn tell(&mut self, standing: Standing, path: impl Into<String>, count: usize, what: impl Into<String>) {
        self.entries.push(InventoryEntry::new(standing, path, count, what));
    }

    /// Tells of `count` of `total` records of `path` that are left out as they are not finite. `first` is the first one's error.
    pub(super) fn tell_bad(&mut self, path: String, errors: &[Error], total: usize, kind: &str) {
        if let Some(first) = errors.first() {
            let what = format!("{} of {total} {kind} left out, as it is not valid: {first}", errors.len());
            self.tell(Standing::Unused, path, errors.len(), what);
        }
    }

    /// Leaves out all but the first of several entries for the same picture.
    pub(super) fn leave_out_repeated(&mut self, folder: &Path) {
        let mut seen: HashMap<PathBuf, usize> = HashMap::new();
        self.shots.retain(|shot| {
            let count = seen.entry(shot.picture.clone()).or_default();
            *count += 1;
            *count == 1
        });
        let repeated: BTreeMap<_, _> = seen.into_iter().filter(|(_, count)| *count > 1).collect();
        for (picture, count) in repeated {
            let what = format!("it has {count} poses, of which the first is used");
            self.tell(Standing::Unused, relative_to(folder, &picture), count - 1, what);
        }
    }

    /// Looks for the pictures in `folder`, the dataset's: in the folder of smaller ones, else among the photographs, under
    /// their exact names or under the only name that means the same. Names the photographs by their paths.
    pub(super) fn find_pictures(&mut self, folder: &Path) {
        let mut names = NamesOfFolders::default();
        // \[folder of smaller pictures\] pictures that it lacks, and all.
        let mut lacking: BTreeMap<PathBuf, [usize; 2]> = BTreeMap::new();
        for shot in self.shots.iter_mut().chain(self.depth_maps.iter_mut().map(|map| &mut map.shot)) {
            shot.find_picture(folder, &mut names, &mut lacking);
        }
        for (smaller, [missing, all]) in lacking.into_iter().filter(|(_, [missing, _])| *missing > 0) {
            let what = format!("it lacks {missing} of {all} pictures, of which the photographs are used");
            self.tell(Standing::Unused, relative_to(folder, &smaller), missing, what);
        }
        let mut counts: HashMap<String, BTreeMap<String, usize>> = HashMap::new();
        for shot in &self.shots {
            *counts.entry(shot.name.clone()).or_default().entry(shot.path.clone()).or_default() += 1;
        }
        for shot in &mut self.shots {
            if counts[&shot.name].len() > 1 {
                // Names name files elsewhere, so they have no folders.
                shot.name = files::without_ending(Path::new(&shot.path)).to_string_lossy().replace('/', "_");
            }
        }
        let repeated: BTreeMap<String, usize> =
            counts.into_values().flatten().filter(|(_, count)| *count > 1).collect();
        if let Some((path, count)) = repeated.first_key_value() {
            let more =
                if repeated.len() > 1 { format!("; {} pictures have several", repeated.len()) } else { String::new() };
            self.tell(
                Standing::Doubtful,
                path.clone(),
                repeated.len(),
                format!("it has {count} poses, all used{more}"),
            );
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
                    let (count, picture) = (self.left_out.len(), picture.clone());
                    let instead = NamesOfFolders::default().instead_of(&picture);
                    Error::MissingPictures { path, picture, instead, count, of: count + self.shots.len() }
                }
                None if self.shots.is_empty() => Error::NoFrames { path, lost: self.lost },
                None => {
                    let others = self.shots.len();
                    Error::EmptySplit { path, split: name.into(), others, is_held_out: !has_splits }
                }
            });
        }
        Ok(chosen)
    }

    /// The photographs ascending by name, and whether each is a test view.
    fn held_out(&self, holdout: &Holdout) -> Result<Vec<(&Shot, bool)>, Error> {
        let mut shots: Vec<&Shot> = self.shots.iter().collect();
        shots.sort_by(|a, b| Path::new(&a.path).cmp(Path::new(&b.path)));
        let Some(list) = &holdout.names else {
            let is_out = |n: usize| holdout.every > 0 && n.is_multiple_of(holdout.every);
            return Ok(shots.into_iter().enumerate().map(|(n, shot)| (shot, is_out(n))).collect());
        };
        let text = files::read_listing(list)?;
        let paths: Vec<&str> = shots.iter().map(|shot| shot.path.as_str()).collect();
        let mut held_out = vec![false; shots.len()];
        for line in text.lines().map(str::trim).filter(|line| !line.is_empty()) {
            let found = meant_by(line, &paths);
            let path = found.first().map(|&n| paths[n]);
            if path.is_none() || found.iter().any(|&n| Some(paths[n]) != path) {
                let name = files::without_ending(Path::new(&line.replace('\\', "/")));
                let place = format!("the name {:?}", name.display().to_string());
                let several = || format!("those of {}", found.iter().map(|&n| paths[n]).collect::<Vec<_>>().join(", "));
                let found = if path.is_none() { "no such photograph".into() } else { several() };
                return Err(Error::text(list, place, "that of a photograph", found));
            }
            found.into_iter().for_each(|n| held_out[n] = true);
        }
        Ok(shots.into_iter().zip(held_out).collect())
    }
}

/// The `paths` that `name` means: that path itself, else those that end in its folders and name, with or without an ending;
/// exactly, else without regard to case and normal form.
pub(super) fn meant_by(name: &str, paths: &[&str]) -> Vec<usize> {
    let name = name.replace('\\', "/");
    let name = name.trim_start_matches("./");
    let is_end = |path: &str, name: &str| {
        let without = |path: &str| files::without_ending(Path::new(path));
        without(path).ends_with(without(name))
    };
    let by = |is_meant: &dyn Fn(&str) -> bool| -> Vec<usize> {
        paths.iter().enumerate().filter(|(_, path)| is_meant(path)).map(|(n, _)| n).collect()
    };
    let lower = normal(name);
    let rules: [&dyn Fn(&str) -> bool; 5] = [
        &|path| path == name,
        &|path| files::without_ending(Path::new(path)) == files::without_ending(Path::new(name)),
        &|path| is_end(path, name),
        &|path| normal(path) == lower,
        &|path| is_end(&normal(path), &lower),
    ];
    rules.iter().map(|rule| by(*rule)).find(|found| !found.is_empty()).unwrap_or_default()
}

impl Shot {
    /// Looks for the picture in `folder`; `lacking` counts, by folder of smaller pictures, those that it lacks, and all.
    fn find_picture(&mut self, folder: &Path, names: &mut NamesOfFolders, lacking: &mut BTreeMap<PathBuf, [usize; 2]>) {
        let mut find = |picture: &Path| match picture.strip_prefix(folder) {
            Ok(relative) => names.find(folder, relative),
            Err(_) => picture.is_file().then(|| picture.to_path_buf()),
        };
        let full = find(&self.picture);
        self.path = relative_to(folder, full.as_ref().unwrap_or(&self.picture));
        if let Some((smaller, factor)) = &self.smaller {
            let found = find(smaller);
            let counts = lacking.entry(smaller.parent().unwrap_or(folder).to_path_buf()).or_default();
            *counts = [counts[0] + usize::from(found.is_none() && full.is_some()), counts[1] + 1];
            if let Some(smaller) = found {
                (self.picture, self.reduced) = (smaller, *factor);
                return;
            }
        }
        self.picture = full.unwrap_or_else(|| self.picture.clone());
    }
}
