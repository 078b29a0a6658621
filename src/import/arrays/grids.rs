//! Grids of booleans, numbers and densities.

use super::array::{Array, visit_all};
use crate::grid::{At, Grid, Order, bounds_given, three_axes};
use crate::npy::Number;
use crate::{Fault, ReadOptions, Visitor};
use strivec_format::geometry::Aabb;

/// Passes the occupied cells of a grid over `bounds` to `visitor`: those that are true or above 0, or, for floats,
/// above [`ReadOptions::threshold`].
pub(super) fn occupancy(
    array: &mut dyn Array,
    order: Order,
    bounds: Option<Aabb>,
    options: &ReadOptions,
    visitor: &mut dyn Visitor,
) -> Result<(), Fault> {
    let threshold = if let Number::Float(_) = array.header().number { options.threshold } else { 0.0 };
    occupied(array, order, At::Cells, bounds, options, visitor, &|value| value > threshold)
}

/// Passes the boxes of the numbers that are `occupied` to `visitor`.
pub(super) fn occupied(
    array: &mut dyn Array,
    order: Order,
    at: At,
    bounds: Option<Aabb>,
    options: &ReadOptions,
    visitor: &mut dyn Visitor,
    occupied: &dyn Fn(f64) -> bool,
) -> Result<(), Fault> {
    let shape = three_axes(&array.header().shape)?;
    let bounds = bounds.map_or_else(|| bounds_given(options), Ok)?;
    // Dropped axes of length 1 do not change the position of a number in either order.
    let grid = Grid::new(shape, order, at, &bounds)?.fortran(array.header().fortran_order);
    visit_all(array, visitor, &mut |visitor, n, value| {
        if value.is_nan() {
            return Err(Fault::malformed(format!("number {n} of the grid"), "a number", value));
        }
        if occupied(value) { visitor.cell(&grid.cell(n), None) } else { Ok(()) }
    })
}
