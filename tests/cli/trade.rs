//! The command `strivec trade` on a small file.

use std::fs;

use crate::command::{PACK, json_of, run_program, strivec};
use serde_json::Value;

const FIXTURE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/fixtures/v1/f32.strivec");

/// A small sweep of pictures of this width.
fn sweep<'a>(size: &'a str, combinations: &'a str, more: &[&'a str]) -> Vec<&'a str> {
    let own = ["trade", "scene.strivec", "--views", "2", "--rounds", "2", "--quiet", "--json"];
    [&own[..], &["--size", size, "--combinations", combinations], more].concat()
}

#[test]
fn a_sweep_measures_reports_and_stores_settings_that_render_accepts() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    fs::copy(FIXTURE, folder.join("scene.strivec")).unwrap();
    let report = json_of(&strivec(folder, &sweep("48", "8", &["--encodings", "--store"])));

    let rows = report["rows"].as_array().unwrap();
    let row = |name: &str| rows.iter().find(|row| row["name"] == name).unwrap_or_else(|| panic!("{name}: {report:#}"));
    let psnr = |name: &str| row(name)["psnr"].as_f64().unwrap();
    assert_eq!(psnr("exact"), 99.0, "its own pictures are the same");
    assert!(psnr("step x4") < psnr("step x1.5"));
    assert!(row("grid6")["bytes"].as_u64() < row("f16")["bytes"].as_u64());
    assert!(psnr("grid6") < psnr("f16"));
    for row in rows {
        assert!(row["milliseconds"]["count"] == 2 && row["memory_bytes"].as_u64() > Some(0), "{row:#}");
    }
    // No point of the front is dominated.
    let front = report["front"]["points"].as_array().unwrap();
    for pair in front.windows(2) {
        assert!(pair[0]["psnr"].as_f64() < pair[1]["psnr"].as_f64(), "{front:#?}");
        assert!(pair[0]["milliseconds"].as_f64() <= pair[1]["milliseconds"].as_f64(), "{front:#?}");
    }
    for file in ["trade.json", "trade.csv", "time.svg", "time.png", "size.svg", "size.png", "pictures.png"] {
        assert!(fs::metadata(folder.join("trade").join(file)).unwrap().len() > 100, "{file}");
    }
    assert_eq!(fs::read_to_string(folder.join("trade/trade.csv")).unwrap().lines().count(), rows.len() + 1);

    // Stored settings are available by name.
    let names: Vec<_> = front.iter().flat_map(|p| p["names"].as_array().cloned().unwrap_or_default()).collect();
    assert_eq!(names.len(), 3, "{names:?}");
    let fast = front.iter().find(|p| p["names"].as_array().is_some_and(|n| n.contains(&"fast".into()))).unwrap();
    let render = |more: &[&str]| {
        let views = ["render", "scene.strivec", "--orbit", "1", "--size", "32x32", "--out", "frames"];
        strivec(folder, &[&views[..], &["--force", "--quiet", "--json"], more].concat())
    };
    let drawn = json_of(&render(&["--quality", "fast"]));
    assert_eq!(drawn["approximation"], fast["settings"]["approximation"]);
    assert_eq!(json_of(&render(&["--quality", "best"]))["files"], drawn["files"]);
    json_of(&render(&["--min-psnr", "20"]));
    json_of(&render(&["--min-fps", "0.001"]));
    for (wish, expected) in [
        (&["--quality", "wild"][..], "fast"),
        (&["--min-psnr", "1000"], "99.00 dB"),
        (&["--min-fps", "1e9"], "99.00 dB"),
        (&["--min-fps", "5", "--min-psnr", "5"], "cannot be used with"),
    ] {
        let refused = render(wish);
        let message = String::from_utf8_lossy(&refused.stderr).into_owned();
        assert!(refused.status.code() == Some(1) && message.contains(expected), "{wish:?}: {message}");
    }

    // Stored settings can be applied to a file.
    let convert = ["convert", "scene.strivec", "-o", "fast.strivec", "--quality", "fast", "--quiet"];
    run_program(PACK, folder, &convert);
    run_program(PACK, folder, &["verify", "fast.strivec"]);
}

#[test]
fn a_sweep_resumes_and_refuses_the_log_of_another() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    fs::copy(FIXTURE, folder.join("scene.strivec")).unwrap();
    let arguments = sweep("48", "0", &["--threads-list", "1"]);
    let first = json_of(&strivec(folder, &arguments));
    let log = folder.join("trade/visits.jsonl");
    let whole = fs::read_to_string(&log).unwrap();
    // As if it had been stopped while it wrote a line.
    let cut = whole.len() / 2;
    fs::write(&log, &whole[..cut]).unwrap();
    let again = json_of(&strivec(folder, &arguments));
    let kept = whole[..cut].lines().count() - 1;
    let now = fs::read_to_string(&log).unwrap();
    assert!(now.lines().take(kept).eq(whole.lines().take(kept)), "measured pictures were measured again");
    assert_eq!(now.lines().count(), whole.lines().count());
    let psnrs =
        |report: &Value| report["rows"].as_array().unwrap().iter().map(|r| r["psnr"].clone()).collect::<Vec<_>>();
    assert_eq!(psnrs(&first), psnrs(&again));

    let as_text: Vec<&str> = arguments.iter().copied().filter(|argument| *argument != "--json").collect();
    let table = String::from_utf8(strivec(folder, &as_text).stdout).unwrap();
    assert!(table.contains("time: share of the exact picture's time, median over rounds"), "{table}");
    assert!(table.contains(", 1 thread") || table.contains(" threads\n"), "{table}");

    let other = strivec(folder, &sweep("40", "0", &[]));
    let message = String::from_utf8_lossy(&other.stderr).into_owned();
    assert!(other.status.code() == Some(1) && message.contains("belongs to another sweep"), "{message}");
}
