//! DECODER: the MLP, its mode and its positional encodings.

use super::cursor::Payload;
use super::{Error, floats, records};
use crate::model::{Decoder, DecoderMode, Linear};

pub(super) fn write(decoder: &Decoder) -> Result<Vec<u8>, Error> {
    let record = records::Decoder {
        mode: match decoder.mode {
            DecoderMode::PerSample => 0,
            DecoderMode::PerRay => 1,
            DecoderMode::Residual => 2,
        },
        feature_frequencies: decoder.feature_frequencies,
        direction_frequencies: decoder.direction_frequencies,
        layers: decoder.layers.iter().map(|l| records::Layer { inputs: l.inputs, outputs: l.outputs }).collect(),
    };
    let mut bytes = records::write(&"DECODER", &record)?;
    for layer in &decoder.layers {
        bytes.extend(floats::write(&layer.weights));
        bytes.extend(floats::write(&layer.bias));
    }
    Ok(bytes)
}

pub(super) fn read(payload: &Payload<'_>) -> Result<Decoder, Error> {
    let (record, mut body): (records::Decoder, _) = records::read(payload.section, payload.stored()?)?;
    // Within the limits a layer has less than 2^31 bytes and all of them less than 2^35.
    let sizes =
        record.layers.iter().map(|l| (4 * u64::from(l.inputs) * u64::from(l.outputs), 4 * u64::from(l.outputs)));
    let length = sizes.clone().map(|(weights, bias)| weights + bias).sum();
    Error::unless_equal(format!("{} body length", payload.section), length, body.len() as u64)?;
    let mut take = |length: u64| {
        let (values, rest) = body.split_at(length as usize);
        body = rest;
        floats::read(values)
    };
    let layers = (record.layers.iter().zip(sizes))
        .map(|(layer, (weights, bias))| Linear {
            inputs: layer.inputs,
            outputs: layer.outputs,
            weights: take(weights),
            bias: take(bias),
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
