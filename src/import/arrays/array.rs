//! Arrays of numbers, wherever their bytes are.

use crate::import::{Fault, Visitor};
use crate::npy::Header;

/// Numbers between two reports of progress.
pub(super) const REPORT_EVERY: u64 = 1 << 20;

/// An array that can be read more than once.
pub(super) trait Array {
    /// Its type and shape.
    fn header(&self) -> &Header;

    /// Visits its first `count` numbers, in the file's order.
    fn visit(&mut self, count: u64, visit: &mut dyn FnMut(u64, f64) -> Result<(), Fault>) -> Result<(), Fault>;
}

/// What describes the first `count` numbers alone.
pub(super) fn first(header: &Header, count: u64) -> Header {
    Header { count: count.min(header.count), ..header.clone() }
}

/// Takes a visitor, a number's place and the number.
pub(super) type VisitNumber<'v> = dyn FnMut(&mut dyn Visitor, u64, f64) -> Result<(), Fault> + 'v;

/// Visits all numbers, and tells `visitor` how far this is.
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
