//! Benchmarks of single kernels on one thread: `cargo bench`, or `cargo bench -- march` for those of this name.
//!
//! `strivec bench` measures whole steps and frames, on all threads.

use std::sync::LazyLock;

use divan::Bencher;
use divan::counter::{BytesCount, ItemsCount};
use strivec::cli::bench::lab::{ball, ball_views};
use strivec::container::{self, EncodeOptions, Encoding};
use strivec::field::{Activations, Field, Matrix, MatrixMut, Samples, multiply, vectorized};
use strivec::geometry::Ray;
use strivec::model::Scene;
use strivec::train::{Backward, BatchRoulette, Target, TrainConfig};

/// Rays per call of a kernel, as in training.
const RAYS: usize = 128;
/// Rays of a whole batch.
const BATCH: usize = 1024;

fn main() {
    divan::main();
}

/// The preset "24" in the middle of its schedule.
static SCENE: LazyLock<Scene> = LazyLock::new(|| {
    let config = TrainConfig::preset("24").expect("a preset");
    ball(&config, 2).expect("a ball")
});
static FIELD: LazyLock<Field<f32>> = LazyLock::new(|| Field::unlimited(&SCENE));

/// `count` neighboring rays, row by row, that meet the ball.
fn rays(count: usize) -> Vec<Ray> {
    let camera = ball_views(1, 100).remove(0).camera;
    let middle = (30..70).flat_map(|row| (30..70).map(move |column| (row, column)));
    middle.take(count).map(|(row, column)| camera.ray(column, row).unwrap()).collect()
}

fn marched(rays: &[Ray]) -> Samples<f32> {
    let mut samples = Samples::default();
    vectorized(
        #[inline(always)]
        || FIELD.march(rays, &mut samples),
    );
    samples
}

#[divan::bench]
fn march(bencher: Bencher<'_, '_>) {
    let rays = rays(RAYS);
    let mut samples = marched(&rays);
    bencher.counter(ItemsCount::new(samples.len())).bench_local(|| {
        vectorized(
            #[inline(always)]
            || FIELD.march(&rays, &mut samples),
        );
    });
}

/// Neighbors and density, one point at a time.
#[divan::bench]
fn density_at_points(bencher: Bencher<'_, '_>) {
    let samples = marched(&rays(RAYS));
    let mut scratch = Samples::default();
    bencher.counter(ItemsCount::new(samples.len())).bench_local(|| {
        vectorized(
            #[inline(always)]
            || {
                let feature = |&position| FIELD.density_feature(position, &mut scratch);
                samples.positions.iter().filter_map(feature).sum::<f32>()
            },
        )
    });
}

/// Colors of the colored samples of a march: gathering, matrices, encoding and MLP.
#[divan::bench]
fn decode(bencher: Bencher<'_, '_>) {
    let rays = rays(RAYS);
    let mut samples = marched(&rays);
    let mut activations = Activations::default();
    FIELD.select_shaded(&samples, None, &mut activations.shaded);
    bencher.counter(ItemsCount::new(activations.shaded.len())).bench_local(|| {
        vectorized(
            #[inline(always)]
            || FIELD.decode(&rays, &mut samples, &mut activations),
        );
    });
}

/// A batch forward and backward up to the factors, on all threads.
#[divan::bench(sample_count = 20)]
fn backward_loss(bencher: Bencher<'_, '_>) {
    let rays = rays(BATCH);
    let targets =
        vec![Target { color: [0.5; 3], background: [1.0; 3], view: 0, distance: 0.0, weight: 1.0 }; rays.len()];
    let mut backward = Backward::new(&FIELD);
    bencher
        .counter(ItemsCount::new(rays.len()))
        .bench_local(|| backward.loss(&FIELD, &rays, &targets, BatchRoulette::default()));
}

/// Components of each tensor: below, at and beyond the lanes of registers.
const RANKS: [u32; 16] = [1, 2, 3, 4, 6, 8, 12, 15, 16, 17, 24, 31, 32, 33, 40, 48];

/// [`SCENE`] with two scales whose tensors have `rank` components of density and of appearance.
fn field_of_rank(rank: u32) -> Field<f32> {
    let mut config = TrainConfig::preset("24").expect("a preset");
    config.scales.truncate(2);
    config.scales.iter_mut().for_each(|scale| (scale.density_rank, scale.appearance_rank) = (rank, rank));
    Field::unlimited(&ball(&config, 2).expect("a ball"))
}

/// Neighbors and density at all samples of some rays, by components of a tensor.
#[divan::bench(args = RANKS)]
fn density_of_rank(bencher: Bencher<'_, '_>, rank: u32) {
    let field = field_of_rank(rank);
    let positions = marched(&rays(RAYS)).positions;
    let mut scratch = Samples::default();
    bencher.counter(ItemsCount::new(positions.len())).bench_local(|| {
        vectorized(
            #[inline(always)]
            || {
                let mut sum = 0.0;
                field.density_features(positions.iter().copied(), &mut scratch, |_, feature| sum += feature);
                sum
            },
        )
    });
}

/// Gradients of all factors, by components of a tensor, on all threads. Includes a batch forward and backward.
#[divan::bench(args = RANKS, sample_count = 10)]
fn gradients_of_rank(bencher: Bencher<'_, '_>, rank: u32) {
    let field = field_of_rank(rank);
    let rays = rays(BATCH);
    let targets =
        vec![Target { color: [0.5; 3], background: [1.0; 3], view: 0, distance: 0.0, weight: 1.0 }; rays.len()];
    let mut backward = Backward::new(&field);
    bencher
        .counter(ItemsCount::new(rays.len()))
        .bench_local(|| backward.gradients(&field, &rays, &targets, BatchRoulette::default()));
}

/// Rows, inner length and columns: larger than the caches, the decoder's layers, and the appearance matrices.
#[divan::bench(args = [[1024, 1024, 1024], [4096, 150, 128], [512, 150, 128], [512, 128, 128], [512, 128, 3], [512, 72, 27]])]
fn product(bencher: Bencher<'_, '_>, [rows, inner, columns]: [usize; 3]) {
    let (left, right) = (vec![0.5f32; rows * inner], vec![0.25f32; inner * columns]);
    let mut product = vec![0f32; rows * columns];
    // An item is one multiply-add.
    bencher.counter(ItemsCount::new(rows * inner * columns)).bench_local(|| {
        multiply(
            MatrixMut::new(&mut product, rows, columns, columns),
            Matrix::new(&left, rows, inner, inner),
            Matrix::new(&right, inner, columns, columns),
            false,
        );
    });
}

const ENCODINGS: [Encoding; 2] = [Encoding::F16, Encoding::F32];

fn encoded(factors: Encoding) -> Vec<u8> {
    container::encode(&SCENE, &EncodeOptions::uniform(factors)).expect("a sound scene")
}

#[divan::bench(args = ENCODINGS, sample_count = 5)]
fn container_encode(bencher: Bencher<'_, '_>, factors: Encoding) {
    let bytes = encoded(factors).len();
    bencher.counter(BytesCount::new(bytes)).bench_local(|| encoded(factors));
}

#[divan::bench(args = ENCODINGS, sample_count = 5)]
fn container_decode(bencher: Bencher<'_, '_>, factors: Encoding) {
    let bytes = encoded(factors);
    bencher.counter(BytesCount::new(bytes.len())).bench_local(|| container::decode(&bytes).expect("as written"));
}
