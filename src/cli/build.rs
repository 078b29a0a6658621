//! Passes the commit of a release build to `version` as `STRIVEC_BUILD`: empty in a package without its repository.
//!
//! Debug builds do not name their commit, so that committing does not rebuild them.

use std::fs;
use std::path::{Path, PathBuf};

/// Characters of the commit that are shown.
const LENGTH: usize = 9;

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    let package = PathBuf::from(std::env::var_os("CARGO_MANIFEST_DIR").unwrap_or_default());
    let root = package.join("../..");
    let release = std::env::var("PROFILE").is_ok_and(|profile| profile == "release");
    let commit = if release { commit(&root) } else { None }.unwrap_or_default();
    println!("cargo::rustc-env=STRIVEC_BUILD={commit}");
}

/// The commit that is checked out at `root`, if that is a repository; read without git. Later commits run this again.
fn commit(root: &Path) -> Option<String> {
    let git = git_folder(root)?;
    // A work tree beside the first one shares the first one's references.
    let shared = read(&git.join("commondir")).map_or(git.clone(), |folder| git.join(folder));
    let head = read(&git.join("HEAD"))?;
    rerun_if_changed(&git.join("HEAD"));
    let commit = match head.strip_prefix("ref: ") {
        None => head,
        Some(name) => {
            let loose = shared.join(name);
            let packed = shared.join("packed-refs");
            if let Some(commit) = read(&loose) {
                rerun_if_changed(&loose);
                commit
            } else {
                rerun_if_changed(&packed);
                rerun_if_changed(loose.parent()?);
                let packed = read(&packed)?;
                packed.lines().find_map(|line| Some(line.strip_suffix(name)?.strip_suffix(' ')?.to_owned()))?
            }
        }
    };
    commit.get(..LENGTH).map(str::to_owned)
}

/// `.git` at `root`, or the folder that a file of this name points to.
fn git_folder(root: &Path) -> Option<PathBuf> {
    let git = root.join(".git");
    if git.is_dir() {
        return Some(git);
    }
    Some(root.join(read(&git)?.strip_prefix("gitdir: ")?))
}

fn read(path: &Path) -> Option<String> {
    Some(fs::read_to_string(path).ok()?.trim_end().to_owned())
}

/// A path that does not exist would run this at every build.
fn rerun_if_changed(path: &Path) {
    if path.exists() {
        println!("cargo::rerun-if-changed={}", path.display());
    }
}
