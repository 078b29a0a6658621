//! APPEARANCE: a scale's appearance matrix.

use super::cursor::Payload;
use super::{Error, floats, records};
use crate::model::AppearanceMatrix;

pub(super) fn write(scale: u16, matrix: &AppearanceMatrix) -> Result<Vec<u8>, Error> {
    let record = records::Appearance { features: matrix.features, rank: matrix.rank };
    let mut bytes = records::write(&format!("APPEARANCE of scale {scale}"), &record)?;
    bytes.extend(floats::write(&matrix.weights));
    Ok(bytes)
}

pub(super) fn read(payload: &Payload<'_>) -> Result<AppearanceMatrix, Error> {
    let (record, body): (records::Appearance, _) = records::read(payload.section, payload.stored()?)?;
    let length = 4 * u64::from(record.features) * u64::from(record.rank);
    Error::unless_equal(format!("{} body length", payload.section), length, body.len() as u64)?;
    Ok(AppearanceMatrix { features: record.features, rank: record.rank, weights: floats::read(body) })
}
