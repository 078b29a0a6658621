//! The example and the limits of the specification are those of the code.

use strivec_format::container::{decode, encode, limits};

use super::roundtrip::f32;
use super::scenes::smallest;

const SPECIFICATION: &str = include_str!("../../format-spec/v1.md");

/// Lines of offset and 16 bytes.
fn dump(bytes: &[u8]) -> String {
    let line = |(n, bytes): (usize, &[u8])| {
        let hex: Vec<_> = bytes.iter().map(|b| format!("{b:02x}")).collect();
        format!("{:04x}  {}\n", 16 * n, hex.join(" "))
    };
    bytes.chunks(16).enumerate().map(line).collect()
}

#[test]
fn the_example_is_the_smallest_scene() {
    let file = encode(&smallest(), &f32()).unwrap();
    let example = SPECIFICATION.split("```hexdump\n").nth(1).and_then(|rest| rest.split("```").next());
    let expected = dump(&file);
    assert!(example == Some(&expected), "the specification should show\n{expected}");
    let mut other = file.clone();
    *other.last_mut().unwrap() ^= 1;
    assert_ne!(dump(&other), expected);
    assert!(decode(&file).is_ok());
}

/// Digits in groups of three, as the specification writes them.
fn grouped(number: u64) -> String {
    if number < 1000 { number.to_string() } else { format!("{} {:03}", grouped(number / 1000), number % 1000) }
}

#[test]
fn the_limits_are_those_of_the_code() {
    let rows = [
        ("sections in a file", limits::SECTIONS),
        ("scales", limits::SCALES),
        ("tensors of a scale", limits::TENSORS),
        ("extent of a lattice, per axis", limits::CELL_EXTENT),
        ("neighbors, `top_k`", limits::TOP_K),
        ("resolution, per axis", limits::RESOLUTION),
        ("density rank, appearance rank", limits::RANK),
        ("features P", limits::FEATURES),
        ("frequencies, each kind", limits::FREQUENCIES),
        ("layers", limits::LAYERS),
        ("inputs, outputs of a layer", limits::LAYER_WIDTH),
        ("occupancy vertices, per axis", limits::OCCUPANCY_AXIS),
        ("occupancy vertices in all", limits::OCCUPANCY_VERTICES),
        ("bytes of a string", limits::STRING_BYTES),
        ("bytes of a record", 0..=limits::RECORD_BYTES as u64),
        ("chunks of a scale", limits::CHUNKS),
        ("sum of appearance ranks in PREFIX", limits::RANK_SUM),
        ("bytes of a text", limits::TEXT_BYTES),
        ("probes, poses, cameras, notes", limits::ITEMS),
        ("bytes of a thumbnail", limits::THUMBNAIL_BYTES),
        ("steps on the longest ray", 0..=1 << 20),
        ("probes, times the steps on the longest ray", limits::PROBE_STEPS),
    ];
    let section = SPECIFICATION.split("## 5. Limits").nth(1).and_then(|rest| rest.split("## 6.").next()).unwrap();
    // Besides them the table has a heading and its rule.
    assert_eq!(section.lines().filter(|line| line.starts_with('|')).count(), rows.len() + 2);
    for (what, range) in rows {
        let row = format!("| {what} | {} | {} |", grouped(*range.start()), grouped(*range.end()));
        assert!(section.lines().any(|line| line.starts_with(&row)), "{row}");
    }
}
