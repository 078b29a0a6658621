//! Tensor boxes, drawn as lines over a picture.

use bytemuck::{Pod, Zeroable};
use glam::{DMat4, DVec2, DVec3, DVec4};

use strivec_field::render::gpu::Gpu;
use strivec_format::geometry::{Camera, Contraction};
use strivec_format::model::Scene;

const SHADER: &str = strivec_shaders::BOXES;
/// Maximum number of scales that are drawn on a device.
const SCALES: usize = 16;
/// Line color of each scale, the coarsest first; repeated after the last.
const COLORS: [[f32; 3]; 4] = [[1.0, 0.45, 0.1], [0.15, 0.7, 1.0], [0.55, 0.9, 0.2], [0.95, 0.3, 0.8]];
/// Minimum and maximum opacity of a scale's lines. Lines of scales with more tensors are fainter.
const OPACITIES: [f32; 2] = [0.05, 0.4];
/// Number of tensors at which lines have opacity 1 before clamping; the opacity is inversely proportional to the
/// number.
const OPAQUE_TENSORS: f32 = 150.0;

/// Straight parts of an edge in a contracted scene, where edges are curved.
const SEGMENTS: u32 = 8;
/// Boxes of a contracted scene are drawn up to this distance from the bounds of contracted space, where space ends.
/// Twin: `expanded` of `shaders/boxes.wgsl`.
const FROM_END: f64 = 1e-3;

/// `Boxes` of `shaders/boxes.wgsl`.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
struct BoxesUniform {
    clip_from_model: [[f32; 4]; 4],
    halves: [[f32; 4]; SCALES],
    colors: [[f32; 4]; SCALES],
    shell: f32,
    segments: u32,
    padding: [u32; 2],
}

/// The tensor boxes of a scene in device memory.
#[derive(Debug)]
pub struct BoxLines {
    pipeline: wgpu::RenderPipeline,
    bind_group: wgpu::BindGroup,
    uniform_buffer: wgpu::Buffer,
    uniform: BoxesUniform,
    /// \[tensor\] center relative to `origin`, in model units, and index of the scale.
    centers: wgpu::Buffer,
    /// \[scale\] index of its first tensor; after the last scale, the number of tensors.
    firsts: Vec<u32>,
    /// Center of the scene's bounds, in the model's space.
    origin: DVec3,
}

impl BoxLines {
    /// Uploads the tensor boxes of `scene`, to be drawn on surfaces of `format`.
    pub fn new(gpu: &Gpu, scene: &Scene, format: wgpu::TextureFormat) -> Self {
        use wgpu::BufferUsages as Usage;
        let device = gpu.device();
        let origin = scene.bounds.center();
        let (mut centers, mut firsts) = (Vec::new(), vec![0]);
        let (mut halves, mut colors) = ([[0.0; 4]; SCALES], [[0.0; 4]; SCALES]);
        for (s, scale) in scene.scales.iter().take(SCALES).enumerate() {
            centers.extend(scale.cloud.centers().map(|center| {
                let [x, y, z] = (center - origin).to_array().map(|v| v as f32);
                [x, y, z, s as f32]
            }));
            firsts.push(centers.len() as u32);
            let [x, y, z] = scale.cloud.half_edge.to_array().map(|v| v as f32);
            (halves[s], colors[s]) = ([x, y, z, 0.0], color_of(s, scale.cloud.len()));
        }
        let buffer = |label, size: usize, usage| {
            let descriptor =
                wgpu::BufferDescriptor { label: Some(label), size: size as u64, usage, mapped_at_creation: false };
            device.create_buffer(&descriptor)
        };
        let centers_buffer = buffer("centers", 16 * centers.len().max(1), Usage::VERTEX | Usage::COPY_DST);
        gpu.queue().write_buffer(&centers_buffer, 0, bytemuck::cast_slice(&centers));
        let uniform_buffer = buffer("boxes", size_of::<BoxesUniform>(), Usage::UNIFORM | Usage::COPY_DST);
        let pipeline = pipeline(device, format);
        let bind_group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("boxes"),
            layout: &pipeline.get_bind_group_layout(0),
            entries: &[wgpu::BindGroupEntry { binding: 0, resource: uniform_buffer.as_entire_binding() }],
        });
        let (shell, segments) = match scene.rules.contraction {
            None => (0.0, 1),
            Some(contraction) => (contraction.shell as f32, SEGMENTS),
        };
        let uniform = BoxesUniform { clip_from_model: [[0.0; 4]; 4], halves, colors, shell, segments, padding: [0; 2] };
        Self { pipeline, bind_group, uniform_buffer, uniform, centers: centers_buffer, firsts, origin }
    }

    /// Draws the boxes of the scales for which `scales` is true into `pass`, seen from `camera`. The viewport of `pass`
    /// must be the picture's rectangle.
    pub fn draw(&self, gpu: &Gpu, pass: &mut wgpu::RenderPass<'_>, camera: &Camera, scales: &[bool]) {
        let clip_from_model = clip_from_model(camera, self.origin).to_cols_array_2d().map(|c| c.map(|v| v as f32));
        let uniform = BoxesUniform { clip_from_model, ..self.uniform };
        gpu.queue().write_buffer(&self.uniform_buffer, 0, bytemuck::bytes_of(&uniform));
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &self.bind_group, &[]);
        pass.set_vertex_buffer(0, self.centers.slice(..));
        for (range, _) in self.firsts.windows(2).zip(scales).filter(|(_, is_shown)| **is_shown) {
            pass.draw(0..24 * self.uniform.segments, range[0]..range[1]);
        }
    }
}

