//! The triangles that separate the inside corners of a cube from the outside ones, for all 256 cases (Lorensen and Cline,
//! "Marching Cubes", 1987), computed from one rule for faces: an inside corner of a face whose neighbors on it are outside
//! is cut off alone. Two cubes apply the same rule to the face that they share, so surfaces have no holes.
//!
//! Bit a of a corner's number is set if it is the larger one along axis a. Edge 4·a + 2·v + u runs along axis a; u and
//! v are its places along the axes after a and after that.

use std::sync::LazyLock;

/// \[corners that are inside, as bits\] triangles as edges, counterclockwise seen from outside.
pub(super) static TRIANGLES: LazyLock<Vec<Vec<[u8; 3]>>> = LazyLock::new(|| (0..=255).map(triangles).collect());

/// The axes after `axis`, cyclically.
const fn others(axis: usize) -> [usize; 2] {
    [(axis + 1) % 3, (axis + 2) % 3]
}

/// The two corners of `edge`, the smaller one first, and its axis.
pub(super) fn ends(edge: u8) -> ([usize; 2], usize) {
    let (axis, place) = (edge as usize / 4, edge as usize % 4);
    let [u, v] = others(axis);
    let first = (place & 1) << u | (place >> 1) << v;
    ([first, first | 1 << axis], axis)
}

/// The edge between two corners that differ in one bit.
fn edge_between(a: usize, b: usize) -> u8 {
    let axis = (a ^ b).trailing_zeros() as usize;
    let [u, v] = others(axis);
    (4 * axis + (a >> u & 1) + 2 * (a >> v & 1)) as u8
}

/// The corners of each face, counterclockwise seen from outside the cube.
fn faces() -> [[usize; 4]; 6] {
    [0, 1, 2, 3, 4, 5].map(|face| {
        let (axis, far) = (face / 2, face % 2);
        let [u, v] = others(axis);
        let around = [0, 1 << u, 1 << u | 1 << v, 1 << v];
        let corner = |n: usize| around[if far == 1 { n } else { 3 - n }] | far << axis;
        [0, 1, 2, 3].map(corner)
    })
}

/// True if a face of the cube has both edges.
fn share_a_face(a: u8, b: u8) -> bool {
    let [(a, _), (b, _)] = [ends(a), ends(b)];
    let corners = [a[0], a[1], b[0], b[1]];
    (0..3).any(|axis| corners.iter().all(|c| c >> axis & 1 == 0) || corners.iter().all(|c| c >> axis & 1 == 1))
}

fn triangles(inside: usize) -> Vec<[u8; 3]> {
    let is_inside = |corner: usize| inside >> corner & 1 == 1;
    // \[edge\] the next edge of the outline that goes through it: on each face, from where its boundary enters the inside
    // to where it leaves it.
    let mut next = [None; 12];
    for corners in faces() {
        let edge = |n: usize| edge_between(corners[n % 4], corners[(n + 1) % 4]);
        for enter in (0..4).filter(|&n| !is_inside(corners[n]) && is_inside(corners[(n + 1) % 4])) {
            let leave =
                (enter + 1..enter + 4).find(|&n| !is_inside(corners[(n + 1) % 4])).expect("a corner is outside");
            next[edge(enter) as usize] = Some(edge(leave));
        }
    }
    let mut triangles = Vec::new();
    for first in 0..12 {
        let mut outline = Vec::new();
        let mut edge = first;
        while let Some(following) = next[edge as usize].take() {
            outline.push(edge);
            edge = following;
        }
        triangulate(outline, &mut triangles);
    }
    triangles
}

/// Cuts ears off `outline`. A new side that lies in a face of the cube would meet the triangles of the cube beyond, and
/// is avoided.
fn triangulate(mut outline: Vec<u8>, triangles: &mut Vec<[u8; 3]>) {
    while outline.len() >= 3 {
        let n = outline.len();
        let corners = |ear: usize| [outline[ear], outline[(ear + 1) % n], outline[(ear + 2) % n]];
        let is_free = |&ear: &usize| n == 3 || !share_a_face(corners(ear)[0], corners(ear)[2]);
        let ear = (0..n).find(is_free).expect("every outline has an ear through the cube");
        triangles.push(corners(ear));
        outline.remove((ear + 1) % n);
    }
}

#[cfg(test)]
mod tests {
    use std::collections::HashMap;

    use super::*;

    #[test]
    fn one_corner_is_cut_off_by_one_triangle_that_faces_outward() {
        // Edges along x, y and z from corner 0.
        assert_eq!(TRIANGLES[1], [[0, 4, 8]]);
        assert_eq!(ends(0), ([0, 1], 0));
        assert_eq!(ends(11), ([3, 7], 2));
        assert!(TRIANGLES[0].is_empty() && TRIANGLES[255].is_empty());
        assert_eq!(TRIANGLES[254], [[0, 8, 4]], "seen from the other side");
    }

    #[test]
    fn edges_are_numbered_once() {
        for edge in 0..12 {
            let ([a, b], axis) = ends(edge);
            assert_eq!((edge_between(a, b), a ^ b), (edge, 1 << axis));
        }
    }

    #[test]
    fn triangles_use_the_crossed_edges_and_close_up_but_for_sides_in_faces() {
        for (inside, triangles) in TRIANGLES.iter().enumerate() {
            let mut sides: HashMap<[u8; 2], i32> = HashMap::new();
            let mut used = 0_u32;
            for triangle in triangles {
                for n in 0..3 {
                    let (a, b) = (triangle[n], triangle[(n + 1) % 3]);
                    used |= 1 << a;
                    *sides.entry([a.min(b), a.max(b)]).or_default() += if a < b { 1 } else { -1 };
                }
            }
            let is_crossed = |edge: u8| ends(edge).0.map(|c| inside >> c & 1).iter().sum::<usize>() == 1;
            let crossed = (0..12).filter(|&edge| is_crossed(edge)).fold(0, |bits, edge| bits | 1 << edge);
            assert_eq!(used, crossed, "{inside:08b}");
            for (side, balance) in sides {
                assert_eq!(balance == 0, !share_a_face(side[0], side[1]), "{inside:08b}: {side:?}");
            }
        }
    }
}
