use std::io::Cursor;

use ::e57::RecordName as N;
use ::e57::RecordValue::{Double, Integer, ScaledInteger, Single};
use ::e57::{ColorLimits, E57Writer, Quaternion, Record, RecordDataType, RecordValue, Transform, Translation};

use super::pages::{PAGE, checksum};
use super::*;
use crate::testing::{Seen, seen_with};

const DOUBLE: RecordDataType = RecordDataType::Double { min: None, max: None };
const SINGLE: RecordDataType = RecordDataType::Single { min: None, max: None };
const STATE: RecordDataType = RecordDataType::Integer { min: 0, max: 2 };
const BYTE: RecordDataType = RecordDataType::Integer { min: 0, max: 255 };

/// A scan's fields, points, pose and colors' limits.
#[derive(Default)]
struct Made {
    fields: Vec<(N, RecordDataType)>,
    points: Vec<Vec<RecordValue>>,
    pose: Option<Transform>,
    limits: Option<ColorLimits>,
}

fn read_of(bytes: &[u8]) -> Result<Seen, Fault> {
    seen_with(bytes, &ReadOptions::default(), read)
}

fn error(bytes: &[u8]) -> String {
    read_of(bytes).unwrap_err().to_string()
}

fn file(scans: Vec<Made>) -> Vec<u8> {
    let mut bytes = Cursor::new(Vec::new());
    let mut writer = E57Writer::new(&mut bytes, "file").unwrap();
    for made in scans {
        let prototype = made.fields.into_iter().map(|(name, data_type)| Record { name, data_type }).collect();
        let mut scan = writer.add_pointcloud("scan", prototype).unwrap();
        scan.set_transform(made.pose);
        if made.limits.is_some() {
            scan.set_color_limits(made.limits);
        }
        made.points.into_iter().for_each(|point| scan.add_point(point).unwrap());
        scan.finalize().unwrap();
    }
    writer.finalize().unwrap();
    drop(writer);
    bytes.into_inner()
}

fn cartesian(kind: RecordDataType) -> Vec<(N, RecordDataType)> {
    [N::CartesianX, N::CartesianY, N::CartesianZ].map(|name| (name, kind.clone())).to_vec()
}

/// One scan of `count` points at i, i / 2 and -i.
fn plain(count: i32) -> Vec<u8> {
    let point = |i: f64| vec![Double(i), Double(i / 2.0), Double(-i)];
    file(vec![Made {
        fields: cartesian(DOUBLE),
        points: (0..count).map(|i| point(i.into())).collect(),
        ..Made::default()
    }])
}

/// Writes `to` at a byte of the file, or over the first `from` in it, and makes the checksums right.
fn changed(bytes: &[u8], at: usize, to: &[u8]) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    bytes[at..at + to.len()].copy_from_slice(to);
    for page in bytes.chunks_exact_mut(PAGE as usize) {
        let sum = checksum(&page[..1020]).to_be_bytes();
        page[1020..].copy_from_slice(&sum);
    }
    bytes
}

fn replaced(bytes: &[u8], from: &str, to: &str) -> Vec<u8> {
    assert_eq!(from.len(), to.len());
    let at = bytes.windows(from.len()).position(|window| window == from.as_bytes()).expect("it is on one page");
    changed(bytes, at, to.as_bytes())
}

#[test]
fn the_checksum_is_the_one_of_its_test_vector() {
    assert_eq!(checksum(b"123456789"), 0xe306_9283);
}

#[test]
fn many_packets_are_one_scan() {
    let seen = read_of(&plain(10_000)).unwrap();
    assert_eq!(seen.points.len(), 10_000);
    for (i, point) in seen.points.iter().enumerate() {
        let i = i as f64;
        assert_eq!(point.position.to_array(), [i, i / 2.0, -i]);
        assert_eq!(point.color, None);
    }
}

#[test]
fn scans_stand_in_their_poses() {
    let half = std::f64::consts::FRAC_1_SQRT_2;
    // A quarter turn about z, then a step.
    let pose = Transform {
        rotation: Quaternion { w: half, x: 0.0, y: 0.0, z: half },
        translation: Translation { x: 10.0, y: 20.0, z: 30.0 },
    };
    let scan = |pose| Made {
        fields: cartesian(SINGLE),
        points: vec![vec![Single(1.0), Single(2.0), Single(3.5)]],
        pose,
        ..Made::default()
    };
    let seen = read_of(&file(vec![scan(None), scan(Some(pose))])).unwrap();
    assert_eq!(seen.positions()[0], [1.0, 2.0, 3.5]);
    assert!(seen.points[1].position.abs_diff_eq(glam::DVec3::new(8.0, 21.0, 33.5), 1e-12), "{:?}", seen.points[1]);
    assert_eq!(seen.points.len(), 2);
}

