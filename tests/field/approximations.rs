//! Approximations of the CPU renderer: no change at an option's exact value, a visible one at a strong value.

use crate::scenes;

use strivec_field::render::{Approximation, CpuRenderer, Picture, ReferenceRenderer, Renderer, RendererError};
use strivec_format::Place;
use strivec_format::geometry::Camera;
use strivec_format::model::{DecoderMode, Scene};

fn scene() -> Scene {
    let mut config = scenes::config();
    config.optimizer.factor_deviation = 0.8;
    scenes::scene(&config)
}

/// A camera whose picture is not a multiple of the tile size.
fn camera() -> Camera {
    Camera { width: 45, height: 39, ..scenes::camera(42, 0.7) }
}

fn picture(scene: &Scene, approximation: Approximation) -> Picture {
    let renderer = CpuRenderer::<f32>::with_approximation(scene.clone(), &approximation);
    renderer.unwrap_or_else(|error| panic!("{approximation:?}: {error}")).render(&camera())
}

/// The root of the mean squared difference of colors.
fn difference(a: &Picture, b: &Picture) -> f64 {
    let channels = a.pixels.iter().zip(&b.pixels).flat_map(|(a, b)| (0..3).map(|i| a.color[i] - b.color[i]));
    let sum: f64 = channels.map(|d| f64::from(d).powi(2)).sum();
    (sum / (3 * a.pixels.len()) as f64).sqrt()
}

const EXACT: Approximation =
    Approximation { step_scale: 1.0, min_weight: None, min_transmittance: None, decoder: None };

#[test]
fn nothing_is_left_out_by_default() {
    assert_eq!(Approximation::default(), EXACT);
    assert!(EXACT.is_exact());
    assert_eq!(picture(&scene(), EXACT), CpuRenderer::unlimited(&scene()).render(&camera()));
}

#[test]
fn an_option_at_the_scenes_own_value_changes_no_bit() {
    let scene = scene();
    let exact = CpuRenderer::unlimited(&scene).render(&camera());
    for option in [
        Approximation { min_weight: Some(scene.rules.min_weight), ..EXACT },
        Approximation { min_transmittance: Some(scene.rules.min_transmittance), ..EXACT },
        Approximation { decoder: Some(scene.decoder.mode), ..EXACT },
    ] {
        assert!(!option.is_exact());
        assert_eq!(picture(&scene, option), exact, "{option:?}");
    }
}

#[test]
fn a_strong_option_shows() {
    let scene = scene();
    let exact = CpuRenderer::unlimited(&scene).render(&camera());
    for option in [
        Approximation { step_scale: 8.0, ..EXACT },
        Approximation { min_weight: Some(0.05), ..EXACT },
        Approximation { min_transmittance: Some(0.9), ..EXACT },
        Approximation { decoder: Some(DecoderMode::PerRay), ..EXACT },
        Approximation { decoder: Some(DecoderMode::Residual), ..EXACT },
    ] {
        let change = difference(&picture(&scene, option), &exact);
        assert!(change > 3e-4, "{option:?}: {change}");
    }
}

/// The formula in the documentation of `Approximation`, from traces of the reference renderer.
#[test]
fn skipped_samples_give_their_weight_to_the_shaded_ones() {
    let mut scene = scene();
    (scene.rules.min_weight, scene.rules.min_transmittance) = (0.005, 0.02);
    let raised = Approximation { min_weight: Some(0.04), min_transmittance: Some(0.3), ..EXACT };
    let rays: Vec<_> = (0..39).flat_map(|y| (0..45).filter_map(move |x| camera().ray(x, y))).collect();
    let background = scene.frame.background.map(f64::from);
    for mode in DecoderMode::ALL {
        scene.decoder.mode = mode;
        let mut shown = scene.clone();
        (shown.rules.min_weight, shown.rules.min_transmittance) = (0.04, 0.3);
        shown.frame.background = [0.0; 3];
        // Its colors are sums of weights.
        let mut white = shown.clone();
        let last = white.decoder.layers.last_mut().unwrap();
        last.weights.fill(0.0);
        last.bias.fill(100.0);
        let mut white_by_own_weight = white.clone();
        white_by_own_weight.rules.min_weight = 0.005;

        let renderer = CpuRenderer::<f64>::with_approximation(scene.clone(), &raised).unwrap();
        let (pixels, fast) = (renderer.trace(&rays), CpuRenderer::<f32>::with_approximation(scene.clone(), &raised));
        let fast = fast.unwrap().trace(&rays);
        let (mut skipping, mut ended, mut planted) = (0, 0, 0.0f64);
        for (ray, (pixel, fast)) in rays.iter().zip(pixels.iter().zip(&fast)) {
            let [trace, white, by_own_weight] =
                [&shown, &white, &white_by_own_weight].map(|scene| ReferenceRenderer::new(scene).trace_one(ray));
            if trace.margin.min(by_own_weight.margin) < 1e-4 {
                continue;
            }
            let (shaded, skipped) = (white.color[0], by_own_weight.color[0] - white.color[0]);
            let remaining = 1.0 - trace.opacity;
            let left = if shaded > 0.0 && remaining < 0.3 { remaining.min(0.02) } else { remaining };
            let scale = if shaded > 0.0 { 1.0 + (remaining - left + skipped) / shaded } else { 1.0 };
            for c in 0..3 {
                let expected = scale * trace.color[c] + left * background[c];
                assert!((f64::from(pixel.color[c]) - expected).abs() < 1e-6, "{mode:?}: {pixel:?}, {expected}");
                assert!((f64::from(fast.color[c]) - expected).abs() < 1e-4, "{mode:?}: {fast:?}, {expected}");
                planted = planted.max((trace.color[c] + remaining * background[c] - expected).abs());
            }
            assert!((f64::from(pixel.opacity) - (1.0 - left)).abs() < 1e-6, "{mode:?}: {pixel:?}, {left}");
            skipping += u32::from(skipped > 0.01 && shaded > 0.0);
            ended += u32::from(left < remaining);
        }
        assert!(skipping > 50 && ended > 20, "{mode:?}: {skipping}, {ended}");
        assert!(planted > 0.05, "{mode:?}: pictures without that weight go unnoticed: {planted}");
    }
}

