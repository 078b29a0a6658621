//! The structure of `src/`, enforced: the layers of `src/lib.rs`, no cycles between files, and no command-line flags in
//! the library's strings. Syntax is read with `syn`; nothing is compiled.
//!
//! Layers: a path that starts at `crate::`, or climbs there by `super::`, names a top-level module; it must be of a
//! layer below the file's own. Binaries name `strivec::` modules. Tests count.
//!
//! Cycles: one file uses another if it names an item that the other defines.
//!
//! - A path is followed through imports, re-exports and globs to the file whose text defines the item, so that
//!   `crate::model::Scene` names `model/scene.rs` and not `model/mod.rs`.
//! - A path that ends at a module names no item. Importing `super::limits` and then using `limits::MAX` does.
//! - `mod child;` is not a use, and neither is a `pub use` by which a module re-exports an item of its own descendants.
//!   Code of that module that names the item is.
//! - `#[cfg(test)]` items and modules are left out.
//! - Methods and fields are not followed, as syntax alone does not resolve their types.
//!
//! Flags: a string literal that contains `--` and a letter. Literals in attributes and macros count, documentation
//! comments do not.

mod cycles;
mod layers;
mod tree;

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use tree::Tree;

/// The tree of these files: paths and texts.
fn tree_of(files: &[(&str, &str)]) -> Tree {
    Tree::new(files.iter().copied())
}

/// The tree of `src/`.
static OWN: LazyLock<Tree> = LazyLock::new(|| {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut paths = Vec::new();
    rust_files(&src, &mut paths);
    paths.sort();
    assert!(paths.len() > 20, "found only {} files in {}", paths.len(), src.display());
    let files: Vec<(String, String)> = paths
        .iter()
        .map(|path| {
            let name = path.strip_prefix(&src).unwrap().to_str().unwrap().replace('\\', "/");
            (name, fs::read_to_string(path).unwrap())
        })
        .collect();
    Tree::new(files.iter().map(|(path, text)| (path.as_str(), text.as_str())))
});

fn rust_files(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            rust_files(&path, found);
        } else if path.extension().is_some_and(|e| e == "rs") {
            found.push(path);
        }
    }
}

/// A description of each cycle in the tree.
fn cycles_in(tree: &Tree) -> Vec<String> {
    let edges = cycles::edges(tree);
    let cycles = cycles::cycles(tree, &edges);
    cycles.iter().map(|cycle| cycles::describe(tree, &edges, cycle)).collect()
}

/// Each string literal with a command-line flag outside the code that parses them.
fn flags_in(tree: &Tree) -> Vec<String> {
    let names_a_flag =
        |text: &str| text.as_bytes().windows(3).any(|w| w.starts_with(b"--") && w[2].is_ascii_lowercase());
    let of_commands = |path: &str| path.starts_with("cli/") || path == "player/desktop/arguments.rs";
    let files = tree.files.iter().filter(|file| !of_commands(&file.path));
    files
        .flat_map(|file| {
            let literals = file.literals.iter().filter(|(_, text)| names_a_flag(text));
            literals.map(|(line, text)| format!("{}:{line}: {text:?}", file.path))
        })
        .collect()
}

#[test]
fn no_import_points_upwards() {
    let found = layers::violations(&OWN);
    assert!(found.is_empty(), "{}", found.join("\n"));
}

#[test]
fn no_files_need_each_other() {
    let found = cycles_in(&OWN);
    assert!(found.is_empty(), "{}", found.join("\n"));
}

#[test]
fn no_string_of_the_library_names_a_flag() {
    let found = flags_in(&OWN);
    assert!(found.is_empty(), "name the setting instead:\n{}", found.join("\n"));
}

