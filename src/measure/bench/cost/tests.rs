//! Costs of a tiny field. Operations of the inner loops are counted by a number type while plain versions of the loops
//! run; the other stages and the bytes are compared with literals.

use super::*;

/// Two scales, two features of one frequency, one hidden layer of 4.
fn shape() -> FieldShape {
    FieldShape {
        scales: vec![
            ScaleShape { tensors: 3, density_factors: 36, appearance_factors: 18, appearance_rank: 1 },
            ScaleShape { tensors: 5, density_factors: 45, appearance_factors: 135, appearance_rank: 3 },
        ],
        features: 2,
        frequencies: [1, 1],
        // 2 features, direction, PE(features) 4, PE(direction) 6.
        layers: vec![[15, 4], [4, 3]],
        mode: DecoderMode::PerSample,
        first_layer_columns: 9,
    }
}

/// One ray of three samples, two of which count and one is colored and decoded.
fn work() -> Work {
    Work {
        rays: 1,
        evaluated: 3,
        samples: 2,
        contributions: vec![4, 5],
        density_components: 13,
        shaded: 1,
        shaded_contributions: vec![1, 2],
        appearance_components: 7,
        decoded: 1,
        ..Work::default()
    }
}

#[track_caller]
fn expect(stage: Stage, flop: f64, bytes: f64) {
    assert_eq!(shape().cost(stage, &work(), 1), Cost { flop, bytes }, "{}", stage.name());
}

#[track_caller]
fn expect_close(found: f64, expected: f64) {
    assert!((found - expected).abs() < 1e-9 * expected, "{found}, expected {expected}");
}

mod counted;

use counted::{Counted, count};

/// The operations of `stage` in [`work`].
fn flop(stage: Stage) -> f64 {
    shape().cost(stage, &work(), 1).flop
}

fn bytes(stage: Stage) -> f64 {
    shape().cost(stage, &work(), 1).bytes
}

/// A component's vector between two vertices.
fn lerp([below, above]: [Counted; 2], fraction: Counted) -> Counted {
    below + fraction * (above - below)
}

#[test]
fn gathering_interpolates_three_vectors_and_adds_their_product() {
    let one = Counted(1.0);
    let gather = |sum: &mut Counted| {
        let [x, y, z] = [0, 1, 2].map(|_| lerp([one, one], one));
        *sum += one * x * y * z;
    };
    let density = count(|| {
        let mut sum = one;
        for _ in 0..work().density_components {
            gather(&mut sum);
            // Lanes are added.
            sum += one;
        }
    });
    assert_eq!(flop(Stage::DensityGather), density);
    let appearance = count(|| {
        (0..work().appearance_components).for_each(|_| gather(&mut { one }));
    });
    assert_eq!(flop(Stage::AppearanceGather), appearance);
    assert_eq!([bytes(Stage::DensityGather), bytes(Stage::AppearanceGather)], [648.0, 292.0]);
}

#[test]
fn scattering_shares_a_gradient_between_six_entries() {
    let one = Counted(1.0);
    let scatter = |gradient: Counted| {
        let [x, y, z] = [0, 1, 2].map(|_| lerp([one, one], one));
        let (with_x, with_y) = (gradient * x, gradient * y);
        for gradient in [with_y * z, with_x * z, with_y * x] {
            let [mut below, mut above] = [one, one];
            let part = one * gradient;
            above += part;
            below += gradient - part;
        }
    };
    let work = Work { samples: 3, ..work() };
    let locate = |contributions: &[u64]| 12.0 * contributions.iter().sum::<u64>() as f64;
    let density = count(|| (0..work.density_components).for_each(|_| scatter(one)));
    assert_eq!(shape().cost(Stage::DensityBackward, &work, 1).flop, density + locate(&work.contributions));
    let appearance = count(|| (0..work.appearance_components).for_each(|_| scatter(one * one)));
    assert_eq!(flop(Stage::AppearanceBackward), appearance + locate(&work.shaded_contributions));
}

/// The product of a matrix and a vector.
fn product(rows: usize, columns: usize) -> Vec<Counted> {
    let one = Counted(1.0);
    (0..rows).map(|_| (0..columns).fold(Counted(0.0), |sum, _| sum + one * one)).collect()
}

