//! COLMAP's sparse points: `points3D.bin` and `points3D.txt`.

use glam::DVec3;

use super::input::bytes_at;
use super::{Fault, Input, Point, ReadOptions, Visitor};

/// Bytes of a point without its track: number, position, color, error and track length.
const POINT_BYTES: u64 = 8 + 24 + 3 + 8 + 8;

/// Bytes of a track element: numbers of an image and of a keypoint.
const SIGHTING_BYTES: u64 = 4 + 4;

/// Bytes of a line of text, which has two numbers for each image that sees the point.
const MAX_LINE: usize = 1 << 24;

/// Reads `points3D.bin`.
///
/// # Errors
///
/// If the file is shorter or longer than its counts, if a coordinate is not finite, and those of `visitor`.
pub fn read_binary(input: &mut Input<'_>, options: &ReadOptions, visitor: &mut dyn Visitor) -> Result<(), Fault> {
    let count = u64::from_le_bytes(input.array("the number of points")?);
    if count > input.left() / POINT_BYTES {
        let left = input.left();
        let problem = format!("{count} points of at least {POINT_BYTES} bytes are declared, but {left} bytes are left");
        return Err(Fault::broken("byte 0", problem));
    }
    for _ in 0..count {
        input.report(visitor)?;
        let place = input.offset();
        let bytes: [u8; POINT_BYTES as usize] = input.array("a point")?;
        let number = |at: usize| f64::from_le_bytes(bytes_at(&bytes, at));
        let track = u64::from_le_bytes(bytes_at(&bytes, 43));
        if track > input.left() / SIGHTING_BYTES {
            let problem = format!("a track of {track} images is declared, but {} bytes are left", input.left());
            return Err(Fault::broken(format!("byte {}", place + 43), problem));
        }
        input.go_to(input.offset() + track * SIGHTING_BYTES)?;
        let color = [bytes[32], bytes[33], bytes[34]];
        let position = DVec3::new(number(8), number(16), number(24));
        let error = number(35);
        if counts(options, track, error) {
            let point = Point::new(position, Some(color), || format!("byte {}", place + 8));
            Point::pass_tracked(point, track, error, visitor)?;
        }
    }
    match input.left() {
        0 => Ok(()),
        left => Err(Fault::malformed(input.place(), "the end of the file", format!("{left} more bytes"))),
    }
}

/// Reads `points3D.txt`.
///
/// # Errors
///
/// If a line has fewer numbers than a point, if a coordinate is not finite, and those of `visitor`.
pub fn read_text(input: &mut Input<'_>, options: &ReadOptions, visitor: &mut dyn Visitor) -> Result<(), Fault> {
    let mut line = Vec::new();
    let mut at = 0_u64;
    while input.line(&mut line, MAX_LINE)? {
        at += 1;
        input.report(visitor)?;
        let line = line.trim_ascii();
        if line.is_empty() || line.starts_with(b"#") {
            continue;
        }
        let place = || format!("line {at}");
        let mut fields = line.split(u8::is_ascii_whitespace).filter(|field| !field.is_empty());
        let mut next = |what: &str| {
            let field = fields.next().ok_or_else(|| Fault::malformed(place(), what, "the end of the line"))?;
            std::str::from_utf8(field).map_err(|_| Fault::malformed(place(), what, "bytes that are not UTF-8"))
        };
        let _ = number::<u64>(next("the point's number")?, "the point's number", place)?;
        let mut position = [0.0; 3];
        for coordinate in &mut position {
            *coordinate = number(next("a coordinate")?, "a coordinate", place)?;
        }
        let mut color = [0; 3];
        for channel in &mut color {
            *channel = number(next("a color from 0 to 255")?, "a color from 0 to 255", place)?;
        }
        let error: f64 = number(next("the error")?, "the error", place)?;
        let sightings = fields.count() as u64;
        if !sightings.is_multiple_of(2) {
            let found = format!("{sightings} numbers");
            return Err(Fault::malformed(place(), "pairs of an image and a keypoint", found));
        }
        if counts(options, sightings / 2, error) {
            let point = Point::new(DVec3::from_array(position), Some(color), place);
            Point::pass_tracked(point, sightings / 2, error, visitor)?;
        }
    }
    Ok(())
}

/// True if `options` keep a point with `track` images. COLMAP writes an error of -1 if it has not computed one.
fn counts(options: &ReadOptions, track: u64, error: f64) -> bool {
    track >= options.min_track && error <= options.max_reprojection_error
}

