//! `.splat`: records of 32 bytes, little-endian: center and standard deviations, three f32 each; color and opacity,
//! four bytes; rotation w, x, y, z, four bytes, of which 128 is 0.

use glam::DVec3;

use super::super::input::bytes_at;
use super::super::{Fault, Input, ReadOptions, Visitor};
use super::Splat;

/// Bytes of a record.
const RECORD: u64 = 32;

/// Reads `input`.
///
/// # Errors
///
/// If the length is no multiple of a record's, a coordinate is not finite, and those of `visitor`.
pub fn read(input: &mut Input<'_>, options: &ReadOptions, visitor: &mut dyn Visitor) -> Result<(), Fault> {
    if !input.len().is_multiple_of(RECORD) {
        return Err(Fault::malformed("the file", "records of 32 bytes", format!("{} bytes", input.len())));
    }
    for _ in 0..input.len() / RECORD {
        let place = input.offset();
        let record: [u8; RECORD as usize] = input.array("a splat")?;
        let number = |n: usize| f64::from(f32::from_le_bytes(bytes_at(&record, 4 * n)));
        let splat = Splat {
            center: DVec3::new(number(0), number(1), number(2)),
            deviations: [3, 4, 5].map(number),
            rotation: [28, 29, 30, 31].map(|n| f64::from(record[n]) - 128.0),
            opacity: f64::from(record[27]) / 255.0,
            color: Some([record[24], record[25], record[26]]),
        };
        splat.pass(options, visitor, || format!("byte {place}"))?;
        input.report(visitor)?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::LeftOut;
    use crate::testing::seen_with;

    fn record(center: [f32; 3], opacity: u8) -> Vec<u8> {
        let numbers = [center, [0.5, 1.0, 0.0]].concat();
        let mut bytes: Vec<u8> = numbers.iter().flat_map(|v| v.to_le_bytes()).collect();
        // A quarter turn about z.
        bytes.extend([9, 8, 7, opacity, 228, 128, 128, 228]);
        bytes
    }

    #[test]
    fn splats_have_their_extent_and_transparent_ones_are_counted() {
        let file = [record([1.0, 2.0, 3.0], 255), record([0.0; 3], 3)].concat();
        let seen = seen_with(&file, &ReadOptions::default(), read).unwrap();
        let [(center, axes)] = seen.splats[..] else { panic!("{seen:?}") };
        assert_eq!((center.position.to_array(), center.color), ([1.0, 2.0, 3.0], Some([9, 8, 7])));
        let expected = [DVec3::Y, DVec3::NEG_X * 2.0, DVec3::ZERO];
        assert!(axes.iter().zip(expected).all(|(axis, expected)| axis.distance(expected) < 1e-12), "{axes:?}");
        assert_eq!(seen.left_out, [LeftOut::Transparent]);

        let all = ReadOptions { min_opacity: 0.0, vertices: true, ..ReadOptions::default() };
        assert_eq!(seen_with(&file, &all, read).unwrap().points.len(), 2);
        let confident = ReadOptions { min_opacity: 0.0, min_confidence: 0.5, ..ReadOptions::default() };
        let seen = seen_with(&file, &confident, read).unwrap();
        assert_eq!((seen.splats.len(), seen.left_out.len()), (1, 0));
    }

    #[test]
    fn hostile_records_are_named() {
        let fault = |bytes: &[u8]| seen_with(bytes, &ReadOptions::default(), read).unwrap_err().to_string();
        assert_eq!(fault(&[0; 33]), "the file: expected records of 32 bytes, found 33 bytes");
        let bytes = [record([1.0; 3], 255), record([f32::NAN, 0.0, 0.0], 255)].concat();
        assert_eq!(fault(&bytes), "byte 32: expected finite coordinates, found [NaN, 0, 0]");
        let mut endless = record([1.0; 3], 255);
        endless[12..16].copy_from_slice(&f32::INFINITY.to_le_bytes());
        endless[16..20].copy_from_slice(&f32::NAN.to_le_bytes());
        endless[28..32].copy_from_slice(&[128; 4]);
        let seen = seen_with(&endless, &ReadOptions::default(), read).unwrap();
        assert_eq!(seen.splats[0].1, [DVec3::X * 2e30, DVec3::ZERO, DVec3::ZERO]);
    }
}
