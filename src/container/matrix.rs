//! MATRIX: a scale's appearance matrix.

use super::array::{self, ArrayOptions};
use super::limits::Budget;
use super::payload::Payload;
use super::section::SectionKind;
use super::writer::{Place, Writer};
use super::{Error, records};
use crate::model::AppearanceMatrix;

pub(super) fn write(
    writer: &mut Writer,
    scale: u16,
    matrix: &AppearanceMatrix,
    options: ArrayOptions,
) -> Result<(), Error> {
    let name = format!("MATRIX of scale {scale}");
    let rows = std::iter::repeat_n(matrix.rank as usize, matrix.features as usize);
    let written = array::write(&name, &matrix.weights, rows, options, None)?;
    let record = records::Matrix { features: matrix.features, rank: matrix.rank, head: written.head };
    writer.compressed(Place::of_scale(SectionKind::Matrix, scale), records::write(&name, &record)?, &written.body)
}

pub(super) fn read(payload: &Payload<'_>, budget: &mut Budget) -> Result<AppearanceMatrix, Error> {
    let (record, body): (records::Matrix, _) = payload.record_and_body()?;
    let rows = std::iter::repeat_n(record.rank as usize, record.features as usize);
    let weights = array::read_body(&body, &record.head, rows, budget)?;
    Ok(AppearanceMatrix { features: record.features, rank: record.rank, weights })
}