#[test]
fn a_decoded_row_goes_through_matrices_layers_and_sigmoids() {
    let one = Counted(1.0);
    let [features, components] = [2, 4];
    assert_eq!(flop(Stage::AppearanceMatrices), count(|| _ = product(features, components)));
    let layers = shape().layers;
    let forward = count(|| {
        for (l, [inputs, outputs]) in layers.iter().copied().enumerate() {
            for sum in product(outputs, inputs) {
                let biased = sum + one;
                let _output = if l + 1 < layers.len() { biased.max(one) } else { one / (one + biased.exp()) };
            }
        }
    });
    assert_eq!(flop(Stage::Decoder), forward);
    let backward = count(|| {
        for (l, [inputs, outputs]) in layers.iter().copied().enumerate() {
            // The gradients of weights and biases are added to those of other rows.
            let mut sum = one;
            (0..inputs * outputs).for_each(|_| sum += one * one);
            (0..outputs).for_each(|_| sum += one);
            product(if l == 0 { shape().first_layer_columns } else { inputs }, outputs);
        }
    });
    assert_eq!(flop(Stage::DecoderBackward), backward);
    let matrices_backward = count(|| {
        let mut sum = one;
        (0..features * components).for_each(|_| sum += one * one);
        product(components, features);
    });
    assert_eq!(flop(Stage::AppearanceMatricesBackward), matrices_backward);
    let bytes = [Stage::AppearanceMatrices, Stage::Decoder, Stage::DecoderBackward].map(bytes);
    assert_eq!(bytes, [24.0, 104.0, 184.0]);
}

#[test]
fn encoding_takes_sines_and_cosines_and_doubles_their_angles() {
    let one = Counted(1.0);
    for frequencies in [1, 2, 3] {
        let shape = FieldShape { frequencies: [frequencies; 2], ..shape() };
        let forward = count(|| {
            // Two features, and the three axes of a direction.
            for _ in 0..2 + 3 {
                let (mut sine, mut cosine) = one.sine_cosine();
                for _ in 1..frequencies {
                    let doubled = sine * cosine;
                    (sine, cosine) = (doubled + doubled, one - sine * sine);
                }
            }
        });
        assert_eq!(shape.cost(Stage::Encoding, &work(), 1).flop, forward, "{frequencies} frequencies");
        let backward = count(|| {
            let mut gradient = one;
            (0..2 * frequencies).for_each(|_| gradient += one * (one * one - one * one));
        });
        assert_eq!(shape.cost(Stage::EncodingBackward, &work(), 1).flop, backward, "{frequencies} frequencies");
    }
}

#[test]
fn the_optimizer_updates_two_moments_and_a_parameter() {
    let one = Counted(1.0);
    let adam = count(|| {
        let first = one * one + one * one;
        let second = one * one + one * one * one;
        let _parameter = one - one * first / (second.sqrt() * one + one);
    });
    let (density, appearance, networks) = (81.0, 60.0, 87.0);
    assert_eq!(flop(Stage::Optimizer), (density + appearance + networks) * adam + density);
}

#[test]
fn finding_counts_pairs_and_samples() {
    expect(Stage::March, 3.0 * 11.0, 3.0 * 16.0);
    // 3 samples in 2 scales: 9 words each, and 8 a sample.
    expect(Stage::Neighbors, 9.0 * 25.0 + 6.0 * 7.0, 4.0 * (9.0 * 10.0 + 6.0 * 9.0 + 3.0 * 8.0));
}

#[test]
fn scattering_counts_pairs_times_ranks() {
    // All 3 samples count: 13 components of 9 pairs. 8 tensors in one chunk.
    let work = Work { samples: 3, ..work() };
    let all = |stage| shape().cost(stage, &work, 1);
    let density = Cost { flop: 13.0 * 26.0 + 9.0 * 12.0, bytes: 4.0 * (13.0 * 18.0 + 9.0 * 6.0 + 8.0) };
    assert_eq!(all(Stage::DensityBackward), density);
    expect(Stage::AppearanceBackward, 7.0 * 27.0 + 3.0 * 12.0, 4.0 * (7.0 * 19.0 + 3.0 * 6.0 + 8.0));
    // All 9 pairs and the 3 colored; two sums over 8 tensors.
    assert_eq!(all(Stage::ContributionOrder), Cost { flop: 12.0, bytes: 4.0 * (12.0 * 6.0 + 32.0) });
}

#[test]
fn samples_behind_a_ray_s_end_have_no_gradients() {
    let third = Work { samples: 1, ..work() };
    expect_close(shape().cost(Stage::DensityBackward, &third, 1).flop, (13.0 * 26.0 + 9.0 * 12.0) / 3.0);
    expect_close(shape().cost(Stage::ContributionOrder, &third, 1).flop, 9.0 / 3.0 + 3.0);
}

