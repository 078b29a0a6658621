//! Pictures of all kinds against libjpeg's samples (`fixtures/jpeg.zip`, written by `tools/measure/jpeg_matrix.py`), and
//! what is missing, left over, damaged or unsupported.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::Read;

use super::*;

/// Where the first scan of a picture begins.
const SCAN: [u8; 2] = [0xff, 0xda];
const END: [u8; 2] = [0xff, 0xd9];

/// A picture with what libjpeg decodes it to: columns, rows, channels and the checksum of the samples; or why it is refused.
struct Case {
    name: String,
    jpeg: Vec<u8>,
    expected: Result<[u32; 4], String>,
}

fn cases() -> Vec<Case> {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/jpeg.zip");
    let mut archive = zip::ZipArchive::new(File::open(path).unwrap()).unwrap();
    let mut bytes_of = |name: &str| {
        let mut bytes = Vec::new();
        archive.by_name(name).unwrap().read_to_end(&mut bytes).unwrap();
        bytes
    };
    let rows = String::from_utf8(bytes_of("expected.tsv")).unwrap();
    let case = |row: &str| {
        let fields: Vec<&str> = row.split('\t').collect();
        let expected = match fields[..] {
            [_, "refused", why] => Err(why.to_owned()),
            [_, width, height, channels, checksum] => {
                let [width, height, channels] = [width, height, channels].map(|field| field.parse().unwrap());
                Ok([width, height, channels, u32::from_str_radix(checksum, 16).unwrap()])
            }
            _ => panic!("{row}"),
        };
        Case { name: fields[0].to_owned(), jpeg: bytes_of(&format!("{}.jpg", fields[0])), expected }
    };
    rows.lines().map(case).collect()
}

/// The decoded pictures of libjpeg.
fn supported() -> impl Iterator<Item = (String, Vec<u8>, [u32; 4])> {
    cases().into_iter().filter_map(|case| Some((case.name, case.jpeg, case.expected.ok()?)))
}

fn summary(picture: &DynamicImage) -> [u32; 4] {
    let checksum = crc32fast::hash(picture.as_bytes());
    [picture.width(), picture.height(), u32::from(picture.color().channel_count()), checksum]
}

/// The place of the last `marker` in `jpeg`.
fn last(jpeg: &[u8], marker: [u8; 2]) -> usize {
    jpeg.windows(2).rposition(|pair| pair == marker).unwrap()
}

#[test]
fn every_kind_of_picture_has_libjpeg_s_samples() {
    let (mut count, mut wrong) = (0, BTreeMap::new());
    for Case { name, jpeg, expected } in cases() {
        count += 1;
        let found = decode(&jpeg).map(|picture| summary(&picture));
        let is_right = match (&found, &expected) {
            (Ok(found), Ok(expected)) => found == expected,
            (Err(JpegError::Unsupported { what, .. }), Err(why)) => what.contains(why.as_str()),
            _ => false,
        };
        if !is_right {
            wrong.insert(name, format!("{found:?} instead of {expected:?}"));
        }
    }
    assert!(count > 200 && wrong.is_empty(), "{} of {count} are wrong: {wrong:#?}", wrong.len());
}

#[test]
fn a_planted_error_changes_the_checksum() {
    let (_, mut jpeg, expected) = supported().next().unwrap();
    // The first step of the first quantization table: the means.
    let table = jpeg.windows(2).position(|pair| pair == [0xff, 0xdb]).unwrap();
    jpeg[table + 5] += 1;
    assert_ne!(summary(&decode(&jpeg).unwrap())[3], expected[3]);
}

#[test]
fn headers_have_the_size_and_bound_the_memory() {
    for (name, jpeg, [width, height, channels, _]) in supported() {
        let header = JpegHeader::read(&jpeg[..last(&jpeg, SCAN)]).unwrap();
        assert_eq!(header.size(), [width, height], "{name}");
        assert_eq!(header.decoded_bytes(), u64::from(width * height * channels), "{name}");
        assert!(header.working_bytes() >= 64, "{name}");
    }
}

#[test]
fn bytes_behind_a_picture_mean_nothing() {
    let video = b"\0\0\0\x18ftypmp42\0\0\0\0isommp42 \xff\xda\0\x08\x01\x01\0\0\x3f\0 \xff\xc4\0\x02 \xff\xd9 \xff\xc0";
    for (name, jpeg, expected) in supported() {
        for more in [&video[..], &[0; 9][..], &[0xff; 3][..], &jpeg[..]] {
            let picture = decode(&[&jpeg[..], more].concat());
            assert_eq!(picture.as_ref().map(summary), Ok(expected), "{name}");
        }
    }
}

