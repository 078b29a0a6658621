//! The inventory of a dataset's folder: what is used, what is there and not used, and what its files name but is not there.
//!
//! In: a [`Capture`](super::capture::Capture), and the files of its folder. Out: entries with their reasons, the same for all
//! layouts. Layouts add what only they can tell; what else is in the folder is found here.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use super::capture::Capture;
use super::inventory_entry::{InventoryEntry, Standing, relative_to};
use super::{Layout, files};
use strivec_format::digits::plural;

/// Parts of the names of folders with photographs.
const PHOTOGRAPHS: [&str; 6] = ["image", "rgb", "color", "photo", "frame", "input"];

/// Lines in which people read the inventory, at most.
pub const MAX_LINES: usize = 10;
/// Files of the folder that are looked at, at most.
const MAX_FILES: usize = 200_000;
/// Folders in folders that are looked at, at most.
const MAX_DEPTH: usize = 8;
/// Endings of files of points and meshes.
const GEOMETRY: [&str; 9] = ["ply", "obj", "pcd", "las", "laz", "e57", "xyz", "glb", "splat"];
/// Parts of the names of folders with something else than photographs.
const COMPANIONS: [&str; 7] = ["depth", "distance", "normal", "semantic", "label", "instance", "flow"];

/// The files of a dataset's folder by whether they are used, and those it names that are not there.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Inventory {
    /// All entries, the most important ones first.
    pub entries: Vec<InventoryEntry>,
}

impl Inventory {
    /// The entries that people need to know, each with its label and its line: at most [`MAX_LINES`].
    pub fn lines(&self) -> Vec<(&'static str, String)> {
        let label = |standing| match standing {
            Standing::Absent => "not there",
            Standing::Doubtful => "check",
            Standing::Unused | Standing::Used => "not used",
        };
        let told: Vec<_> = self.entries.iter().filter(|entry| entry.standing != Standing::Used).collect();
        let shown = if told.len() > MAX_LINES { MAX_LINES - 1 } else { told.len() };
        let mut lines: Vec<_> = told[..shown].iter().map(|entry| (label(entry.standing), entry.line())).collect();
        if shown < told.len() {
            lines.push(("not used", format!("{} more, which the JSON lists", told.len() - shown)));
        }
        lines
    }

    /// The inventory of `folder`, which has the layout `layout` and was read as `capture`.
    pub(super) fn of(folder: &Path, layout: Layout, capture: &Capture, downscale: u32) -> Self {
        let mut walk = FolderWalk { used: capture.used_files(), ..FolderWalk::default() };
        walk.folder(folder, 0);
        let mut entries: Vec<_> = capture.entries.clone();
        let unused = entries.iter().filter(|entry| entry.standing == Standing::Unused);
        let named: BTreeSet<PathBuf> = unused.map(|entry| folder.join(&entry.path)).collect();
        let mut others = Vec::new();
        for ((parent, kind), files) in &walk.unused {
            // A layout's own entry on a folder or file precedes what its name lets guess.
            let is_told = |path: &Path| path.ancestors().any(|path| path != folder && named.contains(path));
            let untold: Vec<_> = files.iter().filter(|path| !is_told(path)).collect();
            let Some(&first) = untold.first() else { continue };
            let place = if untold.len() == 1 { first } else { parent };
            let relative = relative_to(folder, place);
            let what = kind.what(&relative, untold.len(), layout, downscale, walk.has_used(parent));
            match what {
                Some(what) => entries.push(InventoryEntry::new(Standing::Unused, relative, untold.len(), what)),
                None => others.push((relative, untold.len())),
            }
        }
        if let Some(rest) = other_files(&others) {
            entries.push(rest);
        }
        entries.extend(walk.used_folders(folder));
        // Stable, so that layouts' own entries precede.
        entries.sort_by_key(|entry| entry.standing);
        Self { entries }
    }
}

/// One entry on the files that no layout has.
fn other_files(others: &[(String, usize)]) -> Option<InventoryEntry> {
    const SHOWN: usize = 4;
    let (first, _) = others.first()?;
    let count = others.iter().map(|(_, count)| count).sum();
    let of = |(path, count): &(String, usize)| {
        if *count == 1 { path.clone() } else { format!("{path} ({})", plural(*count, "file")) }
    };
    let shown: Vec<_> = others.iter().take(SHOWN).map(of).collect();
    let more = if others.len() > SHOWN { ", …" } else { "" };
    let what = match others {
        [_] => format!("{}, no part of the layout", plural(count, "file")),
        _ => format!("and others are no part of the layout: {}{more}", shown.join(", ")),
    };
    Some(InventoryEntry::new(Standing::Unused, first, count, what))
}

/// Kinds of files that are told apart by their names.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum FileKind {
    Picture,
    /// A picture whose name begins with `dynamic_mask_`.
    DynamicMask,
    HiddenPicture,
    Transforms,
    Geometry,
    Other,
}

impl FileKind {
    fn of(path: &Path) -> Self {
        let name = path.file_name().map_or_else(String::new, |name| name.to_string_lossy().to_lowercase());
        let ending = name.rsplit_once('.').map_or("", |(_, ending)| ending);
        if files::is_picture(path) {
            return if name.starts_with('.') {
                Self::HiddenPicture
            } else if name.starts_with("dynamic_mask") {
                Self::DynamicMask
            } else {
                Self::Picture
            };
        }
        if name.starts_with("transforms") && ending == "json" {
            Self::Transforms
        } else if GEOMETRY.contains(&ending) {
            Self::Geometry
        } else {
            Self::Other
        }
    }

