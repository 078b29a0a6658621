//! Scenes of other programs: checkpoints of TensoRF against PyTorch's own pictures of them.

use crate::data;

use std::fs;
use std::io::Cursor;
use std::path::Path;

use strivec_checkpoints::{SceneOptions, tensorf, tensorf_checkpoint, write_checkpoint};
use strivec_field::render::{CpuRenderer, ReferenceRenderer, Renderer};
use strivec_format::container::{EncodeOptions, decode, encode};
use strivec_format::geometry::Ray;
use strivec_format::model::{FactorKind, Scene, UpAxis};
use strivec_import::Input;
use strivec_import::npy::Header;

/// Every so many rays are compared.
const EVERY: usize = 37;
/// The error of PyTorch's positions, single precision up to 6 units away: rays whose decisions a displacement of this changes are
/// left out.
const POSITION_ERROR: f64 = 1e-5;
/// The largest difference of a color on clear rays.
const LARGEST: f64 = 2e-5;
const SIZE: u32 = 200;

fn options() -> SceneOptions {
    SceneOptions { background: [1.0; 3], up: UpAxis::Z, dataset: "lego".into() }
}

fn scene(path: &Path) -> Scene {
    tensorf::read(&mut Input::open(path).unwrap(), &options()).unwrap()
}

/// The rays of test view `n` of lego, at 200 × 200 pixels, as PyTorch has them: computed in single precision.
fn rays(lego: &Path, n: usize) -> Vec<Ray> {
    let text = fs::read_to_string(lego.join("transforms_test.json")).unwrap();
    let json: serde_json::Value = serde_json::from_str(&text).unwrap();
    let number = |v: &serde_json::Value| v.as_f64().unwrap();
    let rows = json["frames"][n]["transform_matrix"].as_array().unwrap();
    let pose: Vec<Vec<f32>> =
        rows.iter().map(|row| row.as_array().unwrap().iter().map(|v| number(v) as f32).collect()).collect();
    let half = 0.5 * f64::from(SIZE);
    let focal = (half / (0.5 * number(&json["camera_angle_x"])).tan()) as f32;
    let along = |pixel: u32| ((f64::from(pixel) + 0.5 - half) as f32) / focal;
    let ray = |index: u32| {
        // y down and z forwards.
        let [x, y] = [along(index % SIZE), along(index / SIZE)];
        let length = (x * x + y * y + 1.0).sqrt();
        let [x, y, z] = [x / length, -y / length, -1.0 / length];
        let direction = [0, 1, 2].map(|a| f64::from(pose[a][0] * x + pose[a][1] * y + pose[a][2] * z));
        let origin = [0, 1, 2].map(|a| f64::from(pose[a][3]));
        Ray { origin: origin.into(), direction: direction.into() }
    };
    (0..SIZE * SIZE).map(ray).collect()
}

/// PyTorch's picture.
fn picture(path: &Path) -> Vec<[f64; 3]> {
    let bytes = fs::read(path).unwrap();
    let mut rest = bytes.as_slice();
    let header = Header::read(&mut rest).unwrap();
    assert_eq!(header.shape, [u64::from(SIZE), u64::from(SIZE), 3], "a picture");
    header.numbers(&mut rest).unwrap().as_chunks().0.to_vec()
}

/// The differences of colors to PyTorch's on the rays whose margin is clear: of the reference, and of the fast renderer.
#[derive(Debug, Default)]
struct Difference {
    rays: usize,
    clear: usize,
    largest: [f64; 2],
    /// Clear rays of a larger difference than `LARGEST`.
    above: [usize; 2],
    mean: [f64; 2],
}

