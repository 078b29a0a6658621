//! Random changes, with and without checksums that hide them: whatever opens is a valid scene that can be written.

use proptest::prelude::*;
use strivec_format::container::{Limits, decode, decode_scene_file, encode, sections};

use super::roundtrip::{f16, f32};
use super::scenes::{smallest, two_scales};
use super::surgery::{File, seal};

/// Decodes what may be anything, and holds a scene that comes out against its promises.
fn survive(bytes: &[u8]) -> Result<bool, TestCaseError> {
    let _ = sections(bytes);
    let Ok(scene) = decode(bytes) else { return Ok(false) };
    prop_assert_eq!(scene.check(), Ok(()));
    let written = encode(&scene, &f32()).expect("what was read can be written");
    prop_assert_eq!(decode(&written).expect("what was written can be read"), scene);
    Ok(true)
}

/// Whether the file of these bytes has no ancillary section that cannot be used.
fn skips_nothing(bytes: &[u8]) -> bool {
    decode_scene_file(bytes, Limits::default()).is_ok_and(|file| file.metadata.skipped.is_empty())
}

/// A change to a byte string: overwrite, insert or remove at a place, chosen modulo its length.
#[derive(Clone, Debug)]
enum Edit {
    Set(usize, u8),
    Insert(usize, u8),
    Remove(usize),
}

impl Edit {
    fn apply(&self, bytes: &mut Vec<u8>) {
        match *self {
            Self::Set(at, value) if !bytes.is_empty() => {
                let at = at % bytes.len();
                bytes[at] = value;
            }
            Self::Remove(at) if !bytes.is_empty() => {
                bytes.remove(at % bytes.len());
            }
            Self::Insert(at, value) => bytes.insert(at % (bytes.len() + 1), value),
            _ => (),
        }
    }
}

fn edit() -> impl Strategy<Value = Edit> {
    let value = prop_oneof![any::<u8>(), Just(0), Just(1), Just(0x7F), Just(0x80), Just(0xFF)];
    prop_oneof![
        6 => (any::<usize>(), value.clone()).prop_map(|(at, value)| Edit::Set(at, value)),
        1 => (any::<usize>(), value).prop_map(|(at, value)| Edit::Insert(at, value)),
        1 => any::<usize>().prop_map(Edit::Remove),
    ]
}

fn files() -> Vec<File> {
    let mut files: Vec<_> = [(two_scales(), f32()), (two_scales(), f16()), (smallest(), f32())]
        .iter()
        .map(|(scene, options)| File::of(&encode(scene, options).unwrap()))
        .collect();
    let mut compressed = files[0].clone();
    compressed.part("DENSITY").compress(64);
    compressed.part("PLACEMENT").compress(0);
    files.push(compressed);
    files
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 4000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn changed_files_do_not_open(which in 0..4usize, edits in prop::collection::vec(edit(), 1..6)) {
        let original = files()[which].bytes();
        let mut bytes = original.clone();
        edits.iter().for_each(|e| e.apply(&mut bytes));
        let is_unseen = survive(&bytes)? && skips_nothing(&bytes);
        prop_assert_eq!(is_unseen, bytes == original);
    }

    #[test]
    fn changed_tables_with_right_checksums(which in 0..4usize, edits in prop::collection::vec(edit(), 1..4)) {
        let file = files()[which].bytes();
        let table_end = 64 + 64 * file[12] as usize;
        let mut start = file[8..table_end].to_vec();
        edits.iter().for_each(|e| e.apply(&mut start));
        let mut bytes = [&file[..8], &start, &file[table_end..]].concat();
        seal(&mut bytes);
        survive(&bytes)?;
    }

    #[test]
    fn changed_payloads_with_right_checksums(
        which in 0..4usize,
        // Near the start of a payload is where the records are.
        edits in prop::collection::vec((any::<usize>(), edit(), prop_oneof![Just(40), Just(100), Just(usize::MAX)]), 1..4),
    ) {
        let mut file = files()[which].clone();
        let count = file.sections.len();
        for (section, edit, within) in edits {
            let part = &mut file.sections[section % count];
            let end = part.payload.len().min(within);
            let mut start = part.payload[..end].to_vec();
            edit.apply(&mut start);
            part.payload.splice(..end, start);
            if part.codec == 0 {
                part.decoded_length = part.payload.len() as u64;
            }
        }
        survive(&file.bytes())?;
    }

    #[test]
    fn noise_behind_a_magic(noise in prop::collection::vec(any::<u8>(), 0..300)) {
        prop_assert!(!survive(&noise)?);
        let mut bytes = [b"\xB3STV\r\n\x1A\n\x01\0\0\0\x02\0\0\0".as_slice(), &noise, &[0; 64]].concat();
        seal(&mut bytes);
        survive(&bytes)?;
    }
}

#[test]
fn some_changes_with_right_checksums_open() {
    // Or the properties above would not cover scenes.
    let mut file = files().remove(0);
    file.part("DENSITY").payload[64] ^= 1;
    assert_ne!(decode(&file.bytes()).unwrap(), two_scales());
    assert!(survive(&file.bytes()).unwrap());
}
