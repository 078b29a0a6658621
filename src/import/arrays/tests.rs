use std::io::{Cursor, Write};

use glam::DVec3;
use zip::CompressionMethod;
use zip::write::{SimpleFileOptions, ZipWriter};

use super::read;
use crate::testing::{Seen, seen_with};
use crate::{Fault, ReadOptions};
use strivec_format::geometry::Aabb;

fn npy(descr: &str, fortran: bool, shape: &str, numbers: &[u8]) -> Vec<u8> {
    let order = if fortran { "True" } else { "False" };
    let header = format!("{{'descr': '{descr}', 'fortran_order': {order}, 'shape': {shape}, }}\n");
    [b"\x93NUMPY\x01\x00", (header.len() as u16).to_le_bytes().as_slice(), header.as_bytes(), numbers].concat()
}

fn f64s(numbers: &[f64]) -> Vec<u8> {
    numbers.iter().flat_map(|n| n.to_le_bytes()).collect()
}

fn npz(arrays: &[(&str, Vec<u8>)]) -> Vec<u8> {
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    for (n, (name, bytes)) in arrays.iter().enumerate() {
        let method = if n % 2 == 0 { CompressionMethod::Stored } else { CompressionMethod::Deflated };
        zip.start_file(format!("{name}.npy"), SimpleFileOptions::default().compression_method(method)).unwrap();
        zip.write_all(bytes).unwrap();
    }
    zip.finish().unwrap().into_inner()
}

fn options() -> ReadOptions {
    let bounds = Aabb { min: DVec3::ZERO, max: DVec3::new(3.0, 2.0, 2.0) };
    ReadOptions { bounds: Some(bounds), ..ReadOptions::default() }
}

fn seen(bytes: &[u8]) -> Result<Seen, Fault> {
    seen_with(bytes, &options(), read)
}

fn message(bytes: &[u8]) -> String {
    seen(bytes).unwrap_err().to_string()
}

fn unit(x: f64, y: f64, z: f64) -> Aabb {
    Aabb { min: DVec3::new(x, y, z), max: DVec3::new(x, y, z) + 1.0 }
}

#[test]
fn rows_are_points_in_either_order() {
    let (points, rows) = ([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]], [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
    assert_eq!(seen(&npy("<f8", false, "(2, 3)", &f64s(&rows))).unwrap().positions(), points);
    let columns = [1.0, 4.0, 2.0, 5.0, 3.0, 6.0];
    assert_eq!(seen(&npy("<f8", true, "(2, 3)", &f64s(&columns))).unwrap().positions(), points);
    let seen = seen(&npy("<i2", false, "(1, 4)", &[1, 0, 254, 255, 3, 0, 9, 0])).unwrap();
    assert_eq!((seen.positions(), seen.points[0].color), (vec![[1.0, -2.0, 3.0]], None));
}

#[test]
fn columns_are_colors_where_all_of_them_can_be() {
    let color = |rows: &[f64], n: usize| {
        let bytes = npy("<f8", false, &format!("({}, 6)", rows.len() / 6), &f64s(rows));
        seen(&bytes).unwrap().points[n].color
    };
    assert_eq!(color(&[0.0, 0.0, 0.0, 1.0, 0.5, 0.0], 0), Some([255, 128, 0]));
    assert_eq!(color(&[0.0, 0.0, 0.0, 1.0, 0.0, 7.0], 0), Some([1, 0, 7]), "whole numbers");
    let normals = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -1.0];
    assert_eq!(color(&normals, 0), None, "the second row says what the first is");
    let bytes = npy("|u1", false, "(1, 6)", &[1, 2, 3, 1, 0, 255]);
    assert_eq!(seen(&bytes).unwrap().points[0].color, Some([1, 0, 255]));
}

#[test]
fn bare_grids_are_slowest_in_z_and_span_what_is_given() {
    // [z][y][x] = (2, 2, 3): number 1 is x = 1, number 9 is y = 1 and z = 1.
    let mut cells = [0; 12];
    (cells[1], cells[9]) = (1, 1);
    let expected = [unit(1.0, 0.0, 0.0), unit(0.0, 1.0, 1.0)];
    assert_eq!(seen(&npy("|b1", false, "(2, 2, 3)", &cells)).unwrap().cells, expected);
    assert_eq!(seen(&npy("|b1", false, "(1, 1, 2, 2, 3, 1)", &cells)).unwrap().cells, expected);
    // First axis fastest: number 4 is [0][0][1], 3 is [1][1][0].
    let mut cells = [0; 12];
    (cells[3], cells[4]) = (1, 1);
    assert_eq!(seen(&npy("|b1", true, "(2, 2, 3)", &cells)).unwrap().cells, [unit(0.0, 1.0, 1.0), unit(1.0, 0.0, 0.0)]);
    let signed = npy("|i1", false, "(2, 2, 3)", &[255, 5, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]);
    assert_eq!(seen(&signed).unwrap().cells, [unit(1.0, 0.0, 0.0)], "integers count above 0");
    let mut numbers = [0.5; 12];
    numbers[2] = 0.6;
    let floats = npy("<f8", false, "(2, 2, 3)", &f64s(&numbers));
    assert_eq!(seen(&floats).unwrap().cells, [unit(2.0, 0.0, 0.0)], "floats count above the threshold");
    let error = seen_with(&floats, &ReadOptions::default(), read).unwrap_err();
    assert_eq!(
        error.to_string(),
        "a grid without bounds is not supported: give its smallest and largest corner as `bounds`"
    );
}

