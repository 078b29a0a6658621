//! Pictures of a prior over a photograph.

use rayon::prelude::*;

use super::{Error, FirstHit, SparseVoxelTree, VoxelBoxes};
use crate::geometry::{Camera, Ray};

/// Colors of near and far cells without colors of their own, linear in the distance.
const NEAR_COLOR: [f32; 3] = [1.0, 0.55, 0.1];
const FAR_COLOR: [f32; 3] = [0.15, 0.35, 1.0];
/// Brightness of faces perpendicular to x, y and z, z from above, and of faces seen from below.
const FACES: [f32; 3] = [0.7, 0.85, 1.0];
const FROM_BELOW: f32 = 0.5;
/// Factor of the brightness at the edges of a face.
const EDGE: f32 = 0.4;
/// Edges are drawn if a cell spans at least this number of pixels.
const EDGE_PIXELS: f64 = 6.0;
/// Opacity of the prior.
const OPACITY: f32 = 0.5;

/// Blends the first cell of `boxes` along each ray of `camera` over `photograph`, colors \[height\]\[width\], and
/// returns the same layout. Cells have `colors` (one for each cell), or colors from orange to blue by distance. Faces
/// that point sideways or down are darker, as are the edges of large cells. `tree` is the tree of `boxes`; both are in
/// the camera's space.
///
/// # Errors
///
/// If the number of pixels of `photograph` is not the camera's, or `colors` has another length than the cells.
pub fn overlay(
    tree: &SparseVoxelTree,
    boxes: &VoxelBoxes,
    colors: Option<&[[u8; 3]]>,
    camera: &Camera,
    photograph: &[[f32; 3]],
) -> Result<Vec<[f32; 3]>, Error> {
    let pixels = camera.width as usize * camera.height as usize;
    if photograph.len() != pixels {
        return Err(Error::option("photograph", "one color for each pixel of the camera", photograph.len()));
    }
    if let Some(colors) = colors.filter(|colors| colors.len() != boxes.cells.len()) {
        return Err(Error::option("colors", "one color for each cell", colors.len()));
    }
    let ray = |pixel: usize| camera.ray((pixel % camera.width as usize) as u32, (pixel / camera.width as usize) as u32);
    let hits: Vec<Option<FirstHit>> = (0..pixels).into_par_iter().map(|pixel| tree.cast_ray(&ray(pixel)?)).collect();
    let distances = || hits.iter().flatten().map(|hit| hit.t);
    let (nearest, farthest) = (distances().fold(f64::INFINITY, f64::min), distances().fold(0.0, f64::max));
    let shaded = |pixel: usize, hit: &FirstHit| {
        let base = match colors {
            Some(colors) => colors[hit.cell].map(|channel| f32::from(channel) / 255.0),
            None => {
                let depth = ((hit.t - nearest) / (farthest - nearest).max(f64::MIN_POSITIVE)) as f32;
                [0, 1, 2].map(|c| NEAR_COLOR[c] + depth * (FAR_COLOR[c] - NEAR_COLOR[c]))
            }
        };
        let light = ray(pixel).map_or(1.0, |ray| light(boxes, camera, &ray, hit));
        base.map(|channel| channel * light)
    };
    let blended = |(pixel, photographed): (usize, &[f32; 3])| match &hits[pixel] {
        None => *photographed,
        Some(hit) => {
            let prior = shaded(pixel, hit);
            [0, 1, 2].map(|c| (1.0 - OPACITY) * photographed[c] + OPACITY * prior[c])
        }
    };
    Ok(photograph.par_iter().enumerate().map(blended).collect())
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
    use crate::geometry::Lattice;

    #[test]
    fn cells_cover_half_of_what_they_hide_and_their_edges_are_dark() {
        let lattice = Lattice { origin: DVec3::new(-1.0, -1.0, 0.0), pitch: DVec3::splat(1.0) };
        let boxes = VoxelBoxes { lattice, cells: vec![UVec3::ZERO] };
        let tree = SparseVoxelTree::new(&boxes);
        // From above, 20 pixels a cell on its upper face; the cell is left of and below the middle.
        let camera = Camera::looking_at([60, 60], 40.0, DVec3::new(0.0, 0.0, 3.0), DVec3::ZERO, DVec3::Y);
        let photograph = vec![[0.0, 1.0, 0.5]; 3600];
        let colors = [[255, 0, 51]];
        let picture = overlay(&tree, &boxes, Some(&colors), &camera, &photograph).unwrap();
        let at = |column: usize, row: usize| picture[60 * row + column];
        assert_eq!(at(20, 40), [0.5, 0.5, 0.25 + 0.5 * 0.2], "the face");
        assert_eq!(at(29, 40)[0], 0.5 * EDGE, "its edge");
        assert_eq!(at(40, 20), photograph[0], "beside it");
        let plain = overlay(&tree, &boxes, None, &camera, &photograph).unwrap();
        assert!(plain[60 * 40 + 20] != photograph[0] && plain[60 * 20 + 40] == photograph[0]);
    }

    #[test]
    fn pictures_and_colors_of_other_sizes_are_refused() {
        let lattice = Lattice { origin: DVec3::ZERO, pitch: DVec3::ONE };
        let boxes = VoxelBoxes { lattice, cells: vec![UVec3::ZERO] };
        let tree = SparseVoxelTree::new(&boxes);
        let camera = Camera::looking_at([2, 2], 2.0, DVec3::ZERO, DVec3::X, DVec3::Z);
        let error = overlay(&tree, &boxes, None, &camera, &[[0.0; 3]; 3]).unwrap_err();
        assert_eq!(error.to_string(), "`photograph` must be one color for each pixel of the camera, found 3");
        let error = overlay(&tree, &boxes, Some(&[]), &camera, &[[0.0; 3]; 4]).unwrap_err();
        assert_eq!(error.to_string(), "`colors` must be one color for each cell, found 0");
    }
}
