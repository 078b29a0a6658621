//! The mesh of a ScanNet scene and its alignment.

use std::path::{Path, PathBuf};

use glam::DMat4;

use crate::dataset;
use strivec_import::{Fault, ImportError, Transformed, Visitor};

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
        Transformed { visitor, transform: self.alignment, place: &|| "an aligned vertex".into() }
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use glam::DVec3;

    use super::*;
    use strivec_import::Point;
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
