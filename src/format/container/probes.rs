//! PROBES: rays and their pixels, with which a reader can check that it computes the right picture (spec 3.16).

use std::fmt::Display;

use glam::DVec3;

use super::error::Error;
use super::limits::{self, Budget};
use super::payload::Payload;
use super::record::{self, BorrowDecode, Encode, Record};
use super::section::SectionKind;
use super::writer::{SectionPlace, Writer};
use crate::digits::{number, numbers};
use crate::geometry::{Aabb, Ray};
use crate::model::Rules;

/// Bytes of a probe.
const PROBE_BYTES: usize = 144;
/// Where the reserved bytes of a probe begin.
const RESERVED: usize = 128;

/// Rays and their pixels, computed in f64 from the numbers after decoding, and how close others must come to them.
#[derive(Clone, Debug, PartialEq)]
pub struct Probes {
    /// Tolerance of colors and opacity, absolute.
    pub color_tolerance: f64,
    /// Tolerance of depth, in model units.
    pub depth_tolerance: f64,
    /// Tolerance of density features, relative to max(1, |f|).
    pub density_tolerance: f64,
    /// Files of this crate have at least 64.
    pub probes: Vec<Probe>,
}

/// A ray with its pixel, and a point with its density feature.
#[derive(Clone, Copy, Debug, PartialEq, Encode, BorrowDecode)]
pub struct Probe {
    /// Origin of the ray, in model units.
    pub origin: [f64; 3],
    /// Direction of the ray; of length 1 within 1e-6.
    pub direction: [f64; 3],
    /// Color of the pixel: red, green, blue.
    pub color: [f64; 3],
    /// Opacity of the pixel: 1 − T.
    pub opacity: f64,
    /// Depth of the pixel, in model units: Σ w·t/Σ w.
    pub depth: f64,
    /// A point of the model, in model units.
    pub point: [f64; 3],
    /// The density feature f at `point`.
    pub density_feature: f64,
    /// The decision margin of the ray and of `point`, in model units (spec 4.10).
    pub margin: f64,
    /// Zeros.
    pub reserved: [u64; 2],
}

impl Probe {
    /// The ray.
    pub fn ray(&self) -> Ray {
        Ray { origin: DVec3::from_array(self.origin), direction: DVec3::from_array(self.direction) }
    }
}

#[derive(Encode, BorrowDecode)]
struct ProbesRecord {
    color_tolerance: f64,
    depth_tolerance: f64,
    density_tolerance: f64,
    count: u64,
}

impl Record for ProbesRecord {
    fn check(&self, place: &dyn Display) -> Result<(), Error> {
        let valid = |v: f64| v > 0.0 && v.is_finite();
        for tolerance in [self.color_tolerance, self.depth_tolerance, self.density_tolerance] {
            if !valid(tolerance) {
                let found = number(tolerance);
                return Err(Error::invalid(format!("{place} tolerance"), "a positive finite number", found));
            }
        }
        Ok(())
    }
}

impl Record for Probe {
    fn check(&self, place: &dyn Display) -> Result<(), Error> {
        for (name, values) in [
            ("origin", &self.origin[..]),
            ("direction", &self.direction),
            ("color", &self.color),
            ("opacity", &[self.opacity]),
            ("depth", &[self.depth]),
            ("point", &self.point),
            ("density feature", &[self.density_feature]),
        ] {
            if values.iter().any(|v| !v.is_finite()) {
                let found = numbers(values.iter().copied());
                return Err(Error::invalid(format!("{place} {name}"), "finite", found));
            }
        }
        let length = self.direction.iter().map(|v| v * v).sum::<f64>().sqrt();
        if (length - 1.0).abs() > 1e-6 {
            return Err(Error::invalid(format!("{place} direction"), "of length 1", number(length)));
        }
        if !(self.margin.is_finite() && self.margin >= 0.0) {
            return Err(Error::invalid(format!("{place} margin"), "a number of at least 0", number(self.margin)));
        }
        Ok(())
    }
}

pub(super) fn write(writer: &mut Writer, probes: &Probes) -> Result<(), Error> {
    limits::check("PROBES probes", limits::ITEMS, probes.probes.len())?;
    let record = ProbesRecord {
        color_tolerance: probes.color_tolerance,
        depth_tolerance: probes.depth_tolerance,
        density_tolerance: probes.density_tolerance,
        count: probes.probes.len() as u64,
    };
    let mut body = Vec::with_capacity(PROBE_BYTES * probes.probes.len());
    for probe in &probes.probes {
        body.extend(record::write(&"PROBES", probe)?);
    }
    writer.stored(SectionPlace::whole(SectionKind::Probes), record::write(&"PROBES", &record)?, &body);
    Ok(())
}

/// Checks that tracing all of `probes` takes a bounded time (spec 5).
pub(super) fn check_steps(probes: &Probes, rules: &Rules, bounds: &Aabb) -> Result<(), Error> {
    let steps = rules.most_steps(bounds).ceil().max(1.0) * probes.probes.len() as f64;
    limits::check("PROBES times the steps on the longest ray", limits::PROBE_STEPS, steps as u64)
}

pub(super) fn read(payload: &Payload<'_>, budget: &mut Budget) -> Result<Probes, Error> {
    let name = payload.section;
    let (record, body): (ProbesRecord, _) = payload.record_and_body()?;
    limits::check(format!("{name} probes"), limits::ITEMS, record.count)?;
    let length = record.count * PROBE_BYTES as u64;
    budget.spend(name, length)?;
    let bytes = body.decode(length, budget)?;
    // Additions of later versions come before other faults.
    for (n, probe) in bytes.chunks_exact(PROBE_BYTES).enumerate() {
        Error::unless_reserved(format!("{name} probe {n}"), &probe[RESERVED..])?;
    }
    let probe =
        |(n, bytes): (usize, _)| -> Result<Probe, Error> { record::read_whole(&format!("{name} probe {n}"), bytes) };
    let probes = bytes.chunks_exact(PROBE_BYTES).enumerate().map(probe).collect::<Result<_, _>>()?;
    Ok(Probes {
        color_tolerance: record.color_tolerance,
        depth_tolerance: record.depth_tolerance,
        density_tolerance: record.density_tolerance,
        probes,
    })
}
