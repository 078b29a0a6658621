//! Renderers.

use std::sync::{Arc, Mutex, PoisonError};

use glam::DVec3;
use numpy::PyReadonlyArrayDyn;
use pyo3::prelude::*;
use strivec::geometry::{Camera, Lens, Ray, Similarity};
use strivec::model::{ReferenceField, Scene};
use strivec::render::gpu::{Gpu, GpuError, GpuRenderer, Precision};
use strivec::render::{Approximation, CpuRenderer, Pixel, ReferenceRenderer, Renderer, RendererError, check_picture};

use crate::arrays::{shaped, vectors};
use crate::errors::Failure;
use crate::scene::NativeScene;
use crate::work::detached;

/// A renderer of a scene. Cameras, rays and depths are in model space or, if `in_dataset` is true, in the dataset's.
#[pyclass(frozen, module = "strivec._strivec")]
pub(crate) struct NativeRenderer {
    drawing: Arc<Drawing>,
    model_from_dataset: Similarity,
}

enum Drawing {
    Cpu(Box<CpuRenderer>),
    Reference(Arc<Scene>),
    Gpu(Box<Mutex<GpuRenderer>>),
}

/// Colors, opacities and depths, as arrays.
type Pictures<'py> = (Bound<'py, PyAny>, Bound<'py, PyAny>, Bound<'py, PyAny>);

#[pymethods]
impl NativeRenderer {
    /// A renderer of `scene` on `backend`, as `strivec render --backend` names it, with an approximation in JSON.
    #[new]
    fn new(py: Python<'_>, scene: &NativeScene, backend: &str, approximation: &str) -> PyResult<Self> {
        let approximation: Approximation =
            serde_json::from_str(approximation).map_err(|e| Failure::usage(format!("approximation: {e}")))?;
        let scene = Arc::clone(&scene.scene);
        let model_from_dataset = scene.frame.model_from_dataset;
        let backend = backend.to_owned();
        let drawing = detached(py, move || {
            let copy = || Scene::clone(&scene);
            let usage = |error| match error {
                RendererError::Approximation(e) => Failure::usage(format!("approximation: {e}")),
                error => Failure::from(strivec::cli::Error::from(error)),
            };
            Ok(match backend.as_str() {
                "cpu" => {
                    Drawing::Cpu(Box::new(CpuRenderer::with_approximation(copy(), &approximation).map_err(usage)?))
                }
                "reference" if approximation.is_exact() => {
                    ReferenceField::check_memory(&scene).map_err(strivec::cli::Error::from)?;
                    Drawing::Reference(scene)
                }
                "reference" => return Err(Failure::usage("the reference renders without approximations")),
                "gpu" => {
                    let renderer =
                        Gpu::open().and_then(|gpu| GpuRenderer::new(&gpu, copy(), &approximation, Precision::F32));
                    Drawing::Gpu(Box::new(Mutex::new(renderer.map_err(of_gpu)?)))
                }
                _ => {
                    let message = format!("backend must be cpu, gpu or reference; found {backend}");
                    return Err(Failure::usage(message));
                }
            })
        })?;
        Ok(Self { drawing: Arc::new(drawing), model_from_dataset })
    }

