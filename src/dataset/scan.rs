//! A ScanNet scan without its photographs: its name, its mesh and its axis alignment.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use glam::{DMat4, DVec3};

use super::files::read_text;
use super::{Error, files, shot};
use strivec_format::geometry::{NotRigid, rigid};

/// Endings of a scan's mesh after its name, in order of preference.
const MESHES: [&str; 2] = ["_vh_clean_2.ply", "_vh_clean.ply"];

/// A folder as written by ScanNet's exporter: `NAME/` with `NAME.txt`, `NAME_vh_clean_2.ply`, `pose/` and `color/`.
#[derive(Clone, Debug, PartialEq)]
pub struct Scan {
    /// The scan's folder.
    pub folder: PathBuf,
    /// The scan's name, with which its files' names begin, as in `scene0101_04`.
    pub name: String,
    /// The path of the mesh, if there is one; it is in the space of the stored poses.
    pub mesh: Option<PathBuf>,
    /// The rigid map from that space to the aligned space, whose z is up. The identity if the scan has no alignment.
    pub alignment: DMat4,
}

impl Scan {
    /// Opens the scan at `path`: a folder with a mesh, or with `pose` and `color` or `intrinsic`; or a scan's mesh,
    /// which needs no other files. `None` if `path` is anything else or does not exist.
    ///
    /// # Errors
    ///
    /// If the scan's files cannot be read, its alignment is not rigid, or its name is ambiguous.
    pub fn open(path: &Path) -> Result<Option<Self>, Error> {
        let scan = if path.is_dir() {
            let Some(name) = name_in(path)? else { return Ok(None) };
            let mesh = MESHES.iter().map(|ending| path.join(format!("{name}{ending}"))).find(|mesh| mesh.is_file());
            Self { folder: path.to_path_buf(), name, mesh, alignment: DMat4::IDENTITY }
        } else {
            let file = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
            let Some(name) = MESHES.iter().find_map(|ending| file.strip_suffix(ending)) else { return Ok(None) };
            let folder = path.parent().unwrap_or(Path::new("")).to_path_buf();
            Self { folder, name: name.into(), mesh: Some(path.to_path_buf()), alignment: DMat4::IDENTITY }
        };
        let alignment = match Constants::of(&scan.folder, &scan.name)? {
            Some(constants) => constants.alignment()?,
            None => None,
        };
        Ok(Some(Self { alignment: alignment.unwrap_or(DMat4::IDENTITY), ..scan }))
    }

    /// The aligned position of `point`, which is of the mesh or of a stored pose.
    pub fn aligned(&self, point: DVec3) -> DVec3 {
        self.alignment.transform_point3(point)
    }
}

/// The name of the scan in `folder`; `None` if there is no scan.
fn name_in(folder: &Path) -> Result<Option<String>, Error> {
    let own = files::name_of(folder);
    if MESHES.iter().any(|ending| folder.join(format!("{own}{ending}")).is_file()) {
        return Ok(Some(own));
    }
    // A folder may have been renamed.
    let mut names = BTreeSet::new();
    for entry in fs::read_dir(folder).map_err(Error::read(folder))? {
        let file = entry.map_err(Error::read(folder))?.file_name();
        let name = file.to_str().and_then(|file| MESHES.iter().find_map(|ending| file.strip_suffix(ending)));
        names.extend(name.map(str::to_owned));
    }
    if names.len() > 1 {
        let names: Vec<_> = names.into_iter().collect();
        return Err(Error::text(folder, "the meshes", "of one scan", format!("meshes of {}", names.join(", "))));
    }
    let has = |part: &str| folder.join(part).is_dir();
    let photographed = has("pose") && (has("color") || has("intrinsic"));
    Ok(names.pop_first().or(photographed.then_some(own)))
}

/// `NAME.txt`: lines `key = value`.
pub(super) struct Constants {
    path: PathBuf,
    text: String,
}

impl Constants {
    /// The constants of the scan `name` in `folder`; `None` if there is no such file.
    pub(super) fn of(folder: &Path, name: &str) -> Result<Option<Self>, Error> {
        let path = folder.join(format!("{name}.txt"));
        if !path.is_file() {
            return Ok(None);
        }
        let text = read_text(&path)?;
        Ok(Some(Self { path, text }))
    }

    /// The text after the first `key = `.
    fn value(&self, key: &str) -> Option<&str> {
        let pairs = self.text.lines().filter_map(|line| line.split_once('='));
        pairs.into_iter().find(|(found, _)| found.trim() == key).map(|(_, value)| value.trim())
    }

    /// The number of `key`, if it is present.
    pub(super) fn number(&self, key: &str) -> Result<Option<f64>, Error> {
        let Some(value) = self.value(key) else { return Ok(None) };
        match number(value) {
            Some(found) => Ok(Some(found)),
            None => Err(Error::text(&self.path, key, "a number", format!("{:?}", shortened(value)))),
        }
    }

    /// The extent `value` of pictures, which `key` has, in pixels.
    pub(super) fn extent(&self, key: &str, value: f64) -> Result<u32, Error> {
        shot::extent(value).ok_or_else(|| Error::text(&self.path, key, shot::EXTENT, value.to_string()))
    }

    /// `axisAlignment`, made exactly rigid.
    fn alignment(&self) -> Result<Option<DMat4>, Error> {
        const KEY: &str = "axisAlignment";
        let Some(value) = self.value(KEY) else { return Ok(None) };
        let rows = matrix(&self.path, KEY, value)?;
        let (rotation, translation) =
            rigid(&rows).map_err(|NotRigid { expected, found }| Error::text(&self.path, KEY, expected, found))?;
        Ok(Some(DMat4::from_mat3_translation(rotation, translation)))
    }
}

