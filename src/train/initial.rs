//! The scene that training starts from.

use super::{ConfigError, TrainConfig};
use strivec_format::geometry::Aabb;
use strivec_format::model::{
    AppearanceMatrix, Coverage, Decoder, Factors, Frame, Linear, MemoryLimit, Provenance, Scale, Scene, TensorCloud,
};
use strivec_format::random::Random;
use strivec_format::{Invalid, Place};

/// A scene of random factors and networks on `clouds`, coarsest first. Its bounds are the smallest box around the
/// covered points (paper, Implementation), or those of `config`'s contraction. Its sky, if any, has the color of the
/// background.
///
/// # Errors
///
/// If coverage is by all scales and the clouds have no point in common.
pub fn initial_scene(
    config: &TrainConfig,
    clouds: Vec<TensorCloud>,
    frame: Frame,
    dataset: &str,
) -> Result<Scene, ConfigError> {
    let rules = config.rules(&clouds[0]);
    let boxes = clouds.iter().map(TensorCloud::bounds);
    let bounds = match rules.coverage {
        Coverage::All => boxes.reduce(|a, b| a.intersection(&b)),
        Coverage::Any => boxes.reduce(|a, b| a.union(&b)),
    }
    .unwrap_or(Aabb::EMPTY);
    // The bounds of contracted space are those of all space.
    let bounds = rules.contraction.map_or(bounds, |contraction| contraction.bounds());
    if !bounds.is_solid() {
        let place = Place::option("scales");
        let invalid = Invalid::new(place, "scales whose tensors overlap", "scales without a common point");
        return Err(invalid.into());
    }
    let features = config.decoder.features;
    let scales = (config.scales.iter().zip(clouds).enumerate())
        .map(|(s, (scale, cloud))| {
            // A stream for each scale and a number for each index: the start does not depend on threads or on other
            // scales.
            let normal = Random::new(config.seed, "factors").substream(s as u64);
            let [density, appearance] = scale.forms();
            let mut factors = Factors::zeros(cloud.len(), cloud.resolution, [&density, &appearance]);
            for (i, v) in factors.blocks_mut().flat_map(|block| &mut block.values).enumerate() {
                *v = (config.optimizer.factor_deviation * normal.normal(i as u64)) as f32;
            }
            let appearance_rank = scale.appearance_rank;
            let matrix = Random::new(config.seed, "appearance matrix").substream(s as u64);
            Scale {
                cloud,
                top_k: scale.top_k,
                factors,
                appearance_matrix: AppearanceMatrix {
                    features,
                    rank: appearance_rank,
                    weights: uniform(&matrix, appearance_rank, 0, features * appearance_rank),
                },
            }
        })
        .collect();
    let provenance = Provenance {
        dataset: dataset.into(),
        preset: config.preset.name().into(),
        steps: 0,
        seed: config.seed,
        tool: concat!("strivec ", env!("CARGO_PKG_VERSION")).into(),
    };
    let decoder = initial_decoder(config);
    Ok(Scene { frame, bounds, rules, scales, decoder, occupancy: None, provenance, memory: MemoryLimit::NONE })
}

/// PyTorch's default for linear layers: uniform in ±1/√inputs.
fn uniform(stream: &Random, inputs: u32, first: u32, count: u32) -> Vec<f32> {
    let bound = 1.0 / f64::from(inputs.max(1)).sqrt();
    (first..first + count).map(|i| (bound * (2.0 * stream.uniform(u64::from(i)) - 1.0)) as f32).collect()
}

/// The network before the first step.
pub(super) fn initial_decoder(config: &TrainConfig) -> Decoder {
    let shape = &config.decoder;
    let mut decoder = Decoder {
        mode: shape.mode,
        feature_frequencies: shape.feature_frequencies,
        direction_frequencies: shape.direction_frequencies,
        layers: Vec::new(),
    };
    let mut inputs = decoder.input_len(shape.features);
    let widths = shape.hidden.iter().copied().chain([3]);
    for (l, outputs) in widths.enumerate() {
        let stream = Random::new(config.seed, "decoder").substream(l as u64);
        let weights = uniform(&stream, inputs, 0, inputs * outputs);
        let last = l == shape.hidden.len();
        let bias = if last { vec![0.0; 3] } else { uniform(&stream, inputs, inputs * outputs, outputs) };
        decoder.layers.push(Linear { inputs, outputs, weights, bias });
        inputs = outputs;
    }
    decoder
}
