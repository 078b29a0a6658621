//! The mesh of a ScanNet scene and its alignment.

use std::path::{Path, PathBuf};

use glam::{DMat4, DVec3};

use crate::dataset;
use strivec_format::geometry::Aabb;
use strivec_import::{Fault, ImportError, LeftOut, Point, Visitor};

/// A scan's mesh.
pub(super) struct ScanMesh {
    /// `sceneXXXX_YY_vh_clean_2.ply`, or another mesh of the folder.
    pub(super) mesh: PathBuf,
    /// Map from the mesh's space to the dataset's.
    alignment: DMat4,
}

/// The scan of `path`, its folder or a mesh in it; `None` if `path` belongs to no scan.
pub(super) fn scan_of(path: &Path) -> Result<Option<ScanMesh>, ImportError> {
    let Some(dataset::Scan { name, mesh, alignment, .. }) =
        dataset::Scan::open(path).map_err(|e| e.of_geometry(path))?
    else {
        return Ok(None);
    };
    match mesh {
        Some(mesh) => Ok(Some(ScanMesh { mesh, alignment })),
        None => Err(Fault::broken("the folder", format!("the mesh {name}_vh_clean_2.ply is missing")).of(path)),
    }
}

impl ScanMesh {
    /// A visitor that aligns geometry and passes it to `visitor`.
    pub(super) fn aligned<'a>(&'a self, visitor: &'a mut dyn Visitor) -> impl Visitor + 'a {
        Aligned { visitor, alignment: self.alignment }
    }
}

struct Aligned<'a> {
    visitor: &'a mut dyn Visitor,
    alignment: DMat4,
}

impl Aligned<'_> {
    fn turn(&self, point: Point) -> Result<Point, Fault> {
        // The largest finite coordinates may become infinite.
        Point::new(self.alignment.transform_point3(point.position), point.color, || "an aligned vertex".into())
    }
}

impl Visitor for Aligned<'_> {
    fn point(&mut self, point: Point) -> Result<(), Fault> {
        let point = self.turn(point)?;
        self.visitor.point(point)
    }

    fn triangle(&mut self, [a, b, c]: [Point; 3]) -> Result<(), Fault> {
        let corners = [self.turn(a)?, self.turn(b)?, self.turn(c)?];
        self.visitor.triangle(corners)
    }

    fn splat(&mut self, center: Point, axes: [DVec3; 3]) -> Result<(), Fault> {
        let center = self.turn(center)?;
        self.visitor.splat(center, axes.map(|axis| self.alignment.transform_vector3(axis)))
    }

    fn not_finite(&mut self, fault: Fault) -> Result<(), Fault> {
        self.visitor.not_finite(fault)
    }

    fn left_out(&mut self, reason: LeftOut) {
        self.visitor.left_out(reason);
    }

    fn cell(&mut self, _: &Aabb, _: Option<[u8; 3]>) -> Result<(), Fault> {
        // A rotated cell is not a box. Meshes have no cells.
        Err(Fault::unsupported("a scan's grid", "use its mesh"))
    }

    fn progress(&mut self, done: u64, total: u64) -> Result<(), Fault> {
        self.visitor.progress(done, total)
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;
    use strivec_import::testing::Seen;

    fn scan(text: &str) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("scene0001_00.txt"), text).unwrap();
        fs::write(folder.path().join("scene0001_00_vh_clean_2.ply"), "").unwrap();
        folder
    }

    #[test]
    fn corners_are_aligned() {
        let folder = scan("axisAlignment = 0 -1 0 3 1 0 0 4 0 0 1 5 0 0 0 1");
        let scan = scan_of(folder.path()).unwrap().unwrap();
        assert_eq!(scan.mesh, folder.path().join("scene0001_00_vh_clean_2.ply"));
        let mut seen = Seen::default();
        let at = |position| Point { position, color: None };
        let triangle = [at(DVec3::ZERO), at(DVec3::X), at(DVec3::Y)];
        scan.aligned(&mut seen).triangle(triangle).unwrap();
        scan.aligned(&mut seen).point(at(DVec3::Z)).unwrap();
        assert_eq!(
            seen.triangles[0].map(|corner| corner.position.to_array()),
            [[3.0, 4.0, 5.0], [3.0, 5.0, 5.0], [2.0, 4.0, 5.0]]
        );
        assert_eq!(seen.positions(), [[3.0, 4.0, 6.0]]);
        let far = at(DVec3::splat(f64::MAX));
        let turned = ScanMesh { alignment: DMat4::from_rotation_z(1.0), ..scan };
        let fault = turned.aligned(&mut seen).point(far).unwrap_err().to_string();
        assert!(fault.starts_with("an aligned vertex: expected finite coordinates"), "{fault}");
    }

    #[test]
    fn what_is_wrong_with_a_scan_names_its_file() {
        let folder = scan("axisAlignment = 1 2");
        let message = scan_of(folder.path()).err().unwrap().to_string();
        assert!(message.ends_with("scene0001_00.txt: axisAlignment: expected 16 numbers, found 2"), "{message}");
        let folder = tempfile::tempdir().unwrap();
        for part in ["pose", "color"] {
            fs::create_dir(folder.path().join(part)).unwrap();
        }
        let message = scan_of(folder.path()).err().unwrap().to_string();
        assert!(message.contains("the folder: the mesh ") && message.ends_with(" is missing"), "{message}");
        assert!(scan_of(&folder.path().join("absent")).unwrap().is_none());
    }
}
