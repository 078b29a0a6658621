//! Names of files as other programs wrote them: looked up exactly, then without regard to case and Unicode normal form, then
//! without the ending of a picture, then as numbers without leading zeros.
//!
//! In: a folder and a path in it as a dataset's file has it. Out: the file that is meant, or the names nearest to it.

use std::collections::HashMap;
use std::fs;
use std::path::{Component, Path, PathBuf};

use unicode_normalization::UnicodeNormalization;

use super::files;

/// Names that a message lists.
const SHOWN: usize = 3;
/// Names of a folder that are compared with one that is missing, at most.
const MAX_COMPARED: usize = 20_000;
/// Characters of a name that are compared.
const MAX_CHARACTERS: usize = 64;

/// `text` in the form in which names are equal that differ in case, in Unicode normal form or in the separator of folders.
pub(super) fn normal(text: &str) -> String {
    text.replace('\\', "/").nfc().flat_map(char::to_lowercase).nfc().collect()
}

/// The names in folders, each folder read once.
#[derive(Debug, Default)]
pub(super) struct NamesOfFolders {
    folders: HashMap<PathBuf, NamesOfFolder>,
}

/// The names in a folder but hidden ones, ascending.
#[derive(Debug, Default)]
struct NamesOfFolder {
    paths: Vec<PathBuf>,
    /// By [`normal`] name; `None` for names of several files.
    by_name: HashMap<String, Option<usize>>,
    /// Pictures by their normal name without its ending.
    by_stem: HashMap<String, Option<usize>>,
    /// Pictures whose names are numbers, without leading zeros.
    by_number: HashMap<String, Option<usize>>,
}

impl NamesOfFolder {
    /// The names in `folder`; none if it cannot be read.
    fn read(folder: &Path) -> Self {
        let entries = fs::read_dir(folder).into_iter().flatten().flatten();
        let mut paths: Vec<_> =
            entries.filter(|entry| !files::is_hidden(&entry.file_name())).map(|entry| entry.path()).collect();
        paths.sort();
        let mut names = Self::default();
        let add = |names: &mut HashMap<String, Option<usize>>, name: &str, n: usize| {
            names.entry(name.to_owned()).and_modify(|only| *only = None).or_insert(Some(n));
        };
        for (n, path) in paths.iter().enumerate() {
            let name = normal(&path.file_name().unwrap_or_default().to_string_lossy());
            add(&mut names.by_name, &name, n);
            if files::is_picture(path) {
                add(&mut names.by_stem, stem_of(&name), n);
                if let Some(number) = number_of(stem_of(&name)) {
                    add(&mut names.by_number, number, n);
                }
            }
        }
        Self { paths, ..names }
    }

    fn only(&self, names: &HashMap<String, Option<usize>>, name: &str) -> Option<PathBuf> {
        names.get(name).copied().flatten().map(|n| self.paths[n].clone())
    }

    /// The only file or folder with the normal name `wanted`.
    fn named(&self, wanted: &str) -> Option<PathBuf> {
        self.only(&self.by_name, wanted)
    }

    /// The only picture with the normal name `wanted` but for the ending or leading zeros.
    fn picture_like(&self, wanted: &str) -> Option<PathBuf> {
        let stem = stem_of(wanted);
        let by_number = || self.only(&self.by_number, number_of(stem)?);
        self.only(&self.by_stem, stem).or_else(by_number)
    }
}

impl NamesOfFolders {
    fn of(&mut self, folder: &Path) -> &NamesOfFolder {
        self.folders.entry(folder.to_path_buf()).or_insert_with(|| NamesOfFolder::read(folder))
    }

    /// The file that `relative`, a path in `folder`, means. If no file has this name exactly, it is the only one with the same
    /// name but for case and normal form; for pictures, else, the only one but for the ending or leading zeros.
    pub(super) fn find(&mut self, folder: &Path, relative: &Path) -> Option<PathBuf> {
        let exact = folder.join(relative);
        if exact.is_file() {
            return Some(exact);
        }
        let mut at = folder.to_path_buf();
        let mut components = relative.components().peekable();
        while let Some(component) = components.next() {
            let Component::Normal(name) = component else { return None };
            let next = at.join(name);
            let is_last = components.peek().is_none();
            at = if !is_last && next.is_dir() {
                next
            } else {
                let (names, wanted) = (self.of(&at), normal(&name.to_string_lossy()));
                let same = names.named(&wanted);
                if is_last { same.or_else(|| names.picture_like(&wanted))? } else { same? }
            };
        }
        at.is_file().then_some(at)
    }

    /// The mask, or another companion, of the picture `relative` in `folder`: named as the picture is, with another ending
    /// after its own or instead of it, by the rules of [`NamesOfFolders::find`].
    pub(super) fn companion(&mut self, folder: &Path, relative: &Path) -> Option<PathBuf> {
        // COLMAP's masks are named as the picture with .png after it.
        let mut longer = relative.as_os_str().to_owned();
        longer.push(".png");
        let longer = PathBuf::from(longer);
        [folder.join(&longer), folder.join(relative.with_extension("png"))]
            .into_iter()
            .find(|path| path.is_file())
            .or_else(|| self.find(folder, &longer))
            .or_else(|| self.find(folder, relative))
    }

