//! Scenes.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::{Arc, OnceLock};

use glam::DVec3;
use numpy::PyReadonlyArrayDyn;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use serde::Deserialize;
use strivec::cli;
use strivec::container::{
    self, EncodeOptions, Encoding, Limits, Metadata, Original, SceneFile, Thumbnail, ThumbnailFormat, TrainingCamera,
    Views,
};
use strivec::export::SceneDescription;
use strivec::field::Field;
use strivec::model::{OverMemory, Scene};
use strivec::recipe;

use crate::arrays::{Dictionary, arrays_of, shaped, vectors};
use crate::errors::Failure;
use crate::work::{caught, detached};

/// Points that are evaluated between two checks for Ctrl-C.
const BLOCK: usize = 1 << 18;

/// A scene with the bytes of its file. Nothing changes it; edits return another.
#[pyclass(frozen, module = "strivec._strivec")]
pub(crate) struct NativeScene {
    /// The place that errors name.
    name: PathBuf,
    bytes: Arc<Vec<u8>>,
    pub(crate) scene: Arc<Scene>,
    metadata: Metadata,
    encoding: EncodeOptions,
    /// Prepared at the first query, unless that takes too much memory.
    field: Arc<OnceLock<Result<Field<f32>, OverMemory>>>,
}

/// The ancillary parts that Python changes, as JSON.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Parts {
    license: Option<String>,
    views: Option<Views>,
    cameras: Vec<TrainingCamera>,
    notes: BTreeMap<String, String>,
}

impl NativeScene {
    fn new(name: PathBuf, bytes: Vec<u8>, file: SceneFile) -> Self {
        let SceneFile { scene, metadata, encoding } = file;
        Self { name, bytes: Arc::new(bytes), scene: Arc::new(scene), metadata, encoding, field: Arc::default() }
    }

    fn decoded(name: PathBuf, bytes: Vec<u8>, max_memory: Option<u64>) -> Result<Self, Failure> {
        let limits = max_memory.map_or_else(|| Limits::of_file(bytes.len() as u64), |memory| Limits { memory });
        let file = container::decode_scene_file(&bytes, limits).map_err(|e| Failure::container(&name, e))?;
        Ok(Self::new(name, bytes, file))
    }

    /// This scene with other ancillary parts; all other sections are copied.
    fn with_metadata(&self, py: Python<'_>, metadata: Metadata) -> PyResult<Self> {
        let (name, bytes, scene) = (self.name.clone(), Arc::clone(&self.bytes), Arc::clone(&self.scene));
        let (before, encoding) = (self.metadata.clone(), self.encoding.clone());
        let (metadata, bytes) = detached(py, move || {
            let original = Original { bytes: &bytes, scene: &scene, metadata: &before, encoding: &encoding };
            let bytes = container::rewrite_scene_file(&scene, &metadata, &encoding, original);
            Ok((metadata, bytes.map_err(|e| Failure::container(&name, e))?))
        })?;
        Ok(Self {
            name: self.name.clone(),
            bytes: Arc::new(bytes),
            scene: Arc::clone(&self.scene),
            metadata,
            encoding: self.encoding.clone(),
            field: Arc::clone(&self.field),
        })
    }

    /// The field, within the memory that the scene may take.
    fn field(&self) -> Result<&Field<f32>, Failure> {
        let field = self.field.get_or_init(|| Field::new(&self.scene)).as_ref();
        Ok(field.map_err(|&error| cli::Error::from(error))?)
    }

    /// Evaluates the field at `points` by `evaluate`, such as [`Field::densities`], into an f32 array of shape \[point\]\[row\]. Ctrl-C
    /// stops it after the current block of points.
    fn at_points<'py>(
        &self,
        py: Python<'py>,
        points: &PyReadonlyArrayDyn<'_, f64>,
        in_dataset: bool,
        row: &[usize],
        evaluate: impl Fn(&Field<f32>, &(dyn Fn(usize) -> DVec3 + Sync), &mut [f32]) + Sync,
    ) -> PyResult<Bound<'py, PyAny>> {
        let points = vectors(points, "points")?;
        let shape = [&[points.len()], row].concat();
        let width = row.iter().product::<usize>();
        let mut values = vec![0.0; points.len() * width];
        let map = in_dataset.then_some(&self.scene.frame.model_from_dataset);
        for (points, values) in points.chunks(BLOCK).zip(values.chunks_mut(BLOCK * width)) {
            let point = |n: usize| {
                let point = DVec3::from_array(points[n]);
                map.map_or(point, |map| map.point(point))
            };
            py.detach(|| {
                caught(|| {
                    evaluate(self.field()?, &point, values);
                    Ok(())
                })
            })?;
            py.check_signals()?;
        }
        shaped(py, values, &shape)
    }
}