#[test]
fn a_picture_needs_no_end_mark() {
    for (name, jpeg, expected) in supported() {
        assert!(jpeg.ends_with(&END), "{name}");
        for cut in [1, 2] {
            let picture = decode(&jpeg[..jpeg.len() - cut]);
            assert_eq!(picture.as_ref().map(summary), Ok(expected), "{name}");
        }
    }
}

#[test]
fn a_picture_that_lacks_data_is_truncated() {
    for (name, jpeg, _) in supported() {
        let (first, end) = (jpeg.windows(2).position(|pair| pair == SCAN).unwrap(), jpeg.len() - END.len());
        // The last byte of data may be needed for its first bit alone, never for none.
        for length in (0..end).step_by(1 + end / 50).chain([first, first + 5, end - 1]) {
            let found = decode(&jpeg[..length]).map(|picture| summary(&picture));
            assert_eq!(found, Err(JpegError::Truncated), "{name} cut at {length} of {end}");
        }
        // Programs that repair files add an end mark.
        let data = last(&jpeg, SCAN) + 2;
        let data = data + usize::from(u16::from_be_bytes([jpeg[data], jpeg[data + 1]]));
        if end - data > 4 {
            let repaired = [&jpeg[..data.midpoint(end)], &END].concat();
            assert!(decode(&repaired).is_err(), "{name}");
        }
    }
}

#[test]
fn changed_bytes_are_errors_or_other_pictures() {
    for (name, jpeg, [width, height, channels, _]) in supported() {
        for change in 0..60_usize {
            let mut changed = jpeg.clone();
            let place = 2 + (change * 7919 + name.len() * 104_729) % (jpeg.len() - 2);
            changed[place] = [0, 0xff, 0x80, 0xd9, 0x01][change % 5] ^ (change as u8 & 0x13);
            // Sizes beyond those of the fixture are the caller's to check.
            let is_large = |header: &JpegHeader<'_>| header.decoded_bytes() + header.working_bytes() > 1 << 24;
            if JpegHeader::read(&changed).is_ok_and(|header| is_large(&header)) {
                continue;
            }
            if let Ok(picture) = decode(&changed) {
                assert!(picture.width() > 0 && picture.height() > 0, "{name} {width}x{height} {channels}");
            }
        }
    }
}

#[test]
fn impossible_tables_and_scans_are_named() {
    let (_, jpeg, _) = supported().next().unwrap();
    let of = |marker: u8| jpeg.windows(2).position(|pair| pair == [0xff, marker]).unwrap();
    let [frame, scan, codes, steps] = [0xc0, 0xda, 0xc4, 0xdb].map(of);
    let changed = |place: usize, value: u8| {
        let mut changed = jpeg.clone();
        changed[place] = value;
        decode(&changed).unwrap_err()
    };
    let damaged = |place, value, part: &str| match changed(place, value) {
        JpegError::Damaged(text) => assert!(text.contains(part), "{text}"),
        error => panic!("{error}"),
    };
    damaged(steps + 4, 0x30, "quantization tables");
    damaged(steps + 4, 0x04, "quantization tables");
    damaged(codes + 4, 0x20, "Huffman tables");
    damaged(codes + 5, 3, "Huffman tables");
    damaged(frame + 2, 1, "wrong length");
    damaged(frame + 8, 0, "no columns");
    damaged(frame + 11, 0x50, "sampling factor");
    damaged(frame + 13, 1, "one identifier");
    damaged(frame + 12, 3, "quantization table is missing");
    damaged(scan + 4, 0, "scan is malformed");
    damaged(scan + 5, 9, "scan is malformed");
    damaged(scan + 6, 0x33, "Huffman table is missing");
    damaged(codes + 3, 1, "");
    // Three of the five codes of three bits get one bit instead.
    let mut crowded = jpeg.clone();
    crowded[codes + 5] += 3;
    crowded[codes + 7] -= 3;
    assert_eq!(decode(&crowded).unwrap_err(), JpegError::Damaged("a Huffman table has too many codes"));
    let without_frame = [&jpeg[..frame], &jpeg[scan..]].concat();
    assert_eq!(decode(&without_frame).unwrap_err(), JpegError::Damaged("a scan comes before the frame"));
    let second = [&jpeg[..scan], &jpeg[frame..]].concat();
    assert_eq!(decode(&second).unwrap_err(), JpegError::Damaged("it has two frames"));
    assert_eq!(
        decode(&[&START[..], &[0xc0, 0, 1]].concat()).unwrap_err(),
        JpegError::Damaged("a segment has a length below 2")
    );
}