/// Compares every `every`th of `rays`.
fn difference(scene: &Scene, rays: &[Ray], expected: &[[f64; 3]], every: usize) -> Difference {
    let (rays, expected): (Vec<Ray>, Vec<[f64; 3]>) = rays.iter().zip(expected).step_by(every).unzip();
    let (reference, fast) = (ReferenceRenderer::new(scene), CpuRenderer::unlimited(scene));
    let mut found = Difference { rays: rays.len(), ..Difference::default() };
    for ((ray, expected), pixel) in rays.iter().zip(&expected).zip(fast.trace(&rays)) {
        let trace = reference.trace_one(ray);
        if trace.margin <= POSITION_ERROR {
            continue;
        }
        found.clear += 1;
        for (which, color) in [trace.color, pixel.color.map(f64::from)].into_iter().enumerate() {
            let differences = [0, 1, 2].map(|c| (color[c].clamp(0.0, 1.0) - expected[c]).abs());
            let largest = differences.into_iter().fold(0.0, f64::max);
            found.largest[which] = found.largest[which].max(largest);
            found.above[which] += usize::from(largest > LARGEST);
            found.mean[which] += differences.iter().sum::<f64>() / 3.0;
        }
    }
    found.mean = found.mean.map(|sum| sum / found.clear.max(1) as f64);
    found
}

/// The bytes of the checkpoint of `scene`.
fn exported(scene: &Scene) -> Vec<u8> {
    let checkpoint = tensorf_checkpoint(scene).unwrap();
    write_checkpoint(Cursor::new(Vec::new()), &checkpoint).unwrap().into_inner()
}

/// The checkpoints, the beginning of the names of their pictures, and the kinds of their factors.
const CHECKPOINTS: [(&str, &str, FactorKind); 2] =
    [("lego200_vm192_iter1581.th", "vm200", FactorKind::Vm), ("lego200_cp384_iter346.th", "cp200", FactorKind::Cp)];
/// The views with pictures.
const VIEWS: [usize; 3] = [0, 50, 100];

/// The figures of docs/results.md; takes minutes.
#[test]
#[ignore = "measures, on every ray"]
fn differences_of_whole_pictures() {
    let (Some(folder), Some(lego)) = (data::folder("tensorf-lego"), data::folder("lego")) else { return };
    for (file, prefix, _) in CHECKPOINTS {
        let scene = scene(&folder.join(file));
        for view in VIEWS {
            let expected = picture(&folder.join(format!("{prefix}_r{view}.npy")));
            println!("{prefix}, view {view}: {:?}", difference(&scene, &rays(&lego, view), &expected, 1));
        }
    }
}

#[test]
fn pictures_of_imported_checkpoints_are_pytorchs_and_a_planted_difference_shows() {
    let (Some(folder), Some(lego)) = (data::folder("tensorf-lego"), data::folder("lego")) else { return };
    for (file, prefix, kind) in CHECKPOINTS {
        let scene = scene(&folder.join(file));
        assert_eq!(scene.scales[0].factors.kind(), kind);
        for view in VIEWS {
            let rays = rays(&lego, view);
            let expected = picture(&folder.join(format!("{prefix}_r{view}.npy")));
            let found = difference(&scene, &rays, &expected, EVERY);
            println!("{prefix}, view {view}: {found:?}");
            assert!(2 * found.clear > found.rays, "{found:?}");
            assert_eq!(found.above, [0; 2], "{prefix}, view {view}: {found:?}");
            let mut planted = scene.clone();
            planted.scales[0].appearance_matrix.weights.iter_mut().for_each(|w| *w *= 1.001);
            let changed = difference(&planted, &rays, &expected, EVERY);
            assert!(changed.above.iter().all(|&n| n > 0), "a planted difference goes unnoticed: {changed:?}");
        }
        assert_eq!(decode(&encode(&scene, &EncodeOptions::lossless(&scene)).unwrap()).unwrap(), scene);
        let written = exported(&scene);
        assert_eq!(tensorf::read(&mut Input::from_bytes(&written), &options()).unwrap(), scene);
        assert_eq!(exported(&tensorf::read(&mut Input::from_bytes(&written), &options()).unwrap()), written);
    }
}
