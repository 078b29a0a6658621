//! Points, vertices and triangles with a coordinate that is not finite: a few among many are left out.

use std::path::Path;

use glam::DVec3;

use crate::dataset::{InventoryEntry, Standing};
use crate::geometry;
use strivec_format::digits::{grouped, plural};
use strivec_format::geometry::Aabb;
use strivec_import::{Fault, ImportError, Point, ReadOptions, Visitor};

/// Of so many shapes one may be bad, and at least one of all.
const SHAPES_PER_BAD: u64 = 100;

/// The shapes of a file that are not finite, and the number of the others.
#[derive(Debug, Default)]
pub(super) struct BadShapes {
    pub(super) good: u64,
    bad: u64,
    /// The fault of the first.
    first: Option<Fault>,
}

impl BadShapes {
    pub(super) fn add(&mut self, fault: Fault) {
        self.bad += 1;
        self.first.get_or_insert(fault);
    }

    /// The number of shapes that are left out.
    ///
    /// # Errors
    ///
    /// If these are more than one percent, and more than one; the fault of the first, with their number.
    pub(super) fn tolerated(self) -> Result<u64, Fault> {
        let total = self.good + self.bad;
        let limit = (total / SHAPES_PER_BAD).max(1).min(self.good);
        match self.first {
            Some(Fault::NotFinite(mut invalid)) if self.bad > limit => {
                if self.bad > 1 {
                    let (bad, total) = (grouped(self.bad), grouped(total));
                    invalid.found += &format!("; {bad} of {total} are such, and at most {} left out", grouped(limit));
                }
                Err(Fault::NotFinite(invalid))
            }
            Some(fault) if self.bad > limit => Err(fault),
            _ => Ok(self.bad),
        }
    }
}

/// The number of points or triangles in the file `path` that are left out as they are not finite, and the first one's fault.
///
/// # Errors
///
/// If the file cannot be read.
pub fn not_finite_in(path: &Path) -> Result<Option<(u64, String)>, ImportError> {
    let mut counter = Counter(BadShapes::default());
    geometry::read(path, &ReadOptions::default(), &mut counter)?;
    let BadShapes { bad, first, .. } = counter.0;
    Ok(first.map(|fault| (bad, fault.to_string())))
}

/// The inventory's entry on the points of the dataset in `folder`, whose file is `file`, that are left out as they are not finite.
pub fn points_left_out(folder: &Path, file: &Path) -> Option<InventoryEntry> {
    // Depth maps that a JSON file names have no such points.
    if file.extension().is_some_and(|ending| ending == "json") {
        return None;
    }
    let (count, first) = not_finite_in(file).ok()??;
    let path = file.strip_prefix(folder).unwrap_or(file).to_string_lossy().into_owned();
    let what = format!("{} left out: {first}", plural(count as usize, "point"));
    Some(InventoryEntry { standing: Standing::Unused, path, count: count as usize, what })
}

struct Counter(BadShapes);

impl Visitor for Counter {
    fn point(&mut self, _: Point) -> Result<(), Fault> {
        Ok(())
    }

    fn triangle(&mut self, _: [Point; 3]) -> Result<(), Fault> {
        Ok(())
    }

    fn splat(&mut self, _: Point, _: [DVec3; 3]) -> Result<(), Fault> {
        Ok(())
    }

    fn cell(&mut self, _: &Aabb, _: Option<[u8; 3]>) -> Result<(), Fault> {
        Ok(())
    }

    fn not_finite(&mut self, fault: Fault) -> Result<(), Fault> {
        self.0.add(fault);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::ops::ControlFlow;
    use std::path::PathBuf;

    use super::super::{BuildOptions, build};
    use super::*;

    fn file(bad: usize, good: usize) -> (tempfile::TempDir, PathBuf) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("points.xyz");
        let good = (0..good).map(|n| format!("{} {} {}", n % 7, n / 7 % 7, n / 49));
        let lines: Vec<String> = good.chain((0..bad).map(|_| "1 nan 2".to_owned())).collect();
        fs::write(&path, lines.join("\n")).unwrap();
        (folder, path)
    }

    fn built(path: PathBuf) -> Result<u64, String> {
        let built = build(&[path], &BuildOptions::default(), &mut |_| ControlFlow::Continue(()));
        built.map(|built| built.counts.not_finite).map_err(|error| error.to_string())
    }

    #[test]
    fn one_percent_of_points_is_left_out_and_counted() {
        for (bad, good) in [(0, 4), (1, 4), (1, 300), (3, 300)] {
            let (_folder, path) = file(bad, good);
            assert_eq!(not_finite_in(&path).unwrap().map_or(0, |(count, _)| count), bad as u64);
            assert_eq!(built(path), Ok(bad as u64), "{bad} of {good}");
        }
        for (bad, good, part) in [(1, 0, "found [1, NaN, 2]"), (2, 4, "2 of 6 are such, and at most 1 left out")] {
            let (_folder, path) = file(bad, good);
            let message = built(path).unwrap_err();
            assert!(message.contains("expected finite coordinates") && message.contains(part), "{message}");
        }
    }
}
