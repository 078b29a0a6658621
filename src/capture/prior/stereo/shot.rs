//! A small gray picture of a photograph, and its patches.

use glam::{DVec2, DVec3};

use super::plane::{Plane, direction};
use crate::dataset::Photograph;
use strivec_format::geometry::Camera;

/// The longer edge of the pictures that are compared, in pixels, at most.
const LONG_EDGE: u32 = 320;
/// Pixels between two patches, in both directions.
const STRIDE: usize = 3;
/// Pixels from the middle of a patch to its border.
pub(super) const RADIUS: i32 = 3;
/// Pixels of a patch.
pub(super) const PATCH: usize = ((2 * RADIUS + 1) * (2 * RADIUS + 1)) as usize;

/// The least standard deviation of the luminance of a patch that is searched for, and that counts as similar.
pub(super) const MIN_CONTRAST: f32 = 0.012;

/// \[patch\] the plane that a photograph shows there, if known.
pub(super) type PlaneMap = Vec<Option<Plane>>;

/// A photograph without the distortion of its lens, small and gray.
pub(super) struct StereoShot {
    pub(super) camera: Camera,
    /// \[row\]\[column\] luminance; NaN where nothing is known.
    luminance: Vec<f32>,
}

impl StereoShot {
    pub(super) fn new(view: &Photograph) -> Self {
        let factor = view.camera.width.max(view.camera.height).div_ceil(LONG_EDGE).max(1);
        let camera = view.camera.downscaled(factor).undistorted();
        let lens = view.camera.downscaled(factor);
        let small: Vec<f32> = pixels_of(&lens)
            .map(|(x, y)| {
                let rows = (y * factor)..((y + 1) * factor);
                let cells = rows.flat_map(|row| ((x * factor)..((x + 1) * factor)).map(move |column| (row, column)));
                let mut sum = 0.0;
                for (row, column) in cells {
                    let pixel = (row * view.camera.width + column) as usize;
                    let [r, g, b] = view.pixels.color(pixel, [0.0; 3]);
                    sum += if view.counts(pixel) { 0.299 * r + 0.587 * g + 0.114 * b } else { f32::NAN };
                }
                sum / (factor * factor) as f32
            })
            .collect();
        let shot = Self { camera, luminance: small };
        if lens.lens.is_pinhole() {
            return shot;
        }
        let luminance = pixels_of(&camera)
            .map(|(x, y)| {
                let ray = camera.ray(x, y).and_then(|ray| lens.project(ray.at(1.0)));
                ray.map_or(f32::NAN, |at| shot.at(at))
            })
            .collect();
        Self { camera, luminance }
    }

    /// The luminance at the picture point `at`, between pixels; NaN outside.
    #[inline(always)]
    pub(super) fn at(&self, at: DVec2) -> f32 {
        let (width, height) = (self.camera.width as usize, self.camera.height as usize);
        let (x, y) = (at.x as f32 - 0.5, at.y as f32 - 0.5);
        if !(x >= 0.0 && y >= 0.0 && x < (width - 1) as f32 && y < (height - 1) as f32) {
            return f32::NAN;
        }
        let (column, row) = (x as usize, y as usize);
        let (u, v) = (x - column as f32, y - row as f32);
        let first = row * width + column;
        let (above, below) = (&self.luminance[first..first + 2], &self.luminance[first + width..first + width + 2]);
        let above = above[0] + u * (above[1] - above[0]);
        let below = below[0] + u * (below[1] - below[0]);
        above + v * (below - above)
    }

    /// Patches along columns and rows.
    pub(super) fn patches(&self) -> [usize; 2] {
        [self.camera.width, self.camera.height].map(|extent| extent as usize / STRIDE)
    }

    /// The middle of patch number `n`: a picture point. The whole patch is in the picture.
    pub(super) fn middle(&self, n: usize) -> DVec2 {
        let columns = self.patches()[0];
        let place = [n % columns, n / columns];
        let reach = f64::from(RADIUS);
        let along = |axis: usize| {
            let extent = f64::from([self.camera.width, self.camera.height][axis]);
            ((place[axis] * STRIDE + STRIDE / 2) as f64 + 0.5).min(extent - reach - 1.5).max(reach + 0.5)
        };
        DVec2::new(along(0), along(1))
    }

    /// The place in the middle of patch number `n` at `depth`.
    pub(super) fn place(&self, n: usize, depth: f64) -> DVec3 {
        let seen = depth * direction(&self.camera, self.middle(n));
        self.camera.position + self.camera.world_from_camera * (DVec3::new(1.0, -1.0, -1.0) * seen)
    }

    /// The places of the patches with a plane in `map`.
    pub(super) fn points<'a>(&'a self, map: &'a PlaneMap) -> impl Iterator<Item = DVec3> + 'a {
        map.iter().enumerate().filter_map(|(n, plane)| Some(self.place(n, (*plane)?.depth())))
    }

    /// \[row\]\[column\] the distances along the rays of `camera`, whose picture this was made of, on the planes of the
    /// patches in `map`; 0 if unknown or 1/depth is less than `least`.
    pub(super) fn distances(&self, camera: &Camera, map: &PlaneMap, least: f64) -> Vec<f32> {
        let columns = self.patches()[0];
        let distance = |(x, y): (u32, u32)| {
            let at = camera.ray(x, y).and_then(|ray| self.camera.project(ray.at(1.0)))?;
            let [column, row] = self.patch_at(at)?;
            let n = row * columns + column;
            let plane = map[n]?.moved(at - self.middle(n));
            (plane.inverse >= least).then(|| plane.depth() * direction(&self.camera, at).length())
        };
        pixels_of(camera).map(|pixel| distance(pixel).unwrap_or(0.0) as f32).collect()
    }

    /// The patch whose middle is nearest to the picture point `at`; `None` outside the picture.
    pub(super) fn patch_at(&self, at: DVec2) -> Option<[usize; 2]> {
        let place = (at / STRIDE as f64).floor();
        let [columns, rows] = self.patches();
        let inside = place.min_element() >= 0.0 && place.x < columns as f64 && place.y < rows as f64;
        inside.then_some([place.x as usize, place.y as usize])
    }

    /// The pixels around `middle`, of mean 0 and length 1; `None` without contrast.
    pub(super) fn patch(&self, middle: DVec2) -> Option<[f32; PATCH]> {
        let mut n = 0;
        let mut patch = [0.0; PATCH];
        for y in -RADIUS..=RADIUS {
            for x in -RADIUS..=RADIUS {
                patch[n] = self.at(middle + DVec2::new(f64::from(x), f64::from(y)));
                n += 1;
            }
        }
        let mean = patch.iter().sum::<f32>() / PATCH as f32;
        patch.iter_mut().for_each(|v| *v -= mean);
        let length = patch.iter().map(|v| v * v).sum::<f32>().sqrt();
        patch.iter_mut().for_each(|v| *v /= length);
        (length > MIN_CONTRAST * (PATCH as f32).sqrt()).then_some(patch)
    }
}

fn pixels_of(camera: &Camera) -> impl Iterator<Item = (u32, u32)> + use<> {
    let (width, height) = (camera.width, camera.height);
    (0..height).flat_map(move |y| (0..width).map(move |x| (x, y)))
}