    /// Color f32 \[height\]\[width\]\[3\], opacity and depth f32 \[height\]\[width\], of the camera with this pose (row-major
    /// camera-to-world matrix), size, focal lengths and principal point in pixels, and lens in JSON; a pinhole without.
    #[expect(clippy::too_many_arguments, reason = "the parts of a camera")]
    fn render<'py>(
        &self,
        py: Python<'py>,
        pose: Vec<f64>,
        size: [u32; 2],
        focal: [f64; 2],
        principal: [f64; 2],
        lens: Option<&str>,
        in_dataset: bool,
    ) -> PyResult<Pictures<'py>> {
        let lens = lens.map_or(Ok(Lens::PINHOLE), serde_json::from_str);
        let lens = lens.map_err(|e| Failure::usage(format!("lens: {e}")))?;
        if size.contains(&0) || !focal.iter().all(|f| f.is_finite() && *f > 0.0) {
            return Err(
                Failure::usage(format!("a camera needs pixels and a focal length; found {size:?}, {focal:?}")).into()
            );
        }
        check_picture(size).map_err(|e| Failure::from(strivec::cli::Error::from(e)))?;
        let posed = Camera::posed(&pose, size, focal[0]).map_err(|e| Failure::usage(e.to_string()))?;
        let mut camera = Camera { focal, principal, lens, ..posed };
        if in_dataset {
            camera = camera.mapped(&self.model_from_dataset);
        }
        let drawing = Arc::clone(&self.drawing);
        let pixels = detached(py, move || {
            let picture = match &*drawing {
                Drawing::Cpu(renderer) => renderer.render(&camera),
                Drawing::Reference(scene) => ReferenceRenderer::new(scene).render(&camera),
                Drawing::Gpu(renderer) => locked(renderer).render(&camera).map_err(of_gpu)?,
            };
            Ok(picture.pixels)
        })?;
        self.pictures(py, &pixels, &[size[1] as usize, size[0] as usize], in_dataset)
    }

    /// The values of `render` for rays with these origins and unit directions, f64 \[n\]\[3\].
    fn trace<'py>(
        &self,
        py: Python<'py>,
        origins: PyReadonlyArrayDyn<'_, f64>,
        directions: PyReadonlyArrayDyn<'_, f64>,
        in_dataset: bool,
    ) -> PyResult<Pictures<'py>> {
        let (origins, directions) = (vectors(&origins, "origins")?, vectors(&directions, "directions")?);
        if origins.len() != directions.len() {
            let message =
                format!("expected as many directions as origins; found {}, {}", directions.len(), origins.len());
            return Err(Failure::usage(message).into());
        }
        let [origins, directions] = [origins, directions].map(|all| all.iter().map(|&v| DVec3::from_array(v)));
        if let Some(found) = directions.clone().find(|direction| !direction.is_normalized()) {
            return Err(Failure::usage(format!("directions must have the length 1; found {found}")).into());
        }
        let map = self.model_from_dataset;
        let ray = |(origin, direction)| match in_dataset {
            true => Ray { origin: map.point(origin), direction: map.rotation * direction },
            false => Ray { origin, direction },
        };
        let rays: Vec<Ray> = origins.zip(directions).map(ray).collect();
        let drawing = Arc::clone(&self.drawing);
        let pixels = detached(py, move || {
            Ok(match &*drawing {
                Drawing::Cpu(renderer) => renderer.trace(&rays),
                Drawing::Reference(scene) => ReferenceRenderer::new(scene).trace(&rays),
                Drawing::Gpu(renderer) => locked(renderer).trace(&rays).map_err(of_gpu)?,
            })
        })?;
        self.pictures(py, &pixels, &[pixels.len()], in_dataset)
    }
}

impl NativeRenderer {
    fn pictures<'py>(
        &self,
        py: Python<'py>,
        pixels: &[Pixel],
        shape: &[usize],
        in_dataset: bool,
    ) -> PyResult<Pictures<'py>> {
        let unit = if in_dataset { self.model_from_dataset.scale as f32 } else { 1.0 };
        let colors: Vec<f32> = pixels.iter().flat_map(|pixel| pixel.color).collect();
        let opacities = pixels.iter().map(|pixel| pixel.opacity).collect();
        let depths = pixels.iter().map(|pixel| pixel.depth / unit).collect();
        Ok((shaped(py, colors, &[shape, &[3]].concat())?, shaped(py, opacities, shape)?, shaped(py, depths, shape)?))
    }
}

/// The renderer, also after a thread panicked with it: every picture begins anew.
fn locked(renderer: &Mutex<GpuRenderer>) -> std::sync::MutexGuard<'_, GpuRenderer> {
    renderer.lock().unwrap_or_else(PoisonError::into_inner)
}

fn of_gpu(error: GpuError) -> Failure {
    match error {
        GpuError::Memory(error) => strivec::cli::Error::from(error).into(),
        error => Failure::runtime(format!("backend gpu: {error}")),
    }
}
