//! Checks of the guarantees of readers, shared by their targets.

use std::path::PathBuf;

use glam::DVec3;
use strivec::dataset::LoadOptions;
use strivec::geometry::Aabb;
use strivec::import::{Fault, Input, Point, ReadOptions, Visitor};

/// Points, triangles and cells after which the visitor ends the reading.
const MOST: u64 = 1 << 16;

/// Checks that numbers are finite and that the reader stops after an error of the visitor.
#[derive(Default)]
struct CheckingVisitor {
    seen: u64,
    ended: bool,
}

impl CheckingVisitor {
    fn see(&mut self, finite: bool) -> Result<(), Fault> {
        assert!(finite, "a number that is not finite");
        assert!(!self.ended, "more after the end");
        self.seen += 1;
        self.ended = self.seen >= MOST;
        if self.ended { Err(Fault::Stopped) } else { Ok(()) }
    }
}

impl Visitor for CheckingVisitor {
    fn point(&mut self, point: Point) -> Result<(), Fault> {
        self.see(point.position.is_finite())
    }

    fn triangle(&mut self, corners: [Point; 3]) -> Result<(), Fault> {
        self.see(corners.iter().all(|c| c.position.is_finite()))
    }

    fn splat(&mut self, center: Point, axes: [DVec3; 3]) -> Result<(), Fault> {
        self.see(center.position.is_finite() && axes.iter().all(|axis| axis.is_finite()))
    }

    fn cell(&mut self, cell: &Aabb, _: Option<[u8; 3]>) -> Result<(), Fault> {
        self.see(cell.min.is_finite() && cell.max.is_finite())
    }

    fn progress(&mut self, done: u64, total: u64) -> Result<(), Fault> {
        assert!(done <= total, "{done} of {total}");
        Ok(())
    }
}

/// Calls `read` on `bytes` with two sets of options. It must return without a panic.
pub fn import(bytes: &[u8], read: impl Fn(&mut Input<'_>, &ReadOptions, &mut dyn Visitor) -> Result<(), Fault>) {
    let usual = ReadOptions::default();
    let filtered = ReadOptions {
        vertices: true,
        min_confidence: 0.5,
        min_track: 2,
        max_reprojection_error: 1.0,
        bounds: Some(Aabb { min: [-1.0; 3].into(), max: [1.0; 3].into() }),
        ..usual
    };
    for options in [usual, filtered] {
        let _ = read(&mut Input::from_bytes(bytes), &options, &mut CheckingVisitor::default());
    }
}

/// A folder of this process with `files` alone.
fn folder_of(files: &[(&str, &[u8])]) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("strivec-fuzz-{}", std::process::id()));
    // Files of the last input would be read, too.
    let _ = std::fs::remove_dir_all(&folder);
    for (name, bytes) in files {
        let path = folder.join(name);
        std::fs::create_dir_all(path.parent().expect("a file in the folder")).expect("a folder");
        std::fs::write(path, bytes).expect("a file");
    }
    folder
}

/// Decodes `bytes` as a picture, within 64 MB.
pub fn photograph(bytes: &[u8]) {
    let pose = "[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]";
    let json = format!(r#"{{"fl_x": 10, "frames": [{{"file_path": "a.jpg", "transform_matrix": {pose}}}]}}"#);
    let folder = folder_of(&[("transforms_train.json", json.as_bytes()), ("a.jpg", bytes)]);
    let options = LoadOptions { max_memory: 64_000_000, ..LoadOptions::default() };
    let Ok(dataset) = strivec::dataset::load(&folder, "train", &options) else { return };
    for view in dataset.views {
        assert_eq!(view.pixels.len(), view.camera.width as usize * view.camera.height as usize);
    }
}

/// Reads the cameras of a dataset of `files`, which are written into a folder of this process.
pub fn describe(files: &[(&str, &[u8])]) {
    let folder = folder_of(files);
    let Ok(found) = strivec::dataset::describe(&folder, &Default::default()) else { return };
    for named in found.splits.iter().flat_map(|(_, cameras)| cameras) {
        let camera = &named.camera;
        assert!(camera.position.is_finite() && camera.focal.iter().all(|f| f.is_finite() && *f > 0.0));
        for (x, y) in [(0, 0), (camera.width / 2, camera.height / 2), (camera.width - 1, camera.height - 1)] {
            let ray = camera.ray(x, y);
            assert!(ray.is_none_or(|ray| (ray.direction.length() - 1.0).abs() < 1e-9), "a ray of length 1");
        }
    }
}
