//! The graphics renderer against the reference, on whole pictures. Needs an adapter, such as Mesa's lavapipe
//! (`apt-get install mesa-vulkan-drivers`). Without one the tests fail; they never skip silently.

use crate::scenes;

use std::cell::RefCell;

use strivec_field::render::gpu::{Gpu, GpuRenderer, POSITION_ERROR, Precision};
use strivec_field::render::{Approximation, CpuRenderer, Picture, Pixel, ReferenceRenderer, Renderer};
use strivec_format::geometry::{Camera, Ray};
use strivec_format::model::{DecoderMode, Scene};
use strivec_measure::{Parity, parity};

/// A renderer whose device errors fail the test.
struct Unwrapped(RefCell<GpuRenderer>);

impl Renderer for Unwrapped {
    fn trace(&self, rays: &[Ray]) -> Vec<Pixel> {
        self.0.borrow_mut().trace(rays).unwrap()
    }

    fn background(&self) -> [f32; 3] {
        self.0.borrow().background()
    }

    fn render(&self, camera: &Camera) -> Picture {
        self.0.borrow_mut().render(camera).unwrap()
    }
}

fn gpu() -> Gpu {
    let gpu = Gpu::open().unwrap_or_else(|e| panic!("{e}; apt-get install mesa-vulkan-drivers"));
    println!("{:?}", gpu.info());
    gpu
}

/// The device with its own shaders, and with those of a graphics processor, if it is a software device.
fn gpus() -> [Gpu; 2] {
    let gpu = gpu();
    [gpu.clone(), gpu.as_hardware()]
}

fn renderer(gpu: &Gpu, scene: &Scene, precision: Precision) -> Unwrapped {
    Unwrapped(RefCell::new(GpuRenderer::new(gpu, scene.clone(), &Approximation::default(), precision).unwrap()))
}

fn cameras() -> [Camera; 2] {
    [scenes::camera(32, 0.4), scenes::camera(32, 2.9)]
}

/// Rays from a few units away, rounded to 32 bits.
fn position_error(cameras: &[Camera]) -> f64 {
    POSITION_ERROR * cameras.iter().map(|camera| camera.position.length()).fold(1.0, f64::max)
}

fn compared(scene: &Scene, found: &impl Renderer) -> Parity {
    parity(scene, found, &cameras(), position_error(&cameras()))
}

#[test]
fn pictures_are_the_references_under_every_rule_and_a_planted_difference_shows() {
    let gpus = gpus();
    // All rules, and all decoder modes for some of them: compiling shaders is slow.
    let cases = scenes::rule_cases()
        .into_iter()
        .enumerate()
        .filter(|(n, (name, _))| n % 3 == 0 || *n < 9 || name.contains("Vm"))
        .flat_map(|(n, (name, scene))| gpus.iter().map(move |gpu| (n, name.clone(), scene.clone(), gpu)));
    for (n, name, scene, gpu) in cases {
        let found = compared(&scene, &renderer(gpu, &scene, Precision::F32));
        println!("{name}: {found:?}, near {:.2} %", 100.0 * found.near_share());
        assert!(found.clear_rays > 1500 && found.near_share() < 0.2, "{name}: {found:?}");
        assert!(found.clear_maximum < 1e-3, "{name}: {found:?}");
        assert!(found.near_median < 1e-4 && found.near_999 < 0.5, "{name}: {found:?}");
        if n % 12 == 0 {
            let mut planted = scene.clone();
            planted.decoder.layers.last_mut().unwrap().bias[0] += 0.02;
            let changed = compared(&scene, &renderer(gpu, &planted, Precision::F32));
            assert!(changed.clear_maximum > 1e-3, "{name}: a planted difference goes unnoticed: {changed:?}");
            let Some(sky) = &mut planted.rules.sky else { continue };
            *sky.coefficients.last_mut().unwrap() += 0.05;
            planted.decoder = scene.decoder.clone();
            let changed = compared(&scene, &renderer(gpu, &planted, Precision::F32));
            assert!(changed.clear_maximum > 1e-3, "{name}: another sky goes unnoticed: {changed:?}");
        }
    }
}

