//! Options of synthetic datasets, and writing their files.

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::Path;

use super::camera_model::CameraModel;
use super::layout::SynthLayout;
use super::surroundings::Surroundings;
use crate::Error;
use strivec_format::{Invalid, Place};

/// The most views of a split.
const MAX_VIEWS: u32 = 10_000;
/// The longest edge of a picture that is made.
const MAX_EDGE: u32 = 4096;

/// Options of synthetic datasets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SynthOptions {
    /// The layout.
    pub layout: SynthLayout,
    /// The camera model, one of [`SynthLayout::cameras`].
    pub camera: CameraModel,
    /// Training views, 1 to 10 000.
    pub views: u32,
    /// Test views, from other positions than the training views, 1 to 10 000. Layouts with splits have a quarter of
    /// this number for validation; in others it must be such that every eighth picture is a test view, as of
    /// [`SynthLayout::test_views`].
    pub test_views: u32,
    /// Columns and rows of the pictures, each 1 to 4096.
    pub size: [u32; 2],
    /// Seed of the cameras' positions and the textures' variations; the geometry is always the same.
    pub seed: u64,
    /// The surroundings of the still life. ScanNet's layout describes rooms and rejects a meadow and a floor.
    pub surroundings: Surroundings,
    /// If true, also writes to a folder that is not empty, replacing files of the same names and keeping all others.
    pub force: bool,
}

impl Default for SynthOptions {
    /// 100 training and 20 test views of 200×200 pixels by a pinhole camera, in the Blender layout.
    fn default() -> Self {
        let (layout, camera) = (SynthLayout::Blender, CameraModel::Pinhole);
        let surroundings = Surroundings::None;
        Self { layout, camera, views: 100, test_views: 20, size: [200, 200], seed: 0, surroundings, force: false }
    }
}

/// Counts of a synthetic dataset.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Synthesized {
    /// Number of pictures of all splits, including those without a pose.
    pub pictures: usize,
    /// Number of pictures whose pose is lost; 0 but in ScanNet's layout.
    pub lost: usize,
    /// Number of triangles of the mesh.
    pub triangles: usize,
    /// The share of the surface's area that is missing in the mesh; 0 but in ScanNet's layout.
    pub torn: f64,
    /// Number of points on the surface; 0 in ScanNet's layout.
    pub points: usize,
    /// Number of cells that the scene occupies; 0 in ScanNet's layout.
    pub occupied_cells: usize,
}

/// Rejects options that are out of range, and camera models and splits that the layout cannot state.
pub(super) fn check(options: &SynthOptions) -> Result<(), Error> {
    let SynthOptions { layout, camera, views, test_views, size: [width, height], .. } = *options;
    for (what, limit, found) in [
        ("views", MAX_VIEWS, views),
        ("test_views", MAX_VIEWS, test_views),
        ("width", MAX_EDGE, width),
        ("height", MAX_EDGE, height),
    ] {
        if !(1..=limit).contains(&found) {
            return Err(Invalid::new(Place::option(what), format_args!("1 to {limit}"), found).into());
        }
    }
    if !layout.cameras().contains(&camera) {
        let names: Vec<_> = layout.cameras().iter().map(|camera| camera.name()).collect();
        let expected = format!("{} in the layout {}", names.join(", "), layout.name());
        return Err(Invalid::new(Place::option("camera"), expected, camera.name()).into());
    }
    let outdoors = match options.surroundings {
        Surroundings::Meadow => Some("a meadow"),
        Surroundings::Floor => Some("a floor"),
        Surroundings::None | Surroundings::Room => None,
    };
    if let Some(found) = outdoors.filter(|_| layout == SynthLayout::ScanNet) {
        let place = Place::option("surroundings");
        return Err(Invalid::new(place, "a room or none in the layout scannet", found).into());
    }
    match layout.test_views(views) {
        Some(expected) if !layout.splits(views, test_views) => {
            let layout = layout.name();
            let expected =
                format!("{expected} for {views} training views, as the layout {layout} holds out every eighth picture");
            Err(Invalid::new(Place::option("test_views"), expected, test_views).into())
        }
        _ => Ok(()),
    }
}

/// Creates the folder. Rejects one that is not empty unless `force` is true.
pub(super) fn prepare(out: &Path, force: bool) -> Result<(), Error> {
    fs::create_dir_all(out).map_err(Error::write(out))?;
    let occupied = fs::read_dir(out).map_err(Error::read(out))?.next().is_some();
    if occupied && !force {
        return Err(Error::FolderNotEmpty { path: out.to_path_buf() });
    }
    Ok(())
}

/// Creates the file `path` with the bytes that `fill` writes.
pub(super) fn write(path: &Path, fill: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>) -> Result<(), Error> {
    let written = File::create(path).map(BufWriter::new).and_then(|mut file| {
        fill(&mut file)?;
        file.flush()
    });
    written.map_err(Error::write(path))
}