/// Color and opacity of the lines of scale `s`, which has `tensors` tensors.
fn color_of(s: usize, tensors: usize) -> [f32; 4] {
    let [r, g, b] = COLORS[s % COLORS.len()];
    [r, g, b, (OPAQUE_TENSORS / tensors as f32).clamp(OPACITIES[0], OPACITIES[1])]
}

/// Projects the box edges of the scales of `scene` for which `scales` is true, for windows without a graphics device.
/// Calls `draw` with the two ends of each edge, in parts of the picture's width and height, and with its color and
/// opacity.
pub fn each_line(scene: &Scene, camera: &Camera, scales: &[bool], mut draw: impl FnMut([DVec2; 2], [f32; 4])) {
    let origin = scene.bounds.center();
    let clip_from_model = clip_from_model(camera, origin);
    let contraction = scene.rules.contraction;
    let segments = contraction.map_or(1, |_| SEGMENTS);
    let placed = |point: DVec3| contraction.map_or(point, |contraction| expanded(&contraction, point));
    for (s, scale) in scene.scales.iter().enumerate().filter(|(s, _)| scales.get(*s) == Some(&true)) {
        let color = color_of(s, scale.cloud.len());
        for center in scale.cloud.centers() {
            let corners: [DVec3; 8] = std::array::from_fn(|n| {
                let sign = DVec3::from_array([1, 2, 4].map(|bit| if n & bit == 0 { -1.0 } else { 1.0 }));
                center + sign * scale.cloud.half_edge
            });
            for (a, b) in (0..8).flat_map(|a| [1, 2, 4].map(|bit| (a, a | bit))).filter(|(a, b)| a != b) {
                let end = |n: u32| {
                    let point = corners[a].lerp(corners[b], f64::from(n) / f64::from(segments));
                    clip_from_model * (placed(point) - origin).extend(1.0)
                };
                for n in 0..segments {
                    if let Some(ends) = in_front(end(n), end(n + 1)) {
                        draw(ends.map(|p| DVec2::new(0.5 + 0.5 * p.x / p.w, 0.5 - 0.5 * p.y / p.w)), color);
                    }
                }
            }
        }
    }
}

/// The point of model space whose image is `contracted`, or one far away in its direction if that is near the bounds or
/// beyond.
fn expanded(contraction: &Contraction, contracted: DVec3) -> DVec3 {
    let norm = contracted.abs().max_element();
    let most = 1.0 + contraction.shell - FROM_END;
    contraction.expand(if norm > most { contracted * (most / norm) } else { contracted })
}

/// The part of a line that lies in front of the camera, in clip space; `None` if it lies behind the camera.
fn in_front(a: DVec4, b: DVec4) -> Option<[DVec4; 2]> {
    const NEAREST: f64 = 1e-6;
    if a.w < NEAREST && b.w < NEAREST {
        return None;
    }
    let cut = |from: DVec4, to: DVec4| {
        if from.w < NEAREST { from + (NEAREST - from.w) / (to.w - from.w) * (to - from) } else { from }
    };
    Some([cut(a, b), cut(b, a)])
}

/// Maps positions relative to `origin` to clip space. All points in front of the camera get the same depth.
fn clip_from_model(camera: &Camera, origin: DVec3) -> DMat4 {
    let camera_from_model =
        DMat4::from_mat3(camera.world_from_camera.transpose()) * DMat4::from_translation(origin - camera.position);
    let [width, height] = [camera.width, camera.height].map(f64::from);
    let [fx, fy] = [2.0 * camera.focal[0] / width, 2.0 * camera.focal[1] / height];
    let [cx, cy] = [2.0 * camera.principal[0] / width - 1.0, 1.0 - 2.0 * camera.principal[1] / height];
    let rows = [[fx, 0.0, -cx, 0.0], [0.0, fy, -cy, 0.0], [0.0, 0.0, -0.5, 0.0], [0.0, 0.0, -1.0, 0.0]];
    DMat4::from_cols_array_2d(&rows).transpose() * camera_from_model
}

