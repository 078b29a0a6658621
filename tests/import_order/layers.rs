//! The layers of the top-level modules.

use crate::tree::{File, Name, Tree};

/// Each top-level module and its layer. A new module needs its line here, and in the list of `src/lib.rs`.
const LAYERS: [(&str, u32); 24] = [
    ("color", 0),
    ("color_map", 0),
    ("digits", 0),
    ("escape", 0),
    ("psnr", 0),
    ("geometry", 0),
    ("random", 0),
    ("version", 0),
    ("npy", 0),
    ("model", 1),
    ("container", 2),
    ("dataset", 2),
    ("import", 2),
    ("prior", 2),
    ("field", 2),
    ("render", 3),
    ("train", 3),
    ("measure", 4),
    ("pack", 4),
    ("interop", 4),
    ("recipe", 5),
    ("player", 6),
    ("cli", 6),
    ("web", 6),
];

/// Imports within a layer that are allowed: (importer, imported).
const WITHIN_A_LAYER: [(&str, &str); 4] =
    [("prior", "dataset"), ("prior", "import"), ("import", "dataset"), ("web", "player")];

fn layer(module: &str) -> Option<u32> {
    LAYERS.iter().find(|(name, _)| *name == module).map(|(_, layer)| *layer)
}

/// Every forbidden import of the tree's files.
pub(crate) fn violations(tree: &Tree) -> Vec<String> {
    tree.files.iter().flat_map(of_file).collect()
}

fn of_file(file: &File) -> Vec<String> {
    let path = &file.path;
    let own = file.module.first().map_or("", String::as_str);
    let mut found: Vec<String> = match (own, layer(own)) {
        ("", _) => Vec::new(),
        ("bin", _) => {
            let modules = file.names.iter().filter_map(|name| match name.segments.as_slice() {
                [first, module, ..] if first == "strivec" && layer(module).is_none() => Some((name.line, module)),
                _ => None,
            });
            modules.map(|(line, module)| format!("{path}:{line}: strivec::{module} is no layer's module")).collect()
        }
        (_, None) => vec![format!("{path}: the module {own} has no layer in tests/import_order/layers.rs")],
        (_, Some(layer_of_own)) => {
            let allowed = |module: &str| {
                module == own
                    || WITHIN_A_LAYER.contains(&(own, module))
                    || layer(module).is_some_and(|other| other < layer_of_own)
            };
            let modules = file.names.iter().filter_map(|name| Some((name.line, top_level(name)?)));
            let forbidden = modules.filter(|(_, module)| !allowed(module));
            forbidden
                .map(|(line, module)| format!("{path}:{line}: {own} (layer {layer_of_own}) must not import {module}"))
                .collect()
        }
    };
    found.dedup();
    found
}

/// The top-level module that a path from the root of the crate names, `*` for all of them.
fn top_level(name: &Name) -> Option<&str> {
    let climbs = name.segments.iter().take_while(|segment| *segment == "super").count();
    let from_root = match name.segments.first()?.as_str() {
        "crate" => &name.segments[1..],
        "super" if climbs >= name.module.len() => &name.segments[climbs..],
        _ => return None,
    };
    Some(from_root.first().map_or("*", String::as_str))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn violations_of(path: &str, source: &str) -> Vec<String> {
        violations(&Tree::new([(path, source)]))
    }

    #[test]
    fn an_upward_import_is_found() {
        for (path, source, imported) in [
            ("geometry/ray.rs", "use crate::model::Scene;", "model"),
            ("model/scene.rs", "use crate::container;", "container"),
            ("container/mod.rs", "use crate::dataset::Dataset;", "dataset"),
            ("dataset/mod.rs", "use crate::prior::Grid;", "prior"),
            ("import/mod.rs", "use crate::prior::Grid;", "prior"),
            ("field/mod.rs", "pub use crate::train as t;", "train"),
            ("render/mod.rs", "fn f() -> crate::train::State { todo!() }", "train"),
            ("train/mod.rs", "use crate::measure::psnr;", "measure"),
            ("train/mod.rs", "use crate::cli::main;", "cli"),
            ("measure/mod.rs", "use crate::{geometry::Ray,\n  cli::{Error, Command}};", "cli"),
            ("model/scene.rs", "use super::super::{geometry, render::Picture};", "render"),
            ("model/mod.rs", "use super::train;", "train"),
            ("model/scene.rs", "mod tests { mod deep { use super::super::super::super::cli; } }", "cli"),
            ("model/scene.rs", "fn f() { let _ = '\"'; } use crate::cli;", "cli"),
            ("model/scene.rs", "fn f<'a>(s: &'a str) { \"\\\"\"; r#\"\"\"#; } use crate :: cli;", "cli"),
            ("model/scene.rs", "/* /* */ */ macro_rules! m { () => { $crate::cli::main() } }", "cli"),
            ("model/scene.rs", "#[derive(crate::cli::Args)] struct A;", "cli"),
            ("model/scene.rs", "fn f() { assert_eq!(a, [crate::cli::LIMIT]); }", "cli"),
            ("model/scene.rs", "use crate::*;", "*"),
            ("model/scene.rs", "use crate::nowhere;", "nowhere"),
        ] {
            let found = violations_of(path, source);
            assert_eq!(found.len(), 1, "{path}: {source}: {found:?}");
            assert!(found[0].ends_with(&format!("must not import {imported}")), "{found:?}");
        }
        assert_eq!(
            violations_of("cli/a/b.rs", "\n\nuse crate::player;"),
            ["cli/a/b.rs:3: cli (layer 6) must not import player"]
        );
    }

    #[test]
    fn imports_downwards_are_allowed() {
        for (path, source) in [
            ("model/scene.rs", "use crate::geometry::Aabb; use super::Frame;"),
            ("prior/mod.rs", "use crate::dataset::Dataset; use crate::import::read;"),
            ("prior/mod.rs", "use crate::prior::grid;"),
            ("cli/mod.rs", "use crate::{container, measure::{self, Report}, render::*};"),
            ("model/scene.rs", "// use crate::cli;\n/* crate::cli */ const S: &str = \"crate::cli\";"),
            ("model/scene.rs", "const S: &str = r#\"\"crate::cli\"#; const C: char = '\\'';"),
            ("model/scene.rs", "mod tests { use super::super::Frame; use super::*; }"),
            ("model/scene.rs", "pub(crate) fn f() {} pub(super) fn g() {}"),
            ("bin/strivec.rs", "fn main() { strivec::cli::main() }"),
            ("lib.rs", "pub mod cli; pub use crate::cli::main;"),
        ] {
            assert_eq!(violations_of(path, source), [""; 0], "{path}: {source}");
        }
    }

    #[test]
    fn modules_without_a_layer_are_found() {
        assert_eq!(violations_of("common/mod.rs", "").len(), 1);
        assert_eq!(violations_of("bin/strivec.rs", "use strivec::{cli, common};").len(), 1);
    }
}