/// The rows of the 4x4 matrix in the file `path`, whose numbers need not be finite.
pub(super) fn read_matrix(path: &Path) -> Result<[[f64; 4]; 4], Error> {
    matrix(path, "the matrix", &read_text(path)?)
}

fn matrix(path: &Path, place: &str, text: &str) -> Result<[[f64; 4]; 4], Error> {
    let mut rows = [[0.0; 4]; 4];
    let words = text.split_whitespace();
    let found = words.clone().count();
    if found != 16 {
        return Err(Error::text(path, place, "16 numbers", found.to_string()));
    }
    for (value, word) in rows.as_flattened_mut().iter_mut().zip(words) {
        *value = number(word)
            .ok_or_else(|| Error::text(path, place, "16 numbers", format!("the word {:?}", shortened(word))))?;
    }
    Ok(rows)
}

/// The numbers of the file `path`, which need not be finite. Words from the first `#` of a line on are no numbers.
pub(super) fn numbers_of(path: &Path) -> Result<Vec<f64>, Error> {
    let text = read_text(path)?;
    let words = text.lines().flat_map(|line| line.split('#').next().unwrap_or_default().split_whitespace());
    let parsed = |word: &str| {
        let found = || format!("the word {:?}", shortened(word));
        number(word).ok_or_else(|| Error::text(path, "the file", "numbers", found()))
    };
    words.map(parsed).collect()
}

/// Parses a number as Rust does. Also accepts infinities and NaN as printed by Microsoft's C library, as in `-1.#INF`;
/// all of these become NaN.
fn number(word: &str) -> Option<f64> {
    word.parse().ok().or_else(|| word.contains(".#").then_some(f64::NAN))
}

/// At most the first 40 characters, for messages.
fn shortened(text: &str) -> String {
    text.chars().take(40).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALIGNMENT: &str = "axisAlignment = 0 -1 0 3 1 0 0 4 0 0 1 5 0 0 0 1";

    fn folder(files: &[(&str, &str)]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        for (name, text) in files {
            fs::write(folder.path().join(name), text).unwrap();
        }
        folder
    }

    #[test]
    fn a_scan_is_found_by_its_folder_and_by_its_mesh() {
        let text = format!("sceneType = Bathroom\r\nno pair\n{ALIGNMENT} \ncolorWidth = 1296\n");
        let folder = folder(&[("scene0101_04.txt", &text), ("scene0101_04_vh_clean.ply", ""), ("a.ply", "")]);
        let mesh = folder.path().join("scene0101_04_vh_clean.ply");
        for path in [folder.path(), &mesh] {
            let scan = Scan::open(path).unwrap().unwrap();
            assert_eq!((scan.name.as_str(), scan.mesh.as_ref()), ("scene0101_04", Some(&mesh)));
            assert_eq!(scan.folder, folder.path());
            assert_eq!(scan.aligned(DVec3::new(1.0, 2.0, 3.0)), DVec3::new(1.0, 5.0, 8.0));
        }
        let better = folder.path().join("scene0101_04_vh_clean_2.ply");
        fs::write(&better, "").unwrap();
        assert_eq!(Scan::open(folder.path()).unwrap().unwrap().mesh, Some(better));
        assert_eq!(Scan::open(&folder.path().join("a.ply")).unwrap(), None);
        assert_eq!(Scan::open(&folder.path().join("absent")).unwrap(), None);
    }

    #[test]
    fn photographs_alone_are_a_scan_without_a_mesh_and_other_folders_are_none() {
        let folder = tempfile::tempdir().unwrap();
        assert_eq!(Scan::open(folder.path()).unwrap(), None);
        for part in ["pose", "color"] {
            fs::create_dir(folder.path().join(part)).unwrap();
        }
        let scan = Scan::open(folder.path()).unwrap().unwrap();
        assert_eq!((scan.mesh, scan.alignment), (None, DMat4::IDENTITY));
    }

    #[test]
    fn what_is_wrong_with_a_scan_is_named() {
        for (text, expected) in [
            (&b"axisAlignment = 1 2 3"[..], "scene1.txt: axisAlignment must be 16 numbers; found 3"),
            (b"axisAlignment = 0 -1 0 x 1 0 0 4 0 0 1 5 0 0 0 1", "must be 16 numbers; found the word \"x\""),
            (b"axisAlignment = 0 -1 0 inf 1 0 0 4 0 0 1 5 0 0 0 1", "axisAlignment must be a matrix of finite numbers"),
            (b"axisAlignment = 0 -1 0 3 1 0 0 4 0 0 -1 5 0 0 0 1", "must be a right-handed rotation"),
            (b"axisAlignment = 2 0 0 3 0 2 0 4 0 0 2 5 0 0 0 1", "must be an orthonormal rotation"),
            (b"axis\xffAlignment = 1", "scene1.txt: byte 4 must be UTF-8 text"),
        ] {
            let folder = folder(&[("scene1_vh_clean_2.ply", "")]);
            fs::write(folder.path().join("scene1.txt"), text).unwrap();
            let message = Scan::open(folder.path()).unwrap_err().to_string();
            assert!(message.contains(expected), "{message}");
        }
        let two = folder(&[("a_vh_clean_2.ply", ""), ("b_vh_clean_2.ply", "")]);
        let message = Scan::open(two.path()).unwrap_err().to_string();
        assert!(message.contains("the meshes must be of one scan; found meshes of a, b"), "{message}");
        let long = folder(&[("a_vh_clean_2.ply", ""), ("a.txt", &" ".repeat((1 << 20) + 1))]);
        assert_eq!(Scan::open(long.path()).unwrap_err().kind(), super::super::ErrorKind::Limit);
    }
}