fn number<T: std::str::FromStr>(field: &str, what: &str, place: impl Fn() -> String) -> Result<T, Fault> {
    field.parse().map_err(|_| {
        let shown: String = field.chars().take(40).collect();
        Fault::malformed(place(), what, format!("{shown:?}"))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::seen_with;

    /// Two points: one of three pictures, and one of one picture and a large error.
    fn binary() -> Vec<u8> {
        let mut bytes = 2_u64.to_le_bytes().to_vec();
        for (position, color, error, track) in
            [([1.0, -2.0, 3.5], [9, 8, 7], 0.5, 3_u64), ([4.0, 5.0, 6.0], [255, 0, 1], 2.5, 1)]
        {
            bytes.extend(77_u64.to_le_bytes());
            position.iter().for_each(|x: &f64| bytes.extend(x.to_le_bytes()));
            bytes.extend(color);
            bytes.extend(f64::to_le_bytes(error));
            bytes.extend(track.to_le_bytes());
            bytes.resize(bytes.len() + 8 * track as usize, 5);
        }
        bytes
    }

    const TEXT: &str = "# 3D point list\n#   POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[] as (IMAGE_ID, POINT2D_IDX)\n\
        77 1 -2 3.5 9 8 7 0.5 1 2 3 4 5 6\r\n\n78 4 5 6 255 0 1 2.5 1 2\n";

    fn all() -> ReadOptions {
        ReadOptions::default()
    }

    #[test]
    fn both_files_hold_the_same_points() {
        let binary = seen_with(&binary(), &all(), read_binary).unwrap();
        let text = seen_with(TEXT.as_bytes(), &all(), read_text).unwrap();
        assert_eq!(binary.positions(), [[1.0, -2.0, 3.5], [4.0, 5.0, 6.0]]);
        assert_eq!(binary.points[0].color, Some([9, 8, 7]));
        assert_eq!(binary.points[1].color, Some([255, 0, 1]));
        assert_eq!(text.points, binary.points);
    }

    #[test]
    fn short_tracks_and_large_errors_are_left_out() {
        for options in [
            ReadOptions { min_track: 2, ..all() },
            ReadOptions { min_track: 3, ..all() },
            ReadOptions { max_reprojection_error: 2.0, ..all() },
        ] {
            for seen in [
                seen_with(&binary(), &options, read_binary).unwrap(),
                seen_with(TEXT.as_bytes(), &options, read_text).unwrap(),
            ] {
                assert_eq!(seen.positions(), [[1.0, -2.0, 3.5]], "{options:?}");
            }
        }
        let none = ReadOptions { min_track: 4, ..all() };
        assert!(seen_with(&binary(), &none, read_binary).unwrap().points.is_empty());
    }

    #[test]
    fn hostile_bytes_are_named() {
        let error = |bytes: &[u8]| seen_with(bytes, &all(), read_binary).unwrap_err().to_string();
        let changed = |at: usize, to: &[u8]| {
            let mut bytes = binary();
            bytes[at..at + to.len()].copy_from_slice(to);
            bytes
        };
        assert_eq!(error(&[0; 7]), "byte 0: expected 8 bytes of the number of points, found 7 bytes");
        assert_eq!(
            error(&changed(0, &u64::MAX.to_le_bytes())),
            "byte 0: 18446744073709551615 points of at least 51 bytes are declared, but 134 bytes are left"
        );
        assert_eq!(
            error(&changed(51, &u64::MAX.to_le_bytes())),
            "byte 51: a track of 18446744073709551615 images is declared, but 83 bytes are left"
        );
        assert_eq!(
            error(&changed(16, &f64::NAN.to_le_bytes())),
            "byte 16: expected finite coordinates, found [NaN, -2, 3.5]"
        );
        let mut more = binary();
        more.push(0);
        assert_eq!(error(&more), "byte 142: expected the end of the file, found 1 more bytes");
        assert_eq!(error(&changed(51, &10_u64.to_le_bytes())), "byte 139: expected 51 bytes of a point, found 3 bytes");
    }

    #[test]
    fn hostile_lines_are_named() {
        for (text, expected) in [
            ("1 2 3\n", "line 1: expected a coordinate, found the end of the line"),
            ("\n1 2 3 x 0 0 0 1\n", "line 2: expected a coordinate, found \"x\""),
            ("1 2 3 inf 0 0 0 1\n", "line 1: expected finite coordinates, found [2, 3, inf]"),
            ("1 2 3 4 0 0 256 1\n", "line 1: expected a color from 0 to 255, found \"256\""),
            ("1 2 3 4 0 0 0 1 5\n", "line 1: expected pairs of an image and a keypoint, found 1 numbers"),
            ("-1 2 3 4 0 0 0 1\n", "line 1: expected the point's number, found \"-1\""),
        ] {
            assert_eq!(seen_with(text.as_bytes(), &all(), read_text).unwrap_err().to_string(), expected);
        }
        let bytes = b"1 2 3 \xff 0 0 0 1\n";
        let expected = "line 1: expected a coordinate, found bytes that are not UTF-8";
        assert_eq!(seen_with(bytes, &all(), read_text).unwrap_err().to_string(), expected);
    }
}