    /// What is there instead of the missing file `path`, in words: the names in its folder that are nearest to it.
    pub(super) fn instead_of(&mut self, path: &Path) -> String {
        let Some(folder) = path.parent() else { return String::new() };
        if !folder.is_dir() {
            return "whose folder does not exist".into();
        }
        let wanted = path.file_name().map_or_else(String::new, |name| normal(&name.to_string_lossy()));
        let is_picture = files::is_picture(path);
        let paths = self.of(folder).paths.iter().filter(|path| !is_picture || files::is_picture(path));
        let named = |path: &'_ PathBuf| normal(&path.file_name().unwrap_or_default().to_string_lossy());
        let mut near: Vec<_> = paths.take(MAX_COMPARED).map(|path| (distance(&wanted, &named(path)), path)).collect();
        if near.is_empty() {
            return format!("whose folder has no {}", if is_picture { "pictures" } else { "files" });
        }
        near.sort();
        let shown = near.iter().take(SHOWN).filter_map(|(_, path)| path.file_name());
        let shown: Vec<_> = shown.map(|name| name.to_string_lossy().into_owned()).collect();
        let more = if near.len() > SHOWN { ", …" } else { "" };
        format!("whose folder has {}{more}", shown.join(", "))
    }
}

/// `name` without the ending of a picture.
fn stem_of(name: &str) -> &str {
    match name.rsplit_once('.') {
        Some((stem, ending)) if files::PICTURES.contains(&ending) => stem,
        _ => name,
    }
}

/// The digits of a name that is a number, without leading zeros.
fn number_of(stem: &str) -> Option<&str> {
    let is_number = !stem.is_empty() && stem.bytes().all(|byte| byte.is_ascii_digit());
    let digits = stem.trim_start_matches('0');
    is_number.then_some(if digits.is_empty() { "0" } else { digits })
}

/// The least number of characters that are inserted, removed or replaced between the beginnings of `a` and `b`.
fn distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().take(MAX_CHARACTERS).collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.chars().take(MAX_CHARACTERS).enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, y) in b.iter().enumerate() {
            let replaced = diagonal + usize::from(x != *y);
            diagonal = row[j + 1];
            row[j + 1] = replaced.min(row[j] + 1).min(row[j + 1] + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    fn folder(names: &[&str]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        for name in names {
            let path = folder.path().join(name);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, "").unwrap();
        }
        folder
    }

    #[test]
    fn names_are_found_exactly_then_by_case_form_ending_and_number() {
        let names = ["a.png", "A.png", "b/C.JPG", "u\u{308}.png", "000007.jpg", "._d.png", "e.png", "E.jpg", "1.png"];
        let folder = folder(&names);
        let mut folders = NamesOfFolders::default();
        let mut found = |relative: &str| {
            let found = folders.find(folder.path(), Path::new(relative))?;
            Some(found.strip_prefix(folder.path()).unwrap().to_str().unwrap().to_owned())
        };
        assert_eq!(found("a.png").as_deref(), Some("a.png"));
        assert_eq!(found("B/c.jpg").as_deref(), Some("b/C.JPG"));
        assert_eq!(found("\u{fc}.png").as_deref(), Some("u\u{308}.png"));
        assert_eq!(found("b/c.tif").as_deref(), Some("b/C.JPG"));
        assert_eq!(found("b/c").as_deref(), Some("b/C.JPG"));
        assert_eq!(found("7.png").as_deref(), Some("000007.jpg"));
        assert_eq!(found("0001.png").as_deref(), Some("1.png"));
        // Two files are meant equally, and a hidden one never.
        assert_eq!(["e.tif", "d.png", "f.png", "b"].map(&mut found), [None, None, None, None]);
    }

    #[test]
    fn the_nearest_names_are_shown() {
        let folder = folder(&["photo_1.png", "photo_12.png", "other.png", "notes.txt"]);
        let mut folders = NamesOfFolders::default();
        let shown = folders.instead_of(&folder.path().join("photo_2.png"));
        assert_eq!(shown, "whose folder has photo_1.png, photo_12.png, other.png");
        assert_eq!(folders.instead_of(&folder.path().join("no/a.png")), "whose folder does not exist");
        assert_eq!([distance("", "ab"), distance("kitten", "sitting")], [2, 3]);
    }

    #[test]
    fn masks_are_named_as_their_picture_in_one_of_three_ways() {
        let folder = folder(&["left/a.png.png", "left/b.png", "left/C.jpg"]);
        let mut folders = NamesOfFolders::default();
        let mut found = |relative: &str| folders.companion(folder.path(), Path::new(relative)).is_some();
        assert!(["left/a.png", "left/b.jpg", "left/c.png"].into_iter().all(&mut found));
        assert!(!found("right/a.png") && !found("left/d.png"));
    }
}