#[test]
fn names_say_what_arrays_are() {
    let bounds = ("bounds", npy("<f8", false, "(2, 3)", &f64s(&[1.0, 1.0, 1.0, 3.0, 2.0, 2.0])));
    let occupancy = npz(&[("occupancy", npy("|b1", false, "(1, 1, 2)", &[0, 1])), bounds.clone()]);
    assert_eq!(seen(&occupancy).unwrap().cells, [unit(2.0, 1.0, 1.0)]);

    let prior = npz(&[
        ("cells", npy("<i8", false, "(2, 3)", &[0_i64, 2, 5, -1, 0, 0].map(i64::to_le_bytes).concat())),
        ("origin", npy("<f8", false, "(3,)", &f64s(&[1.0, 0.0, 0.0]))),
        ("pitch", npy("<f8", false, "(3,)", &f64s(&[1.0, 0.5, 0.25]))),
        ("colors", npy("|u1", false, "(2, 3)", &[0; 6])),
    ]);
    let expected = [
        Aabb { min: DVec3::new(1.0, 1.0, 1.25), max: DVec3::new(2.0, 1.5, 1.5) },
        Aabb { min: DVec3::ZERO, max: DVec3::new(1.0, 0.5, 0.25) },
    ];
    assert_eq!(seen(&prior).unwrap().cells, expected);

    let points = npz(&[
        ("rgb", npy("<f4", false, "(1, 3)", &[1.0_f32, 0.0, 0.2].map(f32::to_le_bytes).concat())),
        ("xyz", npy("<f8", false, "(1, 3)", &f64s(&[1.0, 2.0, 3.0]))),
    ]);
    let points = seen(&points).unwrap().points;
    assert_eq!((points[0].position, points[0].color), (DVec3::new(1.0, 2.0, 3.0), Some([255, 0, 51])));

    let single = npz(&[("arr_0", npy("<f8", false, "(1, 3)", &f64s(&[1.0, 2.0, 3.0])))]);
    assert_eq!(seen(&single).unwrap().positions(), [[1.0, 2.0, 3.0]]);
}

#[test]
fn densities_are_dvgos_and_lie_at_vertices() {
    // [x][y][z] = (3, 2, 2): number 5 is x = 1, y = 0, z = 1. Over (3, 2, 2), its box is (1.5, 0, 2) ± (0.75, 1, 1).
    let mut numbers = [0.0; 12];
    numbers[5] = 10.0;
    let density = ("density", npy("<f8", false, "(1, 1, 3, 2, 2)", &f64s(&numbers)));
    let expected = [Aabb { min: DVec3::new(0.75, -1.0, 1.0), max: DVec3::new(2.25, 1.0, 3.0) }];
    let alpha_init = ("alpha_init", npy("<f8", false, "()", &f64s(&[1e-6])));
    assert_eq!(seen(&npz(&[density.clone(), alpha_init.clone()])).unwrap().cells, expected);
    // 1 − (1 + e^10 · 1e-6)^(−r) = 1e-4 at r = 0.0046.
    let ratio = |ratio: f64| ("voxel_size_ratio", npy("<f8", false, "(1,)", &f64s(&[ratio])));
    assert_eq!(seen(&npz(&[density.clone(), alpha_init.clone(), ratio(0.0047)])).unwrap().cells, expected);
    assert_eq!(seen(&npz(&[density.clone(), alpha_init, ratio(0.0045)])).unwrap().cells, []);
    let shift = ("act_shift", npy("<f8", false, "(1,)", &f64s(&[-30.0])));
    assert_eq!(seen(&npz(&[density, shift])).unwrap().cells, []);
    numbers[5] = 2e-4;
    numbers[6] = 1e-4;
    let alpha = npz(&[("alpha", npy("<f8", false, "(3, 2, 2)", &f64s(&numbers)))]);
    assert_eq!(seen(&alpha).unwrap().cells, expected);
}

