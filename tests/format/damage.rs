//! Files that did not arrive as they were sent.

use strivec_format::container::{Error, Limits, decode, decode_scene_file, encode};

use super::roundtrip::f16;
use super::scenes::two_scales;

#[test]
fn every_shorter_file_is_truncated() {
    let file = encode(&two_scales(), &f16()).unwrap();
    for length in 0..file.len() {
        let error = decode(&file[..length]).unwrap_err();
        let Error::Truncated { missing, .. } = &error else { panic!("{length} bytes: {error}") };
        assert_eq!(missing.start, length as u64);
    }
    assert!(decode(&file).is_ok());
}

#[test]
fn every_flipped_bit_is_seen() {
    let mut file = encode(&two_scales(), &f16()).unwrap();
    assert!(decode(&file).is_ok());
    for bit in 0..8 * file.len() {
        file[bit / 8] ^= 1 << (bit % 8);
        let is_unseen = decode_scene_file(&file, Limits::default()).is_ok_and(|read| read.metadata.skipped.is_empty());
        assert!(!is_unseen, "bit {} of byte {} may be either", bit % 8, bit / 8);
        file[bit / 8] ^= 1 << (bit % 8);
    }
    assert!(decode(&file).is_ok());
}

#[test]
fn damage_is_placed() {
    let file = encode(&two_scales(), &f16()).unwrap();
    let contents = strivec_format::container::sections(&file).unwrap();
    for section in &contents.sections {
        let mut damaged = file.clone();
        damaged[section.offset as usize] ^= 0x10;
        let read = decode_scene_file(&damaged, Limits::default());
        assert_eq!(read.is_err(), section.critical, "{section}");
        let error = match read {
            Err(error) => error,
            Ok(mut file) => file.metadata.skipped.remove(0).error,
        };
        let Error::Corrupt { section: name, range, .. } = &error else { panic!("{error}") };
        assert_eq!(name, &section.to_string());
        assert_eq!(*range, section.offset..section.offset + section.length);
    }
    for (byte, part) in [(14, "header"), (70, "section table")] {
        let mut damaged = file.clone();
        damaged[byte] ^= 1;
        assert!(matches!(decode(&damaged), Err(Error::Corrupt { section, .. }) if section == part));
    }
}

#[test]
fn text_transfers_are_named() {
    let file = encode(&two_scales(), &f16()).unwrap();
    let lines = |from: &[u8], to: &[u8]| {
        let (mut converted, mut rest) = (Vec::new(), file.as_slice());
        while let Some(first) = rest.first() {
            let matched = rest.starts_with(from);
            converted.extend_from_slice(if matched { to } else { std::slice::from_ref(first) });
            rest = &rest[if matched { from.len() } else { 1 }..];
        }
        converted
    };
    for (from, to) in [("\r\n", "\n"), ("\n", "\r\n"), ("\r\n", "\r"), ("\n", "\r"), ("\r", "")] {
        let error = decode(&lines(from.as_bytes(), to.as_bytes())).unwrap_err();
        assert!(matches!(error, Error::LineEndingDamage { .. }), "{from:?} to {to:?}: {error}");
    }
    assert!(decode(&lines(b"\n", b"\n")).is_ok());
}