#[test]
fn integers_of_any_width_lie_bit_by_bit() {
    let scaled = |min, max| RecordDataType::ScaledInteger { min, max, scale: 0.25, offset: 5.0 };
    let point = |i: i64| vec![ScaledInteger(i - 900), ScaledInteger(i64::MIN + i), ScaledInteger(42), Integer(i % 3)];
    let fields = vec![
        (N::CartesianX, scaled(-900, 200)),
        (N::CartesianY, scaled(i64::MIN, i64::MAX)),
        // Of no bits at all.
        (N::CartesianZ, scaled(42, 42)),
        (N::CartesianInvalidState, STATE),
    ];
    let seen =
        read_of(&file(vec![Made { fields, points: (0..1000).map(point).collect(), ..Made::default() }])).unwrap();
    // Those of the states 1, a direction, and 2, nothing, are left out.
    assert_eq!(seen.points.len(), 334);
    for (at, point) in seen.points.iter().enumerate() {
        let i = 3.0 * at as f64;
        let y = (i64::MIN + 3 * at as i64) as f64 * 0.25 + 5.0;
        assert_eq!(point.position.to_array(), [(i - 900.0) * 0.25 + 5.0, y, 15.5]);
    }
}

#[test]
fn spherical_coordinates_become_cartesian_ones() {
    let fields = vec![
        (N::SphericalRange, DOUBLE),
        (N::SphericalAzimuth, DOUBLE),
        (N::SphericalElevation, DOUBLE),
        (N::SphericalInvalidState, STATE),
    ];
    let quarter = std::f64::consts::FRAC_PI_2;
    let points = vec![
        vec![Double(2.0), Double(quarter), Double(0.0), Integer(0)],
        vec![Double(3.0), Double(0.0), Double(quarter), Integer(0)],
        vec![Double(4.0), Double(0.0), Double(0.0), Integer(1)],
    ];
    let seen = read_of(&file(vec![Made { fields, points, ..Made::default() }])).unwrap();
    assert_eq!(seen.points.len(), 2);
    assert!(seen.points[0].position.abs_diff_eq(glam::DVec3::new(0.0, 2.0, 0.0), 1e-12));
    assert!(seen.points[1].position.abs_diff_eq(glam::DVec3::new(0.0, 0.0, 3.0), 1e-12));
}

#[test]
fn colors_follow_their_limits() {
    let fields = |kind: RecordDataType, invalid: bool| {
        let mut fields = cartesian(DOUBLE);
        fields.extend([N::ColorRed, N::ColorGreen, N::ColorBlue].map(|name| (name, kind.clone())));
        fields.extend(invalid.then_some((N::IsColorInvalid, RecordDataType::Integer { min: 0, max: 1 })));
        fields
    };
    let at = || vec![Double(1.0), Double(2.0), Double(3.0)];
    let point = |rest: Vec<RecordValue>| [at(), rest].concat();
    let bytes = Made {
        fields: fields(BYTE, true),
        points: vec![
            point(vec![Integer(255), Integer(0), Integer(7), Integer(0)]),
            point(vec![Integer(255), Integer(0), Integer(7), Integer(1)]),
        ],
        ..Made::default()
    };
    let words = Made {
        fields: fields(RecordDataType::Integer { min: 0, max: 65535 }, false),
        points: vec![point(vec![Integer(65535), Integer(0), Integer(257)])],
        ..Made::default()
    };
    let (zero, one) = (Some(Single(0.0)), Some(Single(1.0)));
    let shares = Made {
        fields: fields(SINGLE, false),
        points: vec![point(vec![Single(1.0), Single(0.2), Single(9.0)])],
        limits: Some(ColorLimits {
            red_min: zero.clone(),
            red_max: one.clone(),
            green_min: zero.clone(),
            green_max: one.clone(),
            blue_min: zero,
            blue_max: one,
        }),
        ..Made::default()
    };
    let seen = read_of(&file(vec![bytes, words, shares])).unwrap();
    let colors: Vec<_> = seen.points.iter().map(|point| point.color).collect();
    assert_eq!(colors, [Some([255, 0, 7]), None, Some([255, 0, 1]), Some([255, 51, 255])]);
}

