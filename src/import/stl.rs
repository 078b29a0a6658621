//! STL: triangles, binary or text. Normals and the colors of some programs, which contradict each other, are ignored.
//!
//! A file is binary if its length is that of the declared triangles, or if it does not begin with `solid`: binary
//! headers may begin with this word too.

use glam::DVec3;

use super::error::excerpt;
use super::input::bytes_at;
use super::{Fault, Input, Point, ReadOptions, Visitor};

/// Bytes before the triangles: a comment and their number.
const HEADER: u64 = 84;
/// Bytes of a triangle: a normal, three corners, and two bytes of attributes.
const RECORD: u64 = 50;
/// Bytes of a line of text.
const MAX_LINE: usize = 1 << 16;

/// Reads `input`.
///
/// # Errors
///
/// If the file breaks the format, and those of `visitor`.
pub fn read(input: &mut Input<'_>, options: &ReadOptions, visitor: &mut dyn Visitor) -> Result<(), Fault> {
    let start = input.peek(HEADER as usize)?;
    let count = (start.len() as u64 == HEADER).then(|| u64::from(u32::from_le_bytes(bytes_at(&start, 80))));
    let fits = count.is_some_and(|count| input.len() == HEADER + RECORD * count);
    if !fits && start.trim_ascii_start().starts_with(b"solid") {
        return read_text(input, options, visitor);
    }
    input.expect_left(HEADER, "an STL header")?;
    let count = count.unwrap_or_default();
    input.go_to(HEADER)?;
    input.expect_left(RECORD * count, &format!("{count} triangles"))?;
    for _ in 0..count {
        let place = input.offset();
        let record: [u8; RECORD as usize] = input.array("a triangle")?;
        let number = |at: usize| f64::from(f32::from_le_bytes(bytes_at(&record, at)));
        let corner = |n: usize| {
            let at = 12 * (n + 1);
            let position = DVec3::new(number(at), number(at + 4), number(at + 8));
            Point::new(position, None, || format!("byte {}", place + at as u64))
        };
        match (corner(0), corner(1), corner(2)) {
            (Ok(a), Ok(b), Ok(c)) => pass([a, b, c], options, visitor)?,
            (Err(fault), ..) | (_, Err(fault), _) | (.., Err(fault)) => fault.pass(visitor)?,
        }
        input.report(visitor)?;
    }
    Ok(())
}

fn read_text(input: &mut Input<'_>, options: &ReadOptions, visitor: &mut dyn Visitor) -> Result<(), Fault> {
    let (mut text, mut line) = (Vec::new(), 0_u64);
    let mut corners = Vec::with_capacity(3);
    while input.line(&mut text, MAX_LINE)? {
        line += 1;
        input.report(visitor)?;
        let place = || format!("line {line}");
        let wrong = |expected: &str| Fault::malformed(place(), expected, excerpt(&text));
        let mut words = text.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty());
        match words.next().unwrap_or_default().to_ascii_lowercase().as_slice() {
            b"vertex" => {
                let mut position = [0.0; 3];
                for coordinate in &mut position {
                    let number = words.next().and_then(|word| str::from_utf8(word).ok()?.parse().ok());
                    *coordinate = number.ok_or_else(|| wrong("vertex and three numbers"))?;
                }
                if corners.len() == 3 {
                    return Err(wrong("endloop after three vertices"));
                }
                corners.push(Point::new(position.into(), None, place)?);
            }
            b"endloop" => {
                let [a, b, c] = corners[..] else { return Err(wrong("three vertices before endloop")) };
                pass([a, b, c], options, visitor)?;
                corners.clear();
            }
            b"" | b"solid" | b"facet" | b"outer" | b"endfacet" | b"endsolid" | b"color" => {}
            _ => return Err(wrong("solid, facet, outer loop, vertex, endloop, endfacet or endsolid")),
        }
    }
    if corners.is_empty() { Ok(()) } else { Err(Fault::broken(format!("line {line}"), "the file ends in a triangle")) }
}

fn pass(corners: [Point; 3], options: &ReadOptions, visitor: &mut dyn Visitor) -> Result<(), Fault> {
    if options.vertices {
        return corners.into_iter().try_for_each(|corner| visitor.point(corner));
    }
    visitor.triangle(corners)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{Seen, seen_with};

    fn read_of(bytes: &[u8]) -> Result<Seen, Fault> {
        seen_with(bytes, &ReadOptions::default(), read)
    }

    fn fault(bytes: &[u8]) -> String {
        read_of(bytes).unwrap_err().to_string()
    }

    const CORNERS: [[f32; 3]; 3] = [[0.0, 0.0, 1.0], [1.0, 0.5, 0.0], [0.0, -2.0, 0.0]];

    fn binary(comment: &[u8], triangles: u32) -> Vec<u8> {
        let mut bytes = comment.to_vec();
        bytes.resize(80, b' ');
        bytes.extend(triangles.to_le_bytes());
        for _ in 0..triangles {
            bytes.extend([0; 12]);
            bytes.extend(CORNERS.iter().flatten().flat_map(|v| v.to_le_bytes()));
            bytes.extend([0; 2]);
        }
        bytes
    }

    const TEXT: &str = "solid thing\n facet normal 0 0 0\n  outer loop\n   vertex 0 0 1\n   vertex 1 5e-1 0\r\n   \
                        VERTEX 0 -2 0\n  endloop\n endfacet\nendsolid thing\n";

    #[test]
    fn both_forms_hold_the_same_triangles() {
        let corners = CORNERS.map(|corner| corner.map(f64::from));
        for file in [binary(b"made here", 1), binary(b"solid as well", 1), TEXT.into()] {
            let seen = read_of(&file).unwrap();
            assert_eq!(seen.triangles[0].map(|c| c.position.to_array()), corners);
            let options = ReadOptions { vertices: true, ..ReadOptions::default() };
            assert_eq!(seen_with(&file, &options, read).unwrap().positions(), corners);
        }
        assert_eq!(read_of(&binary(b"", 0)).unwrap().triangles.len(), 0);
    }

    #[test]
    fn hostile_files_are_named() {
        assert_eq!(fault(b""), "byte 0: expected 84 bytes of an STL header, found 0 bytes");
        let mut billions = binary(b"", 1);
        billions[80..84].copy_from_slice(&u32::MAX.to_le_bytes());
        assert_eq!(fault(&billions), "byte 84: expected 214748364750 bytes of 4294967295 triangles, found 50 bytes");
        let mut nan = binary(b"", 1);
        nan[96..100].copy_from_slice(&f32::NAN.to_le_bytes());
        assert_eq!(fault(&nan), "byte 96: expected finite coordinates, found [NaN, 0, 1]");
        for (text, expected) in [
            ("solid\nvertex 0 0\n", "line 2: expected vertex and three numbers, found \"vertex 0 0\""),
            ("solid\nvertex 0 0 inf\n", "line 2: expected finite coordinates, found [0, 0, inf]"),
            ("solid\nvertex 0 0 0\nendloop\n", "line 3: expected three vertices before endloop, found \"endloop\""),
            ("solid\nvertex 0 0 0\n", "line 2: the file ends in a triangle"),
            (
                "solid\nbezier\n",
                "line 2: expected solid, facet, outer loop, vertex, endloop, endfacet or endsolid, found \"bezier\"",
            ),
        ] {
            assert_eq!(fault(text.as_bytes()), expected);
        }
        let four = TEXT.replace("  endloop", "  vertex 1 1 1\n  endloop");
        assert_eq!(fault(four.as_bytes()), "line 7: expected endloop after three vertices, found \"  vertex 1 1 1\"");
    }
}
