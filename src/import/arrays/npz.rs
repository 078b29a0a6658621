//! Archives of named arrays.
//!
//! The first row of this table whose arrays exist determines the contents:
//!
//! | arrays | contents |
//! |---|---|
//! | `cells` (n, 3), `origin`, `pitch` | occupied cells of a lattice, as `strivec prior` writes them |
//! | `occupancy` \[z\]\[y\]\[x\], `bounds` (2, 3) | occupancy of this project's synthetic scenes |
//! | `density` \[x\]\[y\]\[z\] with `act_shift` or `alpha_init`, and `voxel_size_ratio` | DVGO's densities at vertices |
//! | `alpha` \[x\]\[y\]\[z\] | opacities at vertices, as DVGO exports them |
//! | `points`, `xyz` or `positions` (n, 3 or more), `colors` or `rgb` | points |
//! | a single array of any name | as an `.npy` file |
//!
//! The bounds of a grid are `bounds`, else `xyz_min` and `xyz_max`, else [`ReadOptions::bounds`].

use glam::DVec3;

use super::array::{Array, REPORT_EVERY, first};
use super::unnamed::of_any_shape;
use super::{grids, points};
use crate::archive::{Archive, check_end_of};
use crate::grid::{At, Density, Order};
use crate::npy::{Header, Number};
use crate::{Fault, ReadOptions, Visitor};
use strivec_format::Invalid;
use strivec_format::geometry::Aabb;

/// 2^53: larger cell indices are not exact in f64.
const MAX_INDEX: f64 = 9007199254740992.0;

/// Reads the arrays of an archive.
pub(super) fn read(
    mut archive: Archive<'_, '_>,
    options: &ReadOptions,
    visitor: &mut dyn Visitor,
) -> Result<(), Fault> {
    let entries = archive.names();
    let names: Vec<&str> = entries.iter().filter_map(|name| name.strip_suffix(".npy")).collect();
    let one_of = |known: &[&str]| known.iter().find_map(|known| names.iter().find(|name| name == &known)).copied();
    let archive = &mut archive;
    let Some(name) = one_of(&["cells", "occupancy", "density", "alpha", "points", "xyz", "positions"]) else {
        if let [name] = names[..] {
            return of_any_shape(&mut Member::new(archive, name)?, options, visitor).map_err(|f| within(name, f));
        }
        let mut found = names.iter().take(20).map(|name| format!("{name:?}")).collect::<Vec<_>>().join(", ");
        if found.is_empty() {
            found = "no array".into();
        }
        let known = "cells, occupancy, density, alpha, points, xyz, positions or a single array";
        return Err(Fault::malformed("the archive", known, found));
    };
    let in_name = |fault| within(name, fault);
    match name {
        "cells" => cells(archive, one_of(&["colors"]), visitor),
        "occupancy" => {
            let bounds = bounds(archive, &one_of)?;
            grids::occupancy(&mut Member::new(archive, name)?, Order::Zyx, bounds, options, visitor).map_err(in_name)
        }
        "density" => {
            let bounds = bounds(archive, &one_of)?;
            let shift = match (one_of(&["act_shift"]), one_of(&["alpha_init"])) {
                (Some(name), _) => numbers::<1>(archive, name)?[0],
                (None, Some(name)) => Density::shift_of(numbers::<1>(archive, name)?[0])?,
                (None, None) => 0.0,
            };
            let interval = match one_of(&["voxel_size_ratio"]) {
                Some(name) => numbers::<1>(archive, name)?[0],
                None => 1.0,
            };
            let density = Density::new(shift, interval)?;
            let occupied = |value| density.alpha(value) >= options.min_alpha;
            let array = &mut Member::new(archive, name)?;
            grids::occupied(array, Order::Xyz, At::Vertices, bounds, options, visitor, &occupied).map_err(in_name)
        }
        "alpha" => {
            let bounds = bounds(archive, &one_of)?;
            let array = &mut Member::new(archive, name)?;
            let occupied = |value| value > options.min_alpha;
            grids::occupied(array, Order::Xyz, At::Vertices, bounds, options, visitor, &occupied).map_err(in_name)
        }
        _ => {
            let colors = match one_of(&["colors", "rgb"]) {
                Some(name) => {
                    let colors = points::colors(&mut Member::new(archive, name)?);
                    Some(colors.map_err(|fault| within(name, fault))?)
                }
                None => None,
            };
            points::read(&mut Member::new(archive, name)?, colors, visitor).map_err(in_name)
        }
    }
}

/// An array of an archive.
struct Member<'z, 'a, 'b> {
    archive: &'z mut Archive<'a, 'b>,
    entry: String,
    header: Header,
}

impl<'z, 'a, 'b> Member<'z, 'a, 'b> {
    fn new(archive: &'z mut Archive<'a, 'b>, name: &str) -> Result<Self, Fault> {
        let entry = format!("{name}.npy");
        let mut bytes = archive.entry(&entry)?;
        let header = Header::read(&mut bytes).map_err(|error| within(name, error.into()))?;
        // The header's own bytes are not subtracted here: `check_end_of` checks later that the numbers end the entry.
        if header.bytes() > bytes.size() {
            let expected = format!("{} bytes of numbers", header.bytes());
            return Err(Fault::malformed(name, expected, format!("{} bytes", bytes.size())));
        }
        drop(bytes);
        Ok(Self { archive, entry, header })
    }
}

