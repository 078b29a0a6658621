//! OFF: Geomview's meshes, as text.
//!
//! Read: the header, in which `C`, `N` and `ST` announce colors, normals and texture coordinates of vertices; vertices;
//! polygons, cut into triangles. The counts may follow the header on the same line, and `#` begins a comment. Colors
//! of vertices are bytes, or fractions if any of them has a decimal point. Colors of faces are ignored. A file without
//! faces is a point cloud. Binary files, and the letters `4` and `n`, are not supported. Memory holds the vertices.

use glam::DVec3;

use super::error::excerpt;
use super::polygon::{MAX_CORNERS, Triangulator};
use super::{Fault, Input, Point, ReadOptions, Visitor};
use strivec_format::color::byte;

/// Bytes of a line: room for a polygon of a million corners.
const MAX_LINE: usize = 1 << 24;

/// Reads `input`.
///
/// # Errors
///
/// If the file breaks the format, and those of `visitor`.
pub fn read(input: &mut Input<'_>, options: &ReadOptions, visitor: &mut dyn Visitor) -> Result<(), Fault> {
    let mut lines = OffLines { input, text: Vec::new(), number: 0 };
    lines.advance(visitor)?;
    let mut words = lines.words();
    let first = words.next().unwrap_or_default().to_owned();
    let prefix = first.strip_suffix("OFF").ok_or_else(|| lines.wrong("OFF"))?;
    let columns =
        ColorColumns::of(prefix).ok_or_else(|| lines.wrong("OFF, COFF, NOFF, CNOFF or one of these after ST"))?;
    let binary = words.next() == Some("BINARY");
    drop(words);
    if binary {
        return Err(Fault::unsupported("a binary OFF file", "export it as text"));
    }
    let mut counts: Vec<u64> = lines.numbers(1)?;
    if counts.is_empty() {
        lines.advance(visitor)?;
        counts = lines.numbers(0)?;
    }
    let [vertices, faces, ..] = counts[..] else { return Err(lines.wrong("the numbers of vertices and faces")) };
    // A vertex takes at least "0 0 0" and a line end, which the last one may lack.
    let (least, left) = (vertices.saturating_mul(6).saturating_add(faces.saturating_mul(2)), lines.input.left() + 1);
    if least > left {
        let problem = format!("{vertices} vertices and {faces} faces need at least {least} bytes, but {left} are left");
        return Err(Fault::broken(lines.place(), problem));
    }
    let points = options.vertices || faces == 0;
    let mut held = Vec::new();
    for _ in 0..vertices {
        lines.advance(visitor)?;
        let vertex = columns.vertex(&lines)?;
        if points {
            visitor.point(vertex)?;
        } else {
            held.push(vertex);
        }
    }
    if points { Ok(()) } else { read_faces(&mut lines, faces, &held, visitor) }
}

fn read_faces(
    lines: &mut OffLines<'_, '_>,
    faces: u64,
    vertices: &[Point],
    visitor: &mut dyn Visitor,
) -> Result<(), Fault> {
    let mut triangulator = Triangulator::default();
    let mut corners: Vec<usize> = Vec::new();
    for _ in 0..faces {
        lines.advance(visitor)?;
        let mut words = lines.words();
        let count = words.next().and_then(|word| word.parse::<usize>().ok());
        let count = count.ok_or_else(|| lines.wrong("a number of corners"))?;
        Fault::unless_within("corners of a polygon", MAX_CORNERS as u64, count as u64)?;
        corners.clear();
        for word in words.take(count) {
            let corner = word.parse().ok().filter(|&corner| corner < vertices.len());
            corners.push(corner.ok_or_else(|| {
                let expected = format!("a vertex index of at least 0 and below {}", vertices.len());
                Fault::malformed(lines.place(), expected, excerpt(word.as_bytes()))
            })?);
        }
        if corners.len() < count {
            return Err(Fault::malformed(lines.place(), format!("{count} corners"), corners.len()));
        }
        let each = |triangle: [usize; 3]| visitor.triangle(triangle.map(|n| vertices[corners[n]]));
        triangulator.cut(count, |n| vertices[corners[n]].position, each)?;
    }
    Ok(())
}

/// The lines that are not blank, without comments.
struct OffLines<'i, 'a> {
    input: &'i mut Input<'a>,
    text: Vec<u8>,
    number: u64,
}

impl OffLines<'_, '_> {
    fn advance(&mut self, visitor: &mut dyn Visitor) -> Result<(), Fault> {
        loop {
            self.input.report(visitor)?;
            self.number += 1;
            if !self.input.line(&mut self.text, MAX_LINE)? {
                return Err(Fault::broken(self.place(), "the file ends before its last vertex or face"));
            }
            if let Some(start) = self.text.iter().position(|&b| b == b'#') {
                self.text.truncate(start);
            }
            if !self.text.trim_ascii().is_empty() {
                return Ok(());
            }
        }
    }

    fn words(&self) -> impl Iterator<Item = &str> {
        // Words that are no text match nothing.
        self.text.split(u8::is_ascii_whitespace).filter(|w| !w.is_empty()).map(|w| str::from_utf8(w).unwrap_or("�"))
    }

    /// The numbers of the line after `skipped` words.
    fn numbers<T: std::str::FromStr>(&self, skipped: usize) -> Result<Vec<T>, Fault> {
        // Lines of counts and vertices have at most 13 numbers.
        let words = self.words().skip(skipped).take(16);
        words.map(|word| word.parse().map_err(|_| self.wrong("numbers"))).collect()
    }

