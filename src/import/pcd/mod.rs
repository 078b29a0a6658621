//! PCD: the Point Cloud Library's point clouds, as text, binary and compressed.
//!
//! The reader is our own: the format is a few lines of header and an array, and every declared length is checked before
//! memory is allocated.
//!
//! In this format, a point with a NaN coordinate means "no point" and is left out. VIEWPOINT, the pose of the sensor,
//! does not move points, as in PCL.

mod header;
mod lzf;
#[cfg(test)]
mod tests;

use std::ops::Range;

use glam::DVec3;

use self::header::{Data, MAX_LINE, PcdField, PcdHeader};
use super::{Fault, Input, Point, ReadOptions, Visitor};

/// Bytes of one read.
const BATCH_BYTES: u64 = 1 << 18;

/// Bytes of coordinates and colors that are held for compressed files, whose columns follow one another.
const MAX_COLUMNS: u64 = 1 << 31;

/// Reads `input`.
///
/// # Errors
///
/// If the header contradicts itself or declares more than the file holds, compressed bytes are invalid, a coordinate is
/// infinite, and those of `visitor`.
pub fn read(input: &mut Input<'_>, _options: &ReadOptions, visitor: &mut dyn Visitor) -> Result<(), Fault> {
    let header = PcdHeader::read(input)?;
    match header.data {
        Data::Ascii => read_text(input, &header, visitor),
        Data::Binary => read_records(input, &header, visitor),
        Data::Compressed => read_columns(input, &header, visitor),
    }
}

fn read_text(input: &mut Input<'_>, header: &PcdHeader, visitor: &mut dyn Visitor) -> Result<(), Fault> {
    let mut line = Vec::new();
    let mut fields: Vec<Range<usize>> = Vec::new();
    let mut at = header.lines;
    let mut points = 0;
    while points < header.points {
        at += 1;
        let place = || format!("line {at}");
        if !input.line(&mut line, MAX_LINE)? {
            return Err(Fault::malformed(place(), format!("{} points", header.points), points));
        }
        input.report(visitor)?;
        fields.clear();
        let mut start = 0;
        for (end, byte) in line.iter().chain(b" ").enumerate() {
            if byte.is_ascii_whitespace() {
                if end > start {
                    fields.push(start..end);
                }
                start = end + 1;
            }
        }
        if fields.is_empty() {
            continue;
        }
        if fields.len() != header.columns {
            return Err(Fault::malformed(place(), format!("{} numbers", header.columns), fields.len()));
        }
        points += 1;
        let text = |field: &PcdField| {
            let bytes = &line[fields[field.column].clone()];
            std::str::from_utf8(bytes).map_err(|_| Fault::malformed(place(), "a number", "bytes that are not UTF-8"))
        };
        let mut position = [0.0; 3];
        for (coordinate, field) in position.iter_mut().zip(&header.position) {
            let text = text(field)?;
            *coordinate = text.parse().map_err(|_| no_number(place(), text))?;
        }
        let color = header.color.as_ref().map(|field| {
            let text = text(field)?;
            field.packed_of_text(text).ok_or_else(|| no_number(place(), text))
        });
        point(position, color.transpose()?, place, visitor)?;
    }
    Ok(())
}

fn no_number(place: String, text: &str) -> Fault {
    Fault::malformed(place, "a number", format!("{:?}", text.chars().take(40).collect::<String>()))
}

fn read_records(input: &mut Input<'_>, header: &PcdHeader, visitor: &mut dyn Visitor) -> Result<(), Fault> {
    input.expect_left(header.bytes()?, "points")?;
    let most = (BATCH_BYTES / header.record).max(1);
    let mut left = header.points;
    let mut batch = Vec::new();
    while left > 0 {
        let taken = left.min(most);
        left -= taken;
        let start = input.offset();
        batch.resize((taken * header.record) as usize, 0);
        input.fill(&mut batch, "points")?;
        input.report(visitor)?;
        for (at, record) in batch.chunks_exact(header.record as usize).enumerate() {
            let position = header.position.each_ref().map(|field| field.value(&record[field.bytes()]));
            let color = header.color.as_ref().map(|field| field.packed(&record[field.bytes()]));
            point(position, color, || format!("byte {}", start + at as u64 * header.record), visitor)?;
        }
    }
    Ok(())
}

fn read_columns(input: &mut Input<'_>, header: &PcdHeader, visitor: &mut dyn Visitor) -> Result<(), Fault> {
    let place = input.place();
    let packed = u32::from_le_bytes(input.array("the size of the compressed points")?);
    let size = u64::from(u32::from_le_bytes(input.array("the size of the points")?));
    let bytes = header.bytes()?;
    if size != bytes {
        let expected = format!("{bytes} bytes of {} points", header.points);
        return Err(Fault::malformed(place, expected, format!("{size} bytes")));
    }
    input.expect_left(packed.into(), "compressed points")?;
    if size > u64::from(packed) * lzf::MAX_EXPANSION {
        let expected = format!("compressed points of at least {} bytes", size.div_ceil(lzf::MAX_EXPANSION));
        return Err(Fault::malformed(place, expected, format!("{packed} bytes")));
    }
    // The decompressed bytes hold all of the first field, then all of the second. Keep the needed fields.
    let fields: Vec<_> = header.position.iter().chain(&header.color).collect();
    let kept = fields.iter().map(|field| header.points * field.size as u64).sum();
    Fault::unless_within("bytes of coordinates and colors in a compressed file", MAX_COLUMNS, kept)?;
    let mut columns: Vec<Vec<u8>> = vec![Vec::new(); fields.len()];
    let ranges = fields.iter().map(|field| {
        let start = header.points * field.start as u64;
        start..start + header.points * field.size as u64
    });
    let ranges: Vec<Range<u64>> = ranges.collect();
    lzf::decompress(input, packed.into(), size, visitor, &mut |offset, bytes| {
        for (range, column) in ranges.iter().zip(&mut columns) {
            let start = range.start.clamp(offset, offset + bytes.len() as u64) - offset;
            let end = range.end.clamp(offset, offset + bytes.len() as u64) - offset;
            column.extend_from_slice(&bytes[start as usize..end as usize]);
        }
    })?;
    for at in 0..header.points as usize {
        let value = |column: usize, field: &PcdField| &columns[column][at * field.size..][..field.size];
        let mut position = [0.0; 3];
        for (axis, field) in header.position.iter().enumerate() {
            position[axis] = field.value(value(axis, field));
        }
        let color = header.color.as_ref().map(|field| field.packed(value(3, field)));
        point(position, color, || format!("point {at}"), visitor)?;
    }
    Ok(())
}

/// Passes a point to `visitor`, unless a coordinate is NaN.
fn point(
    position: [f64; 3],
    packed: Option<u32>,
    place: impl FnOnce() -> String,
    visitor: &mut dyn Visitor,
) -> Result<(), Fault> {
    if position.iter().any(|x| x.is_nan()) {
        return Ok(());
    }
    let color = packed.map(|packed| [(packed >> 16) as u8, (packed >> 8) as u8, packed as u8]);
    Point::pass(Point::new(DVec3::from_array(position), color, place), visitor)
}
