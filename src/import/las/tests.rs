use std::io::Cursor;

use laz::{LasZipCompressor, LazItemRecordBuilder, LazVlr, LazVlrBuilder};

use super::*;
use crate::LeftOut;
use crate::testing::{Seen, seen_with};

fn read_of(bytes: &[u8]) -> Result<Seen, Fault> {
    seen_with(bytes, &ReadOptions::default(), read)
}

fn error(bytes: &[u8]) -> String {
    read_of(bytes).unwrap_err().to_string()
}

const LENGTHS: [u16; 11] = [20, 28, 26, 34, 57, 63, 30, 36, 38, 59, 67];

/// A point at i, 2i and -i, with a flag byte, a class, and a color of i in the upper bytes.
fn record(format: u8, i: i32, flags: u8, class: u8) -> Vec<u8> {
    let mut bytes = vec![0; LENGTHS[usize::from(format)].into()];
    for (at, value) in [i, 2 * i, -i].into_iter().enumerate() {
        bytes[4 * at..4 * at + 4].copy_from_slice(&value.to_le_bytes());
    }
    if format < 6 {
        bytes[15] = class | flags;
    } else {
        bytes[15] = flags;
        bytes[16] = class;
    }
    let color = [None, None, Some(20), Some(28), None, Some(28), None, Some(30), Some(30), None, Some(30)];
    if let Some(start) = color[usize::from(format)] {
        bytes[start..start + 6].copy_from_slice(&[1, i as u8, 2, 0, 3, 255]);
    }
    bytes
}

/// A header and what follows it: scales of 0.5, 0.25 and 2, an offset of 100 in x.
fn file(minor: u8, format: u8, length: u16, count: u64, records: u32, rest: &[u8], points: &[u8]) -> Vec<u8> {
    let size: usize = if minor < 3 {
        227
    } else if minor == 3 {
        235
    } else {
        375
    };
    let mut bytes = vec![0; size];
    bytes[..4].copy_from_slice(b"LASF");
    bytes[24..26].copy_from_slice(&[1, minor]);
    bytes[94..96].copy_from_slice(&(size as u16).to_le_bytes());
    bytes[96..100].copy_from_slice(&((size + rest.len()) as u32).to_le_bytes());
    bytes[100..104].copy_from_slice(&records.to_le_bytes());
    bytes[104] = format;
    bytes[105..107].copy_from_slice(&length.to_le_bytes());
    if minor < 4 {
        bytes[107..111].copy_from_slice(&(count as u32).to_le_bytes());
    } else {
        bytes[247..255].copy_from_slice(&count.to_le_bytes());
    }
    for (at, value) in [0.5, 0.25, 2.0, 100.0, 0.0, 0.0].into_iter().enumerate() {
        bytes[131 + 8 * at..139 + 8 * at].copy_from_slice(&f64::to_le_bytes(value));
    }
    bytes.extend(rest);
    bytes.extend(points);
    bytes
}

fn las(minor: u8, format: u8, points: &[Vec<u8>]) -> Vec<u8> {
    let length = points[0].len() as u16;
    file(minor, format, length, points.len() as u64, 0, &[], &points.concat())
}

/// The record of LAZ, with its header.
fn described(vlr: &LazVlr) -> Vec<u8> {
    let mut data = Vec::new();
    vlr.write_to(&mut data).unwrap();
    let mut bytes = vec![0; 54];
    bytes[2..16].copy_from_slice(b"laszip encoded");
    bytes[18..20].copy_from_slice(&22204_u16.to_le_bytes());
    bytes[20..22].copy_from_slice(&(data.len() as u16).to_le_bytes());
    bytes.extend(data);
    bytes
}

fn laz(minor: u8, format: u8, points: &[Vec<u8>], chunk: u32) -> Vec<u8> {
    let extra = points[0].len() as u16 - LENGTHS[usize::from(format)];
    let items = LazItemRecordBuilder::default_for_point_format_id(format, extra).unwrap();
    let vlr = LazVlrBuilder::new(items).with_fixed_chunk_size(chunk).build();
    let rest = [vec![0; 54], described(&vlr)].concat();
    let start = file(minor, format | 0x80, points[0].len() as u16, points.len() as u64, 2, &rest, &[]);
    let mut out = Cursor::new(start.clone());
    out.set_position(start.len() as u64);
    let mut compressor = LasZipCompressor::new(out, vlr).unwrap();
    compressor.compress_many(&points.concat()).unwrap();
    compressor.done().unwrap();
    compressor.into_inner().into_inner()
}