#[test]
fn a_planted_cycle_is_found() {
    let scene = "use super::Decoder; pub struct Scene { decoder: Decoder }";
    for (parent, decoder, item) in [
        // Through a re-export of the parent, of a rename, of a glob, of the crate.
        ("mod scene; mod decoder; pub use scene::Scene; pub use decoder::Decoder;", "use super::Scene;", "Scene"),
        ("mod scene; mod decoder; pub use scene::Scene as S; pub use decoder::Decoder;", "use super::S;", "Scene"),
        ("mod scene; mod decoder; pub use scene::*; pub use decoder::*;", "use crate::model::Scene;", "Scene"),
        ("pub mod scene; mod decoder; pub use decoder::Decoder;", "use super::scene; type S = scene::Scene;", "Scene"),
        ("pub mod scene; mod decoder; pub use decoder::Decoder;", "fn f() { super::scene::Scene::new(); }", "Scene"),
        (
            "pub mod scene; mod decoder; pub use decoder::Decoder;",
            "fn f() { vec![super::scene::Scene::new()]; }",
            "Scene",
        ),
        ("pub mod scene; mod decoder; pub use decoder::Decoder;", "fn f() { use super::scene::Scene as S; }", "Scene"),
        ("pub mod scene; mod decoder; pub use decoder::Decoder;", "use super::scene::*; struct A(Scene);", "Scene"),
        ("pub mod scene; mod decoder; pub use decoder::Decoder;", "mod a { use super::super::scene::Scene; }", "Scene"),
    ] {
        let decoder = format!("{decoder} pub struct Decoder;");
        let files = [("model/mod.rs", parent), ("model/scene.rs", scene), ("model/decoder.rs", &decoder)];
        let found = cycles_in(&tree_of(&files));
        let expected = format!(
            "2 files need each other:\n  model/scene.rs -> model/decoder.rs: Decoder (line 1)\n  \
             model/decoder.rs -> model/scene.rs: {item} (line 1)\n"
        );
        assert_eq!(found, [expected], "{parent} {decoder}");
    }
}

#[test]
fn a_parents_own_items_make_a_cycle_and_its_declarations_do_not() {
    let child = ("las/header.rs", "use super::LIMIT; pub struct Header([u8; LIMIT]);");
    let of = |parent: &str| cycles_in(&tree_of(&[("las/mod.rs", parent), child])).len();
    assert_eq!(of("mod header; const LIMIT: usize = 1; use header::Header;"), 1);
    assert_eq!(of("mod header; const LIMIT: usize = 1; fn f() -> header::Header { todo!() }"), 1);
    assert_eq!(of("mod header; const LIMIT: usize = 1; pub use header::Header; fn f(h: &Header) {}"), 1);
    assert_eq!(of("mod header; const LIMIT: usize = 1; pub use header::Header;"), 0);
    assert_eq!(of("mod header; const LIMIT: usize = 1; #[cfg(test)] mod tests { use super::header::Header; }"), 0);
}

#[test]
fn a_longer_cycle_and_two_apart_are_found() {
    let files = [
        ("a.rs", "use crate::b::B; pub struct A;"),
        ("b.rs", "use crate::c::C; pub struct B;"),
        ("c.rs", "use crate::a::A; use crate::d::D; pub struct C;"),
        ("d.rs", "use crate::e::E; pub struct D;"),
        ("e.rs", "use crate::d::D; pub struct E;"),
        ("f.rs", "use crate::a::A;"),
    ];
    let found = cycles_in(&tree_of(&files));
    assert_eq!(found.len(), 2, "{found:?}");
    assert!(found[0].starts_with("3 files") && found[1].starts_with("2 files"), "{found:?}");
    assert!(!found.concat().contains("f.rs"), "{found:?}");
}

#[test]
fn test_modules_make_no_cycle() {
    let files = [
        ("a/mod.rs", "pub struct A; #[cfg(test)] mod tests; #[cfg(test)] use crate::b::B;"),
        ("a/tests.rs", "use crate::b::B; pub struct T;"),
        ("b.rs", "use crate::a::A; pub struct B;"),
    ];
    assert_eq!(cycles_in(&tree_of(&files)), [""; 0]);
}

#[test]
fn planted_flags_are_found_and_documentation_is_not() {
    let source = "//! --a\n/// --b\nfn f() { g(\"--c\"); format!(\"x --d {}\", 1); }\n\
                  #[error(\"use --e\")] struct E; const N: &str = \"a -- b --\";";
    let expected = ["prior/a.rs:3: \"--c\"", "prior/a.rs:3: \"x --d {}\"", "prior/a.rs:4: \"use --e\""];
    assert_eq!(flags_in(&tree_of(&[("prior/a.rs", source)])), expected);
    for path in ["cli/train.rs", "player/desktop/arguments.rs"] {
        assert_eq!(flags_in(&tree_of(&[(path, source)])), [""; 0]);
    }
}
