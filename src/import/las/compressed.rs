//! LAZ: the description of the compression, and its chunks.
//!
//! `laz` trusts its input: it allocates the declared lengths of layers, adds lengths without checks, and indexes tables
//! with numbers from the stream. Therefore the description must be exactly that of the point format, the lengths of
//! each chunk's layers are checked before they are read, and the table of chunks, which only seeking needs, is not
//! read. On streams that no encoder writes, `laz` may still panic (assertions, and overflowing sums in builds that
//! check them). [`std::panic::catch_unwind`] turns these panics into errors, and the decoder is dropped.

use std::io;
use std::panic::{AssertUnwindSafe, catch_unwind};

use laz::LazVlr;
use laz::record::{LayeredPointRecordDecompressor, RecordDecompressor, SequentialPointRecordDecompressor};

use super::header::{BATCH, LasHeader};
use crate::input::bytes_at;
use crate::{Fault, Input};

/// Bytes before the data of a variable length record.
const RECORD_HEADER: u64 = 54;

/// Bytes of a chunk's layers, which are held in memory. Encoders write some 50 000 points per chunk.
const MAX_LAYERS: u64 = 1 << 28;

/// The layout of compressed points.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum ItemKind {
    /// One stream.
    Whole,
    /// Chunks of this number of points.
    Chunked(u64),
    /// Chunks with their own number of points, one layer per field.
    Layered,
}

/// Decompresses the points of `input` and passes batches of records to `sink`.
///
/// # Errors
///
/// If the compression is unknown, the points end early or are invalid, and those of `sink`.
pub(super) fn read(
    input: &mut Input<'_>,
    header: &LasHeader,
    sink: &mut dyn FnMut(&[u8]) -> Result<(), Fault>,
) -> Result<(), Fault> {
    let description = find_description(input, header)?;
    let kind = check(&description, header)?;
    let description = LazVlr::from_buffer(&description).map_err(|error| unknown(&error))?;
    input.go_to(header.offset_to_points)?;
    if header.points == 0 {
        return Ok(());
    }
    if kind != ItemKind::Whole {
        let _: [u8; 8] = input.array("the place of the table of chunks")?;
    }
    let mut left = header.points;
    while left > 0 {
        let points = match kind {
            ItemKind::Whole => left,
            ItemKind::Chunked(points) => points.min(left),
            ItemKind::Layered => check_layers(input, header)?.min(left),
        };
        left -= points;
        let at = input.place();
        let record = header.record as usize;
        match kind {
            ItemKind::Layered => {
                let mut decoder = LayeredPointRecordDecompressor::new(&mut *input);
                decoder.set_fields_from(description.items()).map_err(|error| unknown(&error))?;
                chunk(&mut decoder, points, record, &at, sink)?;
            }
            ItemKind::Whole | ItemKind::Chunked(_) => {
                let mut decoder = SequentialPointRecordDecompressor::new(&mut *input);
                decoder.set_fields_from(description.items()).map_err(|error| unknown(&error))?;
                chunk(&mut decoder, points, record, &at, sink)?;
            }
        }
    }
    Ok(())
}

fn chunk<R>(
    decoder: &mut dyn RecordDecompressor<R>,
    points: u64,
    record: usize,
    at: &str,
    sink: &mut dyn FnMut(&[u8]) -> Result<(), Fault>,
) -> Result<(), Fault> {
    let mut records = Vec::new();
    let mut left = points;
    while left > 0 {
        let taken = left.min(BATCH);
        left -= taken;
        records.resize(taken as usize * record, 0);
        let decoded = catch_unwind(AssertUnwindSafe(|| decoder.decompress_many(&mut records)));
        let bad = |problem: &str| Fault::broken(format!("the chunk at {at}"), problem);
        match decoded {
            Ok(Ok(())) => sink(&records)?,
            Ok(Err(error)) if error.kind() == io::ErrorKind::UnexpectedEof => {
                return Err(bad(&format!("it ends before its {points} points")));
            }
            Ok(Err(error)) => return Err(error.into()),
            Err(_) => return Err(bad("its compressed points are damaged")),
        }
    }
    Ok(())
}

fn unknown(error: &laz::LasZipError) -> Fault {
    Fault::broken("the record of LAZ", format!("unknown compression: {error}"))
}

/// The record that describes the compression.
fn find_description(input: &mut Input<'_>, header: &LasHeader) -> Result<Vec<u8>, Fault> {
    input.go_to(header.header)?;
    for _ in 0..header.records {
        let place = input.place();
        let before = |input: &Input<'_>, bytes: u64| {
            if input.offset() + bytes <= header.offset_to_points {
                return Ok(());
            }
            let problem =
                format!("the record reaches beyond the start of the points, byte {}", header.offset_to_points);
            Err(Fault::broken(place.clone(), problem))
        };
        before(input, RECORD_HEADER)?;
        let head: [u8; RECORD_HEADER as usize] = input.array("a record")?;
        let length = u16::from_le_bytes([head[20], head[21]]);
        before(input, length.into())?;
        let user = head[2..18].split(|byte| *byte == 0).next().unwrap_or_default();
        if user == LazVlr::USER_ID.as_bytes() && u16::from_le_bytes([head[18], head[19]]) == LazVlr::RECORD_ID {
            let mut data = vec![0; length.into()];
            input.fill(&mut data, "the record of LAZ")?;
            return Ok(data);
        }
        input.go_to(input.offset() + u64::from(length))?;
    }
    Err(Fault::broken("the records before the points", "none describes the compression"))
}

