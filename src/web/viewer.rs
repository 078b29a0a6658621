//! An open scene, and its pictures.

use glam::DVec3;
use serde_json::{Value, json};
use wasm_bindgen::Clamped;
use wasm_bindgen::prelude::{JsError, wasm_bindgen};

use super::facts;
use crate::container::{Document, Limits, decode_document};
use crate::geometry::Camera;
use crate::model::{Frame, UpAxis};
use crate::render::gpu::{Gpu, GpuError, GpuRenderer, Precision};
use crate::render::{Approximation, Picture};

/// A scene that is ready to be looked at.
#[wasm_bindgen]
pub struct Viewer {
    gpu: Gpu,
    renderer: GpuRenderer,
    frame: Frame,
    first: Camera,
    document: Value,
}

#[wasm_bindgen]
impl Viewer {
    /// Opens the `.strivec` file of these bytes on the browser's best device.
    ///
    /// # Errors
    ///
    /// Where the bytes are no such file, and where there is no device, or one too small for the scene.
    pub async fn open(bytes: Vec<u8>) -> Result<Self, JsError> {
        let document = decode_document(&bytes, Limits::default())?;
        let known = facts::of_document(&document, bytes.len());
        // The renderer is going to copy what was decoded; it need not also lie beside the file.
        drop(bytes);
        let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
        let gpu = Gpu::request(&instance, None).await?;
        let frame = document.scene.frame.clone();
        let first = first_camera(&document);
        let prepare = async || GpuRenderer::new(&gpu, document.scene, &Approximation::default(), Precision::default());
        let renderer = complaints_of(&gpu, prepare()).await?;
        Ok(Self { gpu, renderer, frame, first, document: known })
    }

    /// What is known of the scene and of the device, as JSON: `{"scene": …, "device": …}`.
    #[wasm_bindgen(getter)]
    pub fn facts(&self) -> String {
        json!({ "scene": self.document, "device": facts::of_device(&self.gpu, &self.renderer) }).to_string()
    }

    /// A pose to begin with, as [`Viewer::render`] takes it: the file's own, or one that sees the whole scene.
    #[wasm_bindgen(getter)]
    pub fn first_pose(&self) -> Vec<f64> {
        self.first.pose().to_vec()
    }

    /// The picture of `width` by `height` pixels that spans `degrees` from left to right, from `pose`: 16 numbers, a row-major
    /// camera-to-world matrix in the dataset's space. 8-bit sRGB with full opacity, row-major from the top left.
    ///
    /// # Errors
    ///
    /// Where `pose` is none or `degrees` are not between 1 and 170, where the picture is too large, and where the device fails.
    pub async fn render(
        &mut self,
        width: u32,
        height: u32,
        pose: Vec<f64>,
        degrees: f64,
    ) -> Result<Clamped<Vec<u8>>, JsError> {
        if !(1.0..=170.0).contains(&degrees) {
            return Err(JsError::new(&format!("angle of view: expected 1 to 170 degrees, found {degrees}")));
        }
        let focal = Camera::focal_of_angle(width, degrees.to_radians());
        let camera = Camera::posed(&pose, [width, height], focal)
            .map_err(|error| JsError::new(&format!("pose: {error}")))?
            .mapped(&self.frame.model_from_dataset);
        let picture = complaints_of(&self.gpu, self.renderer.render_async(&camera)).await?;
        Ok(Clamped(rgba(&picture)))
    }
}

/// Where a viewer begins, in the dataset's space; its picture's size means nothing.
fn first_camera(document: &Document) -> Camera {
    let scene = &document.scene;
    let camera = match &document.extras.views {
        Some(views) => {
            let pose = &views.first;
            let [up, ahead] = [DVec3::Y, DVec3::NEG_Z].map(|axis| pose.rotation * axis);
            Camera::looking_at([1, 1], 1.0, pose.position, pose.position + ahead, up)
        }
        None => {
            let reach = 0.5 * scene.bounds.size().length();
            let [nearest, farthest] = [scene.frame.near + reach, scene.frame.far - reach];
            // A picture that spans 40 degrees holds the sphere around the bounds from there.
            let distance = (reach / 20_f64.to_radians().sin()).min(farthest).max(nearest);
            let [aside, up] = match scene.frame.up {
                UpAxis::X => [DVec3::Y, DVec3::X],
                UpAxis::Y => [DVec3::Z, DVec3::Y],
                UpAxis::Z => [DVec3::X, DVec3::Z],
                UpAxis::MinusX => [DVec3::Z, DVec3::NEG_X],
                UpAxis::MinusY => [DVec3::X, DVec3::NEG_Y],
                UpAxis::MinusZ => [DVec3::Y, DVec3::NEG_Z],
            }
            .map(|axis| scene.frame.model_from_dataset.rotation * axis);
            let (rise, level) = 30_f64.to_radians().sin_cos();
            let center = scene.bounds.center();
            Camera::looking_at([1, 1], 1.0, center + distance * (level * aside + rise * up), center, up)
        }
    };
    camera.mapped(&scene.frame.model_from_dataset.inverse())
}

/// What `work` comes to, or else what the device says against it: browsers refuse what they were asked for later than the
/// asking.
async fn complaints_of<T>(gpu: &Gpu, work: impl Future<Output = Result<T, GpuError>>) -> Result<T, GpuError> {
    let filters = [wgpu::ErrorFilter::OutOfMemory, wgpu::ErrorFilter::Validation];
    let mut scopes = filters.map(|filter| gpu.device().push_error_scope(filter)).into_iter().rev();
    let result = work.await;
    let mut complaint = None;
    for scope in &mut scopes {
        complaint = complaint.or(scope.pop().await);
    }
    match complaint {
        Some(complaint) => Err(GpuError::Device(complaint.to_string())),
        None => result,
    }
}

/// A byte for red, green, blue and opacity of each pixel.
fn rgba(picture: &Picture) -> Vec<u8> {
    // In 64 bits, as PNG files are written: halves then fall the same way.
    let byte = |value: f32| (f64::from(value).clamp(0.0, 1.0) * 255.0 + 0.5) as u8;
    picture
        .pixels
        .iter()
        .flat_map(|pixel| [byte(pixel.color[0]), byte(pixel.color[1]), byte(pixel.color[2]), 255])
        .collect()
}
