//! The arguments that trade exactness for speed, of every command that renders.

use std::path::Path;

use clap::builder::{PossibleValuesParser, TypedValueParser};

use super::Error;
use crate::container::SceneFile;
use crate::model::DecoderMode;
use crate::render::{ApproximationError, ParetoError, ParetoFront, QualitySelector, RenderSettings};

/// What may be left out. Nothing is by default.
#[derive(Clone, Debug, Default, clap::Args)]
#[command(next_help_heading = "Approximations (none by default)")]
pub(super) struct Approximations {
    /// Only the N nearest neighbors in each scale
    #[arg(long, value_name = "N")]
    neighbors: Option<u32>,
    /// Only the N coarsest scales
    #[arg(long, value_name = "N")]
    scales: Option<u32>,
    /// Only this share of each tensor's components, the largest
    #[arg(long, value_name = "SHARE")]
    components: Option<f64>,
    /// Steps longer by this factor
    #[arg(long, value_name = "FACTOR")]
    step_scale: Option<f64>,
    /// Only samples that weigh more than W add color [default: the scene's]
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
    /// Pictures rendered N times smaller, and upsample_bilinear
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=16))]
    divisor: Option<u32>,
    #[command(flatten)]
    wish: QualityArgs,
}

/// A point of what `strivec trade --store` wrote into the file; the options above go before it.
#[derive(Clone, Debug, Default, clap::Args)]
#[group(multiple = false)]
struct QualityArgs {
    /// As the file's point of this name: fast, balanced or best
    #[arg(long, value_name = "NAME")]
    quality: Option<String>,
    /// As the file's best point that renders so many pictures a second, on the machine that it was measured on
    #[arg(long, value_name = "N", value_parser = positive)]
    min_fps: Option<f64>,
    /// As the file's fastest point of at least so many dB
    #[arg(long, value_name = "DB", value_parser = positive)]
    min_psnr: Option<f64>,
}

fn positive(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(value) if value > 0.0 && f64::is_finite(value) => Ok(value),
        _ => Err(format!("expected a positive number, found {text:?}")),
    }
}

impl Approximations {
    /// As the renderer takes them, for pictures of `size` of the document in the file `path`.
    ///
    /// Fails where a point is wished for that the file has not.
    pub(super) fn chosen(&self, document: &SceneFile, path: &Path, size: [u32; 2]) -> Result<RenderSettings, Error> {
        let mut choice = match self.wish.wish() {
            Some(wish) => granted(&wish, document, path, size)?,
            None => RenderSettings::default(),
        };
        let approximation = &mut choice.approximation;
        approximation.neighbors = self.neighbors.or(approximation.neighbors);
        approximation.scales = self.scales.or(approximation.scales);
        approximation.components = self.components.or(approximation.components);
        approximation.step_scale = self.step_scale.unwrap_or(approximation.step_scale);
        approximation.min_weight = self.min_weight.or(approximation.min_weight);
        approximation.min_transmittance = self.min_transmittance.or(approximation.min_transmittance);
        approximation.decoder = self.decoder.or(approximation.decoder);
        approximation.density_cache = self.density_cache.or(approximation.density_cache);
        choice.divisor = self.divisor.unwrap_or(choice.divisor);
        choice.approximation.check(&document.scene)?;
        Ok(choice)
    }
}

/// What `wish` means for pictures of `size` of the document in the file `path`.
///
/// Fails where the file has nothing of the kind.
pub(super) fn granted(
    wish: &QualitySelector,
    document: &SceneFile,
    path: &Path,
    size: [u32; 2],
) -> Result<RenderSettings, Error> {
    let named = |e: ParetoError| Error::Usage(format!("{}: {e}", path.display()));
    let trade = ParetoFront::from_notes(&document.metadata.notes).ok_or_else(|| {
        let message = "expected what `strivec trade --store` writes, found no such note";
        Error::Usage(format!("{}: {message}", path.display()))
    })?;
    Ok(trade.map_err(named)?.pick(wish, size).map_err(named)?.choice)
}

impl QualityArgs {
    fn wish(&self) -> Option<QualitySelector> {
        let Self { quality, min_fps, min_psnr } = self;
        let name = quality.clone().map(QualitySelector::Name);
        name.or(min_fps.map(QualitySelector::FramesPerSecond)).or(min_psnr.map(QualitySelector::Psnr))
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
