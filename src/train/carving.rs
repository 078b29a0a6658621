//! Space that known distances show to be empty, left out before the first step.

use glam::{DVec3, IVec3, UVec3};
use rayon::prelude::*;

use super::occupancy::occupy_cells;
use strivec_capture::dataset::Photograph;
use strivec_format::geometry::{Lattice, Ray, RayPath, cell_at, index_of};
use strivec_format::model::{Occupancy, Scene};

/// Cells along the longest edge of the bounds.
const CELLS: f64 = 192.0;
/// Rays of a photograph, at most, about.
const RAYS: f64 = 12_000.0;
/// The share of a known distance, at its end, that is not taken as free.
const MARGIN: f64 = 0.05;
/// The part of the distance of the nearest surfaces in a photograph, up to which the space before its camera is empty.
const OPEN: f64 = 0.5;
/// The share of the known distances that are those of the nearest surfaces.
const NEAREST_SHARE: f64 = 0.02;
/// Photographs that must see through a cell: a single one may have a wrong distance there.
const MIN_VIEWS: u16 = 3;

/// The occupancy of `scene` before the first step: all of its bounds but the cells that several photographs see through, by their
/// known distances, or that are much closer to a camera than what its photograph shows, unless some photograph sees a surface in
/// them or beside them. `None` if no distance is known.
///
/// The fox gains 0.4 dB and trains in 0.83 of the time, bonsai 0.5 dB in 0.95; a can has 0.1 dB more in 0.92
/// of the time by cells close to cameras (docs/experiments/2026-11-30-captures.md).
pub fn carved(scene: &Scene, views: &[Photograph]) -> Option<Occupancy> {
    if views.iter().all(|view| view.distances.is_empty()) {
        return None;
    }
    let grid = Grid::new(scene);
    // By groups of photographs; sums do not depend on their order.
    let group = views.len().div_ceil(4 * rayon::current_num_threads()).max(1);
    let seen = views.par_chunks(group).map(|views| grid.seen(views, scene)).reduce(|| grid.unseen(), Seen::joined);
    let size = grid.cells.as_ivec3();
    let is_near_surface = |cell: UVec3| {
        (0..27).any(|n| {
            let beside = cell.as_ivec3() + IVec3::new(n % 3, n / 3 % 3, n / 9) - 1;
            let is_within = beside.cmpge(IVec3::ZERO).all() && beside.cmplt(size).all();
            is_within && seen.surface[index_of(beside.as_uvec3(), grid.cells) as usize]
        })
    };
    // \[z\]\[y\]\[x\] by their smallest vertex; the last vertices have no cell.
    let vertices = grid.cells + 1;
    let layer = |z: u32| -> Vec<bool> {
        let is_occupied = |n: u64| {
            let cell = UVec3 { z, ..cell_at(n, vertices) };
            cell.cmplt(grid.cells).all()
                && (seen.through[index_of(cell, grid.cells) as usize] < MIN_VIEWS || is_near_surface(cell))
        };
        (0..u64::from(vertices.x * vertices.y)).map(is_occupied).collect()
    };
    let mut occupancy = Occupancy::empty(scene.bounds, vertices);
    occupy_cells(&mut occupancy, (0..vertices.z).into_par_iter().map(layer).collect());
    Some(occupancy)
}

/// The cells of a scene's bounds.
struct Grid {
    lattice: Lattice,
    cells: UVec3,
}

/// \[z\]\[y\]\[x\] what photographs see in the cells.
struct Seen {
    /// Photographs that see through a cell.
    through: Vec<u16>,
    /// True if any sees a surface in it.
    surface: Vec<bool>,
}

impl Seen {
    fn joined(mut self, other: Self) -> Self {
        self.through.iter_mut().zip(other.through).for_each(|(sum, more)| *sum = sum.saturating_add(more));
        self.surface.iter_mut().zip(other.surface).for_each(|(a, b)| *a |= b);
        self
    }
}

impl Grid {
    fn new(scene: &Scene) -> Self {
        let size = scene.bounds.size();
        let cells = (size / (size.max_element() / CELLS)).ceil().max(DVec3::ONE).as_uvec3();
        Self { lattice: Lattice { origin: scene.bounds.min, pitch: size / cells.as_dvec3() }, cells }
    }

