//! The gradients of the whole chain, grid to loss, against central differences in f64.

use glam::{DVec3, UVec3};

use super::adam::{SortedSamples, gradient};
use super::grid::{Channels, CoarseGrid, Live};
use super::ray_loss::{CompositingConstants, Medium, Segment, activate, density_of_alpha, trace};
use strivec_format::geometry::{Aabb, Ray};
use strivec_format::random::Random;

const STEP: f64 = 0.5;
const TARGETS: [[f64; 3]; 3] = [[0.9, 0.2, 0.4], [0.1, 0.8, 1.0], [0.5, 0.0, 0.3]];

fn noise(key: u64) -> f64 {
    Random::new(11, "test").uniform(key) * 2.0 - 1.0
}

/// Densities from almost empty to almost opaque, colors of all kinds.
fn tiny_grid() -> CoarseGrid<f64> {
    let vertices = UVec3::new(4, 5, 3);
    let values = (0..60).map(|n| std::array::from_fn(|c| 2.0 * noise(4 * n + c as u64))).collect();
    CoarseGrid { origin: DVec3::ZERO, voxel: 1.0, vertices, values }
}

fn rays() -> [Ray; 3] {
    let through = |from: DVec3, to: DVec3| Ray { origin: from, direction: (to - from).normalize() };
    [
        through(DVec3::new(-1.0, 0.3, 0.4), DVec3::new(3.0, 3.1, 1.7)),
        through(DVec3::new(1.3, 6.0, 2.5), DVec3::new(1.6, 0.1, 0.3)),
        through(DVec3::new(2.2, 1.1, -2.0), DVec3::new(0.7, 2.9, 2.0)),
    ]
}

fn shading(entropy: f64, point_color: f64) -> CompositingConstants<f64> {
    CompositingConstants {
        shift: -0.5,
        interval: 0.5,
        min_density: f64::NEG_INFINITY,
        min_transmittance: 0.0,
        background: [1.0, 0.9, 0.7],
        entropy,
        point_color,
        per_ray: 1.0 / 3.0,
    }
}

/// The mean loss of the rays and its gradient.
fn evaluate(grid: &CoarseGrid<f64>, shading: &CompositingConstants<f64>) -> (f64, Vec<Channels<f64>>) {
    let live = Live::of(grid, &vec![1.0; grid.values.len()], f64::NEG_INFINITY);
    let extent = Aabb { min: DVec3::ZERO, max: grid.vertices.as_dvec3() - 1.0 };
    let medium = Medium { grid, live: &live, shading, step: STEP };
    let (mut samples, mut shaded) = (Vec::new(), Vec::new());
    let mut total = 0.0;
    for (ray, target) in rays().iter().zip(TARGETS) {
        let segment = Segment::new(ray, &extent, &live.bounds, (0.0, 100.0), STEP).expect("the ray meets the grid");
        total += trace(&medium, &segment, target, &mut samples, &mut shaded).total / 3.0;
    }
    assert!(samples.len() > 15, "the rays cross the grid: {} samples", samples.len());
    let mut batch = SortedSamples::default();
    batch.sort(&samples, grid.plane(), grid.vertices.z as usize);
    (total, gradient(grid, &[batch]))
}

/// The largest difference between `analytic` and central differences over `channels`, relative to the largest entry.
fn worst(
    grid: &CoarseGrid<f64>,
    shading: &CompositingConstants<f64>,
    analytic: &[Channels<f64>],
    channels: &[usize],
) -> f64 {
    const H: f64 = 1e-5;
    let (mut worst, mut largest) = (0.0_f64, 0.0_f64);
    for (n, analytic) in analytic.iter().enumerate() {
        for &c in channels {
            let at = |offset: f64| {
                let mut moved = grid.clone();
                moved.values[n][c] += offset;
                evaluate(&moved, shading).0
            };
            let numeric = (at(H) - at(-H)) / (2.0 * H);
            worst = worst.max((numeric - analytic[c]).abs());
            largest = largest.max(numeric.abs());
        }
    }
    worst / largest
}

