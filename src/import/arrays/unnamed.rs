//! Arrays without a name, whose shape determines their contents.

use super::array::Array;
use super::{grids, points};
use crate::grid::Order;
use crate::{Fault, ReadOptions, Visitor};

/// Reads points or a grid, by the number of axes.
pub(super) fn of_any_shape(
    array: &mut dyn Array,
    options: &ReadOptions,
    visitor: &mut dyn Visitor,
) -> Result<(), Fault> {
    match array.header().shape.len() {
        2 => points::read(array, None, visitor),
        0 | 1 => {
            let found = format!("{:?}", array.header().shape);
            Err(Fault::malformed("the array's shape", "(rows, 3 or more) or three axes", found))
        }
        _ => grids::occupancy(array, Order::Zyx, None, options, visitor),
    }
}