    fn unseen(&self) -> Seen {
        let count = self.cells.as_u64vec3().element_product() as usize;
        Seen { through: vec![0; count], surface: vec![false; count] }
    }

    /// The surfaces in `views`, and the cells that they see through.
    fn seen(&self, views: &[Photograph], scene: &Scene) -> Seen {
        let mut seen = self.unseen();
        let scale = scene.frame.model_from_dataset.scale;
        // \[cell\] one more than the number of the last photograph that saw through it.
        let mut last = vec![0_u32; seen.through.len()];
        for (n, view) in (1..).zip(views).filter(|(_, view)| !view.distances.is_empty()) {
            let camera = view.camera.mapped(&scene.frame.model_from_dataset);
            let open = OPEN * scale * nearest(&view.distances);
            let stride = (view.distances.len() as f64 / RAYS).sqrt().ceil().max(1.0) as usize;
            for row in (stride as u32 / 2..camera.height).step_by(stride) {
                for column in (stride as u32 / 2..camera.width).step_by(stride) {
                    let known =
                        view.distances.get((row * camera.width + column) as usize).map_or(0.0, |&d| f64::from(d));
                    let Some(ray) = camera.ray(column, row) else { continue };
                    for cell in self.along(&ray, [scene.frame.near, open], scene) {
                        seen.through[cell] = seen.through[cell].max(MIN_VIEWS);
                    }
                    if known <= 0.0 {
                        continue;
                    }
                    let end = known * scale;
                    if let Some(cell) =
                        self.cell(scene.rules.contraction.map_or(ray.at(end), |c| c.contract(ray.at(end))))
                    {
                        seen.surface[cell] = true;
                    }
                    for cell in self.along(&ray, [scene.frame.near, (1.0 - MARGIN) * end], scene) {
                        if last[cell] != n {
                            last[cell] = n;
                            seen.through[cell] += 1;
                        }
                    }
                }
            }
        }
        seen
    }

    /// The index of the cell that holds `point`, which is contracted if the scene is.
    fn cell(&self, point: DVec3) -> Option<usize> {
        let cell = self.lattice.cell_of(point);
        let is_within = cell.cmpge(IVec3::ZERO).all() && cell.as_uvec3().cmplt(self.cells).all();
        is_within.then(|| index_of(cell.as_uvec3(), self.cells) as usize)
    }

    /// The cells at points of `ray` between two distances, about half a cell apart.
    fn along(&self, ray: &Ray, near_far: [f64; 2], scene: &Scene) -> impl Iterator<Item = usize> {
        let path = RayPath::new(ray, &scene.bounds, scene.rules.contraction, near_far);
        let (from, to) = path.span.unwrap_or((0.0, 0.0));
        let speed =
            path.contraction().map_or(1.0, |(contraction, spacing)| spacing.max_speed(contraction).max(spacing.scale));
        let count = (2.0 * speed * (to - from) / self.lattice.pitch.min_element()).clamp(0.0, 1e5) as usize;
        let place = move |n: usize| path.position(from + (to - from) * (n as f64 + 0.5) / count as f64);
        (0..count).filter_map(move |n| self.cell(place(n)))
    }
}

