//! DECODER: the MLP, its mode and its positional encodings (spec 3.5).

use std::fmt::Display;

use super::array::{self, ArrayHead};
use super::encoding::ArrayOptions;
use super::error::Error;
use super::limits::{self, Budget};
use super::payload::Payload;
use super::record::{self, BorrowDecode, Encode, List, Record};
use super::section::SectionKind;
use super::writer::{SectionPlace, Writer};
use crate::model::{Decoder, DecoderMode, Linear};

#[derive(Encode, BorrowDecode)]
struct DecoderRecord {
    mode: u8,
    feature_frequencies: u32,
    direction_frequencies: u32,
    layers: List<LayerRecord, { *limits::LAYERS.end() }>,
    head: ArrayHead,
}

impl Record for DecoderRecord {
    fn check(&self, place: &dyn Display) -> Result<(), Error> {
        self.head.check(place)?;
        limits::check(format!("{place} feature frequencies"), limits::FREQUENCIES, self.feature_frequencies)?;
        limits::check(format!("{place} direction frequencies"), limits::FREQUENCIES, self.direction_frequencies)?;
        limits::check(format!("{place} layers"), limits::LAYERS, self.layers.0.len())?;
        for (i, layer) in self.layers.0.iter().enumerate() {
            limits::check(format!("{place} layer {i} inputs"), limits::LAYER_WIDTH, layer.inputs)?;
            limits::check(format!("{place} layer {i} outputs"), limits::LAYER_WIDTH, layer.outputs)?;
        }
        Ok(())
    }
}

fn mode_of(code: u8) -> Result<DecoderMode, Error> {
    match code {
        0 => Ok(DecoderMode::PerSample),
        1 => Ok(DecoderMode::PerRay),
        2 => Ok(DecoderMode::Residual),
        code => Err(Error::unknown_code("DECODER", "mode", code)),
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
    let place = SectionPlace::whole(SectionKind::Decoder);
    array::write_network(writer, place, &"DECODER", &numbers, group_lengths(&layers), options, |head| {
        let record = DecoderRecord {
            mode: match decoder.mode {
                DecoderMode::PerSample => 0,
                DecoderMode::PerRay => 1,
                DecoderMode::Residual => 2,
            },
            feature_frequencies: decoder.feature_frequencies,
            direction_frequencies: decoder.direction_frequencies,
            layers: List(layers.clone()),
            head,
        };
        record::write(&"DECODER", &record)
    })
}

/// The decoder, the encoding and step codes of its numbers, and P, the number of features that it takes.
pub(super) fn read(payload: &Payload<'_>, budget: &mut Budget) -> Result<(Decoder, ArrayOptions, Vec<u8>, u32), Error> {
    payload.section.check_entry()?;
    // Before the number of layers, which may be beyond its limit.
    payload.bytes().first().map_or(Ok(()), |&code| mode_of(code).map(drop))?;
    let (record, body): (DecoderRecord, _) = payload.record_and_body()?;
    let mode = mode_of(record.mode)?;
    let features = features_of(&record, mode)?;
    let (numbers, steps) = array::read_network(&body, &record.head, group_lengths(&record.layers.0), budget)?;
    let mut rest = numbers.as_slice();
    let mut take = |count: usize| {
        let (values, after) = rest.split_at(count);
        rest = after;
        values.to_vec()
    };
    let layers = (record.layers.0.iter())
        .map(|&LayerRecord { inputs, outputs }| Linear {
            inputs,
            outputs,
            weights: take(inputs as usize * outputs as usize),
            bias: take(outputs as usize),
        })
        .collect();
    let decoder = Decoder {
        mode,
        feature_frequencies: record.feature_frequencies,
        direction_frequencies: record.direction_frequencies,
        layers,
    };
    Ok((decoder, record.head.options(payload.section)?, steps, features))
}

/// P, from the widths of the layers, which must fit each other.
fn features_of(record: &DecoderRecord, mode: DecoderMode) -> Result<u32, Error> {
    let layers = &record.layers.0;
    let invalid = |place: String, expected: String, found: u32| Err(Error::invalid(place, expected, found));
    for (n, pair) in layers.windows(2).enumerate() {
        if pair[1].inputs != pair[0].outputs {
            let place = format!("DECODER layer {} inputs", n + 1);
            return invalid(place, pair[0].outputs.to_string(), pair[1].inputs);
        }
    }
    let (Some(first), Some(last)) = (layers.first(), layers.last()) else {
        return invalid("DECODER layers".into(), "at least 1".into(), 0);
    };
    if last.outputs != 3 {
        return invalid("DECODER outputs of the last layer".into(), "3".into(), last.outputs);
    }
    let (direction, of_feature) = (3 * (1 + 2 * record.direction_frequencies), 1 + 2 * record.feature_frequencies);
    let features = first.inputs.checked_sub(direction).filter(|rest| rest % of_feature == 0);
    let features = features.map(|rest| rest / of_feature).filter(|&p| limits::FEATURES.contains(&p.into()));
    let Some(features) = features else {
        let expected = format!("{direction} and a multiple of {of_feature}, for 1 to 256 features");
        return invalid("DECODER layer 0 inputs".into(), expected, first.inputs);
    };
    if features < mode.min_features() {
        let place = format!("DECODER features of the mode {}", mode.name());
        return invalid(place, format!("at least {}", mode.min_features()), features);
    }
    Ok(features)
}

/// The lengths of the array's groups: each row of weights, then the bias, layer by layer.
fn group_lengths(layers: &[LayerRecord]) -> impl Iterator<Item = usize> + Clone {
    layers.iter().flat_map(|l| {
        std::iter::repeat_n(l.inputs as usize, l.outputs as usize).chain(std::iter::once(l.outputs as usize))
    })
}
