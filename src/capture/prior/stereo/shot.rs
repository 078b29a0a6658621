//! A small gray picture of a photograph, and its patches.

use glam::{DVec2, DVec3, Vec2};
use rayon::prelude::*;

use super::plane::{Plane, direction};
use crate::dataset::Photograph;
use strivec_format::geometry::Camera;

/// The longer edge of the pictures that are compared, in pixels, at most.
const LONG_EDGE: u32 = 320;
/// Pixels between two patches, in both directions.
const STRIDE: usize = 3;
/// Pixels from the middle of a patch to its border.
pub(super) const RADIUS: i32 = 3;
/// Pixels along a patch.
const SIDE: usize = (2 * RADIUS + 1) as usize;
/// Pixels of a patch.
const PATCH: usize = SIDE * SIDE;
/// Numbers that are held for a row of a patch: as many as are computed at once. The last one repeats the last pixel.
const LANES: usize = SIDE.next_power_of_two();
/// \[row\]\[column\] the pixels of a patch, of mean 0 and length 1; 0 behind the last column.
pub(super) type Patch = [[f32; LANES]; SIDE];

/// The columns of a row's lanes, and their weights.
const LANE_COLUMNS: [f32; LANES] = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 6.0];
const LANE_WEIGHTS: [f32; LANES] = [1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 0.0];
/// Places so much, in pixels, before the last column or row count as outside: they are rounded.
const WITHIN: f64 = 0.01;

/// The least standard deviation of the luminance of a patch that is searched for, and that counts as similar: less than a step of
/// 8 bits, which the pixels of a small picture resolve as means of several.
const MIN_CONTRAST: f32 = 0.003;

/// \[patch\] the plane that a photograph shows there, if known.
pub(super) type PlaneMap = Vec<Option<Plane>>;

/// A photograph without the distortion of its lens, small and gray.
pub(super) struct StereoShot {
    pub(super) camera: Camera,
    /// \[row\]\[column\] luminance; NaN where nothing is known.
    luminance: Vec<f32>,
}

impl StereoShot {
    /// The camera of the small picture of a photograph of `camera`.
    pub(super) fn camera_of(camera: &Camera) -> Camera {
        small_lens(camera).1.undistorted()
    }

