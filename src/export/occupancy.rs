//! Occupied cells as a NumPy archive.

use std::io::{Seek, Write};

use glam::{DQuat, DVec3, UVec3};

use super::sampling::Sampler;
use super::{Error, Space};
use strivec_format::geometry::Aabb;
use strivec_format::model::Scene;
use strivec_import::npy::NpzWriter;

/// The most cells.
const MAX_CELLS: u64 = 1 << 30;
/// Share of a cell's edge that is left out on each side, so that cells that touch it do not count.
const MARGIN: f64 = 0.1;

/// Cells along the longest edge, if no number is given and the scene has no grid.
const RESOLUTION: u32 = 256;

/// Settings of [`write_occupancy`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OccupancyOptions {
    /// Cells along the longest edge, 1 to 4096; `None` for the cells of the scene's own grid.
    pub resolution: Option<u32>,
    /// The space of the grid, whose axes are those of the space.
    pub space: Space,
}

/// A written grid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OccupancyGrid {
    /// The box of the grid.
    pub bounds: Aabb,
    /// Cells along x, y and z.
    pub cells: UVec3,
    /// Number of occupied cells.
    pub occupied: u64,
}

/// Writes where samples of `scene` count, which must have passed [`Scene::check`], as an `.npz` archive that
/// [`strivec_import`] reads: `occupancy`, bool \[z\]\[y\]\[x\], and `bounds`, the corners of the grid, float64 (2, 3).
///
/// If the scene has no grid of its own, is unbounded (the inner cube alone is written), or is turned in the space, the
/// cells are cubes, 256 along the longest edge if `resolution` is `None`. A cube is true if anything in the box around its
/// image in model space may count.
///
/// # Errors
///
/// If the resolution is out of range, the grid is too large, the scene is empty, or `out` fails.
pub fn write_occupancy(
    scene: &Scene,
    options: &OccupancyOptions,
    out: impl Write + Seek,
) -> Result<OccupancyGrid, Error> {
    if let Some(resolution) = options.resolution {
        Error::unless_setting("resolution", 1..=4096, resolution)?;
    }
    let sampler = Sampler::new(scene, false)?;
    let from_model = options.space.map_from_model(&scene.frame);
    let to_model = from_model.inverse();
    let mapped = |within: &Aabb| Aabb::from_points(within.corners().map(|corner| from_model.point(corner)));
    let is_turned = from_model.rotation.angle_between(DQuat::IDENTITY) > 1e-9;
    let own = scene.occupancy.as_ref().filter(|_| options.resolution.is_none());
    let own = own.filter(|_| !is_turned && scene.rules.contraction.is_none());
    let (bounds, cells) = match own {
        Some(own) => (mapped(&own.bounds), own.vertices - 1),
        None => {
            let region = mapped(&sampler.region);
            let edge = region.size().max_element() / f64::from(options.resolution.unwrap_or(RESOLUTION));
            let cells = (region.size() / edge - 1e-9).ceil().max(DVec3::ONE);
            (Aabb::around(region.center(), 0.5 * cells * edge), cells.as_uvec3())
        }
    };
    let count = cells.as_u64vec3().element_product();
    Error::unless_within("cells", MAX_CELLS, count)?;
    let size = bounds.size() / cells.as_dvec3();
    let is_occupied = |cell: UVec3| match own {
        Some(own) => own.cell_is_occupied(cell.as_ivec3()),
        None => {
            let corners = [MARGIN, 1.0 - MARGIN].map(|share| bounds.min + (cell.as_dvec3() + share) * size);
            let corners = Aabb { min: corners[0], max: corners[1] }.corners().map(|corner| to_model.point(corner));
            sampler.may_count_in(&Aabb::from_points(corners))
        }
    };
    let mut occupied = 0;
    let mut archive = NpzWriter::new(out, count > u64::from(u32::MAX) / 2);
    let shape = [cells.z, cells.y, cells.x].map(|n| n as usize);
    let rows = (0..cells.z).flat_map(|z| (0..cells.y).map(move |y| (y, z)));
    let values = rows.flat_map(|(y, z)| (0..cells.x).map(move |x| UVec3::new(x, y, z))).map(is_occupied);
    archive.add("occupancy", &shape, values.inspect(|is_occupied| occupied += u64::from(*is_occupied)))?;
    archive.add("bounds", &[2, 3], [bounds.min, bounds.max].into_iter().flat_map(|corner| corner.to_array()))?;
    archive.finish()?;
    Ok(OccupancyGrid { bounds, cells, occupied })
}