#[pymethods]
impl NativeScene {
    /// The scene in the bytes of a file, with at most `max_memory` bytes of memory for what is decoded.
    #[staticmethod]
    fn decode(py: Python<'_>, bytes: &[u8], name: PathBuf, max_memory: Option<u64>) -> PyResult<Self> {
        let bytes = bytes.to_vec();
        detached(py, move || Self::decoded(name, bytes, max_memory))
    }

    /// The scene in the file `path`.
    #[staticmethod]
    fn read(py: Python<'_>, path: PathBuf, max_memory: Option<u64>) -> PyResult<Self> {
        detached(py, move || {
            let bytes = recipe::read_file(&path)?;
            Self::decoded(path, bytes, max_memory)
        })
    }

    /// The scene of `arrays` and their `description`, JSON.
    #[staticmethod]
    fn assemble(py: Python<'_>, description: &str, arrays: &Bound<'_, PyDict>) -> PyResult<Self> {
        let description: SceneDescription =
            serde_json::from_str(description).map_err(|e| Failure::malformed(format!("description: {e}")))?;
        let file = description.scene(&Dictionary(arrays))?;
        detached(py, move || {
            let name = PathBuf::from("scene of arrays");
            let bytes = container::encode_scene_file(&file.scene, &file.metadata, &file.encoding);
            let bytes = bytes.map_err(|e| Failure::container(&name, e))?;
            Ok(Self::new(name, bytes, file))
        })
    }

    /// The bytes of the file.
    fn bytes<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        PyBytes::new(py, &self.bytes)
    }

    /// Writes the file `path`, which then is whole or as before.
    fn write(&self, py: Python<'_>, path: PathBuf, force: bool) -> PyResult<()> {
        let bytes = Arc::clone(&self.bytes);
        detached(py, move || Ok(cli::write_atomically(&path, &bytes, force)?))
    }

    /// This scene with its factors as floats of 32 or 16 bits.
    fn encoded(&self, py: Python<'_>, bits: u32) -> PyResult<Self> {
        let encoding = match bits {
            16 => Encoding::F16,
            32 => Encoding::F32,
            _ => return Err(Failure::usage(format!("expected 16 or 32 bits; found {bits}")).into()),
        };
        let (name, scene, metadata) = (self.name.clone(), Arc::clone(&self.scene), self.metadata.clone());
        detached(py, move || {
            let bytes = container::encode_scene_file(&scene, &metadata, &EncodeOptions::uniform(encoding));
            Self::decoded(name.clone(), bytes.map_err(|e| Failure::container(&name, e))?, Some(u64::MAX))
        })
    }

    /// The facts that `strivec info` prints, as JSON.
    fn info(&self) -> PyResult<String> {
        Ok(cli::info_of(&self.name, &self.bytes, &self.scene, &self.metadata).map_err(Failure::from)?)
    }

    /// All but the long arrays, as JSON.
    fn description(&self) -> PyResult<String> {
        let description = SceneDescription::of(&self.scene, &self.metadata);
        Ok(serde_json::to_string(&description).map_err(|e| Failure::runtime(e.to_string()))?)
    }

    /// The long arrays, by name; those of 32-bit floats show this scene's memory.
    fn arrays<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        arrays_of(py, &self.scene)
    }

    /// This scene with another license, other views, cameras and notes, in JSON as in the description.
    fn with_parts(&self, py: Python<'_>, parts: &str) -> PyResult<Self> {
        let parts = serde_json::from_str(parts).map_err(|e| Failure::usage(e.to_string()))?;
        let Parts { license, views, cameras, notes } = parts;
        self.with_metadata(py, Metadata { license, views, cameras, notes, ..self.metadata.clone() })
    }

    /// The format ("png" or "jpeg") and the bytes of the thumbnail.
    fn thumbnail<'py>(&self, py: Python<'py>) -> Option<(&'static str, Bound<'py, PyBytes>)> {
        let Thumbnail { format, file, .. } = self.metadata.thumbnail.as_ref()?;
        let format = match format {
            ThumbnailFormat::Png => "png",
            ThumbnailFormat::Jpeg => "jpeg",
        };
        Some((format, PyBytes::new(py, file)))
    }

    /// The densities at `points`, f64 \[n\]\[3\] in the dataset's space or in the model's, f32 \[n\].
    fn densities<'py>(
        &self,
        py: Python<'py>,
        points: PyReadonlyArrayDyn<'_, f64>,
        in_dataset: bool,
    ) -> PyResult<Bound<'py, PyAny>> {
        self.at_points(py, &points, in_dataset, &[], |field, point, values| field.densities(point, values))
    }

    /// The appearance features at `points`, f32 \[n\]\[P\].
    fn features<'py>(
        &self,
        py: Python<'py>,
        points: PyReadonlyArrayDyn<'_, f64>,
        in_dataset: bool,
    ) -> PyResult<Bound<'py, PyAny>> {
        let width = self.scene.features() as usize;
        self.at_points(py, &points, in_dataset, &[width], |field, point, values| field.appearances(point, values))
    }
}