    pub(super) fn new(view: &Photograph) -> Self {
        let (factor, lens) = small_lens(&view.camera);
        let camera = lens.undistorted();
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

    /// \[row\]\[column\] luminance; NaN where nothing is known.
    pub(super) fn luminance(&self) -> &[f32] {
        &self.luminance
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

    /// The mean luminance of the pixels that are nearer to patch number `n` than to others; NaN if one is not known.
    pub(super) fn mean_luminance(&self, n: usize) -> f32 {
        let columns = self.patches()[0];
        let first = n / columns * STRIDE * self.camera.width as usize + n % columns * STRIDE;
        let row = |row: usize| self.luminance[first + row * self.camera.width as usize..][..STRIDE].iter().sum::<f32>();
        (0..STRIDE).map(row).sum::<f32>() / (STRIDE * STRIDE) as f32
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

    /// \[row\]\[column\] the distances along the rays through `pixels`, on the planes of the patches in `map`; 0 if unknown or
    /// 1/depth is less than `least`.
    pub(super) fn distances(&self, pixels: &[Vec2], map: &PlaneMap, least: f64) -> Vec<f32> {
        let columns = self.patches()[0];
        let distance = |at: DVec2| {
            let [column, row] = self.patch_at(at)?;
            let n = row * columns + column;
            let plane = map[n]?.moved(at - self.middle(n));
            (plane.inverse >= least).then(|| plane.depth() * direction(&self.camera, at).length())
        };
        pixels.iter().map(|at| distance(at.as_dvec2()).unwrap_or(0.0) as f32).collect()
    }

    /// \[row\]\[column\] the pixels of `camera`, of whose photograph this was made: the picture points on their rays, NaN
    /// without a ray.
    pub(super) fn pixels(&self, camera: &Camera) -> Vec<Vec2> {
        let point = move |x, y| camera.ray(x, y).and_then(|ray| self.camera.project(ray.at(1.0)));
        let row = |y| (0..camera.width).map(move |x| point(x, y).map_or(Vec2::NAN, DVec2::as_vec2));
        (0..camera.height).into_par_iter().flat_map_iter(row).collect()
    }

    /// The patch whose middle is nearest to the picture point `at`; `None` outside the picture.
    pub(super) fn patch_at(&self, at: DVec2) -> Option<[usize; 2]> {
        let place = (at / STRIDE as f64).floor();
        let [columns, rows] = self.patches();
        let inside = place.min_element() >= 0.0 && place.x < columns as f64 && place.y < rows as f64;
        inside.then_some([place.x as usize, place.y as usize])
    }

    /// The pixels around `middle`, of mean 0 and length 1; `None` without contrast.
    pub(super) fn patch(&self, middle: DVec2) -> Option<Patch> {
        let mut patch = [[0.0; LANES]; SIDE];
        for (row, values) in patch.iter_mut().enumerate() {
            for (column, value) in values[..SIDE].iter_mut().enumerate() {
                *value = self.at(middle + DVec2::new(column as f64, row as f64) - f64::from(RADIUS));
            }
        }
        let pixels = |patch: &mut Patch, change: &dyn Fn(f32) -> f32| {
            patch.iter_mut().flat_map(|row| &mut row[..SIDE]).for_each(|value| *value = change(*value));
        };
        let mean = patch.iter().flatten().sum::<f32>() / PATCH as f32;
        pixels(&mut patch, &|value| value - mean);
        let length = patch.iter().flatten().map(|v| v * v).sum::<f32>().sqrt();
        pixels(&mut patch, &|value| value / length);
        (length > MIN_CONTRAST * (PATCH as f32).sqrt()).then_some(patch)
    }

    /// The similarity, from −1 to 1, of `patch` to the pixels around `origin`, where its columns are `right` apart and its
    /// rows `down`; `None` where they are not all known, and without contrast.
    #[inline(always)]
    pub(super) fn similarity(&self, patch: &Patch, origin: DVec2, right: DVec2, down: DVec2) -> Option<f32> {
        let reach = f64::from(RADIUS) * (right.abs() + down.abs());
        let size = DVec2::new(f64::from(self.camera.width), f64::from(self.camera.height));
        let is_within = (origin - reach - 0.5).cmpge(DVec2::ZERO) & (origin + reach + 0.5).cmplt(size - WITHIN);
        if !is_within.all() {
            return None;
        }
        let width = self.camera.width as usize;
        let first = (origin - f64::from(RADIUS) * (right + down) - 0.5).as_vec2();
        let (right, down) = (right.as_vec2(), down.as_vec2());
        let [mut sums, mut squares, mut products] = [[0.0_f32; LANES]; 3];
        for (row, patch) in patch.iter().enumerate() {
            // All places of a row, then all pixels around them, then all values between: this way the first and the last
            // are computed for several pixels at once.
            let start = first + row as f32 * down;
            let [mut u, mut v] = [[0.0; LANES]; 2];
            for lane in 0..LANES {
                let column = LANE_COLUMNS[lane];
                (u[lane], v[lane]) = (start.x + column * right.x, start.y + column * right.y);
            }
            let [mut above, mut below] = [[[0.0; LANES]; 2]; 2];
            for lane in 0..LANES {
                let (column, line) = (u[lane] as usize, v[lane] as usize);
                (u[lane], v[lane]) = (u[lane] - column as f32, v[lane] - line as f32);
                let at = line * width + column;
                let (upper, lower) = (&self.luminance[at..at + 2], &self.luminance[at + width..at + width + 2]);
                for side in 0..2 {
                    (above[side][lane], below[side][lane]) = (upper[side], lower[side]);
                }
            }
            for lane in 0..LANES {
                let upper = above[0][lane] + u[lane] * (above[1][lane] - above[0][lane]);
                let lower = below[0][lane] + u[lane] * (below[1][lane] - below[0][lane]);
                let value = LANE_WEIGHTS[lane] * (upper + v[lane] * (lower - upper));
                sums[lane] += value;
                squares[lane] += value * value;
                products[lane] += value * patch[lane];
            }
        }
        let [sum, square, product] = [sums, squares, products].map(|lanes| lanes.iter().sum::<f32>());
        let variance = square - sum * sum / PATCH as f32;
        (variance > 0.0).then(|| product / variance.max(MIN_CONTRAST * MIN_CONTRAST * PATCH as f32).sqrt())
    }
}

/// The number of pixels of a photograph of `camera` along a pixel of its small picture, and the camera of that picture with
/// its lens.
fn small_lens(camera: &Camera) -> (u32, Camera) {
    let factor = camera.width.max(camera.height).div_ceil(LONG_EDGE).max(1);
    (factor, camera.downscaled(factor))
}

fn pixels_of(camera: &Camera) -> impl Iterator<Item = (u32, u32)> + use<> {
    let (width, height) = (camera.width, camera.height);
    (0..height).flat_map(move |y| (0..width).map(move |x| (x, y)))
}
