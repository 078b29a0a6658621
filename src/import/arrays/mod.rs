//! NumPy arrays: points, and grids of booleans, numbers or densities.
//!
//! In: `.npy`, or `.npz`, which is told by its first bytes. Two axes are rows of x, y, z, three are a grid; a bare grid is
//! \[z\]\[y\]\[x\], as this project's synthetic `occupancy`. What the arrays of an `.npz` are is told by their names (`npz`).

mod grids;
mod npz;
mod points;
#[cfg(test)]
mod tests;

use std::io::ErrorKind;

use super::archive::{Archive, reading};
use super::grid::Order;
use super::{Fault, Input, ReadOptions, Visitor};
use crate::npy::{Header, NpyError};

/// Numbers between two reports of progress.
const REPORT_EVERY: u64 = 1 << 20;

/// Reads `input`.
///
/// # Errors
///
/// Where it is not what the format says, and those of `visitor`.
pub fn read(input: &mut Input<'_>, options: &ReadOptions, visitor: &mut dyn Visitor) -> Result<(), Fault> {
    let start = input.peek(6)?;
    if start == b"\x93NUMPY" {
        return of_any_shape(&mut Bare::new(input)?, options, visitor);
    }
    if Archive::begins(&start) {
        return npz::read(Archive::open(input)?, options, visitor);
    }
    Err(Fault::malformed("byte 0", "NumPy's .npy (\\x93NUMPY) or .npz (PK)", format!("{start:02x?}")))
}

/// Points or a grid, by the number of axes.
fn of_any_shape(array: &mut dyn Array, options: &ReadOptions, visitor: &mut dyn Visitor) -> Result<(), Fault> {
    match array.header().shape.len() {
        2 => points::read(array, None, visitor),
        0 | 1 => {
            let found = format!("{:?}", array.header().shape);
            Err(Fault::malformed("the array's shape", "(points, 3 or more) or three axes", found))
        }
        _ => grids::occupancy(array, Order::Zyx, None, options, visitor),
    }
}

/// An array that can be read more than once.
trait Array {
    /// Its type and shape.
    fn header(&self) -> &Header;

    /// Visits its first `count` numbers, in the file's order.
    fn visit(&mut self, count: u64, visit: &mut dyn FnMut(u64, f64) -> Result<(), Fault>) -> Result<(), Fault>;
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

/// What describes the first `count` numbers alone.
fn first(header: &Header, count: u64) -> Header {
    Header { count: count.min(header.count), ..header.clone() }
}

/// Takes a visitor, a number's place and the number.
type VisitNumber<'v> = dyn FnMut(&mut dyn Visitor, u64, f64) -> Result<(), Fault> + 'v;

/// Visits all numbers, and tells `visitor` how far this is.
fn visit_all(array: &mut dyn Array, visitor: &mut dyn Visitor, visit: &mut VisitNumber<'_>) -> Result<(), Fault> {
    let (count, width) = (array.header().count, array.header().number.width() as u64);
    array.visit(count, &mut |n, value| {
        if n % REPORT_EVERY == REPORT_EVERY - 1 {
            visitor.progress(n * width, count * width)?;
        }
        visit(visitor, n, value)
    })
}

impl From<NpyError> for Fault {
    fn from(error: NpyError) -> Self {
        match error {
            NpyError::Io(error) if error.kind() == ErrorKind::UnexpectedEof => {
                Self::malformed("the array", "all of it", "the end of the file")
            }
            NpyError::Io(error) => reading("the array", error),
            NpyError::Malformed { place, expected, found } => Self::malformed(place, expected, found),
        }
    }
}
