//! DECODER: the MLP, its mode and its positional encodings (spec 3.5).

use std::fmt::Display;

use super::array::{self, ArrayHead};
use super::encoding::ArrayOptions;
use super::error::Error;
use super::limits::{self, Budget};
use super::payload::Payload;
use super::record::{self, BorrowDecode, Encode, Record};
use super::section::SectionKind;
use super::writer::{Place, Writer};
use crate::model::{Decoder, DecoderMode, Linear};

#[derive(Encode, BorrowDecode)]
struct DecoderRecord {
    mode: u8,
    feature_frequencies: u32,
    direction_frequencies: u32,
    layers: Vec<LayerRecord>,
    head: ArrayHead,
}

impl Record for DecoderRecord {
    fn check(&self, place: &dyn Display) -> Result<(), Error> {
        limits::check(format!("{place} feature frequencies"), limits::FREQUENCIES, self.feature_frequencies)?;
        limits::check(format!("{place} direction frequencies"), limits::FREQUENCIES, self.direction_frequencies)?;
        limits::check(format!("{place} layers"), limits::LAYERS, self.layers.len())?;
        for (i, layer) in self.layers.iter().enumerate() {
            limits::check(format!("{place} layer {i} inputs"), limits::LAYER_WIDTH, layer.inputs)?;
            limits::check(format!("{place} layer {i} outputs"), limits::LAYER_WIDTH, layer.outputs)?;
        }
        Ok(())
    }
}

/// The shape of a layer.
#[derive(Clone, Copy, Encode, BorrowDecode)]
struct LayerRecord {
    inputs: u32,
    outputs: u32,
}

pub(super) fn write(writer: &mut Writer, decoder: &Decoder, options: (ArrayOptions, &[u8])) -> Result<(), Error> {
    let layers: Vec<_> = decoder.layers.iter().map(|l| LayerRecord { inputs: l.inputs, outputs: l.outputs }).collect();
    let numbers: Vec<f32> = decoder.layers.iter().flat_map(|l| l.weights.iter().chain(&l.bias)).copied().collect();
    let place = Place::whole(SectionKind::Decoder);
    array::write_network(writer, place, &"DECODER", &numbers, group_lengths(&layers), options, |head| {
        let record = DecoderRecord {
            mode: match decoder.mode {
                DecoderMode::PerSample => 0,
                DecoderMode::PerRay => 1,
                DecoderMode::Residual => 2,
            },
            feature_frequencies: decoder.feature_frequencies,
            direction_frequencies: decoder.direction_frequencies,
            layers: layers.clone(),
            head,
        };
        record::write(&"DECODER", &record)
    })
}

/// The decoder, and the encoding and step codes of its numbers.
pub(super) fn read(payload: &Payload<'_>, budget: &mut Budget) -> Result<(Decoder, ArrayOptions, Vec<u8>), Error> {
    let (record, body): (DecoderRecord, _) = payload.record_and_body()?;
    let (numbers, steps) = array::read_network(&body, &record.head, group_lengths(&record.layers), budget)?;
    let mut rest = numbers.as_slice();
    let mut take = |count: usize| {
        let (values, after) = rest.split_at(count);
        rest = after;
        values.to_vec()
    };
    let layers = (record.layers.iter())
        .map(|&LayerRecord { inputs, outputs }| Linear {
            inputs,
            outputs,
            weights: take(inputs as usize * outputs as usize),
            bias: take(outputs as usize),
        })
        .collect();
    let decoder = Decoder {
        mode: match record.mode {
            0 => DecoderMode::PerSample,
            1 => DecoderMode::PerRay,
            2 => DecoderMode::Residual,
            code => return Err(Error::unsupported("DECODER mode", format!("code {code}"))),
        },
        feature_frequencies: record.feature_frequencies,
        direction_frequencies: record.direction_frequencies,
        layers,
    };
    Ok((decoder, record.head.options(payload.section)?, steps))
}

/// The lengths of the array's groups: each row of weights, then the bias, layer by layer.
fn group_lengths(layers: &[LayerRecord]) -> impl Iterator<Item = usize> + Clone {
    layers.iter().flat_map(|l| {
        std::iter::repeat_n(l.inputs as usize, l.outputs as usize).chain(std::iter::once(l.outputs as usize))
    })
}