/// The quantile [`NEAREST_SHARE`] of the known distances; 0 if none is known.
fn nearest(distances: &[f32]) -> f64 {
    let mut known: Vec<f32> = distances.iter().copied().filter(|&d| d > 0.0).collect();
    let at = (NEAREST_SHARE * known.len() as f64) as usize;
    if known.is_empty() { 0.0 } else { f64::from(*known.select_nth_unstable_by(at, f32::total_cmp).1) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{TrainConfig, initial_scene};
    use strivec_capture::dataset::Pixels;
    use strivec_format::geometry::{Aabb, Camera, Similarity};
    use strivec_format::model::{Placement, TensorCloud};

    /// A scene of one tensor within ±1, and photographs of the wall x = 0.5 from the left, with distances.
    fn wall() -> (Scene, Vec<Photograph>) {
        let config = TrainConfig::preset("fast").unwrap();
        let scale = &config.scales[0];
        let cloud = TensorCloud {
            placement: Placement::Lattice {
                lattice: Lattice { origin: DVec3::splat(-1.0), pitch: DVec3::splat(2.0) },
                cells: vec![UVec3::ZERO],
            },
            half_edge: DVec3::ONE,
            resolution: scale.resolutions[0],
        };
        let clouds = config.scales.iter().map(|_| cloud.clone()).collect();
        let frame = crate::prepare::frame(&config, Similarity::IDENTITY, [0.1, 9.0]);
        let scene = initial_scene(&config, clouds, frame, "wall").unwrap();
        let views = (0..30).map(|n| {
            let at = DVec3::new(-3.0, 0.02 * f64::from(n), 0.017 * f64::from(n % 7));
            let camera = Camera::looking_at([100, 100], 150.0, at, DVec3::new(0.5, 0.0, 0.0), DVec3::Z);
            let distances =
                camera.rays(0..100).map(|ray| ray.map_or(0.0, |ray| (3.5 / ray.direction.x) as f32)).collect();
            let pixels = Pixels::opaque(vec![[0.5; 3]; 10_000]);
            Photograph { distances, ..Photograph::new(n.to_string(), camera, pixels) }
        });
        (scene, views.collect())
    }

    #[test]
    fn space_before_a_wall_is_empty_and_the_wall_and_what_is_behind_it_is_not() {
        let (scene, views) = wall();
        let found = carved(&scene, &views).unwrap();
        assert_eq!(found.bounds, Aabb::around(DVec3::ZERO, DVec3::ONE));
        let is_occupied = |x: f64, y: f64| {
            let lattice = Lattice { origin: found.bounds.min, pitch: found.cell_size() };
            found.cell_is_occupied(lattice.cell_of(DVec3::new(x, y, 0.0)))
        };
        // Rays are not as close as cells, so that some cells are missed.
        let before =
            (0..400).filter(|n| is_occupied(-0.9 + 0.6 * f64::from(n % 20) / 20.0, 0.2 * f64::from(n / 20) / 20.0));
        let count = before.count();
        let all = found.vertices.as_u64vec3().element_product();
        assert!(
            count < 80,
            "most of what all see through is empty: {count} of 400 are not; {} of {all} vertices",
            found.count()
        );
        assert!(is_occupied(0.5, 0.0) && is_occupied(0.45, 0.0) && is_occupied(0.8, 0.0), "the wall and behind it");
        assert!(is_occupied(-0.9, -0.95), "no camera looks here");
        let few = carved(&scene, &views[..2]).unwrap();
        assert_eq!(few.count(), carved(&scene, &views[..1]).unwrap().count(), "two may be wrong");
        assert!(few.count() > found.count());
    }

    /// Two photographs do not carve by their distances, and only the upper half of each has some.
    #[test]
    fn what_is_much_closer_than_all_known_surfaces_is_empty() {
        let (scene, views) = wall();
        let views: Vec<Photograph> = (views.into_iter().take(2))
            .map(|mut view| {
                view.camera.position.x = -1.5;
                let distances =
                    view.camera.rays(0..100).map(|ray| ray.map_or(0.0, |ray| (2.0 / ray.direction.x) as f32));
                view.distances = distances.collect();
                view.distances[5000..].fill(0.0);
                view
            })
            .collect();
        let found = carved(&scene, &views).unwrap();
        let lattice = Lattice { origin: found.bounds.min, pitch: found.cell_size() };
        // Columns of cells along y before the cameras, below their horizon.
        let occupied = |x: f64| {
            let is_occupied =
                |n: i32| found.cell_is_occupied(lattice.cell_of(DVec3::new(x, 0.01 * f64::from(n), -0.1 * (x + 1.5))));
            (-10..=10).filter(|&n| is_occupied(n)).count()
        };
        assert_eq!([-0.9, -0.6].map(occupied), [0; 2], "half of the way to the wall");
        assert_eq!([-0.3, 0.0].map(occupied), [21; 2], "the other half");
    }

    #[test]
    fn without_distances_nothing_is_known() {
        let (scene, mut views) = wall();
        views.iter_mut().for_each(|view| view.distances.clear());
        assert_eq!(carved(&scene, &views), None);
    }
}
