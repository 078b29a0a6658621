//! Occupied cells in the dataset's space from files of geometry.
//!
//! In: files, and [`BuildOptions`]. Out: a [`Built`]. Files are streamed, twice if the size of the cells is derived
//! from the geometry. Memory grows with the number of cells, and with the number of points if outliers are removed.

use std::ops::ControlFlow;
use std::path::PathBuf;

use glam::{DAffine3, DVec3, IVec3, Vec3};

use super::NoCells;
use super::bad_shapes::BadShapes;
use super::extent::{Extent, keeps_upright};
use super::holes::filled;
use super::morphology::CellRuns;
use super::outliers::{Outliers, inliers};
use super::overlap::{Convex, Parallelepiped, Triangle};
use super::voxels::{MAX_CELLS, Voxels, boxes_of, too_many_cells};
use super::{BuildError, Error, VoxelBoxes};
use crate::geometry;
use strivec_format::geometry::{Aabb, Lattice};
use strivec_import::{Fault, LeftOut, Point, ReadOptions, Visitor};

/// Points among which outliers are searched; each takes some 100 bytes.
const MAX_SEARCHED: usize = 1 << 27;

/// Options of [`build`].
#[derive(Clone, Debug, PartialEq)]
pub struct BuildOptions {
    /// The parts of the files that are read.
    pub read: ReadOptions,
    /// Map from the files' space to the dataset's.
    pub transform: DAffine3,
    /// Geometry outside this box, in the dataset's space, is left out.
    pub crop: Option<Aabb>,
    /// Edge length of a cell, in dataset units. `None` keeps the cells of grids, and divides the bounds of other
    /// geometry into about as many cells as the coarse trainer has; outliers and points far from most others do not
    /// count for these bounds.
    pub voxel: Option<f64>,
    /// Thickness of surfaces and points, in dataset units.
    pub thickness: f64,
    /// The rule for outliers; `None` keeps all points.
    pub outliers: Option<Outliers>,
    /// Cells with fewer points are left out.
    pub min_points: u32,
    /// Radius of the largest holes that are filled, in dataset units.
    pub close: f64,
    /// Radius by which cells are grown, in dataset units.
    pub dilate: f64,
}

impl Default for BuildOptions {
    fn default() -> Self {
        Self {
            read: ReadOptions::default(),
            transform: DAffine3::IDENTITY,
            crop: None,
            voxel: None,
            thickness: 0.0,
            outliers: None,
            min_points: 1,
            close: 0.0,
            dilate: 0.0,
        }
    }
}

/// Occupied cells and their colors.
#[derive(Clone, Debug, PartialEq)]
pub struct Built {
    /// The cells, in the dataset's space.
    pub boxes: VoxelBoxes,
    /// sRGB color of each cell, gray if unknown; `None` if no file has colors.
    pub colors: Option<Vec<[u8; 3]>>,
    /// The geometry that was read.
    pub counts: Counts,
}

/// Amounts of geometry that were read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Points, outliers included.
    pub points: u64,
    /// Points that were outliers.
    pub outliers: u64,
    /// Triangles.
    pub triangles: u64,
    /// Triangles without an area.
    pub degenerate: u64,
    /// Cells of grids and octrees.
    pub cells: u64,
    /// Points left out because their file marks them as withheld ([`ReadOptions::keep_noise`]).
    pub withheld: u64,
    /// Points left out because their class is noise ([`ReadOptions::keep_noise`]).
    pub noise: u64,
    /// Splats left out because of their opacity ([`ReadOptions::min_opacity`]).
    pub transparent: u64,
    /// Points and triangles left out because a coordinate is not finite: at most one percent of a file, or one.
    pub not_finite: u64,
}

/// Progress of the reading.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BuildProgress {
    /// Index of the file, counted over all passes.
    pub file: usize,
    /// Files in all passes.
    pub files: usize,
    /// Bytes read of this file.
    pub done: u64,
    /// Bytes of this file.
    pub total: u64,
}

