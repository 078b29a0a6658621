use super::*;
use crate::testing::{Seen, seen_with};

fn read_of(bytes: &[u8]) -> Result<Seen, Fault> {
    seen_with(bytes, &ReadOptions::default(), read)
}

fn error(bytes: &[u8]) -> String {
    read_of(bytes).unwrap_err().to_string()
}

/// Three points, of which the second is none; fields before, between and after those that are read.
fn header(data: &str) -> Vec<u8> {
    format!(
        "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\nFIELDS hist z rgb label x y\nSIZE 4 4 4 2 8 2\n\
         TYPE F F F U F I\nCOUNT 3 1 1 2 1 1\nWIDTH 3\nHEIGHT 1\nVIEWPOINT 9 9 9 1 0 0 0\nPOINTS 3\nDATA {data}\n"
    )
    .into_bytes()
}

const POINTS: [([f64; 3], u32); 3] =
    [([1.25, -2.0, 3.5], 0x00_0a_0b_0c), ([f64::NAN, 0.0, 0.0], 0), ([4.0, 5.0, -6.0], 0xff_ff_80_01)];

/// The fields of a point in the header's order.
fn fields(([x, y, z], color): ([f64; 3], u32)) -> [Vec<u8>; 6] {
    let bytes = |length: usize| vec![7_u8; length];
    [
        bytes(12),
        (z as f32).to_le_bytes().to_vec(),
        color.to_le_bytes().to_vec(),
        bytes(4),
        x.to_le_bytes().to_vec(),
        (y as i16).to_le_bytes().to_vec(),
    ]
}

fn binary() -> Vec<u8> {
    let mut file = header("binary");
    POINTS.into_iter().flat_map(fields).for_each(|field| file.extend(field));
    file
}

fn compressed(packed: &[u8], size: u32) -> Vec<u8> {
    let mut file = header("binary_compressed");
    file.extend((packed.len() as u32).to_le_bytes());
    file.extend(size.to_le_bytes());
    file.extend(packed);
    file
}

/// The points column by column, as LZF that copies nothing but the first field, a run of sevens.
fn packed() -> Vec<u8> {
    let columns = POINTS.map(fields);
    let rest: Vec<u8> = (1..6).flat_map(|field| columns.iter().flat_map(move |p| p[field].clone())).collect();
    let mut packed = vec![0, 7, 0xe0, 35 - 9, 0];
    for run in rest.chunks(32) {
        packed.push(run.len() as u8 - 1);
        packed.extend(run);
    }
    packed
}

fn expect_the_points(seen: &Seen) {
    assert_eq!(seen.positions(), [POINTS[0].0, POINTS[2].0]);
    assert_eq!(seen.points[0].color, Some([10, 11, 12]));
    assert_eq!(seen.points[1].color, Some([255, 128, 1]));
}

#[test]
fn the_three_encodings_hold_the_same_points() {
    let mut text = header("ascii");
    text.extend(b"0 0 0 3.5 658188 1 1 1.25 -2\n0 0 0 0 0 1 1 nan 0\n\n0 0 0 -6 4294934529 1 1 4 5\n");
    expect_the_points(&read_of(&text).unwrap());
    expect_the_points(&read_of(&binary()).unwrap());
    expect_the_points(&read_of(&compressed(&packed(), 102)).unwrap());
}

#[test]
fn a_color_may_be_the_digits_of_a_float() {
    let digits = f32::from_bits(0x0a_0b_0c).to_string();
    let text = format!("FIELDS x y z rgb\nSIZE 4 4 4 4\nTYPE F F F F\nWIDTH 1\nHEIGHT 1\nDATA ascii\n1 2 3 {digits}\n");
    assert_eq!(read_of(text.as_bytes()).unwrap().points[0].color, Some([10, 11, 12]));
}

#[test]
fn headers_without_points_or_colors_are_enough() {
    let text = "FIELDS x y z\nSIZE 1 8 4\nTYPE I U F\nWIDTH 1\nHEIGHT 1\nDATA binary\n";
    let mut file = text.as_bytes().to_vec();
    file.push(0xfe);
    file.extend(300_u64.to_le_bytes());
    file.extend(0.5_f32.to_le_bytes());
    let seen = read_of(&file).unwrap();
    assert_eq!(seen.positions(), [[-2.0, 300.0, 0.5]]);
    assert_eq!(seen.points[0].color, None);
}

#[test]
fn decompression_is_the_same_over_many_batches() {
    // Two million bytes: copies of 264 from 8192 back, after 8192 bytes that differ.
    let seed: Vec<u8> = (0..8192_u32).map(|n| (n.wrapping_mul(2_654_435_761) >> 13) as u8).collect();
    let mut packed = Vec::new();
    for run in seed.chunks(32) {
        packed.push(31);
        packed.extend(run);
    }
    (0..8000).for_each(|_| packed.extend([0xff, 255, 0xff]));
    let size = 8192 + 8000 * 264;
    let mut out: Vec<u8> = Vec::new();
    let mut input = Input::from_bytes(&packed);
    let mut sink = |offset: u64, bytes: &[u8]| {
        assert_eq!(offset, out.len() as u64);
        out.extend(bytes);
    };
    lzf::decompress(&mut input, packed.len() as u64, size, &mut Seen::default(), &mut sink).unwrap();
    assert_eq!(out.len() as u64, size);
    assert!(out.iter().enumerate().all(|(at, byte)| *byte == seed[at % 8192]));
}

