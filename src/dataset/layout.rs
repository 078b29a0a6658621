//! The layouts of datasets, and which one a folder has.

use std::path::{Path, PathBuf};

use super::capture::Capture;
use super::shot::Split;
use super::{Error, Scan, colmap, files, llff, metashape, nsvf, scannet, transforms};

strivec_format::named! {
    /// How photographs and their poses lie in a folder, in the order in which a folder is compared with layouts.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
    pub enum Layout {
        /// `transforms_train.json` and its kin, of NeRF-synthetic.
        Blender = "blender",
        /// One `transforms.json`, of Instant-NGP and nerfstudio.
        Transforms = "transforms",
        /// `cameras` and `images` of a sparse reconstruction, and `images/`.
        Colmap = "colmap",
        /// `intrinsics.txt`, `pose/` and `rgb/`, of Tanks and Temples.
        Nsvf = "nsvf",
        /// `pose/` and `color/`.
        ScanNet = "scannet",
        /// `poses_bounds.npy` and `images/`.
        Llff = "llff",
        /// `cameras.xml` and `images/`.
        Metashape = "metashape",
    }
}

impl Layout {
    /// The files by which it is recognized.
    pub fn files(self) -> &'static str {
        match self {
            Self::Blender => "transforms_train.json",
            Self::Transforms => "transforms.json",
            Self::Colmap => {
                "cameras and images (.bin or .txt) in sparse/0, sparse or colmap/sparse/0; pictures in images/"
            }
            Self::Nsvf => "intrinsics.txt, pose/ and rgb/",
            Self::Llff => "poses_bounds.npy; pictures in images/",
            Self::ScanNet => "pose/ and color/",
            Self::Metashape => "cameras.xml; pictures in images/",
        }
    }

    /// The error that `folder` has none of the `layouts`.
    fn not_found(folder: &Path, layouts: &[Self]) -> Error {
        let wanted: Vec<_> = layouts.iter().map(|layout| format!("{} ({})", layout.name(), layout.files())).collect();
        Error::Layout { path: folder.to_path_buf(), found: found_in(folder), wanted: wanted.join(", ") }
    }

    /// The layout of `folder`.
    ///
    /// # Errors
    ///
    /// If it is not a folder or has no layout's files.
    pub fn of(folder: &Path) -> Result<Self, Error> {
        if folder.is_file() {
            return Err(Error::NotAFolder { path: folder.to_path_buf() });
        }
        // A folder that cannot be read has no layout for that reason.
        std::fs::read_dir(folder).map_err(Error::read(folder))?;
        for layout in Self::ALL {
            if layout.is_in(folder)? {
                return Ok(layout);
            }
        }
        Err(Self::not_found(folder, &Self::ALL))
    }

    fn is_in(self, folder: &Path) -> Result<bool, Error> {
        Ok(match self {
            Self::Blender => !transforms::splits(folder)?.is_empty(),
            Self::Transforms => folder.join("transforms.json").is_file(),
            Self::Colmap => colmap::Project::find(folder).is_some(),
            Self::Nsvf => nsvf::PARTS.iter().all(|part| folder.join(part).exists()),
            Self::ScanNet => Scan::open(folder)?.is_some(),
            Self::Llff => folder.join(llff::POSES).is_file(),
            Self::Metashape => folder.join(metashape::CAMERAS).is_file(),
        })
    }

    /// The dataset in `folder`, as far as the split `split` needs it, with the files of its pictures.
    pub(super) fn read(self, folder: &Path, split: &str, downscale: u32) -> Result<Capture, Error> {
        let mut capture = self.listed(folder, split, downscale)?;
        capture.find_pictures(folder);
        if self == Self::Transforms {
            // Instant-NGP leaves them out, too, and its own examples lack some.
            capture.leave_out_missing();
        }
        Ok(capture)
    }

    /// The dataset in `folder` by its files alone.
    fn listed(self, folder: &Path, split: &str, downscale: u32) -> Result<Capture, Error> {
        let not_found = || Self::not_found(folder, &[self]);
        match self {
            Self::Blender => blender(folder, split, downscale),
            Self::Transforms => transforms::read(&folder.join("transforms.json"), None, downscale),
            Self::Colmap => colmap::Project::find(folder).ok_or_else(not_found)?.read(folder, downscale),
            Self::Nsvf => nsvf::read(folder),
            Self::Llff => llff::read(folder, downscale),
            Self::Metashape => metashape::read(folder, downscale),
            Self::ScanNet => scannet::read(Scan::open(folder)?.ok_or_else(not_found)?, split),
        }
    }
}

