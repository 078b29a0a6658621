//! Marching cubes over a regular grid, one layer of vertices after the other.
//!
//! In: a function that fills blocks of the grid with levels. Out: the closed surface around the vertices of positive
//! level, as triangles over shared vertices. Memory besides the result: ten layers of levels, two of edges.

use glam::{DVec3, UVec3};

use super::Error;
use super::cube::{TRIANGLES, ends};
use super::layers::for_each_layer;

/// The level of a vertex where there is nothing.
pub(super) const NOTHING: f32 = f32::NEG_INFINITY;

/// The most cells along the longest edge of a grid.
pub(super) const MAX_RESOLUTION: u32 = 2048;
/// The most vertices of a surface; with their triangles, normals and colors they take 2.5 GB.
const MAX_VERTICES: u64 = 1 << 25;
/// Vertices stay this far from the ends of their edge, in cells, so that no triangle shrinks to a point.
const MARGIN: f64 = 1e-3;
const NO_VERTEX: u32 = u32::MAX;

/// Triangles over shared vertices.
#[derive(Debug, Default)]
pub(super) struct MarchedSurface {
    /// Positions of the vertices, in cells from the first vertex of the grid.
    pub(super) positions: Vec<DVec3>,
    /// Counterclockwise seen from outside.
    pub(super) triangles: Vec<[u32; 3]>,
}

/// A layer of the grid's vertices.
struct VertexLayer {
    /// \[y\]\[x\].
    levels: Vec<f32>,
    /// \[y\]\[word\] a bit for each vertex, set if its level is positive; the last word of a row is 0.
    inside: Vec<u64>,
    /// \[axis\]\[y\]\[x\] the surface's vertex on the edge from this vertex along x and along y.
    edges: [Vec<u32>; 2],
}

/// The surface in a grid of `vertices` vertices, whose levels `fill` writes; see [`for_each_layer`].
///
/// The outermost vertices of the grid should be outside, else the surface is open there.
///
/// # Errors
///
/// [`Error::TooLarge`] if the surface has too many vertices.
pub(super) fn march(
    vertices: UVec3,
    fill: impl Fn(UVec3, &mut [f32]) + Sync,
    progress: &dyn Fn(u64, u64),
) -> Result<MarchedSurface, Error> {
    let mut mesher = Mesher::new(vertices);
    for_each_layer(vertices, fill, progress, |z, levels| {
        mesher.take_layer(levels);
        if z > 0 { mesher.mesh_cells(z - 1) } else { Ok(()) }
    })?;
    Ok(mesher.surface)
}

struct Mesher {
    /// Vertices along x and y.
    extent: [usize; 2],
    /// Words of a row of bits.
    words: usize,
    /// The layers below and above the cells.
    layers: [VertexLayer; 2],
    /// \[y\]\[x\] the surface's vertex on the edge from this vertex of the lower layer along z.
    upright: Vec<u32>,
    surface: MarchedSurface,
}

impl Mesher {
    fn new(vertices: UVec3) -> Self {
        let extent = [vertices.x as usize, vertices.y as usize];
        let (count, words) = (extent[0] * extent[1], extent[0].div_ceil(64) + 1);
        let layer = || VertexLayer {
            levels: vec![NOTHING; count],
            inside: vec![0; words * extent[1]],
            edges: [0, 1].map(|_| vec![NO_VERTEX; count]),
        };
        let layers = [layer(), layer()];
        Self { extent, words, layers, upright: vec![NO_VERTEX; count], surface: MarchedSurface::default() }
    }

    /// Makes `next` the upper layer, and leaves the memory of the lower one in its place.
    fn take_layer(&mut self, next: &mut Vec<f32>) {
        self.layers.swap(0, 1);
        let VertexLayer { levels, inside, edges } = &mut self.layers[1];
        std::mem::swap(levels, next);
        edges.iter_mut().for_each(|edges| edges.fill(NO_VERTEX));
        self.upright.fill(NO_VERTEX);
        for (row, words) in levels.chunks_exact(self.extent[0]).zip(inside.chunks_exact_mut(self.words)) {
            for (part, word) in row.chunks(64).zip(words) {
                *word = part.iter().rev().fold(0, |bits, level| bits << 1 | u64::from(*level > 0.0));
            }
        }
    }

    /// Adds the triangles of the cells between the two layers, the lower of which has the height `z`.
    fn mesh_cells(&mut self, z: u32) -> Result<(), Error> {
        let [width, rows] = self.extent;
        for y in 0..rows - 1 {
            for word in 0..self.words - 1 {
                let mut mixed = self.mixed_cells(y, word);
                if width - 64 * word <= 64 {
                    // The last vertex of the row begins no cell.
                    mixed &= !(u64::MAX << (width - 64 * word - 1));
                }
                while mixed != 0 {
                    self.mesh_cell([64 * word + mixed.trailing_zeros() as usize, y], z);
                    mixed &= mixed - 1;
                }
            }
            let found = self.surface.positions.len() as u64;
            Error::unless_within("vertices of the surface", MAX_VERTICES, found)?;
        }
        Ok(())
    }

    /// A bit for each of 64 cells of the row `y`: its corners are neither all inside nor all outside.
    fn mixed_cells(&self, y: usize, word: usize) -> u64 {
        let rows = [(0, y), (0, y + 1), (1, y), (1, y + 1)];
        let of = |word: usize| rows.map(|(layer, y)| self.layers[layer].inside[y * self.words + word]);
        let (these, next) = (of(word), of(word + 1));
        let any = |words: [u64; 4]| words.iter().fold(0, |all, word| all | word);
        let all = |words: [u64; 4]| words.iter().fold(u64::MAX, |all, word| all & word);
        let with_next = |words: u64, next: u64| words >> 1 | next << 63;
        let some = any(these) | with_next(any(these), any(next));
        some & !(all(these) & with_next(all(these), all(next)))
    }

