//! PROVENANCE: where the scene came from, for people (spec 3.4).

use std::fmt::Display;

use super::error::Error;
use super::limits;
use super::payload::Payload;
use super::record::{self, BorrowDecode, Encode, Record};
use crate::model::Provenance;

#[derive(Encode, BorrowDecode)]
struct ProvenanceRecord<'a> {
    steps: u64,
    seed: u64,
    dataset: &'a str,
    preset: &'a str,
    tool: &'a str,
}

impl Record for ProvenanceRecord<'_> {
    fn check(&self, place: &dyn Display) -> Result<(), Error> {
        for (name, string) in [("dataset", self.dataset), ("preset", self.preset), ("tool", self.tool)] {
            limits::check(format!("{place} {name} bytes"), limits::STRING_BYTES, string.len())?;
        }
        Ok(())
    }
}

pub(super) fn write(provenance: &Provenance) -> Result<Vec<u8>, Error> {
    let record = ProvenanceRecord {
        steps: provenance.steps,
        seed: provenance.seed,
        dataset: &provenance.dataset,
        preset: &provenance.preset,
        tool: &provenance.tool,
    };
    record::write(&"PROVENANCE", &record)
}

pub(super) fn read(payload: &Payload<'_>) -> Result<Provenance, Error> {
    let record: ProvenanceRecord<'_> = payload.record()?;
    Ok(Provenance {
        dataset: record.dataset.into(),
        preset: record.preset.into(),
        steps: record.steps,
        seed: record.seed,
        tool: record.tool.into(),
    })
}
