//! The nodes of a scene: the meshes and their transforms.

use glam::{DMat4, DQuat, DVec3, Vec4};
use gltf::json::{Index, Mesh};

use super::super::Fault;
use super::document::{Document, Node, get};

/// Calls `each` for every mesh of the default scene, or of all root nodes if there is none, with the transform from the
/// mesh's space to the scene's. The format allows one parent per node, so a second visit of a node is an error, and
/// cycles end.
///
/// # Errors
///
/// If the nodes are not trees, a transform is invalid, and those of `each`.
pub(super) fn walk(
    document: &Document,
    mut each: impl FnMut(Index<Mesh>, &DMat4) -> Result<(), Fault>,
) -> Result<(), Fault> {
    let mut waiting: Vec<(Index<Node>, DMat4)> = Vec::new();
    let roots = roots(document)?;
    waiting.extend(roots.into_iter().rev().map(|root| (root, DMat4::IDENTITY)));
    let mut visited = vec![false; document.nodes.len()];
    while let Some((index, parent)) = waiting.pop() {
        let node = get(&document.nodes, index, "node")?;
        if std::mem::replace(&mut visited[index.value()], true) {
            return Err(Fault::broken(format!("node {index}"), "it has two parents or is part of a cycle"));
        }
        let world = parent * local(node, index)?;
        if let Some(mesh) = node.mesh {
            each(mesh, &world)?;
        }
        for &child in node.children.iter().flatten().rev() {
            waiting.push((child, world));
            // More nodes can wait than exist only if one waits twice.
            Fault::unless_within("children", document.nodes.len() as u64, waiting.len() as u64)?;
        }
    }
    Ok(())
}

fn roots(document: &Document) -> Result<Vec<Index<Node>>, Fault> {
    if let Some(scene) = document.scene {
        return Ok(get(&document.scenes, scene, "scene")?.nodes.clone());
    }
    let mut is_child = vec![false; document.nodes.len()];
    for child in document.nodes.iter().flat_map(|node| node.children.iter().flatten()) {
        get(&document.nodes, *child, "node")?;
        is_child[child.value()] = true;
    }
    Ok((0..is_child.len()).filter(|&n| !is_child[n]).map(|n| Index::new(n as u32)).collect())
}

/// The transform from the node's space to its parent's.
fn local(node: &Node, index: Index<Node>) -> Result<DMat4, Fault> {
    let wrong = |expected: &str, found: &dyn ToString| {
        Err(Fault::malformed(format!("node {index}"), expected, found.to_string()))
    };
    if let Some(matrix) = node.matrix {
        let matrix = DMat4::from_cols_array(&matrix);
        // Files round matrices, to 32 bits as well.
        if matrix.row(3).as_vec4() != Vec4::W {
            return wrong("a matrix whose last row is 0, 0, 0, 1", &matrix.row(3));
        }
        return Ok(matrix);
    }
    let vector = |values: Option<[f64; 3]>, default| values.map_or(default, DVec3::from_array);
    let rotation = node.rotation.map_or(DQuat::IDENTITY, DQuat::from_array);
    // Files round quaternions, so a length of exactly 1 is not required.
    if !(0.5..2.0).contains(&rotation.length()) {
        return wrong("a rotation of length 1", &rotation);
    }
    let (scale, translation) = (vector(node.scale, DVec3::ONE), vector(node.translation, DVec3::ZERO));
    Ok(DMat4::from_scale_rotation_translation(scale, rotation.normalize(), translation))
}
