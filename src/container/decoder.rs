//! DECODER: the MLP, its mode and its positional encodings.

use super::array::{self, ArrayOptions};
use super::limits::Budget;
use super::payload::Payload;
use super::section::SectionKind;
use super::writer::{Place, Writer};
use super::{Error, records};
use crate::model::{Decoder, DecoderMode, Linear};

pub(super) fn write(writer: &mut Writer, decoder: &Decoder, options: ArrayOptions) -> Result<(), Error> {
    let layers: Vec<_> =
        decoder.layers.iter().map(|l| records::Layer { inputs: l.inputs, outputs: l.outputs }).collect();
    let numbers: Vec<f32> = decoder.layers.iter().flat_map(|l| l.weights.iter().chain(&l.bias)).copied().collect();
    let written = array::write(&"DECODER", &numbers, group_lengths(&layers), options, None)?;
    let record = records::Decoder {
        mode: match decoder.mode {
            DecoderMode::PerSample => 0,
            DecoderMode::PerRay => 1,
            DecoderMode::Residual => 2,
        },
        feature_frequencies: decoder.feature_frequencies,
        direction_frequencies: decoder.direction_frequencies,
        layers,
        head: written.head,
    };
    writer.compressed(Place::of(SectionKind::Decoder), records::write(&"DECODER", &record)?, &written.body)
}

pub(super) fn read(payload: &Payload<'_>, budget: &mut Budget) -> Result<Decoder, Error> {
    let (record, body): (records::Decoder, _) = payload.record_and_body()?;
    let numbers = array::read_body(&body, &record.head, group_lengths(&record.layers), budget)?;
    let mut rest = numbers.as_slice();
    let mut take = |count: usize| {
        let (values, after) = rest.split_at(count);
        rest = after;
        values.to_vec()
    };
    let layers = (record.layers.iter())
        .map(|&records::Layer { inputs, outputs }| Linear {
            inputs,
            outputs,
            weights: take(inputs as usize * outputs as usize),
            bias: take(outputs as usize),
        })
        .collect();
    Ok(Decoder {
        mode: match record.mode {
            0 => DecoderMode::PerSample,
            1 => DecoderMode::PerRay,
            2 => DecoderMode::Residual,
            code => return Err(Error::unsupported("DECODER mode", format!("code {code}"))),
        },
        feature_frequencies: record.feature_frequencies,
        direction_frequencies: record.direction_frequencies,
        layers,
    })
}

/// A row of weights is a group, and so is a layer's bias.
fn group_lengths(layers: &[records::Layer]) -> impl Iterator<Item = usize> + Clone {
    layers.iter().flat_map(|l| {
        std::iter::repeat_n(l.inputs as usize, l.outputs as usize).chain(std::iter::once(l.outputs as usize))
    })
}
