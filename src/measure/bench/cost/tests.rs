//! Costs of a field so small that they are counted by hand.

use super::*;

/// Two scales, two features of one frequency, one hidden layer of 4.
fn shape() -> FieldShape {
    FieldShape {
        scales: vec![
            ScaleShape { tensors: 3, rows: 6, density_rank: 2, appearance_rank: 1 },
            ScaleShape { tensors: 5, rows: 9, density_rank: 1, appearance_rank: 3 },
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
        shaded: 1,
        shaded_contributions: vec![1, 2],
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

#[test]
fn gathering_counts_pairs_times_ranks() {
    // 4·2 + 5·1 = 13 components of 13 FLOP; 3 samples sum 2 + 1 components. 9 pairs of 7 words, 3 samples of 5.
    expect(Stage::DensityGather, 13.0 * 13.0 + 9.0, 4.0 * (13.0 * 6.0 + 9.0 * 7.0 + 3.0 * 5.0));
    // 1·1 + 2·3 = 7 components, 3 pairs of 12; pairs of 5 words, ranges 4, a position 3 and a row of 4 components.
    expect(Stage::AppearanceGather, 7.0 * 13.0 + 3.0 * 12.0, 4.0 * (7.0 * 6.0 + 3.0 * 5.0 + 11.0));
}

#[test]
fn finding_counts_pairs_and_samples() {
    expect(Stage::March, 3.0 * 11.0, 3.0 * 16.0);
    // 3 samples in 2 scales: 9 words each, and 8 a sample.
    expect(Stage::Neighbors, 9.0 * 25.0 + 6.0 * 7.0, 4.0 * (9.0 * 10.0 + 6.0 * 9.0 + 3.0 * 8.0));
}

#[test]
fn products_count_two_a_weight() {
    expect(Stage::AppearanceMatrices, 2.0 * 2.0 * 4.0, 4.0 * (4.0 + 2.0));
    // 2·15·4 + 2·4·3 = 144, biases and rectifiers 2·(4 + 3), sigmoids 3·12.
    expect(Stage::Decoder, 144.0 + 14.0 + 36.0, 4.0 * (15.0 + 4.0 + 4.0 + 3.0));
    // Weights 144, biases 7, inputs 2·9·4 + 2·4·3 = 96.
    expect(Stage::DecoderBackward, 144.0 + 7.0 + 96.0, 4.0 * (15.0 + 8.0 + 9.0 + 4.0 + 6.0 + 4.0));
    expect(Stage::AppearanceMatricesBackward, 4.0 * 2.0 * 4.0, 4.0 * (4.0 + 8.0));
}

#[test]
fn encoding_counts_elements() {
    // Two features of one frequency; one direction.
    expect(Stage::Encoding, 2.0 * 30.0 + 3.0 * 30.0, 4.0 * 15.0);
    expect(Stage::EncodingBackward, 2.0 * 5.0, 4.0 * 2.0 * 6.0);
    let two = FieldShape { frequencies: [2, 2], ..shape() };
    assert_eq!(two.cost(Stage::Encoding, &work(), 1).flop, 2.0 * 34.0 + 3.0 * 34.0);
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
    assert_eq!(more(Stage::Composite), [2.0 * (4.0 * 2.0 + 2.0), 4.0 * (8.0 + 4.0)]);
    assert_eq!(more(Stage::CompositeBackward), [2.0 * (4.0 * 3.0 + 4.0), 4.0 * (8.0 + 2.0 * 4.0)]);
    assert_eq!(more(Stage::Decoder), [0.0, 0.0]);
}

#[test]
fn colors_of_samples_own_cost_a_product_and_a_sigmoid_each() {
    let more = |stage| more_of(DecoderMode::Residual, DecoderMode::PerRay, stage);
    // Two terms instead of one; 3 features of 4 components of two samples.
    assert_eq!(more(Stage::Composite), [6.0, 4.0 * 4.0]);
    assert_eq!(more(Stage::AppearanceMatrices), [2.0 * 3.0 * 2.0 * 4.0, 4.0 * 2.0 * (4.0 + 3.0)]);
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