/// `trace` gets rays computed in 64 bits; `render` computes them on the device.
#[test]
fn the_device_computes_the_cameras_rays() {
    let (_, scene) = scenes::rule_cases().swap_remove(0);
    let gpu = gpu();
    let renderer = renderer(&gpu, &scene, Precision::F32);
    let reference = ReferenceRenderer::new(&scene);
    for size in [1, 7, 33, 40] {
        let camera = scenes::camera(size, 1.0);
        let drawn = renderer.render(&camera);
        assert_eq!((drawn.width, drawn.height, drawn.pixels.len()), (size, size, (size * size) as usize));
        let (mut near, mut opaque) = (0, 0);
        for (n, drawn) in drawn.pixels.iter().enumerate() {
            let expected = reference.trace_one(&camera.ray(n as u32 % size, n as u32 / size).unwrap());
            if expected.margin < position_error(&[camera]) {
                near += 1;
                continue;
            }
            let apart = (0..3).map(|c| (f64::from(drawn.color[c]) - expected.color[c]).abs()).fold(0.0, f64::max);
            let of_opacity = (f64::from(drawn.opacity) - expected.opacity).abs();
            let of_depth = (f64::from(drawn.depth) - expected.depth).abs();
            assert!(apart.max(of_opacity) < 1e-4 && of_depth < 1e-3, "{n}: {drawn:?}, {expected:?}");
            opaque += usize::from(drawn.opacity > 0.3);
        }
        assert!(near * 20 <= drawn.pixels.len() && opaque * 10 >= drawn.pixels.len(), "{near}, {opaque}");
    }
}

/// Thresholds above the scene's own, with a sky and without; a picture without the weight that they skip shows.
#[test]
fn raised_thresholds_have_the_pixels_of_the_cpu() {
    let gpu = gpu();
    let cases = scenes::rule_cases();
    let with_sky = &cases.iter().find(|(_, scene)| scene.rules.sky.is_some()).expect("a scene with a sky").1;
    let of_each_mode = DecoderMode::ALL.map(|mode| (&cases[0].1, mode));
    for (scene, mode) in of_each_mode.into_iter().chain([(with_sky, with_sky.decoder.mode)]) {
        let mut scene = scene.clone();
        (scene.rules.min_weight, scene.rules.min_transmittance, scene.decoder.mode) = (0.005, 0.02, mode);
        let raised = Approximation { min_weight: Some(0.04), min_transmittance: Some(0.3), ..Approximation::default() };
        let mut baked = scene.clone();
        (baked.rules.min_weight, baked.rules.min_transmittance) = (0.04, 0.3);
        let camera = scenes::camera(40, 1.0);
        let device = GpuRenderer::new(&gpu, scene.clone(), &raised, Precision::F32);
        let drawn = Unwrapped(RefCell::new(device.unwrap())).render(&camera).pixels;
        let expected = CpuRenderer::<f32>::with_approximation(scene, &raised).unwrap().render(&camera).pixels;
        let left_out = CpuRenderer::unlimited(&baked).render(&camera).pixels;
        let far = |of: &[Pixel]| {
            let is_far = |(a, b): &(&Pixel, &Pixel)| {
                (0..3).any(|c| (a.color[c] - b.color[c]).abs() > 1e-4) || (a.opacity - b.opacity).abs() > 1e-4
            };
            of.iter().zip(&drawn).filter(is_far).count()
        };
        assert!(far(&expected) <= 8, "{mode:?}: {}", far(&expected));
        assert!(far(&left_out) > 100, "{mode:?}: {}", far(&left_out));
    }
}

#[test]
fn cameras_with_lenses_have_the_pixels_of_the_cpu() {
    let (_, scene) = scenes::rule_cases().swap_remove(0);
    let drawn = renderer(&gpu(), &scene, Precision::F32);
    let camera = scenes::bent_camera(40);
    let [found, expected] = [drawn.render(&camera), CpuRenderer::unlimited(&scene).render(&camera)].map(|p| p.pixels);
    let is_far = |(a, b): &(&Pixel, &Pixel)| (0..3).any(|c| (a.color[c] - b.color[c]).abs() > 1e-4);
    assert!(found.iter().zip(&expected).filter(is_far).count() <= 4);
    assert_eq!((found[0].opacity, found[0].color), (0.0, scene.frame.background), "beyond the lens");
}

