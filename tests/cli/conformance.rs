//! The conformance suite of the format: this reader makes of each file what `expected.json` records.

use std::path::{Path, PathBuf};

use crate::command::{json_of, pack};
use serde_json::Value;

/// Difference of traced rays, which depend on the machine's functions.
const ROUNDING: f64 = 1e-9;

/// The places in which `expected` and `found` differ.
fn differences(place: &str, expected: &Value, found: &Value, differ: &mut Vec<String>) {
    match (expected, found) {
        (Value::Object(a), Value::Object(b)) if a.keys().eq(b.keys()) => {
            a.iter().for_each(|(key, value)| differences(&format!("{place}.{key}"), value, &b[key], differ));
        }
        (Value::Array(a), Value::Array(b)) if a.len() == b.len() => {
            a.iter().zip(b).enumerate().for_each(|(n, (a, b))| differences(&format!("{place}[{n}]"), a, b, differ));
        }
        (Value::Number(a), Value::Number(b)) => {
            let [a, b] = [a, b].map(|number| number.as_f64().unwrap());
            if (a - b).abs() > ROUNDING * a.abs().max(1.0) {
                differ.push(format!("{place} must be {a}, is {b}"));
            }
        }
        _ if expected == found => {}
        _ => differ.push(format!("{place} must be {expected}, is {found}")),
    }
}

fn differing(expected: &Value, found: &Value) -> Vec<String> {
    let mut differ = Vec::new();
    differences("", expected, found, &mut differ);
    differ
}

#[test]
fn this_reader_conforms() {
    let root = PathBuf::from(env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(root.join("format-spec/conformance/expected.json")).unwrap();
    let mut expected: Value = serde_json::from_str(&text).unwrap();
    let files: Vec<String> =
        expected.as_array().unwrap().iter().map(|row| row["file"].as_str().unwrap().to_owned()).collect();
    let fixtures = root.join("fixtures");
    let count = |folder: &str| {
        let entries = std::fs::read_dir(fixtures.join(folder)).unwrap();
        entries.filter(|entry| entry.as_ref().unwrap().path().extension().is_some_and(|e| e == "strivec")).count()
    };
    assert_eq!(files.len(), ["v1", "skipped", "hostile"].into_iter().map(count).sum::<usize>(), "all files are listed");
    assert!(files.iter().all(|file| Path::new(file).parent().is_some()));

    let names: Vec<&str> = files.iter().map(String::as_str).collect();
    let conform = [&["--json", "--quiet", "conform", "--memory", "64"][..], &names].concat();
    let found = json_of(&pack(&fixtures, &conform));
    assert_eq!(differing(&expected, &found), Vec::<String>::new());

    // The comparison sees a number, a class and a missing section.
    let wrong = |change: &dyn Fn(&mut Value)| {
        let mut changed = expected.clone();
        change(&mut changed);
        differing(&changed, &found).len()
    };
    let row = |kind: &str| files.iter().position(|file| file.starts_with(kind)).unwrap();
    let (valid, hostile, skipped) = (row("v1/"), row("hostile/"), row("skipped/"));
    assert_eq!(wrong(&|rows| rows[valid]["numbers"]["step"] = 1.5e-3.into()), 1);
    assert_eq!(wrong(&|rows| rows[hostile]["class"] = "kind".into()), 1);
    assert_eq!(wrong(&|rows| rows[skipped]["skipped"] = Value::Array(Vec::new())), 1);
    expected[valid]["numbers"]["scales"][0]["density"] = 1.into();
    assert_eq!(differing(&expected, &found).len(), 1);
}
