//! The input of `tobj`: the vertices and polygons of an OBJ file, after checks.

use std::io::{self, BufRead, Read, Write};

use super::super::error::excerpt;
use super::super::{Fault, Visitor};
use super::statements::Statements;

/// Corners of a group. `tobj` allocates about a hundred bytes for each face of a group.
const GROUP: usize = 1 << 20;

/// The checked statements as text.
pub(super) struct Guard<'g, 'a> {
    statements: Statements<'g, 'a>,
    visitor: &'g mut dyn Visitor,
    /// One statement for `tobj`, and the number of its bytes that have been read.
    text: Vec<u8>,
    read: usize,
    vertices: u64,
    /// True if the first vertex has a color; then vertices without one are white. Otherwise all colors are dropped:
    /// `tobj` would assign them to wrong vertices.
    colored: bool,
    /// Corners since the last group.
    corners: usize,
    fault: Option<Fault>,
}

impl<'g, 'a> Guard<'g, 'a> {
    pub(super) fn new(statements: Statements<'g, 'a>, visitor: &'g mut dyn Visitor) -> Self {
        let (text, fault) = (Vec::new(), None);
        Self { statements, visitor, text, read: 0, vertices: 0, colored: false, corners: 0, fault }
    }

    /// The fault that ended the reading, if any.
    pub(super) fn end(self) -> Option<Fault> {
        self.fault
    }

    /// Sets the text to the next vertex or polygon; to nothing at the end.
    fn advance(&mut self) -> Result<(), Fault> {
        self.text.clear();
        self.read = 0;
        while self.text.is_empty() && self.statements.advance(self.visitor)? {
            match self.statements.keyword() {
                b"v" => self.vertex()?,
                b"f" => self.face()?,
                _ => {}
            }
        }
        Ok(())
    }

    fn vertex(&mut self) -> Result<(), Fault> {
        let vertex = self.statements.vertex()?;
        if self.vertices == 0 {
            self.colored = vertex.color.is_some();
        }
        self.vertices += 1;
        let own_words = if vertex.color.is_some() && !self.colored { 3 } else { usize::MAX };
        self.text.push(b'v');
        if self.colored && vertex.color.is_none() {
            let [x, y, z] = vertex.position.to_array();
            // White.
            write!(self.text, " {x} {y} {z} 1 1 1")?;
        } else {
            for word in self.statements.words().take(own_words) {
                self.text.push(b' ');
                self.text.extend_from_slice(word);
            }
        }
        self.text.push(b'\n');
        Ok(())
    }

    /// Sets the text to the face with vertex indices alone; to nothing if it has fewer than three corners.
    fn face(&mut self) -> Result<(), Fault> {
        self.text.push(b'f');
        let mut corners = 0;
        for word in self.statements.words() {
            let Some(vertex) = self.corner(word) else {
                let expected = format!("the index of one of the {} vertices above", self.vertices);
                let place = format!("line {}", self.statements.line());
                return Err(Fault::malformed(place, expected, excerpt(word)));
            };
            write!(self.text, " {vertex}")?;
            corners += 1;
        }
        if corners < 3 {
            self.text.clear();
            return Ok(());
        }
        self.text.push(b'\n');
        self.corners += corners;
        if self.corners >= GROUP {
            self.text.extend_from_slice(b"g\n");
            self.corners = 0;
        }
        Ok(())
    }

    /// The vertex index, from 1, of a corner `vertex/texture/normal`.
    fn corner(&self, word: &[u8]) -> Option<u64> {
        let vertex = word.split(|&b| b == b'/').next()?;
        let vertex: i64 = std::str::from_utf8(vertex).ok()?.parse().ok()?;
        let vertex = if vertex < 0 { self.vertices.checked_sub(vertex.unsigned_abs())? + 1 } else { vertex as u64 };
        (1..=self.vertices).contains(&vertex).then_some(vertex)
    }
}

impl BufRead for Guard<'_, '_> {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        if self.read == self.text.len()
            && self.fault.is_none()
            && let Err(fault) = self.advance()
        {
            self.fault = Some(fault);
        }
        match self.fault {
            Some(_) => Err(io::Error::other("see the guard's fault")),
            None => Ok(&self.text[self.read..]),
        }
    }

    fn consume(&mut self, amount: usize) {
        self.read += amount;
    }
}

impl Read for Guard<'_, '_> {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        let read = self.fill_buf()?.read(bytes)?;
        self.consume(read);
        Ok(read)
    }
}