    fn place(&self) -> String {
        format!("line {}", self.number)
    }

    fn wrong(&self, expected: &str) -> Fault {
        Fault::malformed(self.place(), expected, excerpt(&self.text))
    }
}

/// The columns of a vertex after its position.
struct ColorColumns {
    normal: bool,
    color: bool,
}

impl ColorColumns {
    fn of(prefix: &str) -> Option<Self> {
        match prefix.strip_prefix("ST").unwrap_or(prefix) {
            "" => Some(Self { normal: false, color: false }),
            "N" => Some(Self { normal: true, color: false }),
            "C" => Some(Self { normal: false, color: true }),
            "CN" | "NC" => Some(Self { normal: true, color: true }),
            _ => None,
        }
    }

    fn vertex(&self, lines: &OffLines<'_, '_>) -> Result<Point, Fault> {
        let values: Vec<f64> = lines.numbers(0)?;
        let [x, y, z, ref more @ ..] = values[..] else { return Err(lines.wrong("three coordinates")) };
        let more = if self.normal { more.get(3..).unwrap_or_default() } else { more };
        let color = match more {
            [r, g, b, ..] if self.color => {
                let fractions = lines.text.split(u8::is_ascii_whitespace).filter(|w| !w.is_empty());
                let fractions = fractions.skip(values.len() - more.len()).any(|word| word.contains(&b'.'));
                let channel = |value: f64| if fractions { byte(value) } else { value.clamp(0.0, 255.0) as u8 };
                Some([*r, *g, *b].map(channel))
            }
            _ if self.color => return Err(lines.wrong("a color after the coordinates")),
            _ => None,
        };
        Point::new(DVec3::new(x, y, z), color, || lines.place())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{Seen, seen_with};

    fn seen(text: &str) -> Seen {
        seen_with(text.as_bytes(), &ReadOptions::default(), read).unwrap()
    }

    fn fault(text: impl AsRef<[u8]>) -> String {
        seen_with(text.as_ref(), &ReadOptions::default(), read).unwrap_err().to_string()
    }

    #[test]
    fn meshes_and_clouds_are_read() {
        let square = "0 0 0\n1 0 0 # a corner\n\n1 1 0\n0 1 0\n";
        for head in ["OFF\n4 2 0\n", "# a square\nOFF 4 2 5\n", "\nOFF\r\n# none\n4 2\r\n"] {
            let seen = seen(&format!("{head}{square}4 0 1 2 3 255 0 0\n3  0 1 2"));
            assert_eq!(seen.triangles.len(), 3, "{head:?}");
            assert_eq!(seen.triangles[1].map(|c| c.position.to_array()), [[0.0; 3], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]]);
        }
        assert_eq!(seen(&format!("OFF\n4 0 0\n{square}")).points.len(), 4);
        let options = ReadOptions { vertices: true, ..ReadOptions::default() };
        let text = format!("OFF\n4 1 0\n{square}3 0 1 2\n");
        assert_eq!(seen_with(text.as_bytes(), &options, read).unwrap().points.len(), 4);
    }

    #[test]
    fn colors_of_vertices_are_bytes_or_fractions() {
        let color = |text: &str| seen(text).points[0].color;
        assert_eq!(color("COFF\n1 0 0\n1 2 3 255 0 7 255\n"), Some([255, 0, 7]));
        assert_eq!(color("COFF\n1 0 0\n1 2 3 1.0 0 0.5\n"), Some([255, 0, 128]));
        assert_eq!(color("STCNOFF\n1 0 0\n1 2 3 0 0 1. 9 8 7 255 0 0\n"), Some([9, 8, 7]));
        assert_eq!(color("NOFF\n1 0 0\n1 2 3 0 0 1\n"), None);
    }

    #[test]
    fn hostile_files_are_named() {
        for (text, expected) in [
            ("", "line 1: the file ends before its last vertex or face"),
            ("solid\n", "line 1: expected OFF, found \"solid\""),
            ("4OFF\n", "line 1: expected OFF, COFF, NOFF, CNOFF or one of these after ST, found \"4OFF\""),
            ("OFF BINARY\n", "a binary OFF file is not supported: export it as text"),
            ("OFF\n4\n", "line 2: expected the numbers of vertices and faces, found \"4\""),
            ("OFF\nx 1\n", "line 2: expected numbers, found \"x 1\""),
            (
                "OFF\n18446744073709551615 4000000000 0\n",
                "line 2: 18446744073709551615 vertices and 4000000000 faces need at least 18446744073709551615 bytes, \
                 but 1 are left",
            ),
            ("OFF\n1 0 0\n1 2\n   ", "line 3: expected three coordinates, found \"1 2\""),
            ("OFF\n1 0 0\n1 nan 2", "line 3: expected finite coordinates, found [1, NaN, 2]"),
            ("OFF\n1 1 0\n1 1 2\n3 0 0 1", "line 4: expected a vertex index of at least 0 and below 1, found \"1\""),
            ("OFF\n1 1 0\n1 1 2\n3 0 0", "line 4: expected 3 corners, found 2"),
            ("OFF\n1 1 0\n1 1 2\n9999999 0", "corners of a polygon: at most 1048576 are read, found 9999999"),
            ("COFF\n1 0 0\n1 1 2", "line 3: expected a color after the coordinates, found \"1 1 2\""),
        ] {
            assert_eq!(fault(text), expected);
        }
        assert!(fault(b"OFF\n1 0 0\n1 2 \xff\n").starts_with("line 3: expected numbers"));
    }
}
