//! The scenes that were opened last: a text file in the user's configuration folder, one path or URL a line.

use std::path::{Path, PathBuf};

use super::opening::is_url;

/// Length of the list.
const MAX_LENGTH: usize = 10;

/// Path of the list; `None` if the system has no configuration folder.
fn file() -> Option<PathBuf> {
    let set = |name: &str| std::env::var_os(name).filter(|v| !v.is_empty()).map(PathBuf::from);
    let folder = if cfg!(windows) {
        set("APPDATA")
    } else {
        set("XDG_CONFIG_HOME").or_else(|| Some(set("HOME")?.join(".config")))
    };
    Some(folder?.join("strivec").join("recent.txt"))
}

/// The scenes that were opened last and still exist, newest first.
pub(super) fn load() -> Vec<String> {
    let text = file().and_then(|path| std::fs::read_to_string(path).ok()).unwrap_or_default();
    let exists = |place: &&str| is_url(place) || (Path::new(place).is_absolute() && Path::new(place).exists());
    text.lines().filter(exists).take(MAX_LENGTH).map(str::to_owned).collect()
}

/// Puts `place`, which was opened, in front of `recent`, and saves the list.
pub(super) fn add(recent: &mut Vec<String>, place: &str) {
    let place = if is_url(place) { place.to_owned() } else { absolute(place) };
    recent.retain(|other| *other != place);
    recent.insert(0, place);
    recent.truncate(MAX_LENGTH);
    if let Some(path) = file()
        && path.parent().is_some_and(|folder| std::fs::create_dir_all(folder).is_ok())
    {
        // The list is a convenience, so an error of saving it is not reported.
        let _ = std::fs::write(path, recent.join("\n"));
    }
}

/// The absolute form of `path`.
pub(super) fn absolute(path: &str) -> String {
    std::path::absolute(path).map_or_else(|_| path.to_owned(), |path| path.display().to_string())
}