/// The cells that the geometry of all `files` together occupies.
///
/// # Errors
///
/// [`BuildError`].
pub fn build(
    files: &[PathBuf],
    options: &BuildOptions,
    progress: &mut dyn FnMut(BuildProgress) -> ControlFlow<()>,
) -> Result<Built, BuildError> {
    options.check()?;
    let passes = if options.voxel.is_some() { 1 } else { 2 };
    let mut run = BuildRun { files, options, progress, passes, passed: 0 };
    let (lattice, kept) = match options.voxel {
        Some(edge) => (Lattice { origin: DVec3::ZERO, pitch: DVec3::splat(edge) }, None),
        None => {
            let mut first = FirstPass::new(options);
            run.pass(&mut first)?;
            first.finish(&run)?
        }
    };
    let mut filling = Filling::new(lattice, options);
    run.pass(&mut filling)?;
    filling.finish(kept)
}

impl BuildOptions {
    fn check(&self) -> Result<(), BuildError> {
        let error = |name, expected, found: &dyn std::fmt::Debug| Err(Error::option(name, expected, found).into());
        let determinant = self.transform.matrix3.determinant();
        if !self.transform.is_finite() || !determinant.is_normal() {
            return error("transform", "an invertible map", &self.transform);
        }
        if let Some(edge) = self.voxel.filter(|v| !(v.is_normal() && *v > 0.0)) {
            return error("voxel", "a positive length", &edge);
        }
        for (field, length) in [("thickness", self.thickness), ("close", self.close), ("dilate", self.dilate)] {
            if !(length >= 0.0 && length.is_finite()) {
                return error(field, "a length of at least 0", &length);
            }
        }
        match (&self.crop, &self.outliers) {
            (Some(crop), _) if !crop.is_solid() => error("crop", "two corners, the smaller one first", crop),
            (_, Some(rule)) if rule.neighbors == 0 || rule.deviations.is_nan() || rule.deviations < 0.0 => {
                error("outliers", "at least 1 neighbor and a number of deviations of at least 0", rule)
            }
            _ => Ok(()),
        }
    }
}

/// The passes over all files.
struct BuildRun<'a> {
    files: &'a [PathBuf],
    options: &'a BuildOptions,
    progress: &'a mut dyn FnMut(BuildProgress) -> ControlFlow<()>,
    passes: usize,
    passed: usize,
}

impl BuildRun<'_> {
    fn pass(&mut self, shapes: &mut dyn Shapes) -> Result<(), BuildError> {
        for file in self.files {
            let at = BuildProgress { file: self.passed, files: self.files.len() * self.passes, done: 0, total: 0 };
            let mut placed = Placed {
                transform: self.options.transform,
                shapes: &mut *shapes,
                at,
                progress: self.progress,
                bad: BadShapes::default(),
            };
            let read = geometry::read(file, &self.options.read, &mut placed);
            let bad = std::mem::take(&mut placed.bad);
            // An error of the cells reaches the reader as `Fault::Stopped`; the error itself is in `shapes`.
            if let Some(error) = shapes.failure() {
                return Err(error);
            }
            read.map_err(|e| match e.fault {
                Fault::Stopped => BuildError::Stopped,
                _ => BuildError::Import(e),
            })?;
            bad.tolerated().map_err(|fault| BuildError::Import(fault.of(file)))?;
            self.passed += 1;
        }
        Ok(())
    }
}

/// Receives shapes in the dataset's space.
trait Shapes {
    fn point(&mut self, at: DVec3, color: Option<[u8; 3]>) -> Result<(), Fault>;
    fn splat(&mut self, at: DVec3, axes: [DVec3; 3], color: Option<[u8; 3]>) -> Result<(), Fault>;
    fn triangle(&mut self, triangle: Triangle, color: Option<[u8; 3]>) -> Result<(), Fault>;
    fn cell(&mut self, cell: &Aabb, color: Option<[u8; 3]>, map: &DAffine3) -> Result<(), Fault>;
    fn left_out(&mut self, reason: LeftOut);
    /// The error of the cells that ended the reading, if any.
    fn failure(&mut self) -> Option<BuildError>;
}

