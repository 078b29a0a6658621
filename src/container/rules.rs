//! RULES: the rules of the field and the march, the bounds that rays march through, the number of scales, the sky
//! (spec 3.2).

use std::fmt::Display;

use glam::DVec3;

use super::error::Error;
use super::limits;
use super::payload::Payload;
use super::record::{self, BorrowDecode, Encode, Record};
use crate::geometry::{Aabb, Contraction};
use crate::model::{Aggregation, Coverage, Reduction, Rules, Scene, Sky};

#[derive(Encode, BorrowDecode)]
struct RulesRecord {
    scales: u16,
    coverage: u8,
    aggregation: u8,
    density_reduction: u8,
    appearance_reduction: u8,
    contraction: u8,
    /// 0 without a sky. Its coefficients follow the record.
    sky_degree: u8,
    bounds_min: [f64; 3],
    bounds_max: [f64; 3],
    density_shift: f64,
    distance_scale: f64,
    step: f64,
    min_transmittance: f64,
    min_weight: f64,
    /// b of the contraction; all bits 0 if nothing is contracted.
    contracted_length: f64,
}

impl Record for RulesRecord {
    fn check(&self, place: &dyn Display) -> Result<(), Error> {
        limits::check(format!("{place} scales"), limits::SCALES, self.scales)
    }
}

pub(super) fn write(scene: &Scene) -> Result<Vec<u8>, Error> {
    let rules = &scene.rules;
    let reduction_code = |reduction| match reduction {
        Reduction::Sum => 0,
        Reduction::Mean => 1,
    };
    let record = RulesRecord {
        scales: scene.scales.len().try_into().unwrap_or(u16::MAX),
        coverage: match rules.coverage {
            Coverage::All => 0,
            Coverage::Any => 1,
        },
        aggregation: match rules.aggregation {
            Aggregation::Normalized => 0,
            Aggregation::Clamped => 1,
        },
        density_reduction: reduction_code(rules.density_reduction),
        appearance_reduction: reduction_code(rules.appearance_reduction),
        contraction: rules.contraction.is_some().into(),
        sky_degree: rules.sky.as_ref().map_or(0, |sky| sky.degree as u8),
        bounds_min: scene.bounds.min.to_array(),
        bounds_max: scene.bounds.max.to_array(),
        density_shift: rules.density_shift,
        distance_scale: rules.distance_scale,
        step: rules.step,
        min_transmittance: rules.min_transmittance,
        min_weight: rules.min_weight,
        contracted_length: rules.contraction.map_or(0.0, |contraction| contraction.shell),
    };
    let mut bytes = record::write(&"RULES", &record)?;
    let coefficients = rules.sky.iter().flat_map(|sky| &sky.coefficients);
    bytes.extend(coefficients.flat_map(|c| c.to_le_bytes()));
    Ok(bytes)
}

/// The sky of this degree with the coefficients in `bytes`.
fn read_sky(degree: u8, bytes: &[u8]) -> Result<Option<Sky>, Error> {
    let terms = match u32::from(degree) {
        0 => 0,
        degree @ 1..=Sky::MAX_DEGREE => Sky::terms(degree),
        degree => return Err(Error::unsupported("RULES sky", format!("code {degree}"))),
    };
    Error::unless_equal("RULES number of bytes of the sky", 12 * terms, bytes.len())?;
    let coefficients = bytes.as_chunks().0.iter().map(|b| f32::from_le_bytes(*b)).collect();
    Ok((degree > 0).then_some(Sky { degree: degree.into(), coefficients }))
}

/// Rules, bounds, and the number of scales.
pub(super) fn read(payload: &Payload<'_>) -> Result<(Rules, Aabb, u16), Error> {
    let (record, tail): (RulesRecord, _) = payload.record_and_tail()?;
    let unknown = |what: &str, code: u8| Error::unsupported(format!("RULES {what}"), format!("code {code}"));
    let reduction = |what, code| match code {
        0 => Ok(Reduction::Sum),
        1 => Ok(Reduction::Mean),
        code => Err(unknown(what, code)),
    };
    let contraction = match record.contraction {
        0 => {
            Error::unless_equal("RULES contracted length", 0, record.contracted_length.to_bits())?;
            None
        }
        1 => Some(Contraction { shell: record.contracted_length }),
        code => return Err(unknown("contraction", code)),
    };
    let rules = Rules {
        coverage: match record.coverage {
            0 => Coverage::All,
            1 => Coverage::Any,
            code => return Err(unknown("coverage", code)),
        },
        aggregation: match record.aggregation {
            0 => Aggregation::Normalized,
            1 => Aggregation::Clamped,
            code => return Err(unknown("aggregation", code)),
        },
        density_reduction: reduction("density reduction", record.density_reduction)?,
        appearance_reduction: reduction("appearance reduction", record.appearance_reduction)?,
        density_shift: record.density_shift,
        distance_scale: record.distance_scale,
        step: record.step,
        min_transmittance: record.min_transmittance,
        min_weight: record.min_weight,
        contraction,
        sky: read_sky(record.sky_degree, tail)?,
    };
    let bounds = Aabb { min: DVec3::from_array(record.bounds_min), max: DVec3::from_array(record.bounds_max) };
    Ok((rules, bounds, record.scales))
}