/// Rays that the device and the host compute, and pixels without a ray.
#[test]
fn skies_are_opaque_where_a_camera_sees_and_the_background_is_elsewhere() {
    let gpu = gpu();
    let (_, scene) = scenes::rule_cases().swap_remove(0);
    for mut scene in [scene, scenes::contracted(scenes::scene(&scenes::config()))] {
        scene.rules.sky = Some(scenes::sky(4));
        let drawn = renderer(&gpu, &scene, Precision::F32);
        for camera in [scenes::camera(33, 1.0), scenes::bent_camera(40)] {
            let [found, expected] =
                [drawn.render(&camera), CpuRenderer::unlimited(&scene).render(&camera)].map(|p| p.pixels);
            assert!(found.iter().zip(&expected).all(|(a, b)| a.opacity == b.opacity), "opacities are 0 or 1");
            let is_far = |(a, b): &(&Pixel, &Pixel)| (0..3).any(|c| (a.color[c] - b.color[c]).abs() > 1e-4);
            assert!(found.iter().zip(&expected).filter(is_far).count() <= 8);
            let unseen = Pixel { color: scene.frame.background, ..Pixel::default() };
            let is_bent = !camera.lens.is_pinhole();
            assert_eq!(found.contains(&unseen), is_bent, "pixels beyond the lens");
            let sees_all = is_bent || scene.rules.contraction.is_some();
            assert!(sees_all || found.iter().any(|p| p.opacity == 1.0 && p.depth == 0.0), "rays that meet nothing");
        }
    }
}

/// 16-bit factors have a relative error of 1/2000; the pictures' bound is in docs/numerics.md.
#[test]
fn sixteen_bit_factors_stay_within_their_bound() {
    for gpu in gpus() {
        for (name, scene) in scenes::rule_cases().into_iter().take(6) {
            let found = compared(&scene, &renderer(&gpu, &scene, Precision::F16));
            println!("{name}: {found:?}");
            assert!(found.clear_maximum > 1e-6, "{name}: nothing was rounded: {found:?}");
            assert!(found.clear_maximum < 1e-2, "{name}: {found:?}");
        }
    }
}

/// A picture of several batches, the last one partial.
#[test]
fn batches_make_one_picture() {
    let (_, scene) = scenes::rule_cases().swap_remove(0);
    let gpu = gpu();
    let renderer = renderer(&gpu, &scene, Precision::F32);
    let camera = scenes::camera(600, 1.0);
    let drawn = renderer.render(&camera);
    let rays: Vec<_> = (0..600).step_by(59).flat_map(|y| (0..600).step_by(59).map(move |x| (x, y))).collect();
    let traced = renderer.trace(&rays.iter().map(|&(x, y)| camera.ray(x, y).unwrap()).collect::<Vec<_>>());
    let far = rays.iter().zip(&traced).filter(|((x, y), traced)| {
        let pixel = drawn.pixels[(y * 600 + x) as usize];
        (0..3).any(|c| (pixel.color[c] - traced.color[c]).abs() > 1e-4)
    });
    assert!(far.count() <= 2);
    assert!(renderer.render(&scenes::camera(8, 1.0)).pixels.len() == 64, "a small picture after a large one");
}

/// llvmpipe ends the loops of an invocation early, so the shaders for software devices need few loops for a sample.
#[test]
fn rays_of_a_thousand_shaded_samples_have_the_pixels_of_the_cpu() {
    let gpu = gpu();
    for mode in [DecoderMode::Residual, DecoderMode::PerRay] {
        let mut config = scenes::config();
        config.decoder.mode = mode;
        let mut scene = scenes::scene(&config);
        (scene.rules.step, scene.rules.min_weight, scene.rules.min_transmittance) = (1.4e-3, 0.0, 1e-9);
        scene.rules.distance_scale = 2.0;
        let camera = scenes::camera(8, 1.0);
        let drawn = renderer(&gpu, &scene, Precision::F32).render(&camera);
        let expected = CpuRenderer::unlimited(&scene).render(&camera);
        let apart = |(a, b): (&Pixel, &Pixel)| (0..3).map(|c| (a.color[c] - b.color[c]).abs()).fold(0.0, f32::max);
        let largest = drawn.pixels.iter().zip(&expected.pixels).map(apart).fold(0.0, f32::max);
        assert!(expected.pixels.iter().any(|p| p.opacity > 0.3) && largest < 1e-3, "{mode:?}: {largest}");
    }
}
