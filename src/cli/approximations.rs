//! The arguments that trade exactness for speed, of every command that renders.

use clap::builder::{PossibleValuesParser, TypedValueParser};

use super::Error;
use crate::model::DecoderMode;
use crate::render::{Approximation, ApproximationError};

/// What may be left out. Nothing is by default.
#[derive(Clone, Debug, Default, clap::Args)]
#[command(next_help_heading = "Approximations (none by default)")]
pub(super) struct Approximations {
    /// Only the N nearest neighbours in each scale
    #[arg(long, value_name = "N")]
    neighbours: Option<u32>,
    /// Only the N coarsest scales
    #[arg(long, value_name = "N")]
    scales: Option<u32>,
    /// Steps longer by this factor
    #[arg(long, value_name = "FACTOR")]
    step_scale: Option<f64>,
    /// Only samples that weigh more than W add colour [default: the scene's]
    #[arg(long, value_name = "W")]
    min_weight: Option<f64>,
    /// Rays end where less than T of their light is left [default: the scene's]
    #[arg(long, value_name = "T")]
    min_transmittance: Option<f64>,
    /// Where the network is called, if not where the scene was trained with it
    #[arg(long, value_name = "MODE", value_parser = decoder_mode())]
    decoder: Option<DecoderMode>,
    /// Density baked on a grid of N cells along the longest edge; its memory is in --json
    #[arg(long, value_name = "N")]
    density_cache: Option<u32>,
}

impl Approximations {
    /// As the renderer takes them.
    pub(super) fn chosen(&self) -> Approximation {
        Approximation {
            neighbours: self.neighbours,
            scales: self.scales,
            step_scale: self.step_scale.unwrap_or(1.0),
            min_weight: self.min_weight,
            min_transmittance: self.min_transmittance,
            decoder: self.decoder,
            density_cache: self.density_cache,
        }
    }
}

/// Reads a mode's name.
fn decoder_mode() -> impl TypedValueParser<Value = DecoderMode> {
    let of_name = |name: String| DecoderMode::ALL.into_iter().find(|mode| mode.name() == name);
    PossibleValuesParser::new(DecoderMode::ALL.map(DecoderMode::name)).map(move |name| of_name(name).expect("a name"))
}

impl From<ApproximationError> for Error {
    fn from(error: ApproximationError) -> Self {
        let ApproximationError { option, expected, found } = error;
        Self::Usage(format!("--{}: expected {expected}, found {found}", option.replace('_', "-")))
    }
}
