//! The commands `strivec eval` and `strivec compare` with the files that they write, on scenes of the fixtures.

use crate::command;

use std::fs;
use std::path::Path;

use command::{json, run, strivec};
use tempfile::TempDir;

const FIXTURE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/fixtures/v1/f32.strivec");
/// A scene of the same background with a sky, which views of the dataset show.
const WITH_SKY: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/fixtures/v1/sky.strivec");
const OTHER_BACKGROUND: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/fixtures/v1/everything.strivec");

/// A folder with the scenes `a.strivec` and `b.strivec`, and a dataset of three test views in `data`.
fn folder() -> TempDir {
    let folder = TempDir::new().unwrap();
    fs::copy(FIXTURE, folder.path().join("a.strivec")).unwrap();
    fs::copy(WITH_SKY, folder.path().join("b.strivec")).unwrap();
    run(folder.path(), &["synth", "data", "--views", "4", "--test-views", "3", "--size", "32x24", "--quiet"]);
    folder
}

/// Rows of a CSV file without quoted fields.
fn rows(path: &Path) -> Vec<Vec<String>> {
    let text = fs::read_to_string(path).unwrap();
    text.lines().map(|line| line.split(',').map(str::to_owned).collect()).collect()
}

#[test]
fn csv_json_and_page_of_an_evaluation_agree() {
    let folder = folder();
    let folder = folder.path();
    let files = ["--csv", "a.csv", "--report", "a.html", "--report-views", "2", "--report-pictures", "png"];
    let arguments = [&["eval", "a.strivec", "data", "--ssim", "3dgs,skimage"][..], &files].concat();
    let result = json(folder, &arguments);
    let table = rows(&folder.join("a.csv"));
    assert_eq!(table[0].join(","), "file,view,mse,psnr,psnr_after_color_fit,ssim,ssim_3dgs,ssim_skimage");
    assert_eq!(table.len(), 4);
    for (row, view) in table[1..].iter().zip(result["views"].as_array().unwrap()) {
        assert_eq!((row[0].as_str(), row[1].as_str()), ("a.strivec", view["name"].as_str().unwrap()));
        for (name, text) in table[0].iter().zip(row).skip(2) {
            assert_eq!(text.parse::<f64>().unwrap(), view[name].as_f64().unwrap(), "{name}");
        }
    }
    let mean = table[1..].iter().map(|row| row[6].parse::<f64>().unwrap()).sum::<f64>() / 3.0;
    assert!((result["ssim_3dgs"].as_f64().unwrap() - mean).abs() < 1e-12, "{result}");

    let page = fs::read_to_string(folder.join("a.html")).unwrap();
    assert_eq!((page.matches("src=\"data:image/png;base64,").count(), page.matches("<figure").count()), (6, 2));
    assert!(page.contains("<th scope=\"col\">SSIM 3dgs</th>") && !page.contains("://"), "the page loads nothing");
    // Nothing is overwritten without --force.
    let output = strivec(folder, &arguments);
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.code() == Some(1) && message.contains("--force"), "{message}");
    let text = run(folder, &["eval", "a.strivec", "data", "--ssim", "3dgs", "--quiet"]);
    assert!(text.lines().next().unwrap().ends_with("SSIM  SSIM 3dgs"), "{text}");
}

#[test]
fn comparison_has_the_mean_of_differences_and_its_standard_error() {
    let folder = folder();
    let folder = folder.path();
    let compared = json(folder, &["compare", "a.strivec", "b.strivec", "data", "--csv", "c.csv", "--report", "c.html"]);
    let psnr = |file: usize| -> Vec<f64> {
        let views = compared["files"][file]["views"].as_array().unwrap();
        views.iter().map(|view| view["psnr"].as_f64().unwrap()).collect()
    };
    let differences: Vec<f64> = psnr(1).iter().zip(psnr(0)).map(|(b, a)| b - a).collect();
    let mean = differences.iter().sum::<f64>() / 3.0;
    let error = (differences.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / 2.0 / 3.0).sqrt();
    let found = &compared["differences"][0]["psnr"];
    assert!(error > 0.0 && (found["mean"].as_f64().unwrap() - mean).abs() < 1e-12, "{found}");
    assert!((found["standard_error"].as_f64().unwrap() - error).abs() < 1e-12, "{found}");
    assert_eq!(compared["differences"].as_array().unwrap().len(), 1);

    // Each file has what `eval` prints of it.
    let alone = json(folder, &["eval", "b.strivec", "data"]);
    assert_eq!(alone["views"], compared["files"][1]["views"]);
    assert_eq!(rows(&folder.join("c.csv")).len(), 7);
    let page = fs::read_to_string(folder.join("c.html")).unwrap();
    assert_eq!(page.matches("src=\"data:image/jpeg;base64,").count(), 15, "5 pictures of 3 views");
    assert!(page.contains("alt=\"rendering B\"") && page.contains("<th scope=\"col\">PSNR B − A</th>"));

    let same = json(folder, &["compare", "a.strivec", "a.strivec", "data"]);
    assert_eq!(same["differences"][0]["ssim"]["mean"], 0.0);
    assert_eq!(same["differences"][0]["ssim"]["standard_error"], 0.0);
    let text = run(folder, &["compare", "a.strivec", "b.strivec", "data", "--quiet"]);
    assert!(text.contains(&format!("{mean:+.3} ± {error:.3}")) && text.contains("mean over 3 views"), "{text}");
}

#[test]
fn wrong_arguments_are_named() {
    let folder = folder();
    let folder = folder.path();
    for (arguments, code, expected) in [
        (&["--ssim", "sk"][..], 1, "skimage"),
        (
            &["--ssim", "skimage", "--downscale", "4"],
            1,
            "view r_0: SSIM needs pictures of at least 7x7 pixels, not 8x6",
        ),
        (&["--csv", "x", "--report", "x"], 1, "--csv and --report name the same file"),
    ] {
        let output = strivec(folder, &[&["eval", "a.strivec", "data", "--quiet"][..], arguments].concat());
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.code() == Some(code) && message.contains(expected), "{arguments:?}: {message}");
    }
    let output = strivec(folder, &["compare", "a.strivec", "data"]);
    assert_eq!(output.status.code(), Some(1), "one file");
    let output = strivec(folder, &["compare", "a.strivec", OTHER_BACKGROUND, "data", "--quiet"]);
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    let expected = "its background is (1, 0.5, 0.25), that of a.strivec is (1, 0.9, 0.2): the transparent photographs";
    assert!(output.status.code() == Some(1) && message.contains(expected), "{message}");
}
