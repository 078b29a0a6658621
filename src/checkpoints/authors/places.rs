//! The centers and half edges of the tensors, which a checkpoint does not hold.

use std::path::Path;

use glam::DVec3;

use super::config::Config;
use crate::torch::{Pickle, Value};
use strivec_format::geometry::Aabb;
use strivec_import as import;
use strivec_import::{Fault, ImportError, Input, Point, ReadOptions, Visitor};

/// Points of a file, held in memory (384 MiB).
const MAX_POINTS: u64 = 1 << 24;
/// Bytes of a side file.
const MAX_SIDE_FILE: u64 = 1 << 28;

/// Where the tensors are.
#[derive(Clone, Debug, PartialEq)]
pub enum Places {
    /// Points: the centers of each scale in the order of the checkpoint, or the prior's points alone. Half edges are those of the
    /// configuration.
    Points(Vec<Vec<DVec3>>),
    /// Boxes: the centers and the half edges of each scale, as `NAME_meta.pkl` holds them.
    Boxes(Vec<(Vec<DVec3>, DVec3)>),
}

impl Places {
    /// Reads the side file `NAME_meta.pkl` of a `Strivec_DBase`. It is parsed, never executed.
    ///
    /// # Errors
    ///
    /// If it is not a pickle with the arrays `geo_xyz` and `local_range` of each scale.
    pub fn from_meta(input: &mut Input<'_>) -> Result<Self, Fault> {
        Fault::unless_within("bytes of a side file", MAX_SIDE_FILE, input.left())?;
        let mut bytes = vec![0; input.left() as usize];
        input.fill(&mut bytes, "the pickle")?;
        let pickle = Pickle::parse(bytes, "the side file")?;
        let arrays = |name: &str, columns: usize| -> Result<Vec<Vec<DVec3>>, Fault> {
            let missing = || Fault::malformed("the keys of the side file", name, pickle.keys(pickle.root));
            let Value::Items(items) = pickle.value(pickle.get(pickle.root, name).ok_or_else(missing)?) else {
                return Err(Fault::malformed(name, "a list of arrays", "something else"));
            };
            let of_item = |(scale, &id): (usize, _)| {
                let place = format!("{name}, scale {scale}");
                let (header, bytes) = pickle.array(id, &place)?;
                let is_right = header.shape.len() == columns && header.shape.last() == Some(&3);
                if !is_right || header.fortran_order {
                    let expected = if columns == 2 { "rows of three numbers" } else { "three numbers" };
                    return Err(Fault::malformed(place, expected, format!("{:?}", header.shape)));
                }
                let numbers = header.numbers(&mut bytes.as_slice())?;
                Ok(numbers.as_chunks().0.iter().map(|&row| DVec3::from_array(row)).collect())
            };
            items.iter().enumerate().map(of_item).collect()
        };
        let (centers, half_edges) = (arrays("geo_xyz", 2)?, arrays("local_range", 1)?);
        if centers.len() != half_edges.len() {
            let found = format!("{} and {}", centers.len(), half_edges.len());
            return Err(Fault::malformed("geo_xyz and local_range", "as many scales", found));
        }
        Ok(Self::Boxes(centers.into_iter().zip(half_edges).map(|(centers, half)| (centers, half[0])).collect()))
    }