/// Maps the geometry of a file to the dataset's space.
struct Placed<'a> {
    transform: DAffine3,
    shapes: &'a mut dyn Shapes,
    at: BuildProgress,
    progress: &'a mut dyn FnMut(BuildProgress) -> ControlFlow<()>,
    bad: BadShapes,
}

impl Visitor for Placed<'_> {
    fn not_finite(&mut self, fault: Fault) -> Result<(), Fault> {
        self.bad.add(fault);
        self.shapes.left_out(LeftOut::NotFinite);
        Ok(())
    }

    fn point(&mut self, point: Point) -> Result<(), Fault> {
        self.bad.good += 1;
        self.shapes.point(self.transform.transform_point3(point.position), point.color)
    }

    fn splat(&mut self, center: Point, axes: [DVec3; 3]) -> Result<(), Fault> {
        self.bad.good += 1;
        let axes = axes.map(|axis| self.transform.transform_vector3(axis));
        self.shapes.splat(self.transform.transform_point3(center.position), axes, center.color)
    }

    fn left_out(&mut self, reason: LeftOut) {
        self.shapes.left_out(reason);
    }

    fn triangle(&mut self, corners: [Point; 3]) -> Result<(), Fault> {
        self.bad.good += 1;
        let color = mean_color(corners.map(|c| c.color));
        let corners = corners.map(|c| self.transform.transform_point3(c.position));
        self.shapes.triangle(Triangle { corners }, color)
    }

    fn cell(&mut self, cell: &Aabb, color: Option<[u8; 3]>) -> Result<(), Fault> {
        self.shapes.cell(cell, color, &self.transform)
    }

    fn progress(&mut self, done: u64, total: u64) -> Result<(), Fault> {
        match (self.progress)(BuildProgress { done, total, ..self.at }) {
            ControlFlow::Continue(()) => Ok(()),
            ControlFlow::Break(()) => Err(Fault::Stopped),
        }
    }
}

fn mean_color(colors: [Option<[u8; 3]>; 3]) -> Option<[u8; 3]> {
    let [a, b, c] = [colors[0]?, colors[1]?, colors[2]?];
    Some([0, 1, 2].map(|i| ((u32::from(a[i]) + u32::from(b[i]) + u32::from(c[i]) + 1) / 3) as u8))
}

/// The first pass: the bounds of the geometry, or, if outliers are removed, of the points that are kept.
struct FirstPass {
    extent: Extent,
    /// Points within the crop, if outliers are removed.
    searched: Option<Vec<DVec3>>,
    crop: Option<Aabb>,
    failure: Option<BuildError>,
}

impl FirstPass {
    fn new(options: &BuildOptions) -> Self {
        let searched = options.outliers.map(|_| Vec::new());
        Self { extent: Extent::new(options.crop), searched, crop: options.crop, failure: None }
    }

    /// The lattice, and for each point within the crop whether it is kept.
    fn finish(mut self, run: &BuildRun<'_>) -> Result<(Lattice, Option<Vec<bool>>), BuildError> {
        let kept = match (&self.searched, &run.options.outliers) {
            (Some(searched), Some(rule)) => {
                let kept = inliers(searched, rule);
                searched.iter().zip(&kept).filter(|(_, kept)| **kept).for_each(|(at, _)| self.extent.point(*at));
                Some(kept)
            }
            _ => None,
        };
        Ok((self.extent.lattice(run.files)?, kept))
    }
}

impl Shapes for FirstPass {
    fn point(&mut self, at: DVec3, _: Option<[u8; 3]>) -> Result<(), Fault> {
        match &mut self.searched {
            // Points outside the crop do not influence which points are outliers.
            Some(searched) if self.crop.is_none_or(|crop| crop.contains(at)) => {
                if searched.len() == MAX_SEARCHED {
                    self.failure = Some(BuildError::TooManyPoints { limit: MAX_SEARCHED });
                    return Err(Fault::Stopped);
                }
                searched.push(at);
            }
            _ => self.extent.point(at),
        }
        Ok(())
    }

