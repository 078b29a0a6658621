//! PROVENANCE: what made the scene, for people.

use super::payload::Payload;
use super::{Error, records};
use crate::model::Provenance;

pub(super) fn write(provenance: &Provenance) -> Result<Vec<u8>, Error> {
    let record = records::Provenance {
        steps: provenance.steps,
        seed: provenance.seed,
        dataset: &provenance.dataset,
        preset: &provenance.preset,
        tool: &provenance.tool,
    };
    records::write(&"PROVENANCE", &record)
}

pub(super) fn read(payload: &Payload<'_>) -> Result<Provenance, Error> {
    let record: records::Provenance<'_> = payload.record()?;
    Ok(Provenance {
        dataset: record.dataset.into(),
        preset: record.preset.into(),
        steps: record.steps,
        seed: record.seed,
        tool: record.tool.into(),
    })
}
