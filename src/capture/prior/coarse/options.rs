//! Settings of the coarse trainer.

use serde::{Deserialize, Serialize};

use crate::prior::{Error, Unbounded, VoxelBoxes};

/// Settings of [`super::reconstruct`]. The defaults are those of DVGO's coarse stage unless a field names another one.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields, rename_all = "snake_case")]
pub struct CoarseOptions {
    /// Approximate number of vertices of the finest grid over the box of all frusta.
    pub voxels: u32,
    /// Steps on each grid, coarsest first. The last grid has `voxels` vertices, each one before it an eighth of the
    /// next. A finer grid covers only the box of the voxels that the coarser one occupies. (DVGO: one grid, 5000
    /// steps.)
    pub steps: Vec<u32>,
    /// Rays per step. (DVGO: 8192.)
    pub rays: u32,
    /// Distance between samples in voxels of the current grid.
    pub step_size: f64,
    /// α of one voxel of the finest grid at the start.
    pub initial_alpha: f64,
    /// Adam's learning rate for densities and colors.
    pub learning_rate: f64,
    /// Adam's ε. (DVGO: 1e-8, which exceeds most gradients of an almost transparent grid and so slows the start.)
    pub adam_epsilon: f64,
    /// Weight of the entropy of the transmittance that reaches the background.
    pub background_entropy: f64,
    /// Weight of the squared color errors of single samples.
    pub point_color: f64,
    /// Samples of smaller α are skipped and get no gradient. (DVGO: `fast_color_thres`.)
    pub skip_alpha: f64,
    /// Rays end where their transmittance falls below this.
    pub min_transmittance: f64,
    /// Vertices seen by fewer views stay empty; limited to the number of views. (DVGO: 3.)
    pub min_views: u32,
    /// Scale learning rates by the share of views that see a vertex (DVGO: `pervoxel_lr`).
    pub view_count_rate: bool,
    /// A voxel is occupied if its α over one voxel edge exceeds this.
    pub occupied_alpha: f64,
    /// A voxel is not occupied if its visibility weight is at most this in every traced pixel: this removes fog and
    /// hidden interiors. 0 keeps every voxel that a ray reaches. (DVGO and the paper have no such rule.)
    pub min_visibility_weight: f64,
    /// For `min_visibility_weight`, only every n-th pixel of every n-th row is traced; this is n.
    pub visibility_stride: u32,
    /// sRGB color of the background and behind transparent pixels of photographs.
    #[serde(skip)]
    pub background: [f32; 3],
    /// Distance at which rays begin, in dataset units; `None` derives it from the cameras.
    #[serde(skip)]
    pub near: Option<f64>,
    /// Distance at which rays end, in dataset units; `None` derives it from the cameras.
    #[serde(skip)]
    pub far: Option<f64>,
    /// The contracted space in which the reconstruction is made; `None`: the box of all frusta.
    #[serde(skip)]
    pub unbounded: Option<Unbounded>,
    /// Cells of points on the scene's surfaces, in the space of the reconstruction: they are occupied.
    #[serde(skip)]
    pub points: Option<VoxelBoxes>,
    /// The space before the points is free: nothing that is seen is without points.
    #[serde(skip)]
    pub free_before_points: bool,
}

impl Default for CoarseOptions {
    fn default() -> Self {
        Self {
            voxels: 1_024_000,
            steps: vec![200, 1000],
            rays: 2048,
            step_size: 0.5,
            initial_alpha: 1e-6,
            learning_rate: 0.1,
            adam_epsilon: 1e-12,
            background_entropy: 0.01,
            point_color: 0.1,
            skip_alpha: 1e-7,
            min_transmittance: 1e-3,
            min_views: 3,
            view_count_rate: true,
            occupied_alpha: 1e-4,
            min_visibility_weight: 1e-3,
            visibility_stride: 3,
            background: [1.0; 3],
            near: None,
            far: None,
            unbounded: None,
            points: None,
            free_before_points: false,
        }
    }
}

impl CoarseOptions {
    /// Steps on all grids.
    pub fn total_steps(&self) -> u32 {
        self.steps.iter().fold(0, |sum, &n| sum.saturating_add(n))
    }

    pub(super) fn check(&self) -> Result<(), Error> {
        let fraction = |v: f64| v > 0.0 && v < 1.0;
        let positive = |v: f64| v > 0.0 && v.is_finite();
        let weight = |v: f64| v >= 0.0 && v.is_finite();
        let counts = [
            ("coarse.voxels", self.voxels, (64..=1 << 27).contains(&self.voxels), "an integer from 64 to 134217728"),
            ("coarse.rays", self.rays, (1..=1 << 20).contains(&self.rays), "an integer from 1 to 1048576"),
            ("coarse.visibility_stride", self.visibility_stride, self.visibility_stride > 0, "at least 1"),
        ];
        for (name, found, valid, expected) in counts {
            if !valid {
                return Err(Error::option(name, expected, found));
            }
        }
        if self.steps.is_empty() || self.steps.len() > 4 || self.steps.contains(&0) {
            return Err(Error::option("coarse.steps", "1 to 4 positive integers", &self.steps));
        }
        for (name, found, valid, expected) in [
            ("coarse.step_size", self.step_size, positive(self.step_size), "a positive number"),
            ("coarse.initial_alpha", self.initial_alpha, fraction(self.initial_alpha), "a number between 0 and 1"),
            ("coarse.learning_rate", self.learning_rate, positive(self.learning_rate), "a positive number"),
            ("coarse.adam_epsilon", self.adam_epsilon, positive(self.adam_epsilon), "a positive number"),
            ("coarse.background_entropy", self.background_entropy, weight(self.background_entropy), "at least 0"),
            ("coarse.point_color", self.point_color, weight(self.point_color), "at least 0"),
            ("coarse.skip_alpha", self.skip_alpha, fraction(self.skip_alpha), "a number between 0 and 1"),
            (
                "coarse.min_transmittance",
                self.min_transmittance,
                fraction(self.min_transmittance),
                "a number between 0 and 1",
            ),
            (
                "coarse.min_visibility_weight",
                self.min_visibility_weight,
                (0.0..1.0).contains(&self.min_visibility_weight),
                "a number in [0, 1)",
            ),
            ("coarse.occupied_alpha", self.occupied_alpha, fraction(self.occupied_alpha), "a number between 0 and 1"),
        ] {
            if !valid {
                return Err(Error::option(name, expected, found));
            }
        }
        if !self.background.iter().all(|c| (0.0..=1.0).contains(c)) {
            return Err(Error::option("background", "three numbers in [0, 1]", self.background));
        }
        Ok(())
    }
}
