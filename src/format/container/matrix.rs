//! MATRIX: a scale's appearance matrix (spec 3.8).

use std::fmt::Display;

use super::array::{self, ArrayHead};
use super::encoding::ArrayOptions;
use super::error::Error;
use super::limits::{self, Budget};
use super::payload::Payload;
use super::record::{self, BorrowDecode, Encode, Record};
use super::section::SectionKind;
use super::writer::{SectionPlace, Writer};
use crate::model::AppearanceMatrix;

#[derive(Encode, BorrowDecode)]
struct MatrixRecord {
    features: u32,
    rank: u32,
    head: ArrayHead,
}

impl Record for MatrixRecord {
    fn check(&self, place: &dyn Display) -> Result<(), Error> {
        self.head.check(place)?;
        limits::check(format!("{place} features"), limits::FEATURES, self.features)?;
        limits::check(format!("{place} rank"), limits::RANK, self.rank)
    }
}

pub(super) fn write(
    writer: &mut Writer,
    scale: u16,
    matrix: &AppearanceMatrix,
    options: (ArrayOptions, &[u8]),
) -> Result<(), Error> {
    let name = format!("MATRIX of scale {scale}");
    let rows = std::iter::repeat_n(matrix.rank as usize, matrix.features as usize);
    let place = SectionPlace::in_scale(SectionKind::Matrix, scale);
    array::write_network(writer, place, &name, &matrix.weights, rows, options, |head| {
        record::write(&name, &MatrixRecord { features: matrix.features, rank: matrix.rank, head })
    })
}

/// The matrix of a scale of this appearance `rank`, for a decoder of so many `features`, and the step codes of its rows.
pub(super) fn read(
    payload: &Payload<'_>,
    features: u32,
    rank: u32,
    budget: &mut Budget,
) -> Result<(AppearanceMatrix, Vec<u8>), Error> {
    let name = payload.section;
    let (record, body): (MatrixRecord, _) = payload.record_and_body()?;
    if record.features != features {
        let expected = format!("{features}, as the decoder's inputs say");
        return Err(Error::invalid(format!("{name} features"), expected, record.features));
    }
    Error::unless_equal(format!("{name} rank"), rank, record.rank)?;
    let rows = std::iter::repeat_n(record.rank as usize, record.features as usize);
    let (weights, steps) = array::read_network(&body, &record.head, rows, budget)?;
    Ok((AppearanceMatrix { features: record.features, rank: record.rank, weights }, steps))
}
