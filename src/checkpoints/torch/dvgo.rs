//! DVGO's checkpoints: `coarse_last.tar`, `fine_last.tar`.
//!
//! `model_state_dict` holds `density.grid` (1, 1, X, Y, Z), in older checkpoints `density`. The opacity is 1 − (1 +
//! exp(density + `act_shift`))^(−`voxel_size_ratio`). Fine models also have a mask: `mask_cache.mask`, which has its
//! own size and is sampled at the nearest voxel, or, in the oldest checkpoints, `nonempty_mask`. The
//! `mask_cache.density` of the oldest checkpoints is redundant: the density is −100 where it is empty.

use glam::DVec3;

use super::checkpoint::TorchFile;
use super::pickle::Id;
use strivec_format::geometry::Aabb;
use strivec_import::grid::{At, Density, Grid, Order, three_axes};
use strivec_import::{Fault, ReadOptions, Visitor};

/// Voxels of a mask, one bit each (128 MiB).
const MAX_MASK: u64 = 1 << 30;
/// Voxels between two reports of progress.
const REPORT_EVERY: u64 = 1 << 20;

/// Passes the occupied voxels to `visitor`.
pub(super) fn read(
    checkpoint: &mut TorchFile<'_, '_>,
    options: &ReadOptions,
    visitor: &mut dyn Visitor,
) -> Result<(), Fault> {
    let parts = DvgoParts::of(checkpoint)?;
    let density = parts.density(checkpoint)?;
    let activation = parts.activation(checkpoint)?;
    let corner = |name| parts.state(checkpoint, name).or_else(|| parts.setting(checkpoint, name));
    let (min, max) = (corner("xyz_min"), corner("xyz_max"));
    let (Some(min), Some(max)) = (min, max) else {
        return Err(Fault::malformed(
            "the keys of model_kwargs",
            "xyz_min and xyz_max",
            checkpoint.pickle.keys(parts.kwargs),
        ));
    };
    let bounds =
        Aabb { min: checkpoint.numbers(min, "xyz_min")?.into(), max: checkpoint.numbers(max, "xyz_max")?.into() };
    let not_a_tensor = || Fault::broken("density", "it is not a tensor");
    let tensor = checkpoint.tensor(density).ok_or_else(not_a_tensor)?.clone();
    let shape = three_axes(&tensor.shape)?;
    let grid = Grid::new(shape, Order::Xyz, At::Vertices, &bounds)?;
    let mask = Mask::of(&parts, checkpoint, &grid)?;
    let count: u64 = shape.iter().product();
    checkpoint.for_each(&tensor, |n, value| {
        if n % REPORT_EVERY == REPORT_EVERY - 1 {
            visitor.progress(n, count)?;
        }
        if value.is_nan() {
            return Err(Fault::malformed(format!("number {n} of density"), "a number", value));
        }
        if activation.alpha(value) >= options.min_alpha
            && mask.as_ref().is_none_or(|mask| mask.contains(grid.center(n)))
        {
            visitor.cell(&grid.cell(n), None)?;
        }
        Ok(())
    })
}

/// The dictionaries of a checkpoint.
struct DvgoParts {
    state: Id,
    kwargs: Id,
    /// Settings of the mask, in the oldest checkpoints.
    mask_kwargs: Option<Id>,
}

impl DvgoParts {
    fn of(checkpoint: &TorchFile<'_, '_>) -> Result<Self, Fault> {
        let pickle = &checkpoint.pickle;
        let part = |name: &str| pickle.get(pickle.root, name);
        let (Some(state), Some(kwargs)) = (part("model_state_dict"), part("model_kwargs")) else {
            return Err(Fault::malformed(
                "the checkpoint",
                "model_state_dict and model_kwargs",
                pickle.keys(pickle.root),
            ));
        };
        let parts = Self { state, kwargs, mask_kwargs: part("MaskCache_kwargs") };
        if parts.setting(checkpoint, "mpi_depth").is_some() {
            return Err(Fault::unsupported(
                "a DVGO checkpoint of forward-facing photographs",
                "its grid is not a box in space; use points, a mesh or another reconstruction",
            ));
        }
        if parts.state(checkpoint, "scene_radius").is_some() || parts.setting(checkpoint, "contracted_norm").is_some() {
            return Err(Fault::unsupported(
                "a DVGO checkpoint of an unbounded scene",
                "its grid is contracted; use points, a mesh or another reconstruction",
            ));
        }
        Ok(parts)
    }

    /// A tensor of the model.
    fn state(&self, checkpoint: &TorchFile<'_, '_>, name: &str) -> Option<Id> {
        checkpoint.pickle.get(self.state, name)
    }

    /// A setting of the model.
    fn setting(&self, checkpoint: &TorchFile<'_, '_>, name: &str) -> Option<Id> {
        let of_mask = || checkpoint.pickle.get(self.mask_kwargs?, name);
        checkpoint.pickle.get(self.kwargs, name).or_else(of_mask)
    }

