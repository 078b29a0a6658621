//! The graphics renderer against the reference, on whole pictures. Needs an adapter; Mesa's lavapipe is one
//! (`apt-get install mesa-vulkan-drivers`). None is a failure, never a silent skip.
#![cfg(feature = "gpu")]

mod scenes;

use std::cell::RefCell;

use strivec::geometry::{Camera, Ray};
use strivec::measure::{Parity, parity};
use strivec::model::Scene;
use strivec::render::gpu::{Gpu, GpuRenderer, POSITION_ERROR, Precision};
use strivec::render::{Approximation, Picture, Pixel, ReferenceRenderer, Renderer};

/// The issue of a device that fails in a test is the test's.
struct Unwrapped(RefCell<GpuRenderer>);

impl Renderer for Unwrapped {
    fn trace(&self, rays: &[Ray]) -> Vec<Pixel> {
        self.0.borrow_mut().trace(rays).unwrap()
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
    let gpu = gpu();
    for (n, (name, scene)) in scenes::rule_cases().into_iter().enumerate() {
        let found = compared(&scene, &renderer(&gpu, &scene, Precision::F32));
        println!("{name}: {found:?}, near {:.2} %", 100.0 * found.near_share());
        assert!(found.clear_rays > 1500 && found.near_share() < 0.2, "{name}: {found:?}");
        assert!(found.clear_maximum < 1e-3, "{name}: {found:?}");
        assert!(found.near_median < 1e-4 && found.near_999 < 0.5, "{name}: {found:?}");
        if n % 16 == 0 {
            let mut planted = scene.clone();
            planted.decoder.layers.last_mut().unwrap().bias[0] += 0.02;
            let changed = compared(&scene, &renderer(&gpu, &planted, Precision::F32));
            assert!(changed.clear_maximum > 1e-3, "{name}: a planted difference goes unnoticed: {changed:?}");
        }
    }
}

#[test]
fn a_cameras_rays_are_those_that_it_gives() {
    let scene = scenes::scene(&scenes::config());
    let gpu = gpu();
    let renderer = renderer(&gpu, &scene, Precision::F32);
    for size in [1, 7, 33, 40] {
        let camera = scenes::camera(size, 1.0);
        let (drawn, expected) = (renderer.render(&camera), ReferenceRenderer::new(&scene).render(&camera));
        assert_eq!((drawn.width, drawn.height), (size, size));
        let far = (drawn.pixels.iter().zip(&expected.pixels)).filter(|(d, e)| {
            let color = (0..3).any(|c| (d.color[c] - e.color[c]).abs() > 1e-3);
            color || (d.opacity - e.opacity).abs() > 1e-3 || (d.depth - e.depth).abs() > 1e-2
        });
        assert!(far.count() * 50 <= expected.pixels.len(), "{size}");
    }
}
