//! PROVENANCE: where the scene came from, for people (spec 3.4).

use std::fmt::Display;

use super::error::Error;
use super::limits;
use super::payload::Payload;
use super::record::{self, BorrowDecode, Encode, Record, Str};
use crate::model::Provenance;

type Name<'a> = Str<'a, { *limits::STRING_BYTES.end() }>;

#[derive(Encode, BorrowDecode)]
struct ProvenanceRecord<'a> {
    steps: u64,
    seed: u64,
    dataset: Name<'a>,
    preset: Name<'a>,
    tool: Name<'a>,
}

impl Record for ProvenanceRecord<'_> {
    fn check(&self, place: &dyn Display) -> Result<(), Error> {
        for (name, string) in [("dataset", self.dataset), ("preset", self.preset), ("tool", self.tool)] {
            limits::check(format!("{place} {name} bytes"), limits::STRING_BYTES, string.0.len())?;
        }
        Ok(())
    }
}

pub(super) fn write(provenance: &Provenance) -> Result<Vec<u8>, Error> {
    let record = ProvenanceRecord {
        steps: provenance.steps,
        seed: provenance.seed,
        dataset: Str(&provenance.dataset),
        preset: Str(&provenance.preset),
        tool: Str(&provenance.tool),
    };
    record::write(&"PROVENANCE", &record)
}

pub(super) fn read(payload: &Payload<'_>) -> Result<Provenance, Error> {
    let record: ProvenanceRecord<'_> = payload.record()?;
    Ok(Provenance {
        dataset: record.dataset.0.into(),
        preset: record.preset.0.into(),
        steps: record.steps,
        seed: record.seed,
        tool: record.tool.0.into(),
    })
}
