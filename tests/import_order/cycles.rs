//! Cycles between files.

use std::collections::BTreeMap;

use crate::tree::{Kind, Target, Tree};

/// A use of one file by another.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Edge {
    pub(crate) from: usize,
    pub(crate) to: usize,
    /// The first line that names each item.
    pub(crate) items: BTreeMap<String, usize>,
}

/// Every edge from one file to another; see the rules in `main.rs`.
pub(crate) fn edges(tree: &Tree) -> Vec<Edge> {
    let mut edges: BTreeMap<(usize, usize), BTreeMap<String, usize>> = BTreeMap::new();
    for (from, file) in tree.files.iter().enumerate().filter(|(_, file)| !file.test) {
        for name in file.names.iter().filter(|name| !name.test) {
            let Some(Target::Item(module, item)) = tree.resolve(&name.module, &name.segments) else { continue };
            let to = tree.file_of(&module);
            let of_a_child = name.kind == Kind::Reexport && module.starts_with(&name.module);
            if to != from && !of_a_child {
                let line = edges.entry((from, to)).or_default().entry(item).or_insert(name.line);
                *line = name.line.min(*line);
            }
        }
    }
    edges.into_iter().map(|((from, to), items)| Edge { from, to, items }).collect()
}

/// Sets of two and more files that each use all others of the set, each set and the whole in order of paths.
pub(crate) fn cycles(tree: &Tree, edges: &[Edge]) -> Vec<Vec<usize>> {
    let count = tree.files.len();
    let mut needs = vec![Vec::new(); count];
    for edge in edges {
        needs[edge.from].push(edge.to);
    }
    let reachable: Vec<Vec<bool>> = (0..count)
        .map(|start| {
            let (mut seen, mut open) = (vec![false; count], vec![start]);
            while let Some(file) = open.pop() {
                for &next in &needs[file] {
                    if !std::mem::replace(&mut seen[next], true) {
                        open.push(next);
                    }
                }
            }
            seen
        })
        .collect();
    let mut found: Vec<Vec<usize>> = (0..count)
        .filter(|&file| reachable[file][file])
        .map(|file| (0..count).filter(|&other| reachable[file][other] && reachable[other][file]).collect())
        .collect();
    for set in &mut found {
        set.sort_by_key(|&file| &tree.files[file].path);
    }
    found.sort_by_key(|set| set.first().map(|&file| &tree.files[file].path));
    found.dedup();
    found
}

/// A cycle as text: each edge with the items and lines that make it.
pub(crate) fn describe(tree: &Tree, edges: &[Edge], cycle: &[usize]) -> String {
    let path = |file: usize| &tree.files[file].path;
    let mut text = format!("{} files need each other:\n", cycle.len());
    for edge in edges.iter().filter(|edge| cycle.contains(&edge.from) && cycle.contains(&edge.to)) {
        let items: Vec<String> = edge.items.iter().map(|(item, line)| format!("{item} (line {line})")).collect();
        text += &format!("  {} -> {}: {}\n", path(edge.from), path(edge.to), items.join(", "));
    }
    text
}