/// The file of one split; of all, for `all`.
fn blender(folder: &Path, split: &str, downscale: u32) -> Result<Capture, Error> {
    let splits = transforms::splits(folder)?;
    let json = |split: &str| -> PathBuf { folder.join(format!("transforms_{split}.json")) };
    let is_all = split == "all";
    let wanted: Vec<&str> = match split {
        // Files such as `transforms_backup.json` beside those of the three splits are copies.
        "all" if splits.iter().any(|split| split == "train") => {
            let known = splits.iter().filter(|name| Split::ALL.iter().any(|split| split.name() == name.as_str()));
            known.map(String::as_str).collect()
        }
        "all" => splits.iter().map(String::as_str).collect(),
        split => vec![split],
    };
    let mut capture = Capture::new(&if is_all { folder.to_path_buf() } else { json(split) }, Vec::new());
    for name in wanted {
        if !json(name).is_file() {
            return Err(Error::MissingSplit { path: json(name), splits });
        }
        // Other splits than these are part of `all` only.
        let of_name = Split::ALL.into_iter().find(|split| split.name() == name);
        let Capture { shots, lost, entries, .. } = transforms::read(&json(name), of_name, downscale)?;
        capture.shots.extend(shots);
        capture.entries.extend(entries);
        capture.lost += lost;
        capture.inputs.push(json(name));
    }
    Ok(capture)
}

/// The nearest to a layout that `folder`, which has none, comes: a part of its files, or pictures without poses.
fn found_in(folder: &Path) -> String {
    let mut candidates: Vec<(Layout, Vec<String>)> =
        colmap::Project::places().map(|files| (Layout::Colmap, files.into())).collect();
    candidates.push((Layout::Nsvf, nsvf::PARTS.map(str::to_owned).into()));
    candidates.push((Layout::ScanNet, scannet::PARTS.map(str::to_owned).into()));
    let split = |files: Vec<String>| files.into_iter().partition::<Vec<_>, _>(|file| folder.join(file).exists());
    let partial = candidates.into_iter().map(|(layout, files)| (layout, split(files)));
    if let Some((layout, (present, absent))) = partial.rev().max_by_key(|(_, (present, _))| present.len())
        && !present.is_empty()
    {
        return format!("{} of {} without {}", present.join(" and "), layout.name(), absent.join(" and "));
    }
    if let Some((layout, inner)) = dataset_below(folder) {
        return format!("the layout {} in its folder {inner}, which is the folder to pass", layout.name());
    }
    let pictures = [folder.to_path_buf(), folder.join("images")].map(|folder| files::pictures_in(&folder));
    match pictures.into_iter().flatten().map(|pictures| pictures.len()).max() {
        None | Some(0) => "neither files of a layout nor pictures".into(),
        Some(count) => format!("{count} pictures without poses, which `strivec pose` estimates"),
    }
}

/// The layout of the first folder in `folder` that has one, and the folder's name.
fn dataset_below(folder: &Path) -> Option<(Layout, String)> {
    let entries = std::fs::read_dir(folder).ok()?.flatten();
    let mut below: Vec<_> = entries.map(|entry| entry.path()).filter(|path| path.is_dir()).collect();
    below.sort();
    below.into_iter().find_map(|inner| {
        let layout = Layout::ALL.into_iter().find(|layout| layout.is_in(&inner).is_ok_and(|is_in| is_in))?;
        Some((layout, inner.file_name()?.to_string_lossy().into_owned()))
    })
}