    /// The centers of the `count` tensors of `scale`, of `scales`, in the order of the checkpoint, and their half edges.
    pub(super) fn of_scale(
        &self,
        [scale, scales]: [usize; 2],
        count: usize,
        config: &Config,
    ) -> Result<(Vec<DVec3>, DVec3), Fault> {
        let place = format!("the centers of scale {scale}");
        let (centers, half_edge) = match self {
            Self::Boxes(boxes) => {
                let missing = || Fault::malformed("the side file", format!("{scales} scales"), boxes.len());
                boxes.get(scale).cloned().ok_or_else(missing)?
            }
            Self::Points(points) => {
                let edges = &config.half_edges;
                let missing = || {
                    let expected = format!("half edges of {scales} scales");
                    Fault::malformed("local_range of the configuration", expected, edges.len())
                };
                let half_edge = *edges.get(scale).ok_or_else(missing)?;
                let centers = match &points[..] {
                    [all] if scales > 1 || all.len() != count => voxel_centers(all, scale, config)?,
                    all if all.len() == scales => all[scale].clone(),
                    all => {
                        let expected = format!("one file for each of {scales} scales, or the prior's points alone");
                        return Err(Fault::malformed("the files of points", expected, all.len()));
                    }
                };
                (centers, half_edge)
            }
        };
        if centers.len() != count {
            return Err(Fault::malformed(
                place,
                format!("{count}, as many as the checkpoint has tensors"),
                centers.len(),
            ));
        }
        // Without negative zeros, whose order would be another.
        Ok((centers.into_iter().map(|center| center + DVec3::ZERO).collect(), half_edge))
    }
}

/// The centers of the voxels that hold points, in the order x, y, z: the voxels' faces or centers lie at the middle of the points'
/// box, by the parity of their number. Numbers have 32 bits, as in the program, since their rounding decides.
fn voxel_centers(points: &[DVec3], scale: usize, config: &Config) -> Result<Vec<DVec3>, Fault> {
    let Some(edge) = config.voxels.as_ref().and_then(|voxels| voxels.get(scale)) else {
        let what =
            format!("deriving the centers of scale {scale} without vox_range, with vox_center = 0 or with fps_num");
        let instead = "give one file of centers for each scale, which the program writes as NAME_RANGE_vox.txt";
        return Err(Fault::unsupported(what, instead));
    };
    let points: Vec<[f32; 3]> = points.iter().map(|point| point.as_vec3().to_array()).collect();
    let bound = |pick: fn(f32, f32) -> f32, axis: usize| points.iter().map(|point| point[axis]).reduce(pick);
    let mut shift = [0.0_f32; 3];
    for axis in 0..3 {
        let (Some(min), Some(max)) = (bound(f32::min, axis), bound(f32::max, axis)) else { return Ok(Vec::new()) };
        let is_odd = ((max - min) / edge[axis]).ceil() % 2.0 == 1.0;
        shift[axis] = (max + min) / 2.0 - if is_odd { edge[axis] / 2.0 } else { 0.0 };
    }
    let voxel = |point: &[f32; 3]| [0, 1, 2].map(|axis| ((point[axis] - shift[axis]) / edge[axis]).floor() as i32);
    let mut voxels: Vec<[i32; 3]> = points.iter().map(voxel).collect();
    voxels.sort_unstable();
    voxels.dedup();
    let center = |voxel: [i32; 3], axis: usize| f64::from((voxel[axis] as f32 + 0.5) * edge[axis] + shift[axis]);
    Ok(voxels.into_iter().map(|voxel| DVec3::from_array([0, 1, 2].map(|axis| center(voxel, axis)))).collect())
}

/// Reads the points of the file `path`, of any format of points that [`strivec_import`] reads, in their order.
///
/// # Errors
///
/// If it cannot be read, breaks its format, or holds triangles or cells.
pub fn read_points(path: &Path) -> Result<Vec<DVec3>, ImportError> {
    let mut points = RoundedPoints(Vec::new());
    import::read(path, &ReadOptions::default(), &mut points)?;
    Ok(points.0)
}

/// The positions of points, rounded to 32 bits as in the program.
struct RoundedPoints(Vec<DVec3>);

impl Visitor for RoundedPoints {
    fn point(&mut self, point: Point) -> Result<(), Fault> {
        Fault::unless_within("points", MAX_POINTS, self.0.len() as u64 + 1)?;
        self.0.push(point.position.as_vec3().as_dvec3());
        Ok(())
    }

    fn triangle(&mut self, _: [Point; 3]) -> Result<(), Fault> {
        Err(Fault::unsupported("a file of triangles", "give a file of points"))
    }

    fn cell(&mut self, _: &Aabb, _: Option<[u8; 3]>) -> Result<(), Fault> {
        Err(Fault::unsupported("a file of cells", "give a file of points"))
    }
}