#[test]
fn hostile_headers_are_named() {
    let of = |from: &str, to: &str| {
        let text = String::from_utf8(header("binary")).unwrap();
        assert!(text.contains(from));
        error(text.replacen(from, to, 1).as_bytes())
    };
    assert_eq!(error(b""), "line 1: expected a line DATA, found the end of the file");
    assert_eq!(error(b"ply\n"), "line 1: expected a header line, found \"ply\"");
    assert_eq!(error(b"\xff\xfe\n"), "line 1: expected a header line, found bytes that are not UTF-8");
    assert_eq!(error("#\n".repeat(2000).as_bytes()), "lines of a header: at most 1000 are read, found 1001");
    assert_eq!(of("FIELDS", "WIDTH 1\nFIELDS"), "line 8: a second line WIDTH");
    assert_eq!(of("label x", "label w"), "FIELDS: the field x is missing");
    assert_eq!(of("SIZE 4 ", "SIZE "), "SIZE: expected 6 numbers, found 5");
    assert_eq!(
        of("SIZE 4 ", "SIZE 3 "),
        "TYPE and SIZE: expected F of 4 or 8 bytes, or I or U of 1, 2, 4 or 8 bytes, found F of 3"
    );
    assert_eq!(
        of("TYPE F ", "TYPE Q "),
        "TYPE and SIZE: expected F of 4 or 8 bytes, or I or U of 1, 2, 4 or 8 bytes, found Q of 4"
    );
    assert_eq!(of("TYPE F ", "TYPE "), "TYPE: expected 6 letters, found 5");
    assert_eq!(
        of("COUNT 3", "COUNT 18446744073709551615"),
        "bytes of a record: at most 65536 are read, found 18446744073709551615"
    );
    assert_eq!(of("COUNT 3", "COUNT -1"), "COUNT: expected a number, found \"-1\"");
    assert_eq!(of("POINTS 3", "POINTS 4"), "POINTS: expected WIDTH 3 times HEIGHT 1, found 4");
    assert_eq!(of("HEIGHT 1\n", ""), "the header: the line HEIGHT is missing");
    assert_eq!(
        of("DATA binary", "DATA zip"),
        "line 11: expected DATA ascii, binary or binary_compressed, found \"zip\""
    );
    let many = "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH 9999999999999999999\nHEIGHT 1\nDATA binary\n";
    assert_eq!(error(many.as_bytes()), "POINTS: 9999999999999999999 points of 12 bytes overflow");
}

#[test]
fn hostile_points_are_named() {
    let mut short = binary();
    let points = header("binary").len();
    short.pop();
    assert_eq!(error(&short), format!("byte {points}: expected 102 bytes of points, found 101 bytes"));
    let mut infinite = binary();
    infinite[points + 12..points + 16].copy_from_slice(&f32::INFINITY.to_le_bytes());
    assert_eq!(error(&infinite), format!("byte {points}: expected finite coordinates, found [1.25, -2, inf]"));
    let text = |line: &[u8]| {
        let mut file = header("ascii");
        file.extend(line);
        error(&file)
    };
    assert_eq!(text(b""), "line 12: expected 3 points, found 0");
    assert_eq!(text(b"1 2 3\n"), "line 12: expected 9 numbers, found 3");
    assert_eq!(text(b"0 0 0 z 0 1 1 1 1\n"), "line 12: expected a number, found \"z\"");
    assert_eq!(text(b"0 0 0 1 c 1 1 1 1\n"), "line 12: expected a number, found \"c\"");
    assert_eq!(text(b"0 0 0 \xff 0 1 1 1 1\n"), "line 12: expected a number, found bytes that are not UTF-8");
}

#[test]
fn hostile_compression_is_named() {
    let start = header("binary_compressed").len();
    assert_eq!(
        error(&compressed(&packed(), 101)),
        format!("byte {start}: expected 102 bytes of 3 points, found 101 bytes")
    );
    assert_eq!(
        error(&compressed(&[0], 102)),
        format!("byte {start}: expected compressed points of at least 2 bytes, found 1 bytes")
    );
    let mut cut = compressed(&packed(), 102);
    cut.pop();
    assert_eq!(error(&cut), format!("byte {}: expected 74 bytes of compressed points, found 73 bytes", start + 8));
    let first = start + 8;
    assert_eq!(
        error(&compressed(&[0x20, 0, 0], 102)),
        format!("byte {first}: a copy begins 1 bytes back, before the first byte")
    );
    assert_eq!(
        error(&compressed(&[5, 1], 102)),
        format!("byte {}: expected 6 more compressed bytes, found the end", first + 1)
    );
    assert_eq!(
        error(&compressed(&[0, 1, 0xe0], 102)),
        format!("byte {}: expected 1 more compressed bytes, found the end", first + 3)
    );
    assert_eq!(
        error(&compressed(&[0, 1, 0xe0, 255, 0], 102)),
        format!("byte {}: expected 102 decompressed bytes, found more", first + 2)
    );
    assert_eq!(
        error(&compressed(&[0, 1, 0xe0, 50, 0], 102)),
        format!("byte {}: expected 102 decompressed bytes, found 60", first + 5)
    );
}

#[test]
fn names_of_fields_may_be_capitals() {
    let file = "VERSION .7\nFIELDS X Y Z RGB\nSIZE 4 4 4 4\nTYPE F F F U\nWIDTH 1\nHEIGHT 1\nDATA ascii\n1 2 3 255\n";
    let seen = seen_with(file.as_bytes(), &ReadOptions::default(), read).unwrap();
    assert_eq!((seen.positions(), seen.points[0].color), (vec![[1.0, 2.0, 3.0]], Some([0, 0, 255])));
}
