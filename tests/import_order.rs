//! The layers of `src/lib.rs`, enforced: a module imports only from layers below its own.
//!
//! Comments and literals are stripped, then every path that starts at `crate::`, or climbs there by `super::`, is
//! resolved to the top-level module that it names, groups and renames included. Binaries are searched for
//! `strivec::` in the same way.

use std::fs;
use std::path::{Path, PathBuf};

/// Each top-level module and its layer. A new module needs its line here, and in the list of `src/lib.rs`.
const LAYERS: [(&str, u32); 15] = [
    ("geometry", 0),
    ("random", 0),
    ("npy", 0),
    ("model", 1),
    ("container", 2),
    ("dataset", 2),
    ("prior", 2),
    ("field", 2),
    ("render", 3),
    ("train", 3),
    ("measure", 4),
    ("pack", 4),
    ("player", 5),
    ("cli", 5),
    ("web", 5),
];

/// Imports within a layer that are allowed: (importer, imported).
const WITHIN_A_LAYER: [(&str, &str); 2] = [("prior", "dataset"), ("web", "player")];

fn layer(module: &str) -> Option<u32> {
    LAYERS.iter().find(|(name, _)| *name == module).map(|(_, layer)| *layer)
}

/// Every forbidden import of the file at `path` (relative to `src/`, with `/`) whose text is `source`.
fn violations(path: &str, source: &str) -> Vec<String> {
    let parts: Vec<&str> = path.trim_end_matches(".rs").split('/').filter(|part| *part != "mod").collect();
    let tokens = tokens(source);
    if parts[0] == "bin" {
        return imports(&tokens, "strivec", &[])
            .into_iter()
            .filter(|(_, module)| layer(module).is_none())
            .map(|(line, module)| format!("{path}:{line}: strivec::{module} is no layer's module"))
            .collect();
    }
    if parts == ["lib"] {
        return Vec::new();
    }
    let Some(own) = layer(parts[0]) else {
        return vec![format!("{path}: the module {} has no layer in tests/import_order.rs", parts[0])];
    };
    let allowed = |module: &str| {
        module == parts[0]
            || WITHIN_A_LAYER.contains(&(parts[0], module))
            || layer(module).is_some_and(|other| other < own)
    };
    imports(&tokens, "crate", &parts)
        .into_iter()
        .filter(|(_, module)| !allowed(module))
        .map(|(line, module)| format!("{path}:{line}: {} (layer {own}) must not import {module}", parts[0]))
        .collect()
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Token<'a> {
    text: &'a str,
    line: usize,
}

/// Identifiers, `::` and single punctuation characters; no comments, literals, lifetimes or white space.
fn tokens(source: &str) -> Vec<Token<'_>> {
    let bytes = source.as_bytes();
    let is_word = |b: u8| b.is_ascii_alphanumeric() || b == b'_' || !b.is_ascii();
    let mut tokens: Vec<Token<'_>> = Vec::new();
    let mut at = 0;
    while at < bytes.len() {
        let rest = &source[at..];
        let end = if rest.starts_with("//") {
            at + rest.find('\n').unwrap_or(rest.len())
        } else if rest.starts_with("/*") {
            at + block_comment(rest)
        } else if let Some(length) = raw_string(rest) {
            at + length
        } else if rest.starts_with('"') {
            at + quoted(rest, b'"')
        } else if rest.starts_with('\'') {
            // A lifetime is a quote and a word without a closing quote.
            let word = rest.bytes().skip(1).take_while(|&b| is_word(b)).count();
            let lifetime = word > 0 && rest.as_bytes().get(1 + word) != Some(&b'\'');
            at + if lifetime { 1 + word } else { quoted(rest, b'\'') }
        } else if is_word(bytes[at]) {
            let length = rest.bytes().take_while(|&b| is_word(b)).count();
            tokens.push(token(source, at, length));
            at + length
        } else {
            let length = if rest.starts_with("::") { 2 } else { 1 };
            if !bytes[at].is_ascii_whitespace() {
                tokens.push(token(source, at, length));
            }
            at + length
        };
        at = end;
    }
    tokens
}

fn token(source: &str, at: usize, length: usize) -> Token<'_> {
    Token { text: &source[at..at + length], line: 1 + source[..at].matches('\n').count() }
}

/// The length of the block comment, nested ones included, at the start of `rest`.
fn block_comment(rest: &str) -> usize {
    let (mut at, mut depth) = (0, 0);
    while at < rest.len() {
        let step = &rest.as_bytes()[at..];
        match step {
            [b'/', b'*', ..] => depth += 1,
            [b'*', b'/', ..] => depth -= 1,
            _ => {
                at += 1;
                continue;
            }
        }
        at += 2;
        if depth == 0 {
            return at;
        }
    }
    rest.len()
}

/// The length of the raw string at the start of `rest`, if there is one.
fn raw_string(rest: &str) -> Option<usize> {
    let hashes = rest.strip_prefix('r').or_else(|| rest.strip_prefix("br"))?;
    let count = hashes.bytes().take_while(|&b| b == b'#').count();
    let body = hashes[count..].strip_prefix('"')?;
    let close = format!("\"{}", "#".repeat(count));
    let inside = body.find(&close).unwrap_or(body.len());
    Some(rest.len() - body.len() + (inside + close.len()).min(body.len()))
}