    fn density(&self, checkpoint: &TorchFile<'_, '_>) -> Result<Id, Fault> {
        let named = self.state(checkpoint, "density.grid").or_else(|| self.state(checkpoint, "density"));
        if let Some(density) = named {
            return Ok(density);
        }
        if self.state(checkpoint, "density.xy_plane").is_some() {
            return Err(Fault::unsupported(
                "a DVGO checkpoint whose density is a TensoRFGrid",
                "train with density_type='DenseGrid', or use the coarse stage's checkpoint",
            ));
        }
        let found = checkpoint.pickle.keys(self.state);
        Err(Fault::malformed("the keys of model_state_dict", "density.grid or density", found))
    }

    fn activation(&self, checkpoint: &mut TorchFile<'_, '_>) -> Result<Density, Fault> {
        let named = self.state(checkpoint, "act_shift").or_else(|| self.setting(checkpoint, "act_shift"));
        let shift = match (named, self.setting(checkpoint, "alpha_init")) {
            (Some(shift), _) => checkpoint.numbers::<1>(shift, "act_shift")?[0],
            (None, Some(alpha)) => Density::shift_of(checkpoint.numbers::<1>(alpha, "alpha_init")?[0])?,
            (None, None) => {
                let found = checkpoint.pickle.keys(self.kwargs);
                return Err(Fault::malformed("the keys of model_kwargs", "act_shift or alpha_init", found));
            }
        };
        let counts = ["num_voxels_base", "num_voxels"].map(|name| self.setting(checkpoint, name));
        let interval = match (self.setting(checkpoint, "voxel_size_ratio"), counts) {
            (Some(ratio), _) => checkpoint.numbers::<1>(ratio, "voxel_size_ratio")?[0],
            (None, [Some(base), Some(count)]) => {
                let [base] = checkpoint.numbers(base, "num_voxels_base")?;
                let [count] = checkpoint.numbers(count, "num_voxels")?;
                (base / count).cbrt()
            }
            _ => 1.0,
        };
        Density::new(shift, interval)
    }
}

/// The voxels outside which a fine model is empty.
struct Mask {
    shape: [u64; 3],
    /// The voxel of a position is `scale` · position + `shift`, rounded.
    scale: DVec3,
    shift: DVec3,
    bits: Vec<u64>,
}

impl Mask {
    fn of(parts: &DvgoParts, checkpoint: &mut TorchFile<'_, '_>, grid: &Grid) -> Result<Option<Self>, Fault> {
        let own_size = parts.state(checkpoint, "mask_cache.mask").is_some();
        let (mask, scale, shift) = if let Some(mask) = parts.state(checkpoint, "mask_cache.mask") {
            let [scale, shift] = ["mask_cache.xyz2ijk_scale", "mask_cache.xyz2ijk_shift"].map(|name| {
                let missing = || Fault::broken("model_state_dict", format!("the key {name} is missing"));
                parts.state(checkpoint, name).ok_or_else(missing).map(|id| (id, name))
            });
            let ((scale, scale_name), (shift, shift_name)) = (scale?, shift?);
            (mask, checkpoint.numbers(scale, scale_name)?.into(), checkpoint.numbers(shift, shift_name)?.into())
        } else if let Some(mask) = parts.state(checkpoint, "nonempty_mask") {
            // It has the voxels of the density.
            let pitch = grid.cell(0).size();
            (mask, 1.0 / pitch, -grid.center(0) / pitch)
        } else {
            return Ok(None);
        };
        let not_a_tensor = || Fault::broken("the mask", "it is not a tensor");
        let tensor = checkpoint.tensor(mask).ok_or_else(not_a_tensor)?.clone();
        let shape = three_axes(&tensor.shape)?;
        if !own_size && shape != grid.shape {
            let expected = format!("the shape of the density, {:?}", grid.shape);
            return Err(Fault::malformed("nonempty_mask", expected, format!("{shape:?}")));
        }
        Fault::unless_within("voxels of the mask", MAX_MASK, shape.iter().product())?;
        let mut bits: Vec<u64> = Vec::new();
        checkpoint.for_each(&tensor, |n, value| {
            if n % 64 == 0 {
                bits.push(0);
            }
            if let Some(last) = bits.last_mut() {
                *last |= u64::from(value != 0.0) << (n % 64);
            }
            Ok(())
        })?;
        Ok(Some(Self { shape, scale, shift, bits }))
    }

    fn contains(&self, position: DVec3) -> bool {
        let at = (self.scale * position + self.shift).round();
        let shape = DVec3::from_array(self.shape.map(|n| n as f64));
        if !(at.cmpge(DVec3::ZERO).all() && at.cmplt(shape).all()) {
            return false;
        }
        let [x, y, z] = at.to_array().map(|n| n as u64);
        let n = (x * self.shape[1] + y) * self.shape[2] + z;
        self.bits[(n / 64) as usize] >> (n % 64) & 1 == 1
    }
}
