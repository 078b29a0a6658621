//! Space that sparse points show to be free: what is nearer to a camera than the points in that part of its picture.

use glam::DVec3;

use super::VoxelBoxes;
use strivec_format::geometry::{Camera, Contraction};

/// Tiles along the longer edge of a picture.
const TILES: u32 = 16;
/// Points of a tile from which its nearest one counts: a single one may be wrong.
const MIN_POINTS: u32 = 2;
/// The share of the distance to the nearest point up to which space is free: surfaces without points may bulge toward
/// the camera.
const FREE_SHARE: f64 = 0.85;

/// The distances up to which the cameras see through free space.
#[derive(Debug)]
pub(super) struct FreeSpace(Vec<TiledCamera>);

#[derive(Debug)]
struct TiledCamera {
    camera: Camera,
    /// Edge of a tile in pixels.
    tile: f64,
    columns: usize,
    rows: usize,
    /// \[row\]\[column\] the distance up to which space is free; 0 if nothing is known.
    free: Vec<f64>,
}

impl FreeSpace {
    /// The free space between `cameras` and the cells of `points`, which are in the space of the cameras or, with a
    /// `contraction`, in that space contracted.
    pub(super) fn new(cameras: &[Camera], points: &VoxelBoxes, contraction: Option<&Contraction>) -> Self {
        let centers = points.boxes().map(|cell| cell.center());
        let places: Vec<DVec3> = centers.map(|at| contraction.map_or(at, |c| c.expand(at))).collect();
        let slack = points.lattice.pitch.length();
        Self(cameras.iter().map(|camera| TiledCamera::new(camera, &places, slack)).collect())
    }

    /// True if any camera sees through `point`.
    pub(super) fn contains(&self, point: DVec3) -> bool {
        self.0.iter().any(|view| {
            let place = view.place(point);
            place.is_some_and(|(n, distance)| distance < view.free[n])
        })
    }
}

impl TiledCamera {
    fn new(camera: &Camera, points: &[DVec3], slack: f64) -> Self {
        let tile = f64::from(camera.width.max(camera.height)) / f64::from(TILES);
        let [columns, rows] = [camera.width, camera.height].map(|n| (f64::from(n) / tile).ceil() as usize);
        let mut view = Self { camera: *camera, tile, columns, rows, free: vec![0.0; columns * rows] };
        let (mut counts, mut nearest) = (vec![0_u32; columns * rows], vec![f64::INFINITY; columns * rows]);
        for (n, distance) in points.iter().filter_map(|&point| view.place(point)) {
            counts[n] += 1;
            nearest[n] = nearest[n].min(distance);
        }
        for n in (0..counts.len()).filter(|&n| counts[n] >= MIN_POINTS) {
            // A near thing may reach into its neighbors' tiles.
            let (row, column) = (n / columns, n % columns);
            let around = (row.saturating_sub(1)..=(row + 1).min(rows - 1)).flat_map(|row| {
                (column.saturating_sub(1)..=(column + 1).min(columns - 1)).map(move |column| row * columns + column)
            });
            let nearest = around.map(|n| nearest[n]).fold(f64::INFINITY, f64::min);
            view.free[n] = (FREE_SHARE * nearest - slack).max(0.0);
        }
        view
    }

    /// The tile in which `point` is seen, and its distance; `None` outside the picture.
    fn place(&self, point: DVec3) -> Option<(usize, f64)> {
        let at = self.camera.project(point).filter(|&at| self.camera.is_inside(at))?;
        let [column, row] =
            [(at.x, self.columns), (at.y, self.rows)].map(|(v, n)| ((v / self.tile) as usize).min(n - 1));
        Some((row * self.columns + column, point.distance(self.camera.position)))
    }
}

#[cfg(test)]
mod tests {
    use glam::UVec3;

    use super::*;
    use strivec_format::geometry::Lattice;

    #[test]
    fn space_before_a_wall_of_points_is_free_and_space_behind_it_and_beside_it_is_not() {
        let camera = Camera::looking_at([64, 48], 60.0, DVec3::ZERO, DVec3::X, DVec3::Z);
        let lattice = Lattice { origin: DVec3::new(5.0, -3.0, -3.0), pitch: DVec3::splat(0.05) };
        // The left half of a wall 5 units ahead, and one point alone before its right half.
        let mut cells: Vec<UVec3> = (0..120).flat_map(|z| (60..120).map(move |y| UVec3::new(0, y, z))).collect();
        cells.insert(0, UVec3::new(0, 20, 60));
        let space = FreeSpace::new(&[camera], &VoxelBoxes { lattice, cells }, None);
        let at = |x: f64, y: f64| space.contains(DVec3::new(x, y * x, 0.0));
        assert!(at(0.5, 0.3) && at(3.5, 0.3));
        assert!(!at(4.6, 0.3), "near the wall, where a surface may bulge");
        assert!(!at(5.5, 0.3) && !at(3.0, -0.3), "behind the wall, and where one point says nothing");
        assert!(!at(-1.0, 0.3) && !at(1.0, 3.0), "out of the picture");
    }
}
