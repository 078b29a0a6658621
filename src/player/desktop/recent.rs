//! Which scenes were opened last: a text file in the user's configuration folder, one a line.

use std::path::PathBuf;

/// So many are kept.
const KEPT: usize = 10;

/// Where the list is; `None` where the system has no such place.
fn file() -> Option<PathBuf> {
    let set = |name: &str| std::env::var_os(name).filter(|v| !v.is_empty()).map(PathBuf::from);
    let folder = if cfg!(windows) {
        set("APPDATA")
    } else {
        set("XDG_CONFIG_HOME").or_else(|| Some(set("HOME")?.join(".config")))
    };
    Some(folder?.join("strivec").join("recent.txt"))
}

/// The last ones, newest first. That there are none is no error.
pub(super) fn load() -> Vec<String> {
    let text = file().and_then(|path| std::fs::read_to_string(path).ok()).unwrap_or_default();
    text.lines().filter(|line| !line.is_empty()).take(KEPT).map(str::to_owned).collect()
}

/// Puts `place` in front of `recent`, and remembers that where it can.
pub(super) fn add(recent: &mut Vec<String>, place: &str) {
    recent.retain(|other| other != place);
    recent.insert(0, place.to_owned());
    recent.truncate(KEPT);
    if let Some(path) = file()
        && path.parent().is_some_and(|folder| std::fs::create_dir_all(folder).is_ok())
    {
        // Nothing depends on it.
        let _ = std::fs::write(path, recent.join("\n"));
    }
}
