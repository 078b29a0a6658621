//! `--backend`: the renderer of commands that make pictures.

#[cfg(feature = "gpu")]
use std::cell::{OnceCell, RefCell};

use clap::ValueEnum;
use serde::{Deserialize, Serialize};

use super::Error;
use super::console::Console;
#[cfg(feature = "gpu")]
use strivec_field::render::Pixel;
#[cfg(feature = "gpu")]
use strivec_field::render::gpu::{Gpu, GpuError, GpuRenderer, POSITION_ERROR, Precision};
use strivec_field::render::{Approximation, CpuRenderer, Picture, ReferenceRenderer, Renderer, check_picture};
use strivec_format::geometry::Camera;
#[cfg(feature = "gpu")]
use strivec_format::geometry::Ray;
use strivec_format::model::{ReferenceField, Scene};
use strivec_measure as measure;
use strivec_measure::{F32_POSITION_ERROR, Parity};

/// The renderers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, ValueEnum)]
#[serde(rename_all = "kebab-case")]
#[value(rename_all = "kebab-case")]
pub(super) enum Backend {
    /// Fast renderer on the processor, 32-bit floating point
    #[default]
    Cpu,
    /// Graphics processor, 32-bit floating point; in builds with the feature `gpu`
    Gpu,
    /// Direct implementation of the specification, 64-bit floating point, slow
    Reference,
}

/// The renderer and its arithmetic.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct BackendOptions {
    /// Renderer
    #[arg(long, alias = "renderer", value_enum, default_value_t)]
    backend: Backend,
    /// Round factors to 16 bits on the graphics processor: half the memory, color errors mostly below 0.01
    #[arg(long)]
    half: bool,
}

impl BackendOptions {
    /// This backend; `half` is the graphics device's.
    pub(super) fn new(backend: Backend, half: bool) -> Self {
        Self { backend, half }
    }

    /// The renderer of `scene` with `approximation`.
    ///
    /// # Errors
    ///
    /// If the renderer does not support the approximation, this build lacks the renderer, or there is no device for it.
    pub(super) fn prepare(
        &self,
        scene: Scene,
        approximation: &Approximation,
        console: &Console,
    ) -> Result<Prepared, Error> {
        let drawing = match self.backend {
            Backend::Cpu => Drawing::Cpu(Box::new(CpuRenderer::with_approximation(scene, approximation)?)),
            Backend::Reference if approximation.is_exact() => {
                ReferenceField::check_memory(&scene)?;
                Drawing::Reference(Box::new(scene))
            }
            Backend::Reference => {
                return Err(Error::Usage(
                    "--backend reference renders without approximations; leave them out, or use --backend cpu".into(),
                ));
            }
            Backend::Gpu => self.on_gpu(scene, approximation, console)?,
        };
        Ok(Prepared { backend: self.backend, half: self.half, drawing, stages: Vec::new(), pictures: 0 })
    }

    /// Errors before any work is done if the options contradict each other or this build lacks the renderer.
    pub(super) fn check(&self) -> Result<(), Error> {
        match self.backend {
            Backend::Gpu if cfg!(not(feature = "gpu")) => Err(no_gpu()),
            Backend::Cpu | Backend::Reference if self.half => Err(Error::Usage("--half needs --backend gpu".into())),
            _ => Ok(()),
        }
    }

    #[cfg(not(feature = "gpu"))]
    fn on_gpu(&self, _: Scene, _: &Approximation, _: &Console) -> Result<Drawing, Error> {
        Err(no_gpu())
    }

    #[cfg(feature = "gpu")]
    fn on_gpu(&self, scene: Scene, approximation: &Approximation, console: &Console) -> Result<Drawing, Error> {
        let gpu = Gpu::open()?;
        let info = gpu.info();
        let adapter = format!("{}, {}", info.name, info.backend);
        console.say(&format!("rendering on {adapter}"));
        if info.device_type == wgpu::DeviceType::Cpu {
            console.say("this graphics device is emulated on the processor; --backend cpu is faster");
        }
        let precision = if self.half { Precision::F16 } else { Precision::F32 };
        let renderer = GpuRenderer::new(&gpu, scene, approximation, precision)?;
        Ok(Drawing::Gpu { renderer: Box::new(renderer), adapter })
    }
}

fn no_gpu() -> Error {
    let message = "--backend gpu needs a build with the feature gpu (cargo install --path . --features gpu)";
    Error::Usage(message.into())
}

#[cfg(feature = "gpu")]
impl From<GpuError> for Error {
    fn from(error: GpuError) -> Self {
        match error {
            GpuError::Approximation(error) => error.into(),
            GpuError::Memory(error) => error.into(),
            _ => Self::Runtime(format!("--backend gpu: {error}")),
        }
    }
}

/// A renderer that owns its scene.
pub(super) struct Prepared {
    backend: Backend,
    half: bool,
    drawing: Drawing,
    /// Time by stage over all pictures.
    stages: Vec<StageMilliseconds>,
    pictures: u32,
}