    fn mesh_cell(&mut self, [x, y]: [usize; 2], z: u32) {
        let width = self.extent[0];
        let at = |corner: usize| (corner >> 2, (y + (corner >> 1 & 1)) * width + x + (corner & 1));
        let levels = [0, 1, 2, 3, 4, 5, 6, 7].map(|corner| {
            let (layer, index) = at(corner);
            self.layers[layer].levels[index]
        });
        let inside = (0..8).filter(|&corner| levels[corner] > 0.0).fold(0, |bits, corner| bits | 1 << corner);
        let surface = &mut self.surface;
        for triangle in &TRIANGLES[inside] {
            let corners = triangle.map(|edge| {
                let ([first, second], axis) = ends(edge);
                let (layer, index) = at(first);
                let known = match axis {
                    2 => &mut self.upright[index],
                    _ => &mut self.layers[layer].edges[axis][index],
                };
                if *known == NO_VERTEX {
                    *known = surface.positions.len() as u32;
                    let offset = DVec3::new((first & 1) as f64, (first >> 1 & 1) as f64, (first >> 2) as f64);
                    let mut position = DVec3::new(x as f64, y as f64, f64::from(z)) + offset;
                    position[axis] += crossing(levels[first], levels[second]);
                    surface.positions.push(position);
                }
                *known
            });
            surface.triangles.push(corners);
        }
    }
}

/// The place of the surface between two vertices of the levels `a` and `b`, from 0 at the first to 1. Beside nothing it is
/// in the middle.
fn crossing(a: f32, b: f32) -> f64 {
    if a == NOTHING || b == NOTHING {
        return 0.5;
    }
    let (a, b) = (f64::from(a), f64::from(b));
    (a / (a - b)).clamp(MARGIN, 1.0 - MARGIN)
}

#[cfg(test)]
mod tests {
    use std::collections::HashMap;

    use super::super::layers::vertices_of_block;
    use super::*;
    use strivec_format::random::Random;

    fn surface_of(vertices: UVec3, level: impl Fn(UVec3) -> f32 + Sync) -> MarchedSurface {
        let fill = |first: UVec3, levels: &mut [f32]| {
            levels.iter_mut().zip(vertices_of_block(first)).for_each(|(l, vertex)| *l = level(vertex));
        };
        march(vertices, fill, &|_, _| {}).unwrap()
    }

    /// Fails unless each side of a triangle is a side of exactly one other, in the other direction.
    fn check_closed(surface: &MarchedSurface) {
        let mut sides: HashMap<[u32; 2], u32> = HashMap::new();
        for triangle in &surface.triangles {
            (0..3).for_each(|n| *sides.entry([triangle[n], triangle[(n + 1) % 3]]).or_default() += 1);
        }
        for ([a, b], count) in &sides {
            assert_eq!((*count, sides.get(&[*b, *a])), (1, Some(&1)), "the side from {a} to {b}");
        }
    }

    fn volume(surface: &MarchedSurface) -> f64 {
        let corners = |triangle: &[u32; 3]| triangle.map(|n| surface.positions[n as usize]);
        surface.triangles.iter().map(corners).map(|[a, b, c]| a.dot(b.cross(c)) / 6.0).sum()
    }

    #[test]
    fn a_ball_is_closed_and_outward_and_has_its_radius_across_blocks_and_layers() {
        const RADIUS: f64 = 27.3;
        let vertices = UVec3::new(71, 65, 66);
        let center = DVec3::new(35.2, 31.9, 32.4);
        let ball = surface_of(vertices, |vertex| (RADIUS - (vertex.as_dvec3() - center).length()) as f32);
        check_closed(&ball);
        let farthest = ball.positions.iter().map(|p| ((p - center).length() - RADIUS).abs()).fold(0.0, f64::max);
        assert!(farthest < 0.01, "{farthest}");
        let exact = 4.0 / 3.0 * std::f64::consts::PI * RADIUS.powi(3);
        assert!((volume(&ball) / exact - 1.0).abs() < 2e-3, "{}", volume(&ball) / exact);
        // Euler: a sphere has two vertices more than half as many triangles.
        assert_eq!(ball.positions.len(), ball.triangles.len() / 2 + 2);
    }

    #[test]
    fn noise_is_closed_where_faces_are_ambiguous() {
        let random = Random::new(3, "levels");
        let vertices = UVec3::new(67, 19, 18);
        let noise = surface_of(vertices, |vertex| {
            let is_border = vertex.cmpeq(UVec3::ZERO).any() || vertex.cmpge(vertices - 1).any();
            let draw = random.normal(u64::from((vertex.z * 100 + vertex.y) * 100 + vertex.x)) as f32;
            if is_border || draw < -1.0 { NOTHING } else { draw }
        });
        check_closed(&noise);
        assert!(noise.triangles.len() > 10_000 && volume(&noise) > 0.0);
    }

    #[test]
    fn one_vertex_is_an_octahedron_and_beside_nothing_the_surface_is_in_the_middle() {
        let one = surface_of(UVec3::splat(3), |vertex| if vertex == UVec3::ONE { 1.0 } else { NOTHING });
        check_closed(&one);
        assert_eq!((one.positions.len(), one.triangles.len()), (6, 8));
        assert!(one.positions.iter().all(|p| (p - 1.0).length() == 0.5), "{:?}", one.positions);
        assert_eq!((crossing(1.0, -3.0), crossing(-3.0, 1.0), crossing(1.0, 0.0)), (0.25, 0.75, 1.0 - MARGIN));
    }
}