#[test]
fn compositing_counts_samples() {
    expect(Stage::Composite, 3.0 * 34.0 + 2.0 * 3.0 + 6.0, 4.0 * (3.0 * 3.0 + 2.0 * 3.0 + 2.0 + 4.0));
    expect(Stage::CompositeBackward, 2.0 * 22.0 + 8.0 + 12.0 + 24.0, 4.0 * (2.0 * 5.0 + 7.0 + 7.0));
}

#[test]
fn a_decoder_once_a_ray_composites_components() {
    let more = |stage| more_of(DecoderMode::PerRay, DecoderMode::PerSample, stage);
    // Two samples of 4 components, one row of 4.
    assert_eq!(more(Stage::Composite), [2.0, 0.0]);
    assert_eq!(more(Stage::AppearanceGather), [2.0 * (4.0 * 2.0 + 1.0), 4.0 * (8.0 + 4.0)]);
    assert_eq!(more(Stage::CompositeBackward), [2.0 * (4.0 * 3.0 + 4.0), 4.0 * (8.0 + 2.0 * 4.0)]);
    assert_eq!(more(Stage::Decoder), [0.0, 0.0]);
}

#[test]
fn colors_of_samples_own_cost_a_product_and_a_sigmoid_each() {
    let more = |stage| more_of(DecoderMode::Residual, DecoderMode::PerRay, stage);
    // Two terms instead of one; 3 features of 4 components of two samples.
    assert_eq!(more(Stage::Composite), [6.0, 4.0 * 4.0]);
    assert_eq!(more(Stage::AppearanceGather), [2.0 * 3.0 * 2.0 * 4.0, 4.0 * 2.0 * (4.0 + 3.0)]);
    assert_eq!(more(Stage::Decoder), [36.0 + 2.0 * 3.0, 4.0 * 2.0 * 6.0]);
    assert_eq!(more(Stage::CompositeBackward), [12.0 + 2.0 * (3.0 + 8.0), 4.0 * (7.0 + 2.0 * (3.0 + 8.0))]);
    assert_eq!(more(Stage::AppearanceMatricesBackward), [2.0 * 4.0 * 3.0 * 4.0, 4.0 * 2.0 * (6.0 + 8.0)]);
    assert_eq!(more(Stage::Encoding), [0.0, 0.0]);
}

/// What `mode` costs more than `other`, FLOP and bytes, for two colored samples of one ray.
fn more_of(mode: DecoderMode, other: DecoderMode, stage: Stage) -> [f64; 2] {
    let work = Work { shaded: 2, ..work() };
    let [with, without] = [mode, other].map(|mode| FieldShape { mode, ..shape() }.cost(stage, &work, 1));
    [with.flop - without.flop, with.bytes - without.bytes]
}

#[test]
fn the_optimizer_counts_entries_that_take_part() {
    // Densities 3·6·2 + 5·9·1 = 81; appearance 1·6·1 + 2·9·3 = 60 of the tensors that pairs can reach; networks
    // 2·4 + 15·4 + 4 + 4·3 + 3 = 87.
    expect(Stage::Optimizer, 228.0 * 13.0 + 81.0, 228.0 * 28.0);
    let many = Work { shaded_contributions: vec![1000, 1000], ..work() };
    let all = 81.0 + (3.0 * 6.0 + 5.0 * 9.0 * 3.0) + 87.0;
    assert_eq!(shape().cost(Stage::Optimizer, &many, 1).bytes, all * 28.0);
    assert_eq!(shape().cost(Stage::Optimizer, &many, 3).bytes, 3.0 * all * 28.0);
}

#[test]
fn nothing_costs_nothing_but_the_optimizer() {
    for stage in Stage::ALL {
        let cost = shape().cost(stage, &Work::default(), 1);
        assert_eq!(cost == Cost::default(), stage != Stage::Optimizer, "{}", stage.name());
    }
}

#[test]
fn the_paper_s_decoder_is_150_by_128_by_128_by_3() {
    let paper = FieldShape { layers: vec![[150, 128], [128, 128], [128, 3]], first_layer_columns: 138, ..shape() };
    let products = 2.0 * (150.0 * 128.0 + 128.0 * 128.0 + 128.0 * 3.0);
    let flop = paper.cost(Stage::Decoder, &work(), 1).flop;
    assert!(flop > products && flop < 1.01 * products, "{flop}");
    let backward = paper.cost(Stage::DecoderBackward, &work(), 1).flop;
    assert!(backward > 1.9 * products && backward < 2.0 * products, "{backward}");
}
