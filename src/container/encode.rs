//! From a scene to bytes.

use super::section::SectionKind;
use super::writer::Writer;
use super::{
    Error, FactorEncoding, appearance, decoder, factors, frame, limits, occupancy, placement, provenance, rules,
};
use crate::model::Scene;

/// Choices of the writer; the same scene with the same choices gives the same bytes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct EncodeOptions {
    /// How factors are written; everything else keeps its precision.
    pub factors: FactorEncoding,
    /// zstd's compression level, 1 to 22; reading is equally fast for all.
    pub zstd_level: i32,
}

impl Default for EncodeOptions {
    /// Half-precision factors at level 9, which writes quickly enough not to be noticed after training.
    fn default() -> Self {
        Self { factors: FactorEncoding::F16, zstd_level: 9 }
    }
}

/// The `.strivec` file of `scene`.
///
/// # Errors
///
/// Where the scene breaks an invariant ([`Scene::check`]) or exceeds a limit of the format ([`limits`]), where a
/// factor does not fit the encoding, or where the options are not valid.
pub fn encode(scene: &Scene, options: &EncodeOptions) -> Result<Vec<u8>, Error> {
    scene.check()?;
    if !(1..=22).contains(&options.zstd_level) {
        return Err(Error::Level { found: options.zstd_level });
    }
    limits::check("scales", limits::SCALES, scene.scales.len())?;
    let mut writer = Writer::new(options.zstd_level);
    writer.stored(SectionKind::Frame, None, frame::write(&scene.frame)?)?;
    writer.stored(SectionKind::Rules, None, rules::write(scene)?)?;
    writer.stored(SectionKind::Provenance, None, provenance::write(&scene.provenance)?)?;
    writer.stored(SectionKind::Decoder, None, decoder::write(&scene.decoder)?)?;
    if let Some(occupancy) = &scene.occupancy {
        occupancy::write(&mut writer, occupancy)?;
    }
    for (index, scale) in (0..).zip(&scene.scales) {
        placement::write(&mut writer, index, scale)?;
        let payload = appearance::write(index, &scale.appearance_matrix)?;
        writer.stored(SectionKind::Appearance, Some(index), payload)?;
        factors::write(&mut writer, index, scale, options.factors)?;
    }
    writer.finish()
}
