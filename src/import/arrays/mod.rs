//! NumPy arrays: points, and grids of booleans, numbers or densities.
//!
//! In: `.npy` or `.npz`, distinguished by the first bytes. An array without a name has two axes if it holds rows of x,
//! y, z, and three, \[z\]\[y\]\[x\], if it is a grid. The names of the arrays of an `.npz` determine their meaning
//! (`npz`).

mod array;
mod grids;
mod npz;
mod points;
#[cfg(test)]
mod tests;
mod unnamed;

use std::io::ErrorKind;

use self::array::{Array, first};
use self::unnamed::of_any_shape;
use super::archive::{Archive, reading};
use super::{Fault, Input, ReadOptions, Visitor};
use crate::npy::{Header, NpyError};
use strivec_format::Place;

/// Reads `input`.
///
/// # Errors
///
/// If the file breaks the format, and those of `visitor`.
pub fn read(input: &mut Input<'_>, options: &ReadOptions, visitor: &mut dyn Visitor) -> Result<(), Fault> {
    let start = input.peek(6)?;
    if start == b"\x93NUMPY" {
        return of_any_shape(&mut Bare::new(input)?, options, visitor);
    }
    if Archive::begins(&start) {
        return npz::read(Archive::open(input)?, options, visitor);
    }
    Err(Fault::malformed(
        Place::Offset(0),
        "the beginning of an .npy (\\x93NUMPY) or .npz (PK) file",
        format!("{start:02x?}"),
    ))
}

/// An `.npy` file.
struct Bare<'a, 'b> {
    input: &'a mut Input<'b>,
    header: Header,
    start: u64,
}

impl<'a, 'b> Bare<'a, 'b> {
    fn new(input: &'a mut Input<'b>) -> Result<Self, Fault> {
        let header = Header::read(input)?;
        let start = input.offset();
        if header.bytes() != input.left() {
            let expected = format!("{} bytes of numbers", header.bytes());
            return Err(Fault::malformed(input.place(), expected, format!("{} bytes", input.left())));
        }
        Ok(Self { input, header, start })
    }
}

impl Array for Bare<'_, '_> {
    fn header(&self) -> &Header {
        &self.header
    }

    fn visit(&mut self, count: u64, visit: &mut dyn FnMut(u64, f64) -> Result<(), Fault>) -> Result<(), Fault> {
        self.input.go_to(self.start)?;
        first(&self.header, count).for_each(self.input, visit)
    }
}

impl From<NpyError> for Fault {
    fn from(error: NpyError) -> Self {
        match error {
            NpyError::Io(error) if error.kind() == ErrorKind::UnexpectedEof => {
                Self::broken("the array", "the file ends within it")
            }
            NpyError::Io(error) => reading("the array", error),
            NpyError::Malformed(invalid) => invalid.into(),
        }
    }
}