fn pipeline(device: &wgpu::Device, format: wgpu::TextureFormat) -> wgpu::RenderPipeline {
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some("boxes"),
        source: wgpu::ShaderSource::Wgsl(SHADER.into()),
    });
    let attribute = wgpu::VertexAttribute { format: wgpu::VertexFormat::Float32x4, offset: 0, shader_location: 0 };
    device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
        label: Some("boxes"),
        layout: None,
        vertex: wgpu::VertexState {
            module: &module,
            entry_point: Some("vertex"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            buffers: &[Some(wgpu::VertexBufferLayout {
                array_stride: 16,
                step_mode: wgpu::VertexStepMode::Instance,
                attributes: &[attribute],
            })],
        },
        primitive: wgpu::PrimitiveState {
            topology: wgpu::PrimitiveTopology::LineList,
            ..wgpu::PrimitiveState::default()
        },
        depth_stencil: None,
        multisample: wgpu::MultisampleState::default(),
        fragment: Some(wgpu::FragmentState {
            module: &module,
            entry_point: Some("fragment"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            targets: &[Some(wgpu::ColorTargetState {
                format,
                blend: Some(wgpu::BlendState::ALPHA_BLENDING),
                write_mask: wgpu::ColorWrites::ALL,
            })],
        }),
        multiview_mask: None,
        cache: None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_uniform_lies_as_the_shader_has_it() {
        strivec_field::render::gpu::testing::assert_same_layout!(
            SHADER,
            "Boxes",
            BoxesUniform,
            clip_from_model,
            halves,
            colors,
            shell,
            segments
        );
    }

    #[test]
    fn lines_fall_where_rays_pass() {
        let camera = Camera {
            principal: [13.0, 11.0],
            ..Camera::looking_at([30, 20], 25.0, DVec3::new(3.0, 1.0, 2.0), DVec3::ZERO, DVec3::Z)
        };
        let origin = DVec3::new(100.0, 0.0, 0.0);
        for (x, y, distance) in [(0.0, 0.0, 2.0), (17.5, 3.25, 0.7), (30.0, 20.0, 9.0)] {
            let point = camera.ray_through(x, y).unwrap().at(distance);
            let clip = clip_from_model(&camera, origin) * (point - origin).extend(1.0);
            assert!(clip.w > 0.0);
            let ndc = clip.truncate() / clip.w;
            assert!((ndc.x - (x / 15.0 - 1.0)).abs() < 1e-9 && (ndc.y - (1.0 - y / 10.0)).abs() < 1e-9, "{ndc}");
        }
        let mut lines = 0;
        let scene = strivec_format::container::decode(include_bytes!(concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/../../fixtures/v1/occupancy.strivec"
        )))
        .unwrap();
        let away = Camera::looking_at([30, 20], 25.0, DVec3::new(9.0, 7.0, 8.0), scene.bounds.center(), DVec3::Z);
        each_line(&scene, &away, &[true, false], |ends, color| {
            lines += 1;
            assert!(ends.iter().all(|p| p.is_finite()) && color[3] > 0.0);
        });
        assert_eq!(lines, 12 * scene.scales[0].cloud.len());
        let behind = camera.position - camera.ray_through(15.0, 10.0).unwrap().direction;
        assert!((clip_from_model(&camera, DVec3::ZERO) * behind.extend(1.0)).w < 0.0);
    }

    #[test]
    fn boxes_of_a_contracted_scene_lie_where_their_content_is_seen() {
        let mut scene = strivec_format::container::decode(include_bytes!(concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/../../fixtures/v1/f32.strivec"
        )))
        .unwrap();
        let contraction = Contraction { shell: 0.4 };
        (scene.bounds, scene.rules.contraction) = (contraction.bounds(), Some(contraction));
        let camera = Camera::looking_at([30, 20], 25.0, DVec3::new(0.2, 0.1, 0.3), DVec3::X, DVec3::Z);
        let mut lines = 0;
        each_line(&scene, &camera, &[true], |ends, _| {
            lines += 1;
            assert!(ends.iter().all(|p| p.is_finite()), "{ends:?}");
        });
        assert!(lines > 0);
        for (contracted, expected) in [([0.5, -0.9, 0.0], [0.5, -0.9, 0.0]), ([1.2, 0.0, 0.6], [2.0, 0.0, 1.0])] {
            let found = expanded(&contraction, DVec3::from_array(contracted));
            assert!((found - DVec3::from_array(expected)).length() < 1e-12, "{found}");
        }
        let beyond = expanded(&contraction, DVec3::new(0.0, 1.6, 0.0));
        assert!((beyond - DVec3::new(0.0, 400.0, 0.0)).length() < 1e-6, "{beyond}");
    }
}
