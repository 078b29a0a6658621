//! Pictures of a prior over a photograph.

use rayon::prelude::*;

use super::{Error, FirstHit, SparseVoxelTree, VoxelBoxes};
use strivec_format::geometry::{Camera, Ray};

/// Coefficients of red, green and blue of the color map Turbo, from blue at 0 to red at 1, by rising power (Mikhailov,
/// "Turbo, An Improved Rainbow Colormap for Visualization", 2019).
const TURBO: [[f32; 6]; 3] = [
    [0.1357, 4.6154, -42.6603, 132.1311, -152.9424, 59.2864],
    [0.0914, 2.1942, 4.8430, -14.1850, 4.2773, 2.8296],
    [0.1067, 12.6419, -60.5820, 110.3628, -89.9031, 27.3482],
];
/// Brightness of faces perpendicular to x, y and z, z from above, and of faces seen from below.
const FACES: [f32; 3] = [0.7, 0.85, 1.0];
const FROM_BELOW: f32 = 0.5;
/// Factor of the brightness at the edges of a face.
const EDGE: f32 = 0.4;
/// Edges are drawn if a cell spans at least this number of pixels.
const EDGE_PIXELS: f64 = 6.0;
/// Opacity of the prior.
const OPACITY: f32 = 0.5;

/// The colors of cells in [`overlay`].
#[derive(Clone, Copy, Debug)]
pub enum Shading<'a> {
    /// A color of its own for each cell.
    Cells(&'a [[u8; 3]]),
    /// Colors by distance along the ray, in dataset units: red at the first, blue at the second.
    Distance([f64; 2]),
}

/// The smallest and the largest distance at which rays of `cameras` meet a cell; `None` if none does.
pub fn distance_range(tree: &SparseVoxelTree, cameras: &[Camera]) -> Option<[f64; 2]> {
    let of = |camera: &Camera| {
        let rays =
            (0..camera.height).into_par_iter().flat_map_iter(|row| (0..camera.width).map(move |column| (column, row)));
        let hits = rays.filter_map(|(column, row)| tree.cast_ray(&camera.ray(column, row)?));
        hits.map(|hit| [hit.t, hit.t]).reduce_with(joined)
    };
    cameras.iter().filter_map(of).reduce(joined)
}

fn joined(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0].min(b[0]), a[1].max(b[1])]
}

/// Blends the first cell of `boxes` along each ray of `camera` over `photograph`, colors \[height\]\[width\], and
/// returns the same layout. Faces that point sideways or down are darker, as are the edges of large cells. `tree` is the
/// tree of `boxes`; both are in the camera's space.
///
/// # Errors
///
/// If the number of pixels of `photograph` is not the camera's, or the colors are not as many as the cells.
pub fn overlay(
    tree: &SparseVoxelTree,
    boxes: &VoxelBoxes,
    shading: Shading<'_>,
    camera: &Camera,
    photograph: &[[f32; 3]],
) -> Result<Vec<[f32; 3]>, Error> {
    let pixels = camera.width as usize * camera.height as usize;
    if photograph.len() != pixels {
        return Err(Error::option("photograph", "one color for each pixel of the camera", photograph.len()));
    }
    if let Shading::Cells(colors) = shading
        && colors.len() != boxes.cells.len()
    {
        return Err(Error::option("colors", "one color for each cell", colors.len()));
    }
    let ray = |pixel: usize| camera.ray((pixel % camera.width as usize) as u32, (pixel / camera.width as usize) as u32);
    let blended = |(pixel, photographed): (usize, &[f32; 3])| {
        let Some(ray) = ray(pixel) else { return *photographed };
        let Some(hit) = tree.cast_ray(&ray) else { return *photographed };
        let base = match shading {
            Shading::Cells(colors) => colors[hit.cell].map(|channel| f32::from(channel) / 255.0),
            Shading::Distance([near, far]) => {
                turbo(1.0 - ((hit.t - near) / (far - near).max(f64::MIN_POSITIVE)).clamp(0.0, 1.0) as f32)
            }
        };
        let light = light(boxes, camera, &ray, &hit);
        [0, 1, 2].map(|c| (1.0 - OPACITY) * photographed[c] + OPACITY * light * base[c])
    };
    Ok(photograph.par_iter().enumerate().map(blended).collect())
}

fn turbo(share: f32) -> [f32; 3] {
    TURBO.map(|channel| channel.iter().rev().fold(0.0, |sum, factor| sum * share + factor).clamp(0.0, 1.0))
}

