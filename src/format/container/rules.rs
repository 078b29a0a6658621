//! RULES: the rules of the field and the march, the bounds that rays march through, the number of scales, the sky
//! (spec 3.2).

use std::fmt::Display;

use glam::DVec3;

use super::error::Error;
use super::limits;
use super::payload::Payload;
use super::record::{self, BorrowDecode, Encode, Record};
use crate::digits::number;
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
        for (field, code, most) in [
            ("coverage", self.coverage, 1),
            ("aggregation", self.aggregation, 1),
            ("density reduction", self.density_reduction, 1),
            ("appearance reduction", self.appearance_reduction, 1),
            ("contraction", self.contraction, 1),
            ("sky", self.sky_degree, Sky::MAX_DEGREE as u8),
        ] {
            if code > most {
                return Err(Error::unknown_code(place, field, code));
            }
        }
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
    let terms = if degree == 0 { 0 } else { Sky::terms(degree.into()) };
    Error::unless_equal("RULES number of bytes of the sky", 12 * terms, bytes.len())?;
    let coefficients = bytes.as_chunks().0.iter().map(|b| f32::from_le_bytes(*b)).collect();
    Ok((degree > 0).then_some(Sky { degree: degree.into(), coefficients }))
}

/// Rules, bounds, and the number of scales.
pub(super) fn read(payload: &Payload<'_>) -> Result<(Rules, Aabb, u16), Error> {
    let (record, tail): (RulesRecord, _) = payload.record_and_tail()?;
    // No code is above 1: the record was checked.
    let reduction = |code| if code == 0 { Reduction::Sum } else { Reduction::Mean };
    let contraction = match record.contraction {
        0 => {
            if record.contracted_length.to_bits() != 0 {
                let found = number(record.contracted_length);
                return Err(Error::malformed("RULES shell of the contraction", "0 without a contraction", found));
            }
            None
        }
        _ => Some(Contraction { shell: record.contracted_length }),
    };
    let rules = Rules {
        coverage: if record.coverage == 0 { Coverage::All } else { Coverage::Any },
        aggregation: if record.aggregation == 0 { Aggregation::Normalized } else { Aggregation::Clamped },
        density_reduction: reduction(record.density_reduction),
        appearance_reduction: reduction(record.appearance_reduction),
        density_shift: record.density_shift,
        distance_scale: record.distance_scale,
        step: record.step,
        min_transmittance: record.min_transmittance,
        min_weight: record.min_weight,
        contraction,
        sky: read_sky(record.sky_degree, tail)?,
    };
    let bounds = Aabb { min: DVec3::from_array(record.bounds_min), max: DVec3::from_array(record.bounds_max) };
    rules.check(&bounds)?;
    limits::check("RULES steps along the bounds' diagonal", limits::STEPS, rules.most_steps(&bounds).ceil() as u64)?;
    Ok((rules, bounds, record.scales))
}
