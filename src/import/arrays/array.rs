//! Arrays of numbers, in files and in archives.

use crate::npy::Header;
use crate::{Fault, Visitor};

/// Numbers or rows between two reports of progress.
pub(super) const REPORT_EVERY: u64 = 1 << 20;

/// An array that can be read more than once.
pub(super) trait Array {
    /// Type and shape.
    fn header(&self) -> &Header;

    /// Visits the first `count` numbers, in the order of the file.
    fn visit(&mut self, count: u64, visit: &mut dyn FnMut(u64, f64) -> Result<(), Fault>) -> Result<(), Fault>;
}

/// The header of the first `count` numbers.
pub(super) fn first(header: &Header, count: u64) -> Header {
    Header { count: count.min(header.count), ..header.clone() }
}

/// Receives a visitor, a number's index and the number.
pub(super) type VisitNumber<'v> = dyn FnMut(&mut dyn Visitor, u64, f64) -> Result<(), Fault> + 'v;

/// Visits all numbers and reports progress to `visitor`.
pub(super) fn visit_all(
    array: &mut dyn Array,
    visitor: &mut dyn Visitor,
    visit: &mut VisitNumber<'_>,
) -> Result<(), Fault> {
    let (count, width) = (array.header().count, array.header().number.width() as u64);
    array.visit(count, &mut |n, value| {
        if n % REPORT_EVERY == REPORT_EVERY - 1 {
            visitor.progress(n * width, count * width)?;
        }
        visit(visitor, n, value)
    })
}
