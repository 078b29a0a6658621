//! PREFIX: the correction of a scene of the first scales alone (spec 3.11).

use std::fmt::Display;

use super::array::{self, ArrayHead};
use super::encoding::ArrayOptions;
use super::error::Error;
use super::limits::{self, Budget};
use super::payload::Payload;
use super::record::{self, BorrowDecode, Encode, Record};
use super::section::SectionKind;
use super::writer::{SectionPlace, Writer};
use crate::digits::number;
use crate::model::Scene;

/// The correction that makes up for missing scales (spec 3.11).
#[derive(Clone, Debug, PartialEq)]
pub struct Prefix {
    /// g: the density feature f becomes g·f + o.
    pub gain: f64,
    /// o.
    pub offset: f64,
    /// P, the length of the appearance feature vector.
    pub features: u32,
    /// \[scale\] the appearance matrices, \[P\]\[R\] each, that replace those of the scales.
    pub matrices: Vec<Vec<f32>>,
}

impl Prefix {
    /// This correction for a scene to which `applied` was applied, of at least as many scales.
    pub fn after(&self, applied: &Self) -> Self {
        let (gain, offset) = (self.gain / applied.gain, self.offset - applied.offset);
        Self { gain, offset, ..self.clone() }
    }

    /// Corrects `scene`, which must have as many scales as this has matrices.
    pub fn apply(&self, scene: &mut Scene) {
        scene.rules.density_shift += self.offset;
        for (scale, matrix) in scene.scales.iter_mut().zip(&self.matrices) {
            scale.appearance_matrix.weights.clone_from(matrix);
            // Density is linear in each factor of a component.
            let resolution = scale.cloud.resolution;
            for block in &mut scale.factors.density {
                let first = block.form.factors(resolution).first().map_or(0, |rows| rows.len() * block.rank as usize);
                for tensor in block.values.chunks_exact_mut(block.form.rows(resolution) * block.rank as usize) {
                    // Clamped, as a large gain must not make a factor infinite.
                    let gained = |v: f32| (f64::from(v) * self.gain).clamp(f32::MIN.into(), f32::MAX.into()) as f32;
                    tensor[..first].iter_mut().for_each(|v| *v = gained(*v));
                }
            }
        }
    }
}

/// The first `scales` scales of `scene`, corrected by the file's `prefixes` if they have that number of scales; the
/// whole scene if `scales` is `None` or at least its number of scales.
pub fn first_scales(mut scene: Scene, prefixes: &[Option<Prefix>], scales: Option<u32>) -> Scene {
    if let Some(scales) = scales.map(|n| n as usize).filter(|n| *n < scene.scales.len()) {
        scene.scales.truncate(scales);
        if let Some(Some(prefix)) = scales.checked_sub(1).and_then(|last| prefixes.get(last)) {
            prefix.apply(&mut scene);
        }
    }
    scene
}

#[derive(Encode, BorrowDecode)]
struct PrefixRecord {
    gain: f64,
    offset: f64,
    features: u32,
    rank: u32,
    head: ArrayHead,
}

impl Record for PrefixRecord {
    fn check(&self, place: &dyn Display) -> Result<(), Error> {
        self.head.check(place)?;
        if !(self.gain.is_finite() && self.gain > 0.0 && self.offset.is_finite()) {
            let found = format!("{} and {}", number(self.gain), number(self.offset));
            return Err(Error::invalid(format!("{place} gain and offset"), "a positive and a finite number", found));
        }
        limits::check(format!("{place} features"), limits::FEATURES, self.features)?;
        limits::check(format!("{place} sum of ranks"), limits::RANK_SUM, self.rank)
    }
}

pub(super) fn write(
    writer: &mut Writer,
    scale: u16,
    prefix: &Prefix,
    options: (ArrayOptions, &[u8]),
) -> Result<(), Error> {
    let name = format!("PREFIX of scale {scale}");
    let features = prefix.features as usize;
    let ranks: Vec<usize> = prefix.matrices.iter().map(|m| m.len() / features.max(1)).collect();
    let sum: usize = ranks.iter().sum();
    let mut weights = Vec::with_capacity(features * sum);
    for p in 0..features {
        for (matrix, &rank) in prefix.matrices.iter().zip(&ranks) {
            weights.extend_from_slice(&matrix[p * rank..][..rank]);
        }
    }
    let (place, rows) = (SectionPlace::in_scale(SectionKind::Prefix, scale), std::iter::repeat_n(sum, features));
    array::write_network(writer, place, &name, &weights, rows, options, |head| {
        let &Prefix { gain, offset, features, .. } = prefix;
        record::write(&name, &PrefixRecord { gain, offset, features, rank: sum.try_into().unwrap_or(u32::MAX), head })
    })
}

/// The correction, and the step codes of its rows. `ranks` are the appearance ranks of the scales that it corrects, whose
/// matrices have `features` rows.
pub(super) fn read(
    payload: &Payload<'_>,
    features: u32,
    ranks: &[u32],
    budget: &mut Budget,
) -> Result<(Prefix, Vec<u8>), Error> {
    let name = payload.section;
    let (record, body): (PrefixRecord, _) = payload.record_and_body()?;
    Error::unless_equal(format!("{name} features"), features, record.features)?;
    Error::unless_equal(format!("{name} sum of ranks"), ranks.iter().sum(), record.rank)?;
    let rows = std::iter::repeat_n(record.rank as usize, features as usize);
    let (weights, steps) = array::read_network(&body, &record.head, rows, budget)?;
    if weights.iter().any(|w| !w.is_finite()) {
        return Err(Error::invalid(format!("{name} matrices"), "finite numbers", "another number"));
    }
    let mut first = 0;
    let mut matrices = Vec::with_capacity(ranks.len());
    for &rank in ranks {
        let of_row = |p: usize| weights[p * record.rank as usize + first..][..rank as usize].iter().copied();
        matrices.push((0..features as usize).flat_map(of_row).collect());
        first += rank as usize;
    }
    Ok((Prefix { gain: record.gain, offset: record.offset, features, matrices }, steps))
}