enum Drawing {
    /// The fast renderer.
    Cpu(Box<CpuRenderer>),
    /// The renderer on a graphics device.
    #[cfg(feature = "gpu")]
    Gpu { renderer: Box<GpuRenderer>, adapter: String },
    /// The reference renderer, which reads the scene itself.
    Reference(Box<Scene>),
}

/// The renderer, its memory and its times, as `--json` prints them.
#[derive(Serialize)]
pub(super) struct Drawn {
    backend: Backend,
    /// Factors are rounded to 16 bits.
    half: bool,
    /// The graphics device.
    adapter: Option<String>,
    /// Bytes of the scene and its index; on a graphics device with its buffers.
    memory_bytes: u64,
    /// Mean of all pictures, on graphics devices that report times.
    stages: Option<Vec<StageMilliseconds>>,
}

/// A stage's share of a picture.
#[derive(Serialize)]
struct StageMilliseconds {
    stage: &'static str,
    milliseconds: f64,
}

impl Prepared {
    /// The picture from `camera`, in the model's space. Fails if the graphics device does.
    pub(super) fn render(&mut self, camera: &Camera) -> Result<Picture, Error> {
        self.pictures += 1;
        check_picture([camera.width, camera.height])?;
        match &mut self.drawing {
            Drawing::Cpu(renderer) => Ok(renderer.render(camera)),
            Drawing::Reference(scene) => Ok(ReferenceRenderer::new(scene).render(camera)),
            #[cfg(feature = "gpu")]
            Drawing::Gpu { renderer, .. } => {
                let (picture, times) = renderer.render_timed(camera)?;
                if self.stages.is_empty() {
                    let none = times.iter().map(|time| StageMilliseconds { stage: time.name, milliseconds: 0.0 });
                    self.stages = none.collect();
                }
                for (stage, time) in self.stages.iter_mut().zip(&times) {
                    stage.milliseconds += time.milliseconds;
                }
                Ok(picture)
            }
        }
    }

    /// Compares this renderer with the reference's pictures of `scene` from `cameras`, in the model's space. If this is
    /// the reference, the fast renderer is compared instead. Fails if the graphics device does.
    pub(super) fn parity(&mut self, scene: &Scene, cameras: &[Camera]) -> Result<Parity, Error> {
        ReferenceField::check_memory(scene)?;
        match &mut self.drawing {
            Drawing::Cpu(renderer) => Ok(measure::parity(scene, renderer.as_ref(), cameras, F32_POSITION_ERROR)),
            Drawing::Reference(_) => Ok(measure::parity(scene, &CpuRenderer::new(scene)?, cameras, F32_POSITION_ERROR)),
            #[cfg(feature = "gpu")]
            Drawing::Gpu { renderer, .. } => {
                let reach = cameras.iter().map(|camera| camera.position.length()).fold(1.0, f64::max);
                let watched = Watched { renderer: RefCell::new(renderer), failure: OnceCell::new() };
                let parity = measure::parity(scene, &watched, cameras, POSITION_ERROR * reach);
                watched.failure.into_inner().map_or(Ok(parity), |error| Err(error.into()))
            }
        }
    }

    /// Bytes of the scene and its index; on a graphics device with its buffers.
    pub(super) fn memory_bytes(&self) -> u64 {
        match &self.drawing {
            Drawing::Cpu(renderer) => renderer.memory_bytes(),
            Drawing::Reference(scene) => 4 * scene.parameter_count(),
            #[cfg(feature = "gpu")]
            Drawing::Gpu { renderer, .. } => renderer.memory_bytes().iter().sum(),
        }
    }

    /// The renderer, its memory and its times.
    pub(super) fn drawn(self) -> Drawn {
        let adapter = match &self.drawing {
            #[cfg(feature = "gpu")]
            Drawing::Gpu { adapter, .. } => Some(adapter.clone()),
            Drawing::Cpu(_) | Drawing::Reference(_) => None,
        };
        let memory_bytes = self.memory_bytes();
        let pictures = f64::from(self.pictures.max(1));
        let mean =
            |stage: StageMilliseconds| StageMilliseconds { milliseconds: stage.milliseconds / pictures, ..stage };
        let stages = (!self.stages.is_empty()).then(|| self.stages.into_iter().map(mean).collect());
        Drawn { backend: self.backend, half: self.half, adapter, memory_bytes, stages }
    }
}

/// A device's renderer behind a trait without errors: after a failure, pixels are empty and the error is kept.
#[cfg(feature = "gpu")]
struct Watched<'a> {
    renderer: RefCell<&'a mut GpuRenderer>,
    failure: OnceCell<GpuError>,
}

#[cfg(feature = "gpu")]
impl Renderer for Watched<'_> {
    fn trace(&self, rays: &[Ray]) -> Vec<Pixel> {
        self.renderer.borrow_mut().trace(rays).unwrap_or_else(|error| {
            // The first failure explains the others.
            let _ = self.failure.set(error);
            vec![Pixel::default(); rays.len()]
        })
    }

    fn background(&self) -> [f32; 3] {
        self.renderer.borrow().background()
    }
}