    fn splat(&mut self, at: DVec3, _: [DVec3; 3], color: Option<[u8; 3]>) -> Result<(), Fault> {
        self.point(at, color)
    }

    fn triangle(&mut self, triangle: Triangle, _: Option<[u8; 3]>) -> Result<(), Fault> {
        self.extent.triangle(&triangle);
        Ok(())
    }

    fn cell(&mut self, cell: &Aabb, _: Option<[u8; 3]>, map: &DAffine3) -> Result<(), Fault> {
        self.extent.cell(cell, map);
        Ok(())
    }

    fn left_out(&mut self, _: LeftOut) {}

    fn failure(&mut self) -> Option<BuildError> {
        self.failure.take()
    }
}

/// A point that is held until outliers are known.
struct Searched {
    at: DVec3,
    /// Half axes, if it is a splat.
    axes: Option<[Vec3; 3]>,
    color: Option<[u8; 3]>,
}

/// The last pass: the occupied cells.
struct Filling<'a> {
    options: &'a BuildOptions,
    lattice: Lattice,
    voxels: Voxels,
    /// Points, if outliers are removed.
    searched: Vec<Searched>,
    colored: bool,
    counts: Counts,
    failure: Option<BuildError>,
}

impl<'a> Filling<'a> {
    fn new(lattice: Lattice, options: &'a BuildOptions) -> Self {
        Self {
            options,
            lattice,
            voxels: Voxels::new(lattice, options.crop),
            searched: Vec::new(),
            colored: false,
            counts: Counts::default(),
            failure: None,
        }
    }

    fn add(&mut self, point: &Searched) -> Result<(), BuildError> {
        match point.axes {
            Some(axes) => self.voxels.add_splat(point.at, axes, point.color, self.options.thickness),
            None => self.voxels.add_point(point.at, point.color, self.options.thickness),
        }
    }

    /// Adds a point or splat, or holds it if outliers are removed.
    fn take(&mut self, point: Searched) -> Result<(), Fault> {
        self.counts.points += 1;
        self.colored |= point.color.is_some();
        if self.options.outliers.is_none() {
            let added = self.add(&point);
            return self.held(added);
        }
        // Points outside the crop do not influence which points are outliers.
        if self.options.crop.is_some_and(|crop| !crop.contains(point.at)) {
            return Ok(());
        }
        if self.searched.len() == MAX_SEARCHED {
            return self.held(Err(BuildError::TooManyPoints { limit: MAX_SEARCHED }));
        }
        self.searched.push(point);
        Ok(())
    }

    /// Keeps an error of the cells and ends the reading.
    fn held(&mut self, added: Result<(), BuildError>) -> Result<(), Fault> {
        added.map_err(|error| {
            self.failure = Some(error);
            Fault::Stopped
        })
    }

    /// `kept`: for each point within the crop whether it is kept, if the first pass has found that.
    fn finish(mut self, kept: Option<Vec<bool>>) -> Result<Built, BuildError> {
        if let Some(rule) = &self.options.outliers {
            let searched = std::mem::take(&mut self.searched);
            // Another length means that a file has changed in between.
            let kept = kept.filter(|kept| kept.len() == searched.len());
            let kept = kept.unwrap_or_else(|| inliers(&searched.iter().map(|s| s.at).collect::<Vec<_>>(), rule));
            for (point, kept) in searched.iter().zip(kept) {
                if kept {
                    self.add(point)?;
                } else {
                    self.counts.outliers += 1;
                }
            }
        }
        let all = self.voxels.len();
        let cells = self.voxels.into_cells(self.options.min_points);
        let runs = reshaped(&cells, self.options, self.lattice.pitch)?;
        let Some(boxes) = boxes_of(&self.lattice, runs.cells()) else {
            return Err(BuildError::Nothing(match all {
                0 => NoCells::LeftOut(self.counts),
                cells => NoCells::FewPoints { cells, min_points: self.options.min_points },
            }));
        };
        let colors = self.colored.then(|| colors_of(&cells, runs.cells()));
        Ok(Built { boxes, colors, counts: self.counts })
    }
}

