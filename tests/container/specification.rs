//! The specification's example is a file.

use strivec::container::{decode, encode};

use super::roundtrip::F32;
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
    let file = encode(&smallest(), &F32).unwrap();
    let example = SPECIFICATION.split("```hexdump\n").nth(1).and_then(|rest| rest.split("```").next());
    let expected = dump(&file);
    assert!(example == Some(&expected), "the specification should show\n{expected}");
    let mut other = file.clone();
    *other.last_mut().unwrap() ^= 1;
    assert_ne!(dump(&other), expected);
    assert!(decode(&file).is_ok());
}
