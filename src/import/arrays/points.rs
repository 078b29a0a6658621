//! Arrays of points, and of colors.

use glam::DVec3;

use super::array::{Array, REPORT_EVERY};
use crate::npy::Number;
use crate::{Fault, Point, Visitor};

/// Columns of an array of points, of which at most six are used: pictures and height maps have more.
const MAX_COLUMNS: u64 = 12;
/// Columns of LLFF's `poses_bounds.npy`.
const LLFF_COLUMNS: u64 = 17;
/// Numbers of an array in Fortran order, whose columns follow one another and are held in memory (256 MiB).
const MAX_HELD: u64 = 1 << 25;
/// Colors of a separate array, held in memory (192 MiB).
const MAX_COLORS: u64 = 1 << 26;

/// Range of the numbers of a color.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum ColorScale {
    /// 0 to 255.
    Bytes,
    /// 0 to 1.
    Unit,
}

impl ColorScale {
    fn color(self, numbers: &[f64]) -> [u8; 3] {
        let scale = if self == Self::Unit { 255.0 } else { 1.0 };
        std::array::from_fn(|axis| (scale * numbers[axis]).round() as u8)
    }
}

/// Passes the points of `array` to `visitor`, with `colors` or those of its columns 3 to 5.
pub(super) fn read(
    array: &mut dyn Array,
    colors: Option<Vec<[u8; 3]>>,
    visitor: &mut dyn Visitor,
) -> Result<(), Fault> {
    if let [_, LLFF_COLUMNS] = array.header().shape[..] {
        return Err(Fault::unsupported("an array of 17 columns, LLFF's poses and bounds,", "give a file of points"));
    }
    let shape = rows_and_columns(array, "points")?;
    let [count, columns] = shape;
    if let Some(colors) = colors.as_ref().filter(|c| c.len() as u64 != count) {
        return Err(Fault::malformed("the colors", format!("{count}, one for each point"), colors.len()));
    }
    let scale = if columns >= 6 && colors.is_none() { scale_of(array, shape, 3)? } else { None };
    let used = if scale.is_some() { 6 } else { 3 };
    rows(array, shape, used, &mut |n, row| {
        if n % REPORT_EVERY == REPORT_EVERY - 1 {
            visitor.progress(n, count)?;
        }
        let color = match (&colors, scale) {
            (Some(colors), _) => Some(colors[n as usize]),
            (None, Some(scale)) => Some(scale.color(&row[3..])),
            (None, None) => None,
        };
        let position = DVec3::new(row[0], row[1], row[2]);
        Point::pass(Point::new(position, color, || format!("point {n}")), visitor)
    })
}

/// The colors of an array that holds only colors.
pub(super) fn colors(array: &mut dyn Array) -> Result<Vec<[u8; 3]>, Fault> {
    let shape = rows_and_columns(array, "colors")?;
    Fault::unless_within("colors", MAX_COLORS, shape[0])?;
    let Some(scale) = scale_of(array, shape, 0)? else {
        return Err(Fault::broken("the colors", "not all are whole numbers from 0 to 255, or floats from 0 to 1"));
    };
    let mut colors = Vec::new();
    rows(array, shape, 3, &mut |_, row| {
        colors.push(scale.color(row));
        Ok(())
    })?;
    Ok(colors)
}

/// Receives a row's index and its used columns.
type VisitRow<'v> = dyn FnMut(u64, &[f64]) -> Result<(), Fault> + 'v;

/// Visits the first `used` columns of each row; the shape is that of [`rows_and_columns`].
pub(super) fn rows(
    array: &mut dyn Array,
    [count, columns]: [u64; 2],
    used: usize,
    visit: &mut VisitRow<'_>,
) -> Result<(), Fault> {
    if array.header().fortran_order {
        let numbers = count * used as u64;
        Fault::unless_within("numbers in Fortran's order", MAX_HELD, numbers)?;
        let mut held = Vec::new();
        array.visit(numbers, &mut |_, value| {
            held.push(value);
            Ok(())
        })?;
        let mut row = vec![0.0; used];
        for n in 0..count as usize {
            for (column, value) in row.iter_mut().enumerate() {
                *value = held[column * count as usize + n];
            }
            visit(n as u64, &row)?;
        }
        return Ok(());
    }
    let mut row = vec![0.0; columns as usize];
    let all = array.header().count;
    array.visit(all, &mut |n, value| {
        let column = (n % columns) as usize;
        row[column] = value;
        if column + 1 == row.len() { visit(n / columns, &row[..used]) } else { Ok(()) }
    })
}

/// The shape of an array whose rows have three columns or more.
pub(super) fn rows_and_columns(array: &dyn Array, what: &str) -> Result<[u64; 2], Fault> {
    match array.header().shape[..] {
        [count, columns] if (3..=MAX_COLUMNS).contains(&columns) => Ok([count, columns]),
        _ => {
            let found = format!("{:?}", array.header().shape);
            Err(Fault::malformed(format!("the shape of the {what}"), "(rows, 3 to 12)", found))
        }
    }
}

/// The range of the colors in the three columns from `first` on, `None` if they are no colors. Reads them once. Floats
/// that are all within 0 and 1 are fractions; otherwise whole numbers up to 255 are bytes.
fn scale_of(array: &mut dyn Array, shape: [u64; 2], first: usize) -> Result<Option<ColorScale>, Fault> {
    if array.header().number == Number::Unsigned(1) {
        return Ok(Some(ColorScale::Bytes));
    }
    let mut unit = matches!(array.header().number, Number::Float(_));
    let mut bytes = true;
    rows(array, shape, first + 3, &mut |_, row| {
        for value in &row[first..] {
            unit &= (0.0..=1.0).contains(value);
            bytes &= (0.0..=255.0).contains(value) && value.fract() == 0.0;
        }
        Ok(())
    })?;
    Ok(if unit { Some(ColorScale::Unit) } else { bytes.then_some(ColorScale::Bytes) })
}