impl Shapes for Filling<'_> {
    fn point(&mut self, at: DVec3, color: Option<[u8; 3]>) -> Result<(), Fault> {
        self.take(Searched { at, axes: None, color })
    }

    fn splat(&mut self, at: DVec3, axes: [DVec3; 3], color: Option<[u8; 3]>) -> Result<(), Fault> {
        // So that no number overflows.
        let most = DVec3::splat(1e30);
        self.take(Searched { at, axes: Some(axes.map(|axis| axis.clamp(-most, most).as_vec3())), color })
    }

    fn left_out(&mut self, reason: LeftOut) {
        let count = match reason {
            LeftOut::Withheld => &mut self.counts.withheld,
            LeftOut::Noise => &mut self.counts.noise,
            LeftOut::Transparent => &mut self.counts.transparent,
            LeftOut::NotFinite => &mut self.counts.not_finite,
        };
        *count += 1;
    }

    fn failure(&mut self) -> Option<BuildError> {
        self.failure.take()
    }

    fn triangle(&mut self, triangle: Triangle, color: Option<[u8; 3]>) -> Result<(), Fault> {
        let [a, b, c] = triangle.corners;
        self.counts.triangles += 1;
        self.counts.degenerate += u64::from((b - a).cross(c - a) == DVec3::ZERO);
        self.colored |= color.is_some();
        let added = self.voxels.add_triangle(&triangle, color, self.options.thickness);
        self.held(added)
    }

    fn cell(&mut self, cell: &Aabb, color: Option<[u8; 3]>, map: &DAffine3) -> Result<(), Fault> {
        self.counts.cells += 1;
        self.colored |= color.is_some();
        let image = Parallelepiped::image(cell, map);
        let added = if keeps_upright(map) {
            self.voxels.add_box(&image.bounds(), color)
        } else {
            self.voxels.add_convex(&image, color, 0.0)
        };
        self.held(added)
    }
}

/// Fills holes, then grows the cells.
fn reshaped(cells: &[(IVec3, Option<[u8; 3]>)], options: &BuildOptions, pitch: DVec3) -> Result<CellRuns, BuildError> {
    let too_large = |name, length: f64| Error::TooWide { name, length, cells: length / pitch.min_element() };
    let shortest = pitch.min_element();
    let mut runs = CellRuns::of_cells(cells.iter().map(|(cell, _)| *cell));
    if options.close >= shortest {
        let cells: Vec<_> = runs.cells().collect();
        let filled = filled(&cells, options.close / shortest, pitch / shortest);
        runs = CellRuns::of_cells(filled.ok_or_else(|| too_large("close", options.close))?.into_iter());
    }
    let radius = options.dilate / pitch;
    if radius.max_element() >= 1.0 {
        // The runs of all rows of the ball are collected before they are joined.
        let ball = 4.19 * (radius + 1.0).element_product();
        if ball * runs.len() as f64 > 16.0 * MAX_CELLS as f64 {
            return Err(too_large("dilate", options.dilate).into());
        }
        runs = runs.grown(radius);
    }
    if runs.len() > MAX_CELLS {
        return Err(too_many_cells(pitch).into());
    }
    Ok(runs)
}

/// The color of each of `cells`, gray if `known` has none. Both ascend by (z, y, x).
fn colors_of(known: &[(IVec3, Option<[u8; 3]>)], cells: impl Iterator<Item = IVec3>) -> Vec<[u8; 3]> {
    let key = |c: IVec3| [c.z, c.y, c.x];
    let of = |cell: IVec3| {
        let found = known.binary_search_by_key(&key(cell), |(cell, _)| key(*cell)).ok();
        found.and_then(|n| known[n].1).unwrap_or([128; 3])
    };
    cells.map(of).collect()
}