#[test]
fn a_file_keeps_the_scenes_thresholds_unless_they_get_lower() {
    let mut scene = scene();
    (scene.rules.min_weight, scene.rules.min_transmittance) = (0.005, 0.02);
    let option = Approximation { min_weight: Some(0.04), min_transmittance: Some(0.01), ..EXACT };
    assert!(option.raises_thresholds(&scene));
    let rules = option.applied(scene.clone()).rules;
    assert_eq!([rules.min_weight, rules.min_transmittance], [0.005, 0.01]);
    assert!(!Approximation { min_weight: Some(0.005), ..EXACT }.raises_thresholds(&scene));
}

#[test]
fn longer_steps_keep_the_opacity() {
    // The mean over the picture, in which errors at opposite edges cancel.
    let scene = scene();
    let mean = |approximation| {
        let picture = picture(&scene, approximation);
        picture.pixels.iter().map(|p| f64::from(p.opacity)).sum::<f64>() / picture.pixels.len() as f64
    };
    let (exact, long) = (mean(EXACT), mean(Approximation { step_scale: 2.0, ..EXACT }));
    assert!(exact > 0.1 && (long / exact - 1.0).abs() < 0.02, "{long} instead of {exact}");
}

#[test]
fn options_out_of_range_are_refused_by_name() {
    let scene = scene();
    let (nan, infinite) = (f64::NAN, f64::INFINITY);
    for (option, name, expected) in [
        (Approximation { step_scale: 0.0, ..EXACT }, "step_scale", "0.25 to 64"),
        (Approximation { step_scale: nan, ..EXACT }, "step_scale", "0.25 to 64"),
        (Approximation { step_scale: infinite, ..EXACT }, "step_scale", "0.25 to 64"),
        (Approximation { min_weight: Some(1.0), ..EXACT }, "min_weight", "a number in [0, 1)"),
        (Approximation { min_weight: Some(nan), ..EXACT }, "min_weight", "a number in [0, 1)"),
        (Approximation { min_transmittance: Some(-0.1), ..EXACT }, "min_transmittance", "a number in [0, 1)"),
    ] {
        let refused = CpuRenderer::<f32>::with_approximation(scene.clone(), &option).expect_err("a refusal");
        let RendererError::Approximation(error) = refused else { panic!("{refused}") };
        assert_eq!((&error.place, error.expected.as_str()), (&Place::option(name), expected), "{error}");
    }
}

#[test]
fn pictures_do_not_depend_on_the_number_of_threads() {
    let scene = scene();
    for option in [
        EXACT,
        Approximation { decoder: Some(DecoderMode::PerRay), ..EXACT },
        Approximation { decoder: Some(DecoderMode::Residual), ..EXACT },
        Approximation { step_scale: 2.0, ..EXACT },
    ] {
        let with = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| picture(&scene, option))
        };
        let one = with(1);
        assert_eq!(one, with(2), "{option:?}");
        assert_eq!(one, with(3), "{option:?}");
    }
}

#[test]
fn a_picture_has_the_pixels_of_its_rays() {
    let renderer = CpuRenderer::unlimited(&scene());
    let (camera, picture) = (camera(), renderer.render(&camera()));
    for (row, column) in [(0, 0), (20, 17), (38, 44), (15, 16), (16, 15), (25, 31)] {
        let seen = renderer.trace(&[camera.ray(column, row).unwrap()])[0];
        let pixel = picture.pixels[(row * camera.width + column) as usize];
        let close = |a: f32, b: f32| (a - b).abs() < 1e-5;
        assert!((0..3).all(|i| close(seen.color[i], pixel.color[i])), "{seen:?}, {pixel:?}");
        assert!(close(seen.opacity, pixel.opacity) && close(seen.depth, pixel.depth), "{seen:?}, {pixel:?}");
    }
}