    /// Why `count` files of this kind in or at `place` are not used; `None` for files that no layout has.
    fn what(self, place: &str, count: usize, layout: Layout, downscale: u32, has_used: bool) -> Option<String> {
        let pictures = plural(count, "picture");
        let place = place.to_lowercase();
        let has = |part: &str| place.split('/').any(|name| name.contains(part));
        let reduced = place.split('/').find_map(|name| {
            let (of, factor) = name.rsplit_once('_')?;
            factor.parse::<u32>().ok().filter(|_| PHOTOGRAPHS.iter().any(|known| of.contains(known)))
        });
        match self {
            Self::HiddenPicture => Some(format!("{} with the name of a picture", plural(count, "hidden file"))),
            Self::DynamicMask => Some(format!("{pictures}, masks by Instant-NGP's names, which are not supported")),
            Self::Transforms => Some(match layout {
                Layout::Transforms => "transforms.json is used".into(),
                Layout::Blender => "its name is that of no split".into(),
                layout => format!("the layout is {}", layout.name()),
            }),
            Self::Geometry => Some(format!("{} that no file of the dataset names", plural(count, "file"))),
            Self::Other if COMPANIONS.iter().any(|part| has(part)) => {
                Some(format!("{} that no key names", plural(count, "file")))
            }
            Self::Other => None,
            Self::Picture if has("mask") && !has_used => Some(match layout {
                Layout::Colmap => format!("{pictures}, none with the name of a photograph"),
                Layout::Transforms | Layout::Blender => format!("{pictures} that no mask_path names"),
                layout => format!("{pictures}; the layout {} has no masks", layout.name()),
            }),
            Self::Picture if COMPANIONS.iter().any(|part| has(part)) => Some(format!("{pictures} that no key names")),
            Self::Picture if has_used => Some(format!("{pictures} without a pose")),
            Self::Picture => Some(match reduced {
                Some(factor) if factor > 1 => format!("{pictures} of photographs made {factor} times smaller"),
                _ if downscale > 1 => format!("{pictures}; smaller ones beside them are used"),
                _ => format!("{pictures} that no file of the dataset names"),
            }),
        }
    }
}

/// The files of a folder, told apart by whether they are used.
#[derive(Default)]
struct FolderWalk {
    /// The files that are used, with what they are.
    used: BTreeMap<PathBuf, &'static str>,
    seen: usize,
    /// \[folder, kind\] files that are not used.
    unused: BTreeMap<(PathBuf, FileKind), Vec<PathBuf>>,
}

impl FolderWalk {
    fn folder(&mut self, folder: &Path, depth: usize) {
        let entries = fs::read_dir(folder).into_iter().flatten().flatten();
        let mut paths: Vec<_> = entries.map(|entry| (entry.path(), entry.file_type())).collect();
        paths.sort_by(|a, b| a.0.cmp(&b.0));
        for (path, kind) in paths {
            let is_hidden = path.file_name().is_some_and(files::is_hidden);
            if self.seen == MAX_FILES || (is_hidden && !files::is_picture(&path)) {
                continue;
            }
            // Links to folders may lead in circles.
            if kind.is_ok_and(|kind| kind.is_dir()) {
                if depth < MAX_DEPTH && !is_hidden {
                    self.folder(&path, depth + 1);
                }
                continue;
            }
            self.seen += 1;
            if !self.used.contains_key(&path) {
                self.unused.entry((folder.to_path_buf(), FileKind::of(&path))).or_default().push(path);
            }
        }
    }

    /// True if a photograph in `folder` itself is used.
    fn has_used(&self, folder: &Path) -> bool {
        let inside = self.used.range(folder.to_path_buf()..).take_while(|(path, _)| path.starts_with(folder));
        inside.into_iter().any(|(path, what)| *what == PHOTOGRAPH && path.parent() == Some(folder))
    }

    /// The files that are used, by folder and by what they are.
    fn used_folders(&self, folder: &Path) -> Vec<InventoryEntry> {
        let mut groups: BTreeMap<(&Path, &str), Vec<&Path>> = BTreeMap::new();
        for (path, what) in &self.used {
            groups.entry((path.parent().unwrap_or(folder), *what)).or_default().push(path);
        }
        let entry = |((parent, what), files): ((&Path, &str), Vec<&Path>)| {
            let place = if files.len() == 1 { files[0] } else { parent };
            InventoryEntry::new(Standing::Used, relative_to(folder, place), files.len(), plural(files.len(), what))
        };
        groups.into_iter().map(entry).collect()
    }
}

/// Kinds of files that are used.
const PHOTOGRAPH: &str = "photograph";

impl Capture {
    /// The files of the folder that are used, with what they are.
    fn used_files(&self) -> BTreeMap<PathBuf, &'static str> {
        let inputs = self.inputs.iter().chain(&self.points).chain([&self.listing]);
        let inputs = inputs.filter(|path| path.is_file()).map(|path| (path, "input"));
        let depth_maps = self.depth_maps.iter().map(|map| (&map.path, "depth map"));
        let masks = self.shots.iter().filter_map(|shot| Some((shot.mask.as_ref()?, "mask")));
        let photographs = self.shots.iter().map(|shot| (&shot.picture, PHOTOGRAPH));
        // A file with several uses gets the last one's name.
        let used = inputs.chain(depth_maps).chain(masks).chain(photographs);
        used.map(|(path, what)| (path.clone(), what)).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn people_read_at_most_ten_lines() {
        let entry = |n: usize| InventoryEntry::new(Standing::Unused, format!("folder{n}"), n, "a reason");
        let few = Inventory { entries: (0..10).map(entry).collect() };
        assert_eq!((few.lines().len(), few.lines()[0].1.as_str()), (10, "folder0: a reason"));
        let many = Inventory { entries: (0..13).map(entry).collect() };
        assert_eq!(many.lines().len(), MAX_LINES);
        assert_eq!(many.lines()[9].1, "4 more, which the JSON lists");
    }
}
