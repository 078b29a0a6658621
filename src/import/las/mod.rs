//! LAS 1.0 to 1.4, and its compressed form LAZ, through `laz`.
//!
//! LAS has a reader of our own because its records are fixed and short, and because it checks every length before
//! `laz`, which trusts its input, decompresses.
//!
//! Withheld points and those of the noise classes 7 and 18 are left out and counted, unless
//! [`ReadOptions::keep_noise`] is set. Colors have 16 bits; if the first ten thousand
//! are all below 256, they are read as bytes. Waveforms, extra bytes and extended records are ignored.

mod compressed;
mod header;
#[cfg(test)]
mod tests;

use glam::DVec3;

use self::header::{BATCH, LasHeader};
use super::{Fault, Input, Point, ReadOptions, Visitor};

/// Points that are held to find the range of their colors.
const JUDGED: usize = 10_000;

/// Reads `input`.
///
/// # Errors
///
/// If the header contradicts itself or declares more than the file holds, compressed points are invalid, a coordinate
/// is not finite, and those of `visitor`.
pub fn read(input: &mut Input<'_>, options: &ReadOptions, visitor: &mut dyn Visitor) -> Result<(), Fault> {
    let header = LasHeader::read(input)?;
    let mut points =
        RecordReader { header: &header, keep_noise: options.keep_noise, held: Vec::new(), shift: None, done: 0 };
    if header.compressed {
        compressed::read(input, &header, &mut |records| points.take(records, visitor))?;
    } else {
        input.go_to(header.offset_to_points)?;
        // `LasHeader::read` has checked that the file holds all points.
        let mut left = header.points;
        let mut records = Vec::new();
        while left > 0 {
            let taken = left.min(BATCH);
            left -= taken;
            records.resize((taken * header.record) as usize, 0);
            input.fill(&mut records, "points")?;
            points.take(&records, visitor)?;
        }
    }
    points.finish(visitor)
}

/// Converts records to points.
struct RecordReader<'a> {
    header: &'a LasHeader,
    keep_noise: bool,
    held: Vec<(DVec3, [u16; 3])>,
    /// Right shift from 16-bit colors to bytes, once it is known.
    shift: Option<u32>,
    done: u64,
}

impl RecordReader<'_> {
    fn take(&mut self, records: &[u8], visitor: &mut dyn Visitor) -> Result<(), Fault> {
        visitor.progress(self.done, self.header.points)?;
        for record in records.chunks_exact(self.header.record as usize) {
            let at = self.done;
            self.done += 1;
            if let Some(reason) = self.header.leaves_out(record).filter(|_| !self.keep_noise) {
                visitor.left_out(reason);
                continue;
            }
            let position = self.header.position(record);
            let point = match Point::new(position, None, || format!("point {at}")) {
                Ok(point) => point,
                Err(fault) => {
                    fault.pass(visitor)?;
                    continue;
                }
            };
            match (self.header.color(record), self.shift) {
                (None, _) => visitor.point(point)?,
                (Some(color), Some(shift)) => visitor.point(colored(point.position, color, shift))?,
                (Some(color), None) => {
                    self.held.push((point.position, color));
                    if self.held.len() == JUDGED {
                        self.finish(visitor)?;
                    }
                }
            }
        }
        Ok(())
    }

    /// Passes the held points to `visitor`.
    fn finish(&mut self, visitor: &mut dyn Visitor) -> Result<(), Fault> {
        if self.held.is_empty() {
            return Ok(());
        }
        let bytes = self.held.iter().flat_map(|(_, color)| color).all(|channel| *channel < 256);
        let shift = if bytes { 0 } else { 8 };
        self.shift = Some(shift);
        let mut held = std::mem::take(&mut self.held).into_iter();
        held.try_for_each(|(position, color)| visitor.point(colored(position, color, shift)))
    }
}

/// A point with its color as bytes; later colors may be out of range and are clamped.
fn colored(position: DVec3, color: [u16; 3], shift: u32) -> Point {
    Point { position, color: Some(color.map(|channel| (channel >> shift).min(255) as u8)) }
}