#[test]
fn gradients_are_those_of_central_differences_and_a_planted_sign_is_noticed() {
    let grid = tiny_grid();
    // The samples' weights in the point color term count as constants, so densities are checked without it.
    for (shading, channels) in [(shading(0.2, 0.0), &[0][..]), (shading(0.2, 0.3), &[1, 2, 3][..])] {
        let (_, analytic) = evaluate(&grid, &shading);
        let difference = worst(&grid, &shading, &analytic, channels);
        assert!(difference < 1e-7, "channels {channels:?} differ by {difference:e}");
        let wrong: Vec<_> = analytic.iter().map(|g| g.map(|v| -v)).collect();
        assert!(worst(&grid, &shading, &wrong, channels) > 0.1, "a flipped sign is noticed");
    }
}

#[test]
fn point_colors_do_not_move_densities() {
    let grid = tiny_grid();
    let densities =
        |point_color| evaluate(&grid, &shading(0.2, point_color)).1.iter().map(|g| g[0]).collect::<Vec<_>>();
    assert_eq!(densities(0.0), densities(0.3));
}

#[test]
fn alpha_follows_its_definition_on_both_branches() {
    for x in [-14.0, -10.0001, -9.9999, -1.0, 0.0, 3.0_f64] {
        let (alpha, sigmoid) = activate(x, 0.5);
        let expected = -(-0.5 * x.exp().ln_1p()).exp_m1();
        assert!((alpha / expected - 1.0).abs() < 1e-8, "alpha({x}) = {alpha}, not {expected}");
        assert!((sigmoid * (1.0 + (-x).exp()) - 1.0).abs() < 1e-8, "sigmoid({x})");
        let (rough, _) = activate(x as f32, 0.5);
        assert!((f64::from(rough) / expected - 1.0).abs() < 1e-5, "in f32, alpha({x}) = {rough}");
    }
    assert!((activate(density_of_alpha(1e-4, 0.5), 0.5).0 / 1e-4 - 1.0).abs() < 1e-8);
}

#[test]
fn refining_keeps_a_linear_field() {
    let bounds = Aabb { min: DVec3::ZERO, max: DVec3::new(3.0, 4.0, 2.0) };
    let mut grid = CoarseGrid::<f64>::with_voxel(&bounds, 1.0);
    let field = |p: DVec3| [p.x, p.y - p.z, 2.0 * p.z, 1.0];
    grid.values = (0..60).map(|n| field(grid.position(n % 4, n / 4 % 5, n / 20))).collect();
    let fine = grid.refined(&Aabb { min: DVec3::splat(0.5), max: DVec3::new(2.0, 3.0, 2.0) });
    assert_eq!((fine.voxel, fine.vertices), (0.5, UVec3::new(4, 6, 4)));
    for (n, value) in fine.values.iter().enumerate() {
        let expected = field(fine.position(n % 4, n / 4 % 6, n / 24));
        assert!((0..4).all(|c| (value[c] - expected[c]).abs() < 1e-12), "vertex {n}: {value:?}, not {expected:?}");
    }
}

#[test]
fn live_cells_are_those_with_an_unmasked_vertex_above_the_threshold() {
    let mut grid = tiny_grid();
    grid.values.iter_mut().for_each(|v| v[0] = -1.0);
    let (at, masked) = (grid.index(UVec3::new(1, 1, 1)), grid.index(UVec3::new(3, 4, 2)));
    grid.values[at][0] = 1.0;
    grid.values[masked][0] = 1.0;
    let mut rates = vec![1.0; 60];
    rates[masked] = 0.0;
    let live = Live::of(&grid, &rates, 0.0);
    for n in 0..60 {
        let cell = [n % 4, n / 4 % 5, n / 20];
        assert_eq!(live.cells[n], cell.iter().all(|&c| c < 2), "cell {cell:?}");
    }
    assert_eq!(live.bounds, Aabb { min: DVec3::ZERO, max: DVec3::splat(2.0) });
}