#[test]
fn hostile_pages_are_named() {
    let good = plain(100);
    assert_eq!(error(b""), "the file: expected pages of 1024 bytes, found 0 bytes");
    assert_eq!(error(&good[..2000]), "the file: expected pages of 1024 bytes, found 2000 bytes");
    let mut damaged = good.clone();
    damaged[1500] ^= 1;
    let message = error(&damaged);
    assert!(message.starts_with("the page at byte 1024: expected the checksum "), "{message}");
    assert!(error(&changed(&good, 0, b"?")).starts_with("byte 0: expected ASTM-E57, found \"?STM"));
    assert_eq!(error(&changed(&good, 40, &[0, 8])), "byte 40: expected pages of 1024 bytes, found 2048");
    let len = good.len();
    assert_eq!(
        error(&changed(&good, 24, &[255; 8])),
        format!("the XML section: expected an offset within {len} bytes, found byte 18446744073709551615")
    );
    assert_eq!(
        error(&changed(&good, 32, &[255; 8])),
        "bytes of the XML section: at most 16777216 are read, found 18446744073709551615"
    );
    let message = error(&changed(&good, 32, &[0, 0, 255, 0]));
    assert!(message.contains(": expected 16711680 bytes of the XML section, found "), "{message}");
}

/// A file of nothing but this XML section.
fn of_xml(xml: &[u8]) -> Vec<u8> {
    let mut logical = b"ASTM-E57\x01\0\0\0\0\0\0\0".to_vec();
    let pages = (48 + xml.len()).div_ceil(1020);
    for number in [pages as u64 * PAGE, 48, xml.len() as u64, PAGE] {
        logical.extend(number.to_le_bytes());
    }
    logical.extend(xml);
    logical.resize(pages * 1020, 0);
    let file: Vec<u8> = logical.chunks(1020).flat_map(|page| [page, &[0; 4]].concat()).collect();
    changed(&file, 0, &[])
}

#[test]
fn hostile_xml_is_refused_quickly() {
    assert!(error(&of_xml(b"")).starts_with("the XML section: not valid E57: "));
    assert!(error(&of_xml(b"\xff\xff")).starts_with("the XML section: not valid E57: "));
    assert!(error(&of_xml(&b"<a>".repeat(300_000))).starts_with("the XML section: not valid E57: "));
    let entities = b"<!DOCTYPE a [<!ENTITY b \"cccc\">]><a>&b;</a>";
    assert!(error(&of_xml(entities)).starts_with("the XML section: not valid E57: "));
    assert_eq!(
        error(&of_xml(&b"<a xmlns:b=\"c\">".repeat(101))),
        "namespaces in the XML section: at most 100 are read, found 101"
    );
    let attributes = [&b"<a "[..], &b"b=\"\" ".repeat(1001), b"/>"].concat();
    assert_eq!(
        error(&of_xml(&attributes)),
        "attributes of an element in the XML section: at most 1000 are read, found 1001"
    );
}

#[test]
fn hostile_scans_are_named() {
    let good = plain(100);
    assert_eq!(
        error(&replaced(&good, "recordCount=\"100\"", "recordCount=\"999\"")),
        format!("scan 0: expected at most {} records of 192 bits, found 999", good.len() / 1024 * 1020 * 8 / 192)
    );
    // One more than there are: the XML section is no packet.
    let message = error(&replaced(&good, "recordCount=\"100\"", "recordCount=\"101\""));
    assert!(message.contains(": expected a packet of kind 0 to 2, found kind 60 of "), "{message}");
    let two = (0..2).fold(good.clone(), |bytes, _| replaced(&bytes, "cartesianZ", "cartesianQ"));
    assert_eq!(error(&two), "scan 0: it has neither Cartesian nor spherical coordinates");
    assert_eq!(
        error(&replaced(&good, "fileOffset=\"48\"", "fileOffset=\"99\"")),
        "byte 99: expected a scan's head, of kind 1, found 0"
    );
    // The scan's head is at byte 48, the packet at 80: its kind, length, streams and their lengths.
    assert!(error(&changed(&good, 64, &[255; 8])).starts_with("scan 0: expected an offset within "));
    assert!(
        error(&changed(&good, 80, &[9])).starts_with("byte 80: expected a packet of kind 0 to 2, found kind 9 of ")
    );
    assert_eq!(error(&changed(&good, 84, &[4])), "byte 80: expected 3 streams, found 4");
    assert_eq!(error(&changed(&good, 82, &[3, 0])), "byte 80: the streams need 2412 bytes, but the packet has 4");
    assert_eq!(
        error(&changed(&good, 92, &f64::NAN.to_le_bytes())),
        "scan 0, point 0: expected finite coordinates, found [NaN, 0, -0]"
    );
}