fn run(format: u8, count: i32) -> Vec<Vec<u8>> {
    (0..count).map(|i| record(format, i, 0, 2)).collect()
}

fn expect_the_run(seen: &Seen, count: usize, colors: bool) {
    assert_eq!(seen.points.len(), count);
    for (i, point) in seen.points.iter().enumerate() {
        let number = i as f64;
        assert_eq!(point.position.to_array(), [100.0 + 0.5 * number, 0.5 * number, -2.0 * number]);
        assert_eq!(point.color, colors.then_some([i as u8, 0, 255]));
    }
}

#[test]
fn every_point_format_is_read_plain_and_compressed() {
    for format in 0..11_u8 {
        let minor = if format < 4 {
            2
        } else if format < 6 {
            3
        } else {
            4
        };
        let colors = [2, 3, 5, 7, 8, 10].contains(&format);
        let points = run(format, 700);
        expect_the_run(&read_of(&las(minor, format, &points)).unwrap(), 700, colors);
        // Chunks that the last one does not fill.
        expect_the_run(&read_of(&laz(minor, format, &points, 300)).unwrap(), 700, colors);
    }
}

#[test]
fn bytes_that_the_format_does_not_know_are_passed_over() {
    for format in [1, 7] {
        let points: Vec<_> = run(format, 50).into_iter().map(|p| [p, vec![9, 8, 7]].concat()).collect();
        for bytes in [las(4, format, &points), laz(4, format, &points, 1000)] {
            expect_the_run(&read_of(&bytes).unwrap(), 50, format == 7);
        }
    }
}

#[test]
fn withheld_points_and_noise_are_left_out() {
    for (format, withheld) in [(3, 0x80), (7, 4)] {
        let points = [
            record(format, 1, 0, 2),
            record(format, 2, withheld, 2),
            record(format, 3, 0, 7),
            record(format, 4, 0, 18),
            record(format, 5, 0, 6),
        ];
        let seen = read_of(&las(4, format, &points)).unwrap();
        assert_eq!(seen.positions(), [[100.5, 0.5, -2.0], [102.5, 2.5, -10.0]], "format {format}");
        assert_eq!(seen.left_out, [LeftOut::Withheld, LeftOut::Noise, LeftOut::Noise], "format {format}");
        let all = ReadOptions { keep_noise: true, ..ReadOptions::default() };
        assert_eq!(seen_with(&las(4, format, &points), &all, read).unwrap().points.len(), 5, "format {format}");
    }
}

#[test]
fn colors_below_256_are_bytes() {
    let mut points = run(2, 3);
    for point in &mut points {
        point[20..26].copy_from_slice(&[200, 0, 7, 0, 255, 0]);
    }
    assert_eq!(read_of(&las(2, 2, &points)).unwrap().points[2].color, Some([200, 7, 255]));
    points[1][25] = 1;
    assert_eq!(read_of(&las(2, 2, &points)).unwrap().points[2].color, Some([0, 0, 0]));
}

#[test]
fn hostile_headers_are_named() {
    let good = las(2, 0, &run(0, 3));
    let of = |at: usize, to: &[u8]| {
        let mut bytes = good.clone();
        bytes[at..at + to.len()].copy_from_slice(to);
        error(&bytes)
    };
    assert_eq!(error(b""), "byte 0: expected 227 bytes of a LAS header, found 0 bytes");
    assert_eq!(of(0, b"PLYF"), "byte 0: expected LASF, found \"PLYF\"");
    assert_eq!(of(25, &[5]), "byte 24: expected a version from 1.0 to 1.4, found 1.5");
    assert_eq!(of(94, &[226, 0]), "byte 94: expected a header of at least 227 bytes, found 226");
    assert_eq!(of(96, &[255; 4]), "byte 96: expected an offset of the points from 227 to 287, found 4294967295");
    assert_eq!(of(96, &[226, 0, 0, 0]), "byte 96: expected an offset of the points from 227 to 287, found 226");
    assert_eq!(of(104, &[11]), "byte 104: expected a point format from 0 to 10, found 11");
    assert_eq!(of(104, &[0x40]), "byte 104: expected a point format from 0 to 10, found 64");
    assert_eq!(of(105, &[19, 0]), "byte 105: expected records of at least 20 bytes, found 19");
    assert_eq!(of(107, &[4, 0, 0, 0]), "the number of points: expected at most 3 points in 60 bytes, found 4");
    assert!(of(131, &f64::NAN.to_le_bytes()).starts_with("byte 131: expected finite scales and offsets, found"));
    assert!(of(131, &f64::MAX.to_le_bytes()).starts_with("point 2: expected finite coordinates"));
    let many = file(4, 6, 30, u64::MAX, 0, &[], &record(6, 1, 0, 2));
    assert_eq!(
        error(&many),
        format!("the number of points: expected at most 1 points in 30 bytes, found {}", u64::MAX)
    );
}