#[test]
fn what_numpy_does_not_write_is_refused() {
    assert_eq!(message(b""), "byte 0: expected the beginning of an .npy (\\x93NUMPY) or .npz (PK) file, found []");
    assert_eq!(
        message(&npy("<f8", false, "(1000000000, 3)", &[0; 24])),
        "byte 79: expected 24000000000 bytes of numbers, found 24 bytes"
    );
    assert!(message(&npy("<f8", false, "(1, 3)", &[0; 25])).ends_with("expected 24 bytes of numbers, found 25 bytes"));
    assert_eq!(
        message(&npy("<f8", false, "(1, 3)", &f64s(&[0.0, f64::NAN, 1.0]))),
        "point 0: expected finite coordinates, found [0, NaN, 1]"
    );
    assert_eq!(
        message(&npy("<f8", false, "(1, 1, 3)", &f64s(&[0.0, f64::NAN, 1.0]))),
        "number 1 of the grid: expected a number, found NaN"
    );
    for shape in ["()", "(3,)", "(3, 2)"] {
        let count = if shape == "()" {
            1
        } else if shape == "(3,)" {
            3
        } else {
            6
        };
        assert!(message(&npy("|u1", false, shape, &vec![0; count])).contains("shape"), "{shape}");
    }
    assert!(message(&npy("|u1", false, "(2, 2, 3, 2)", &[0; 24])).contains("three axes"));
    assert!(message(&npy("|u1", false, "(0, 2, 3)", &[])).contains("axes of length 1 or more"));
    assert_eq!(seen(&npy("<f8", false, "(0, 3)", &[])).unwrap().points, []);
    assert!(message(&npy("<f8", false, "(0, 18446744073709551615)", &[])).contains("(rows, 3 to 12)"));
}

#[test]
fn archives_that_are_not_what_they_say_are_refused() {
    let points = ("xyz", npy("<f8", false, "(1, 3)", &f64s(&[1.0, 2.0, 3.0])));
    let good = npz(std::slice::from_ref(&points));
    assert_eq!(seen(&good).unwrap().points.len(), 1);

    assert_eq!(message(&good[..good.len() - 30]), "the archive's end: there is no zip directory");
    assert_eq!(
        message(&npz(&[])),
        "the archive: expected cells, occupancy, density, alpha, points, xyz, positions or a single array, found no array"
    );
    let others = npz(&[("a", Vec::new()), ("b", Vec::new())]);
    assert!(message(&others).ends_with("found \"a\", \"b\""), "{}", message(&others));

    let mut flipped = good.clone();
    let at = flipped.windows(8).position(|w| w == 3.0_f64.to_le_bytes()).unwrap();
    flipped[at] ^= 1;
    assert_eq!(message(&flipped), "xyz: the array: its bytes are damaged: Invalid checksum");

    let short = npz(&[("xyz", npy("<f8", false, "(2, 3)", &f64s(&[1.0, 2.0, 3.0])))]);
    assert_eq!(message(&short), "xyz: the array: the file ends within it");
    let bomb = npz(&[("xyz", npy("<f8", false, "(1000000, 3)", &f64s(&[1.0, 2.0, 3.0])))]);
    assert_eq!(message(&bomb), "xyz: expected 24000000 bytes of numbers, found 100 bytes");
    let long = npz(&[("xyz", npy("<f8", false, "(1, 3)", &f64s(&[1.0, 2.0, 3.0, 4.0])))]);
    assert_eq!(message(&long), "xyz: the array: it has more bytes than it declares");

    let cells = ("cells", npy("<f8", false, "(1, 3)", &f64s(&[0.0; 3])));
    let origin = ("origin", npy("<f8", false, "(3,)", &f64s(&[0.0; 3])));
    assert_eq!(message(&npz(&[cells.clone(), origin.clone()])), "the archive: the entry pitch.npy is missing");
    let flat = ("pitch", npy("<f8", false, "(3,)", &f64s(&[1.0, 0.0, 1.0])));
    assert_eq!(
        message(&npz(&[cells.clone(), origin.clone(), flat])),
        "pitch: expected numbers above 0, found [1, 0, 1]"
    );
    let pitch = ("pitch", npy("<f8", false, "(3,)", &f64s(&[1.0; 3])));
    assert!(message(&npz(&[cells, origin, pitch])).contains("integers of shape (n, 3)"));
    let colors = ("colors", npy("|u1", false, "(2, 3)", &[0; 6]));
    assert_eq!(message(&npz(&[points, colors])), "xyz: the colors: expected 1, one for each point, found 2");
}

#[test]
fn an_archive_that_would_be_searched_without_end_is_refused() {
    // A locator of a 64-bit directory that points where there is none.
    let mut bytes = npz(&[("xyz", npy("<f8", false, "(1, 3)", &f64s(&[1.0, 2.0, 3.0])))]);
    let end = bytes.split_off(bytes.len() - 22);
    bytes.extend(b"PK\x06\x07\0\0\0\0");
    bytes.extend(4_u64.to_le_bytes());
    bytes.extend(1_u32.to_le_bytes());
    bytes.extend(&end);
    assert!(
        message(&bytes).starts_with("byte 4: expected the end of a zip64 directory, found ["),
        "{}",
        message(&bytes)
    );
    // As many entries as 16 bits count, and none there.
    let mut bytes = npz(&[("xyz", Vec::new())]);
    let at = bytes.len() - 22 + 8;
    bytes[at..at + 4].copy_from_slice(&[0xff; 4]);
    assert_eq!(message(&bytes), "the archive's entries: at most 2 are read, found 65535");
}
