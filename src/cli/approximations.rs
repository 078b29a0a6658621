//! Options of every command that renders: approximations that trade exactness for speed.

use std::path::Path;

use super::Error;
use super::error::with_flags;
use super::named_value::one_of;
use super::numbers::{POSITIVE, in_range};
use strivec_field::render::{ParetoFront, QualitySelector, RenderSettings};
use strivec_format::Invalid;
use strivec_format::container::SceneFile;
use strivec_format::model::DecoderMode;

/// Approximations; none by default.
#[derive(Clone, Debug, Default, clap::Args)]
#[command(next_help_heading = "Approximations (none by default)")]
pub(super) struct Approximations {
    /// Multiply the length of march steps, 0.25 to 64 [default: 1]
    #[arg(long, value_name = "FACTOR")]
    step_scale: Option<f64>,
    /// Skip the color of samples whose weight is at most W; the others get their weight [default: the scene's]
    #[arg(long, value_name = "W")]
    min_weight: Option<f64>,
    /// End rays below transmittance T, as if opaque; 0 never ends them early [default: the scene's]
    #[arg(long, value_name = "T")]
    min_transmittance: Option<f64>,
    /// Evaluate the color network in this mode [default: the scene's]
    #[arg(long, value_name = "MODE", value_parser = one_of(DecoderMode::ALL, DecoderMode::name))]
    decoder: Option<DecoderMode>,
    /// Render pictures N times smaller and upsample them bilinearly [default: 1]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=16))]
    divisor: Option<u32>,
    #[command(flatten)]
    quality: QualityArgs,
}

/// Selects render settings that `strivec trade --store` wrote into the file; the options above override them.
#[derive(Clone, Debug, Default, clap::Args)]
#[group(multiple = false)]
struct QualityArgs {
    /// Use the stored render settings of this name: fast, balanced or best
    #[arg(long, value_name = "NAME")]
    quality: Option<String>,
    /// Use the stored settings with the highest PSNR that reach N pictures a second on the machine that measured them
    #[arg(long, value_name = "N", value_parser = in_range(POSITIVE, "a positive number"))]
    min_fps: Option<f64>,
    /// Use the fastest stored settings with a PSNR of at least DB
    #[arg(long, value_name = "DB", value_parser = in_range(POSITIVE, "a positive number"))]
    min_psnr: Option<f64>,
}

impl Approximations {
    /// The render settings for pictures of `size` of `scene_file`, which was read from `path`.
    ///
    /// # Errors
    ///
    /// If the file stores no such settings, or an approximation is out of range for the scene.
    pub(super) fn settings(
        &self,
        scene_file: &SceneFile,
        path: &Path,
        size: [u32; 2],
    ) -> Result<RenderSettings, Error> {
        let mut settings = match self.quality.selector() {
            Some(selector) => stored_settings(&selector, scene_file, path, size)?,
            None => RenderSettings::default(),
        };
        let approximation = &mut settings.approximation;
        approximation.step_scale = self.step_scale.unwrap_or(approximation.step_scale);
        approximation.min_weight = self.min_weight.or(approximation.min_weight);
        approximation.min_transmittance = self.min_transmittance.or(approximation.min_transmittance);
        approximation.decoder = self.decoder.or(approximation.decoder);
        settings.divisor = self.divisor.unwrap_or(settings.divisor);
        settings.approximation.check(&scene_file.scene)?;
        Ok(settings)
    }
}

/// The settings that `scene_file`, which was read from `path`, stores for `selector` and pictures of `size`.
///
/// # Errors
///
/// If the file stores no settings, or none that match.
pub(super) fn stored_settings(
    selector: &QualitySelector,
    scene_file: &SceneFile,
    path: &Path,
    size: [u32; 2],
) -> Result<RenderSettings, Error> {
    let named = |e: Invalid| Error::Usage(format!("{}: {e}", path.display()));
    let front = ParetoFront::from_notes(&scene_file.metadata.notes).ok_or_else(|| {
        let message = "the file stores no render settings; `strivec trade FILE --store` measures and stores them";
        Error::Usage(format!("{}: {message}", path.display()))
    })?;
    Ok(front.map_err(named)?.pick(selector, size).map_err(named)?.settings)
}

impl QualityArgs {
    fn selector(&self) -> Option<QualitySelector> {
        let Self { quality, min_fps, min_psnr } = self;
        let name = quality.clone().map(QualitySelector::Name);
        name.or(min_fps.map(QualitySelector::FramesPerSecond)).or(min_psnr.map(QualitySelector::Psnr))
    }
}

impl From<Invalid> for Error {
    /// Approximations are flags of commands.
    fn from(error: Invalid) -> Self {
        Self::Usage(with_flags(&error))
    }
}