impl Array for Member<'_, '_, '_> {
    fn header(&self) -> &Header {
        &self.header
    }

    fn visit(&mut self, count: u64, visit: &mut dyn FnMut(u64, f64) -> Result<(), Fault>) -> Result<(), Fault> {
        let mut bytes = self.archive.entry(&self.entry)?;
        let header = first(&Header::read(&mut bytes)?, count);
        header.for_each(&mut bytes, visit)?;
        if count >= self.header.count { check_end_of(&mut bytes, "the array") } else { Ok(()) }
    }
}

/// `fault` with the array's name before its place.
fn within(name: &str, fault: Fault) -> Fault {
    match fault {
        Fault::Broken { place, problem } => Fault::Broken { place: format!("{name}: {place}"), problem },
        Fault::Malformed(Invalid { place, expected, found }) => {
            Fault::malformed(format!("{name}: {place}"), expected, found)
        }
        Fault::NotFinite(Invalid { place, expected, found }) => {
            Fault::NotFinite(Invalid::new(format!("{name}: {place}"), expected, found))
        }
        other => other,
    }
}

/// The N finite numbers of an array of any shape.
fn numbers<const N: usize>(archive: &mut Archive<'_, '_>, name: &str) -> Result<[f64; N], Fault> {
    let mut array = Member::new(archive, name)?;
    if array.header.count != N as u64 {
        return Err(Fault::malformed(name, format!("{N} numbers"), array.header.count));
    }
    let mut numbers = [0.0; N];
    let visited = array.visit(N as u64, &mut |n, value| {
        numbers[n as usize] = value;
        Ok(())
    });
    visited.map_err(|fault| within(name, fault))?;
    if numbers.iter().any(|n| !n.is_finite()) {
        return Err(Fault::malformed(name, "finite numbers", format!("{numbers:?}")));
    }
    Ok(numbers)
}

/// The bounds of the grid, if the archive has them.
fn bounds<'n>(
    archive: &mut Archive<'_, '_>,
    one_of: &dyn Fn(&[&str]) -> Option<&'n str>,
) -> Result<Option<Aabb>, Fault> {
    let corners = match (one_of(&["bounds"]), one_of(&["xyz_min"]), one_of(&["xyz_max"])) {
        (Some(name), _, _) => numbers::<6>(archive, name)?,
        (None, Some(min), Some(max)) => {
            let (min, max) = (numbers::<3>(archive, min)?, numbers::<3>(archive, max)?);
            std::array::from_fn(|n| if n < 3 { min[n] } else { max[n - 3] })
        }
        _ => return Ok(None),
    };
    Ok(Some(Aabb { min: DVec3::from_slice(&corners[..3]), max: DVec3::from_slice(&corners[3..]) }))
}

/// Passes the occupied cells of a lattice to `visitor`.
fn cells(archive: &mut Archive<'_, '_>, colors: Option<&str>, visitor: &mut dyn Visitor) -> Result<(), Fault> {
    let origin = DVec3::from_array(numbers(archive, "origin")?);
    let pitch = DVec3::from_array(numbers(archive, "pitch")?);
    if pitch.min_element() <= 0.0 {
        return Err(Fault::malformed("pitch", "numbers above 0", pitch));
    }
    let colors = match colors {
        Some(name) => Some(points::colors(&mut Member::new(archive, name)?).map_err(|fault| within(name, fault))?),
        None => None,
    };
    let array = &mut Member::new(archive, "cells")?;
    let mut read = |array: &mut Member<'_, '_, '_>| {
        let shape = points::rows_and_columns(array, "cells")?;
        let [count, columns] = shape;
        if columns != 3 || matches!(array.header.number, Number::Bool | Number::Float(_)) {
            let found = format!("{:?} of {:?}", array.header.shape, array.header.number);
            return Err(Fault::malformed("the array", "integers of shape (n, 3)", found));
        }
        if let Some(colors) = colors.as_ref().filter(|colors| colors.len() as u64 != count) {
            return Err(Fault::malformed("the array", format!("{} rows, one for each color", colors.len()), count));
        }
        points::rows(array, shape, 3, &mut |n, row| {
            if n % REPORT_EVERY == REPORT_EVERY - 1 {
                visitor.progress(n, count)?;
            }
            let cell = DVec3::from_slice(row);
            let at = Aabb { min: origin + cell * pitch, max: origin + (cell + 1.0) * pitch };
            if cell.abs().max_element() >= MAX_INDEX || !at.is_solid() {
                return Err(Fault::malformed(format!("cell {n}"), "a cell with finite corners", cell));
            }
            visitor.cell(&at, colors.as_ref().map(|colors| colors[n as usize]))
        })
    };
    read(array).map_err(|fault| within("cells", fault))
}
