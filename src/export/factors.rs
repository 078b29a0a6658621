//! The arrays of a scene, for NumPy.

use std::io::{self, Seek, Write};

use glam::{DVec3, UVec3};

use super::Error;
use strivec_format::geometry::Aabb;
use strivec_format::model::{Form, Placement, Scene};
use strivec_import::npy::{Element, NpzWriter};

/// Receives named arrays in C order.
pub trait ArrayWriter {
    /// Takes the array `name` of this shape.
    ///
    /// # Errors
    ///
    /// If it cannot be written.
    fn add<T: Element>(&mut self, name: &str, shape: &[usize], values: impl IntoIterator<Item = T>) -> io::Result<()>;

    /// Adds the array `name` of `values` that the scene holds in this order.
    ///
    /// # Errors
    ///
    /// As for [`ArrayWriter::add`].
    fn add_held(&mut self, name: &str, shape: &[usize], values: &[f32]) -> io::Result<()> {
        self.add(name, shape, values.iter().copied())
    }
}

impl<W: Write + Seek> ArrayWriter for NpzWriter<W> {
    fn add<T: Element>(&mut self, name: &str, shape: &[usize], values: impl IntoIterator<Item = T>) -> io::Result<()> {
        Self::add(self, name, shape, values)
    }
}

/// Passes the long arrays of `scene` to `writer`. Those of scale S are
///
/// - `scaleS_cells` u32 \[tensor\]\[3\] on a lattice, else `scaleS_centers` f64 \[tensor\]\[3\], in model units,
/// - `scaleS_density` and `scaleS_appearance` f32 \[tensor\]\[vertex of x, then y, then z\]\[component\]; with matrices, `…_x`,
///   `…_y` and `…_z`, whose vertices are those of the vector along the axis, then those of the matrix, the second axis slowest,
/// - `scaleS_matrix` f32 \[feature\]\[component\].
///
/// The others are `decoderL_weights` f32 \[output\]\[input\] and `decoderL_bias` of layer L, and `occupancy` bool \[z\]\[y\]\[x\].
///
/// # Errors
///
/// The errors of `writer`.
pub fn write_arrays(scene: &Scene, writer: &mut impl ArrayWriter) -> io::Result<()> {
    for (s, scale) in scene.scales.iter().enumerate() {
        let tensors = scale.cloud.len();
        match &scale.cloud.placement {
            Placement::Lattice { cells, .. } => {
                writer.add(&format!("scale{s}_cells"), &[tensors, 3], cells.iter().flat_map(UVec3::to_array))?;
            }
            Placement::Explicit { centers } => {
                writer.add(&format!("scale{s}_centers"), &[tensors, 3], centers.iter().flat_map(DVec3::to_array))?;
            }
        }
        for (part, blocks) in [("density", &scale.factors.density), ("appearance", &scale.factors.appearance)] {
            for block in blocks {
                let shape = [tensors, block.form.rows(scale.cloud.resolution), block.rank as usize];
                writer.add_held(&block_name(s, part, block.form), &shape, &block.values)?;
            }
        }
        let matrix = &scale.appearance_matrix;
        let shape = [matrix.features as usize, matrix.rank as usize];
        writer.add_held(&format!("scale{s}_matrix"), &shape, &matrix.weights)?;
    }
    for (l, layer) in scene.decoder.layers.iter().enumerate() {
        let shape = [layer.outputs as usize, layer.inputs as usize];
        writer.add_held(&format!("decoder{l}_weights"), &shape, &layer.weights)?;
        writer.add_held(&format!("decoder{l}_bias"), &shape[..1], &layer.bias)?;
    }
    if let Some(occupancy) = &scene.occupancy {
        let [x, y, z] = occupancy.vertices.to_array().map(|n| n as usize);
        let bits = (0..x * y * z).map(|bit| occupancy.words[bit / 64] >> (bit % 64) & 1 == 1);
        writer.add("occupancy", &[z, y, x], bits)?;
    }
    Ok(())
}

/// The name of the array of the components of one `form` of density or appearance, `part`.
pub fn block_name(s: usize, part: &str, form: Form) -> String {
    match form {
        Form::Cp => format!("scale{s}_{part}"),
        Form::Vm(axis) => format!("scale{s}_{part}_{}", ["x", "y", "z"][axis]),
    }
}

/// Writes the arrays of `scene` as an `.npz` archive: those of [`write_arrays`], `scaleS_centers` on a lattice too,
/// `scaleS_half_edge` f64 \[3\], `scaleS_resolution` u32 \[3\] and `scaleS_top_k`, the corners `bounds` and `occupancy_bounds` f64
/// \[2\]\[3\], and the rules `density_shift`, `distance_scale`, `step`, `min_transmittance` and `min_weight`, f64. All lengths are in
/// model units.
///
/// # Errors
///
/// If `out` fails.
pub fn write_factors(scene: &Scene, out: impl Write + Seek) -> Result<(), Error> {
    let is_large = scene.parameter_count() > u64::from(u32::MAX) / 8;
    let mut archive = NpzWriter::new(out, is_large);
    write_arrays(scene, &mut archive)?;
    for (s, scale) in scene.scales.iter().enumerate() {
        if matches!(scale.cloud.placement, Placement::Lattice { .. }) {
            let centers = scale.cloud.centers().flat_map(|center| center.to_array());
            archive.add(&format!("scale{s}_centers"), &[scale.cloud.len(), 3], centers)?;
        }
        archive.add(&format!("scale{s}_half_edge"), &[3], scale.cloud.half_edge.to_array())?;
        archive.add(&format!("scale{s}_resolution"), &[3], scale.cloud.resolution)?;
        archive.add(&format!("scale{s}_top_k"), &[], [scale.top_k])?;
    }
    let corners = |bounds: &Aabb| [bounds.min, bounds.max].into_iter().flat_map(|corner| corner.to_array());
    archive.add("bounds", &[2, 3], corners(&scene.bounds))?;
    if let Some(occupancy) = &scene.occupancy {
        archive.add("occupancy_bounds", &[2, 3], corners(&occupancy.bounds))?;
    }
    let rules = &scene.rules;
    for (name, value) in [
        ("density_shift", rules.density_shift),
        ("distance_scale", rules.distance_scale),
        ("step", rules.step),
        ("min_transmittance", rules.min_transmittance),
        ("min_weight", rules.min_weight),
    ] {
        archive.add(name, &[], [value])?;
    }
    archive.finish()?;
    Ok(())
}
