//! From a scene to bytes.

use half::f16;

use super::encoding::{ArrayOptions, Encoding, Filter};
use super::error::Error;
use super::metadata::Metadata;
use super::section::SectionKind;
use super::writer::{Finished, Place, Writer};
use super::{
    chunks, decoder, factors, frame, limits, matrix, occupancy, parallel, placement, prefix, provenance, rules, scale,
};
use crate::model::{Factors, Scene};

/// Choices of the writer; the same scene with the same choices gives the same bytes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct EncodeOptions {
    /// How density factors are written, a scale; the last one holds for all further scales.
    pub density: Vec<FactorOptions>,
    /// The same for appearance factors.
    pub appearance: Vec<FactorOptions>,
    /// How matrices and decoder are written.
    pub networks: ArrayOptions,
    /// Tensors of a chunk, at most.
    pub chunk_tensors: usize,
    /// zstd's compression level, 1 to 22, or `None` to compress nothing; reading is equally fast for all.
    pub zstd_level: Option<i32>,
}

/// How some of a scale's factors are written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FactorOptions {
    /// As floats or integers, and in which arrangement.
    pub array: ArrayOptions,
    /// \[tensor\]\[component\] step codes for grids ([`super::step`]); `None` for the finest steps that reach every
    /// number.
    pub steps: Option<Vec<u8>>,
}

impl FactorOptions {
    /// `encoding`, with nothing else chosen.
    pub fn new(encoding: Encoding) -> Self {
        Self { array: ArrayOptions::best(encoding), steps: None }
    }

    /// Drops the step codes of all but the `kept` of a scale's `tensors`.
    pub fn keep_tensors(&mut self, kept: &[usize], tensors: usize) {
        if let Some(steps) = &mut self.steps {
            let of_tensor = steps.len() / tensors.max(1);
            *steps = kept.iter().flat_map(|n| &steps[n * of_tensor..][..of_tensor]).copied().collect();
        }
    }
}

impl EncodeOptions {
    /// All factors in `encoding`.
    pub fn uniform(encoding: Encoding) -> Self {
        let factors = vec![FactorOptions::new(encoding)];
        Self { density: factors.clone(), appearance: factors, ..Self::default() }
    }

    /// Floats: 16 bits where that loses nothing of `scene`, else 32 bits.
    pub fn lossless(scene: &Scene) -> Self {
        let factors = scene.scales.iter().flat_map(|scale| [&scale.factors.density, &scale.factors.appearance]);
        let is_half = |value: &f32| f16::from_f32(*value).to_f32().to_bits() == value.to_bits();
        Self::uniform(if factors.flatten().all(is_half) { Encoding::F16 } else { Encoding::F32 })
    }
}

impl Default for EncodeOptions {
    /// Half-precision factors at level 9, which writes quickly enough not to be noticed after training.
    fn default() -> Self {
        let factors = vec![FactorOptions::new(Encoding::F16)];
        Self {
            density: factors.clone(),
            appearance: factors,
            networks: ArrayOptions { encoding: Encoding::F32, filter: Filter::None },
            chunk_tensors: 1024,
            zstd_level: Some(9),
        }
    }
}

/// The `.strivec` file of `scene` and nothing else.
///
/// # Errors
///
/// As for [`encode_scene_file`].
pub fn encode(scene: &Scene, options: &EncodeOptions) -> Result<Vec<u8>, Error> {
    encode_scene_file(scene, &Metadata::default(), options)
}

/// The `.strivec` file of `scene` and `metadata`.
///
/// # Errors
///
/// Where the scene breaks an invariant ([`Scene::check`]) or exceeds a limit of the format ([`limits`]), where a
/// number does not fit the encoding, or where the options are not valid.
pub fn encode_scene_file(scene: &Scene, metadata: &Metadata, options: &EncodeOptions) -> Result<Vec<u8>, Error> {
    scene.check()?;
    if let Some(level) = options.zstd_level
        && !(1..=22).contains(&level)
    {
        return Err(Error::Level { found: level });
    }
    limits::check("scales", limits::SCALES, scene.scales.len())?;
    let mut writer = Writer::new(options.zstd_level);
    writer.record(Place::whole(SectionKind::Frame), frame::write(&scene.frame)?);
    writer.record(Place::whole(SectionKind::Rules), rules::write(scene)?);
    writer.record(Place::whole(SectionKind::Provenance), provenance::write(&scene.provenance)?);
    metadata.write_head(&mut writer, scene.scales.len())?;
    decoder::write(&mut writer, &scene.decoder, options.networks)?;
    if let Some(occupancy) = &scene.occupancy {
        occupancy::write(&mut writer, occupancy)?;
    }
    for s in 0..scene.scales.len() {
        write_scale(&mut writer, scene, s, options)?;
        if let Some(Some(correction)) = metadata.prefixes.get(s).filter(|_| s + 1 < scene.scales.len()) {
            prefix::write(&mut writer, s as u16, correction, options.networks)?;
        }
    }
    metadata.write_tail(&mut writer)?;
    writer.finish()
}

/// Writes the sections of scale `s`, but PREFIX.
fn write_scale(writer: &mut Writer, scene: &Scene, s: usize, options: &EncodeOptions) -> Result<(), Error> {
    let (scale, index) = (&scene.scales[s], s as u16);
    let chunks = chunks::chunks_of(&scale.cloud, options.chunk_tensors);
    scale::write(writer, index, scale, &chunks)?;
    matrix::write(writer, index, &scale.appearance_matrix, options.networks)?;
    let of_chunk = |(chunk, tensors): (u32, &Vec<u32>)| -> Result<[Finished; 3], Error> {
        let write = |kind, values, rank: u32, of_scales: &[FactorOptions]| {
            let no_options =
                || Error::malformed("`EncodeOptions::density` and `appearance`", "at least one entry each", "none");
            let factors = of_scales.get(s).or(of_scales.last()).ok_or_else(no_options)?;
            let part = factors::Part { values, rank: rank as usize, resolution: scale.cloud.resolution };
            let place = Place::in_chunk(kind, index, chunk);
            factors::write(writer, place, &part, tensors, factors.array, factors.steps.as_deref())
        };
        let Factors { density, appearance, density_rank, appearance_rank, .. } = &scale.factors;
        Ok([
            placement::write(writer, index, chunk, &scale.cloud, tensors)?,
            write(SectionKind::Density, density, *density_rank, &options.density)?,
            write(SectionKind::Appearance, appearance, *appearance_rank, &options.appearance)?,
        ])
    };
    let finished = parallel::map((0..).zip(&chunks).collect(), of_chunk);
    for sections in finished {
        sections?.into_iter().for_each(|section| writer.add(section));
    }
    Ok(())
}