#[test]
fn hostile_descriptions_are_named() {
    let good = laz(2, 0, &run(0, 3), 50);
    // Two records' headers come after the file's, then the description.
    let start = 227 + 54 + 54;
    let of = |at: usize, to: &[u8]| {
        let mut bytes = good.clone();
        bytes[at..at + to.len()].copy_from_slice(to);
        error(&bytes)
    };
    assert_eq!(of(start, &[3, 0]), "the record of LAZ: expected a compression for point format 0, found compressor 3");
    assert_eq!(
        of(start + 2, &[1, 0]),
        "the record of LAZ: expected items [(6, 20)], versions 1..=2, found [((6, 20), 2)]"
    );
    assert_eq!(
        of(start + 12, &[0; 4]),
        "LAZ of point format 0 in chunks of different sizes is not supported: write it as LAS, or as LAZ with chunks of one size"
    );
    assert_eq!(of(start + 32, &[0, 0]), "the record of LAZ: expected items [(6, 20)], versions 1..=2, found []");
    assert_eq!(of(start + 32, &[255, 255]), "the record of LAZ: expected 65535 items, found 1");
    assert_eq!(
        of(start + 36, &[21, 0]),
        "the record of LAZ: expected items [(6, 20)], versions 1..=2, found [((6, 21), 2)]"
    );
    assert_eq!(of(start - 34, &[255, 255]), "byte 281: the record reaches beyond the start of the points, byte 375");
    assert_eq!(of(227 + 56, b"x"), "the records before the points: none describes the compression");
    assert_eq!(
        of(107, &[255; 4]),
        format!(
            "the number of points: expected at most {} points in {} bytes, found 4294967295",
            100 * (good.len() - 375),
            good.len() - 375
        )
    );
}

#[test]
fn hostile_layers_are_named() {
    let good = laz(4, 6, &run(6, 500), 200);
    let start = u32::from_le_bytes(good[96..100].try_into().unwrap()) as usize + 8;
    let mut bytes = good.clone();
    bytes[start + 34..start + 38].copy_from_slice(&[255, 255, 255, 0]);
    assert!(error(&bytes).contains(" bytes of layers, found "), "{}", error(&bytes));
    bytes[start + 37] = 255;
    let message = error(&bytes);
    assert!(message.starts_with("bytes of a chunk's layers: at most 268435456 are read, found 42949"), "{message}");
    let mut none = good.clone();
    none[start + 30..start + 34].fill(0);
    assert_eq!(error(&none), format!("byte {start}: the chunk has no points"));
}

#[test]
fn bytes_that_no_encoder_wrote_are_an_error_or_points() {
    for (format, minor) in [(3, 2), (7, 4)] {
        let good = laz(minor, format, &run(format, 300), 100);
        let start = u32::from_le_bytes(good[96..100].try_into().unwrap()) as usize + 8;
        let mut cut = good.clone();
        cut.truncate(start + 60);
        assert!(read_of(&cut).is_err());
        let mut state = 1_u32;
        let mut errors = 0;
        for _ in 0..200 {
            let mut bytes = good.clone();
            for _ in 0..4 {
                state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                let at = start + (state >> 8) as usize % (good.len() - start);
                bytes[at] = (state >> 3) as u8 | 0xf0;
            }
            errors += usize::from(read_of(&bytes).is_err());
        }
        assert!(errors > 0, "format {format}");
    }
}