/// The length of the literal that starts and ends with `quote`, at the start of `rest`.
fn quoted(rest: &str, quote: u8) -> usize {
    let mut bytes = rest.bytes().enumerate().skip(1);
    while let Some((i, byte)) = bytes.next() {
        if byte == b'\\' {
            bytes.next();
        } else if byte == quote {
            return i + 1;
        }
    }
    rest.len()
}

/// The line and the top-level module of every path that starts at `root`, or climbs there from the module `parts`.
fn imports<'a>(tokens: &[Token<'a>], root: &str, parts: &[&str]) -> Vec<(usize, &'a str)> {
    let mut found = Vec::new();
    // How deep in braces each enclosing inline module started.
    let (mut depth, mut inline) = (0, Vec::new());
    let mut at = 0;
    while at < tokens.len() {
        let is = |offset: usize, text: &str| tokens.get(at + offset).is_some_and(|t| t.text == text);
        let starts_a_path = at == 0 || tokens[at - 1].text != "::";
        if is(0, "mod") && is(2, "{") {
            inline.push(depth);
            depth += 1;
            at += 3;
        } else if is(0, "{") {
            depth += 1;
            at += 1;
        } else if is(0, "}") {
            depth -= 1;
            if inline.last() == Some(&depth) {
                inline.pop();
            }
            at += 1;
        } else if is(0, root) && is(1, "::") {
            first_segments(tokens, at + 2, &mut found);
            at += 2;
        } else if is(0, "super") && is(1, "::") && starts_a_path {
            let mut climbs = 0;
            while tokens.get(at).is_some_and(|t| t.text == "super") {
                climbs += 1;
                at += 2;
            }
            if root == "crate" && climbs >= parts.len() + inline.len() {
                first_segments(tokens, at, &mut found);
            }
        } else {
            at += 1;
        }
    }
    found
}

/// The first names of the path or the group of paths at `at`.
fn first_segments<'a>(tokens: &[Token<'a>], at: usize, found: &mut Vec<(usize, &'a str)>) {
    let Some(first) = tokens.get(at) else { return };
    if first.text != "{" {
        found.push((first.line, first.text));
        return;
    }
    let (mut depth, mut expects_path) = (1, true);
    for token in &tokens[at + 1..] {
        match token.text {
            "{" => depth += 1,
            "}" => depth -= 1,
            "," if depth == 1 => expects_path = true,
            name if depth == 1 && expects_path => {
                found.push((token.line, name));
                expects_path = false;
            }
            _ => {}
        }
        if depth == 0 {
            return;
        }
    }
}

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

#[test]
fn no_import_points_upwards() {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    rust_files(&src, &mut files);
    files.sort();
    assert!(files.len() > 20, "found only {} files in {}", files.len(), src.display());
    let found: Vec<String> = files
        .iter()
        .flat_map(|file| {
            let path = file.strip_prefix(&src).unwrap().to_str().unwrap().replace('\\', "/");
            violations(&path, &fs::read_to_string(file).unwrap())
        })
        .collect();
    assert!(found.is_empty(), "{}", found.join("\n"));
}

#[test]
fn an_upward_import_is_found() {
    for (path, source, imported) in [
        ("geometry/ray.rs", "use crate::model::Scene;", "model"),
        ("model/scene.rs", "use crate::container;", "container"),
        ("container/mod.rs", "use crate::dataset::Dataset;", "dataset"),
        ("dataset/mod.rs", "use crate::prior::Grid;", "prior"),
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
        ("model/scene.rs", "use crate::*;", "*"),
        ("model/scene.rs", "use crate::nowhere;", "nowhere"),
    ] {
        let found = violations(path, source);
        assert_eq!(found.len(), 1, "{path}: {source}: {found:?}");
        assert!(found[0].ends_with(&format!("must not import {imported}")), "{found:?}");
    }
    assert_eq!(
        violations("cli/a/b.rs", "\n\nuse crate::player;"),
        ["cli/a/b.rs:3: cli (layer 5) must not import player"]
    );
}

#[test]
fn imports_downwards_are_allowed() {
    for (path, source) in [
        ("model/scene.rs", "use crate::geometry::Aabb; use super::Frame;"),
        ("prior/mod.rs", "use crate::dataset::Dataset;"),
        ("prior/mod.rs", "use crate::prior::grid;"),
        ("cli/mod.rs", "use crate::{container, measure::{self, Report}, render::*};"),
        ("model/scene.rs", "// use crate::cli;\n/* crate::cli */ const S: &str = \"crate::cli\";"),
        ("model/scene.rs", "const S: &str = r#\"\"crate::cli\"#; const C: char = '\\'';"),
        ("model/scene.rs", "mod tests { use super::super::Frame; use super::*; }"),
        ("model/scene.rs", "pub(crate) fn f() {} pub(super) fn g() {}"),
        ("bin/strivec.rs", "fn main() { strivec::cli::main() }"),
        ("lib.rs", "pub mod cli; pub use crate::cli::main;"),
    ] {
        assert_eq!(violations(path, source), [""; 0], "{path}: {source}");
    }
}

#[test]
fn modules_without_a_layer_are_found() {
    assert_eq!(violations("common/mod.rs", "").len(), 1);
    assert_eq!(violations("bin/strivec.rs", "use strivec::{cli, common};").len(), 1);
}