/// Brightness of the cell where `ray` meets it.
fn light(boxes: &VoxelBoxes, camera: &Camera, ray: &Ray, hit: &FirstHit) -> f32 {
    let below = hit.axis == 2 && ray.direction.z > 0.0;
    let face = if below { FROM_BELOW } else { FACES[hit.axis] };
    let cell = boxes.cell_box(hit.cell);
    // Size of a pixel at this distance.
    let pixel = hit.t / camera.focal[0].max(camera.focal[1]);
    let at = ray.at(hit.t);
    let across = (0..3).filter(|&axis| axis != hit.axis);
    let on_edge = across.into_iter().any(|axis| {
        let to_edge = (at[axis] - cell.min[axis]).min(cell.max[axis] - at[axis]);
        cell.size()[axis] >= EDGE_PIXELS * pixel && to_edge < 0.6 * pixel
    });
    if on_edge { EDGE * face } else { face }
}

#[cfg(test)]
mod tests {
    use glam::{DVec3, UVec3};

    use super::*;
    use strivec_format::geometry::Lattice;

    #[test]
    fn cells_cover_half_of_what_they_hide_and_their_edges_are_dark() {
        let lattice = Lattice { origin: DVec3::new(-1.0, -1.0, 0.0), pitch: DVec3::splat(1.0) };
        let boxes = VoxelBoxes { lattice, cells: vec![UVec3::ZERO] };
        let tree = SparseVoxelTree::new(&boxes);
        // From above, 20 pixels a cell on its upper face; the cell is left of and below the middle.
        let camera = Camera::looking_at([60, 60], 40.0, DVec3::new(0.0, 0.0, 3.0), DVec3::ZERO, DVec3::Y);
        let photograph = vec![[0.0, 1.0, 0.5]; 3600];
        let colors = [[255, 0, 51]];
        let picture = overlay(&tree, &boxes, Shading::Cells(&colors), &camera, &photograph).unwrap();
        let at = |column: usize, row: usize| picture[60 * row + column];
        assert_eq!(at(20, 40), [0.5, 0.5, 0.25 + 0.5 * 0.2], "the face");
        assert_eq!(at(29, 40)[0], 0.5 * EDGE, "its edge");
        assert_eq!(at(40, 20), photograph[0], "beside it");
        let range = distance_range(&tree, &[camera]).unwrap();
        assert!(range[0] >= 2.0 && range[0] < 2.1 && range[1] > range[0] && range[1] < 4.0, "{range:?}");
        let by_distance = |range| overlay(&tree, &boxes, Shading::Distance(range), &camera, &photograph).unwrap();
        let (near, far) = (by_distance([3.0, 9.0]), by_distance([0.0, 1.0]));
        assert_eq!(near[60 * 20 + 40], photograph[0], "beside it");
        let [near, far] = [near[60 * 40 + 20], far[60 * 40 + 20]];
        assert!(near[0] > far[0] && far[2] > near[2], "{near:?} {far:?}");
    }

    #[test]
    fn near_is_red_and_far_is_blue() {
        let brightest = |share| {
            let color = turbo(share);
            (0..3).max_by(|&a, &b| color[a].total_cmp(&color[b])).unwrap()
        };
        assert_eq!([0.9, 0.5, 0.1].map(brightest), [0, 1, 2]);
        assert!((0..=100).all(|n| turbo(n as f32 / 100.0).iter().all(|channel| (0.0..=1.0).contains(channel))));
    }

    #[test]
    fn pictures_and_colors_of_other_sizes_are_refused() {
        let lattice = Lattice { origin: DVec3::ZERO, pitch: DVec3::ONE };
        let boxes = VoxelBoxes { lattice, cells: vec![UVec3::ZERO] };
        let tree = SparseVoxelTree::new(&boxes);
        let camera = Camera::looking_at([2, 2], 2.0, DVec3::ZERO, DVec3::X, DVec3::Z);
        let error = overlay(&tree, &boxes, Shading::Distance([0.0, 1.0]), &camera, &[[0.0; 3]; 3]).unwrap_err();
        assert_eq!(error.to_string(), "`photograph` must be one color for each pixel of the camera; found 3");
        let error = overlay(&tree, &boxes, Shading::Cells(&[]), &camera, &[[0.0; 3]; 4]).unwrap_err();
        assert_eq!(error.to_string(), "`colors` must be one color for each cell; found 0");
    }
}