/// Checks that the description matches the point format.
fn check(description: &[u8], header: &LasHeader) -> Result<ItemKind, Fault> {
    let bad = |expected: String, found: String| Fault::malformed("the record of LAZ", expected, found);
    let short = |at: usize| description.get(at..at + 2).map(|bytes| u16::from_le_bytes([bytes[0], bytes[1]]));
    let (Some(compressor), Some(coder), Some(count)) = (short(0), short(2), short(32)) else {
        return Err(bad("at least 34 bytes".into(), format!("{} bytes", description.len())));
    };
    let chunk = u32::from_le_bytes(bytes_at(description, 12));
    let extended = header.format >= 6;
    let kind = match (compressor, extended, chunk) {
        (1, false, _) => ItemKind::Whole,
        (2, false, 0 | u32::MAX) => {
            let what = format!("LAZ of point format {} in chunks of different sizes", header.format);
            return Err(Fault::unsupported(what, "write it as LAS, or as LAZ with chunks of one size"));
        }
        (2, false, points) => ItemKind::Chunked(points.into()),
        (3, true, _) => ItemKind::Layered,
        _ => {
            let expected = format!("a compression for point format {}", header.format);
            return Err(bad(expected, format!("compressor {compressor}")));
        }
    };
    let mut items = Vec::new();
    for at in 0..usize::from(count) {
        let start = 34 + 6 * at;
        match (short(start), short(start + 2), short(start + 4)) {
            (Some(item), Some(size), Some(version)) => items.push(((item, size), version)),
            _ => return Err(bad(format!("{count} items"), format!("{at}"))),
        }
    }
    let expected = items_of(header);
    let versions = if extended { 3..=4 } else { 1..=2 };
    let known = items.iter().all(|(_, version)| versions.contains(version));
    if coder != 0 || !known || !items.iter().map(|(item, _)| item).eq(&expected) {
        return Err(bad(format!("items {expected:?}, versions {versions:?}"), format!("{items:?}")));
    }
    Ok(kind)
}

/// LAZ's items of the point format: (kind, bytes).
fn items_of(header: &LasHeader) -> Vec<(u16, u16)> {
    const POINT: (u16, u16) = (6, 20);
    const TIME: (u16, u16) = (7, 8);
    const COLOR: (u16, u16) = (8, 6);
    const WAVE: (u16, u16) = (9, 29);
    const POINT14: (u16, u16) = (10, 30);
    const COLOR14: (u16, u16) = (11, 6);
    const INFRARED14: (u16, u16) = (12, 8);
    const WAVE14: (u16, u16) = (13, 29);
    let parts: &[_] = match header.format {
        0 => &[POINT],
        1 => &[POINT, TIME],
        2 => &[POINT, COLOR],
        3 => &[POINT, TIME, COLOR],
        4 => &[POINT, TIME, WAVE],
        5 => &[POINT, TIME, COLOR, WAVE],
        6 => &[POINT14],
        7 => &[POINT14, COLOR14],
        8 => &[POINT14, INFRARED14],
        9 => &[POINT14, WAVE14],
        _ => &[POINT14, INFRARED14, WAVE14],
    };
    let mut items = parts.to_vec();
    if header.extra() > 0 {
        items.push((if header.format < 6 { 0 } else { 14 }, header.extra()));
    }
    items
}

/// Layers in a chunk of the point format: nine for the point, one each for color and waveform, one for each extra byte.
fn layers(header: &LasHeader) -> u64 {
    let layers = match header.format {
        6 => 9,
        7 | 9 => 10,
        8 => 11,
        _ => 12,
    };
    layers + u64::from(header.extra())
}

/// The number of points of the next chunk, after a check that its layers fit into the file. A chunk begins with an
/// uncompressed point, the number of points, and the lengths of the layers.
fn check_layers(input: &mut Input<'_>, header: &LasHeader) -> Result<u64, Fault> {
    let place = input.place();
    let start = input.offset();
    input.expect_left(header.record + 4 + 4 * layers(header), "a chunk's head")?;
    input.go_to(start + header.record)?;
    let points = u32::from_le_bytes(input.array("a chunk's points")?);
    let mut bytes = 0_u64;
    for _ in 0..layers(header) {
        bytes += u64::from(u32::from_le_bytes(input.array("a layer's length")?));
    }
    Fault::unless_within("bytes of a chunk's layers", MAX_LAYERS, bytes)?;
    input.expect_left(bytes, "layers")?;
    input.go_to(start)?;
    if points == 0 {
        return Err(Fault::broken(place, "the chunk has no points"));
    }
    Ok(points.into())
}