#[test]
fn scans_without_bits_or_with_a_bent_pose_are_refused() {
    let narrow = RecordDataType::Integer { min: 7, max: 8 };
    let made = Made { fields: cartesian(narrow), points: vec![vec![Integer(7); 3]], ..Made::default() };
    let still = (0..3).fold(file(vec![made]), |bytes, _| replaced(&bytes, "maximum=\"8\"", "maximum=\"7\""));
    assert_eq!(error(&still), "scan 0: all numbers of every field are equal");
    let pose = Transform {
        rotation: Quaternion { w: 0.0, x: 0.0, y: 0.0, z: 0.0 },
        translation: Translation { x: 0.0, y: 0.0, z: 0.0 },
    };
    let bent = Made { fields: cartesian(DOUBLE), pose: Some(pose), ..Made::default() };
    assert_eq!(
        error(&file(vec![bent])),
        "scan 0: expected a pose of a unit quaternion and a finite translation, found rotation [0, 0, 0, 0], translation [0, 0, 0]"
    );
}

#[test]
fn streams_that_run_ahead_are_refused() {
    // Packets that feed only x, of which there is one bit each.
    let fields = vec![(N::CartesianX, RecordDataType::Integer { min: 0, max: 1 })];
    let fields = [fields, cartesian(DOUBLE)[1..].to_vec()].concat();
    let mut packet = vec![1, 0, 0xff, 0xff, 3, 0];
    packet.extend([0xff, 0xf0, 0, 0, 0, 0]);
    packet.resize(1 << 16, 0);
    let whole =
        file(vec![Made { fields, points: vec![vec![Integer(1), Double(0.0), Double(0.0)]], ..Made::default() }]);
    let whole: Vec<u8> = whole.chunks(1024).flat_map(|page| page[..1020].to_vec()).collect();
    let xml = String::from_utf8_lossy(&whole);
    let xml = &xml[xml.find("<?xml").unwrap()..xml.rfind('>').unwrap() + 1];
    // The scan's head, its packets, then the XML section.
    let mut logical = whole[..48].to_vec();
    logical.extend([&[1_u8, 0, 0, 0, 0, 0, 0, 0][..], &[0; 8], &80_u64.to_le_bytes(), &[0; 8]].concat());
    (0..400).for_each(|_| logical.extend(&packet));
    let start = logical.len();
    logical.extend(xml.replace("recordCount=\"1\"", "recordCount=\"9\"").as_bytes());
    let length = logical.len() - start;
    logical.resize(logical.len().div_ceil(1020) * 1020, 0);
    let physical = |at: usize| (at / 1020 * 1024 + at % 1020) as u64;
    logical[24..32].copy_from_slice(&physical(start).to_le_bytes());
    logical[32..40].copy_from_slice(&(length as u64).to_le_bytes());
    let bytes: Vec<u8> = logical.chunks(1020).flat_map(|page| [page, &[0; 4]].concat()).collect();
    let message = error(&changed(&bytes, 0, &[]));
    assert!(message.ends_with(": a stream is more than 16777216 bytes ahead of another one"), "{message}");
}

#[test]
fn bytes_that_no_writer_wrote_are_an_error_or_points() {
    let good = plain(30);
    let mut state = 1_u32;
    let mut errors = 0;
    for _ in 0..500 {
        let mut bytes = good.clone();
        for _ in 0..2 {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            let at = (state >> 8) as usize % bytes.len();
            bytes[at] = (state >> 3) as u8;
        }
        errors += usize::from(read_of(&changed(&bytes, 0, &[])).is_err());
    }
    assert!(errors > 100, "{errors}");
}
