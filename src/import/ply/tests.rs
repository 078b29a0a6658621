//! PLY files of every encoding, and such as no reader should trust.

use super::super::testing::{Seen, seen_with};
use super::super::{Fault, LeftOut, ReadOptions};
use super::read;

fn seen(file: &[u8]) -> Seen {
    seen_with(file, &ReadOptions::default(), read).unwrap()
}

fn fault(file: impl AsRef<[u8]>) -> String {
    seen_with(file.as_ref(), &ReadOptions::default(), read).unwrap_err().to_string()
}

/// Every triangle's corners.
fn triangles(seen: &Seen) -> Vec<[[f64; 3]; 3]> {
    seen.triangles.iter().map(|corners| corners.map(|corner| corner.position.to_array())).collect()
}

/// The bytes of `values` in the byte order asked for, each value in the type that its letter names.
fn bytes(values: &[(char, f64)], big_endian: bool) -> Vec<u8> {
    let mut all = Vec::new();
    for &(letter, value) in values {
        let mut one = match letter {
            'b' => (value as i8).to_be_bytes().to_vec(),
            'B' => (value as u8).to_be_bytes().to_vec(),
            'h' => (value as i16).to_be_bytes().to_vec(),
            'H' => (value as u16).to_be_bytes().to_vec(),
            'i' => (value as i32).to_be_bytes().to_vec(),
            'I' => (value as u32).to_be_bytes().to_vec(),
            'f' => (value as f32).to_be_bytes().to_vec(),
            _ => value.to_be_bytes().to_vec(),
        };
        if !big_endian {
            one.reverse();
        }
        all.extend(one);
    }
    all
}

const CORNERS: [[f64; 3]; 5] = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.5], [2.0, 1.0, 0.25], [1.0, 2.0, -1.5], [0.0, 1.0, 3.0]];

/// The fans of a pentagon and a triangle over [`CORNERS`].
fn fans() -> Vec<[[f64; 3]; 3]> {
    [[0, 1, 2], [0, 2, 3], [0, 3, 4], [4, 2, 0]].map(|corners| corners.map(|n| CORNERS[n])).to_vec()
}

/// A mesh with colors between the coordinates, an unknown element with lists of two kinds, and a face with more than
/// its corners. `faces_first` puts the faces before the vertices.
fn mesh(format: &str, faces_first: bool) -> Vec<u8> {
    let vertex = "element vertex 5\nproperty float y\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n\
                  property double x\nproperty list uchar short more\nproperty float z\n";
    let face = "element face 3\nproperty uchar flags\nproperty list uchar int vertex_indices\nproperty list int float weights\n";
    let camera = "element camera 2\nproperty list ushort double view\nproperty int width\n";
    let mut records = [Vec::new(), Vec::new(), Vec::new()];
    for (n, [x, y, z]) in CORNERS.into_iter().enumerate() {
        let color = [('B', 10.0 * n as f64), ('B', 128.0), ('B', 255.0)];
        records[0].push([&[('f', y)], &color[..], &[('d', x), ('B', 2.0), ('h', -7.0), ('h', 9.0), ('f', z)]].concat());
    }
    for corners in [&[0.0, 1.0, 2.0, 3.0, 4.0][..], &[4.0, 2.0, 0.0], &[1.0, 2.0]] {
        let mut record = vec![('B', 1.0), ('B', corners.len() as f64)];
        record.extend(corners.iter().map(|&corner| ('i', corner)));
        record.extend([('i', 1.0), ('f', 0.5)]);
        records[1].push(record);
    }
    records[2] = vec![vec![('H', 1.0), ('d', 0.125), ('i', 640.0)], vec![('H', 0.0), ('i', -640.0)]];

    let order = if faces_first { [1, 2, 0] } else { [2, 0, 1] };
    let mut file = format!("ply\nformat {format} 1.0\ncomment of someone\nobj_info none\n").into_bytes();
    for n in order {
        file.extend([vertex, face, camera][n].bytes());
    }
    file.extend(b"end_header\n");
    for record in order.iter().flat_map(|&n| &records[n]) {
        if format == "ascii" {
            let words: Vec<String> = record.iter().map(|(_, value)| value.to_string()).collect();
            file.extend(format!("{}\n", words.join(" ")).bytes());
        } else {
            file.extend(bytes(record, format == "binary_big_endian"));
        }
    }
    file
}

#[test]
fn a_mesh_reads_alike_in_every_encoding_and_order() {
    for format in ["ascii", "binary_little_endian", "binary_big_endian"] {
        for faces_first in [false, true] {
            let seen = seen(&mesh(format, faces_first));
            assert_eq!(triangles(&seen), fans(), "{format}, faces first: {faces_first}");
            assert_eq!(seen.triangles[2][2].color, Some([40, 128, 255]), "{format}");
            assert!(seen.points.is_empty());
        }
    }
}

#[test]
fn of_a_mesh_the_vertices_alone_can_be_had() {
    for format in ["ascii", "binary_little_endian"] {
        let options = ReadOptions { vertices: true, ..ReadOptions::default() };
        let seen = seen_with(&mesh(format, true), &options, read).unwrap();
        assert_eq!(seen.positions(), CORNERS);
        assert_eq!(seen.points[1].color, Some([10, 128, 255]));
        assert!(seen.triangles.is_empty());
    }
}

#[test]
fn lines_may_end_as_on_windows_and_the_last_need_not() {
    let unix = String::from_utf8(mesh("ascii", false)).unwrap();
    let windows = unix.replace('\n', "\r\n");
    assert_eq!(triangles(&seen(windows.as_bytes())), fans());
    assert_eq!(triangles(&seen(unix.trim_end().as_bytes())), fans());
    let spaced = unix.replace("end_header\n", "end_header\n\n \n");
    assert_eq!(triangles(&seen(spaced.as_bytes())), fans());
}

#[test]
fn every_type_of_number_has_two_names() {
    let types = [
        ("char", "int8", 'b', -128.0),
        ("uchar", "uint8", 'B', 255.0),
        ("short", "int16", 'h', -32768.0),
        ("ushort", "uint16", 'H', 65535.0),
        ("int", "int32", 'i', -2147483648.0),
        ("uint", "uint32", 'I', 4294967295.0),
        ("float", "float32", 'f', 0.1_f32.into()),
        ("double", "float64", 'd', 0.1),
    ];
    for (old, new, letter, x) in types {
        for name in [old, new] {
            let header = |format: &str| {
                format!(
                    "ply\nformat {format} 1.0\nelement vertex 1\nproperty {name} x\nproperty {name} y\nproperty {name} z\nend_header\n"
                )
            };
            let expected = vec![[x, 0.0, 1.0]];
            let ascii = format!("{}{x} 0 1", header("ascii"));
            assert_eq!(seen(ascii.as_bytes()).positions(), expected, "{name}");
            for (format, big_endian) in [("binary_little_endian", false), ("binary_big_endian", true)] {
                let values = bytes(&[(letter, x), (letter, 0.0), (letter, 1.0)], big_endian);
                assert_eq!(seen(&[header(format).as_bytes(), &values].concat()).positions(), expected, "{name}");
            }
        }
    }
}

/// An ASCII mesh: the types of the coordinates, the faces' part of the header, the data.
fn ascii(coordinates: &str, vertices: usize, faces: &str, data: &str) -> String {
    let properties: String = ["x", "y", "z"].map(|axis| format!("property {coordinates} {axis}\n")).concat();
    format!("ply\nformat ascii 1.0\nelement vertex {vertices}\n{properties}{faces}end_header\n{data}")
}

const TRIANGLE: &str = "element face 1\nproperty list uchar int vertex_index\n";

#[test]
fn a_mesh_keeps_what_its_types_hold() {
    // 16777217 and 0.1 are no f32.
    for (coordinates, x) in [("double", 0.1), ("int", 16777217.0), ("ushort", 65535.0)] {
        let file = ascii(coordinates, 3, TRIANGLE, &format!("{x} 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"));
        assert_eq!(triangles(&seen(file.as_bytes()))[0][0][0], x, "{coordinates}");
    }
}

#[test]
fn strips_alternate_and_end_at_minus_one() {
    let strips = "element tristrips 1\nproperty list int int vertex_indices\n";
    let data = "0 0 0\n1 0 0\n2 0 0\n3 0 0\n4 0 0\n9 0 1 2 3 -1 4 3 2 -1\n";
    let seen = seen(ascii("float", 5, strips, data).as_bytes());
    let corners: Vec<_> = triangles(&seen).iter().map(|t| t.map(|corner| corner[0])).collect();
    assert_eq!(corners, [[0.0, 1.0, 2.0], [2.0, 1.0, 3.0], [4.0, 3.0, 2.0]]);
}

#[test]
fn faces_of_fewer_than_three_corners_are_no_triangles_but_checked() {
    let faces = "element face 3\nproperty list uchar int vertex_indices\n";
    let data = "0 0 0\n1 0 0\n2 0 0\n0\n1 2\n2 0 1\n";
    assert!(seen(ascii("float", 3, faces, data).as_bytes()).triangles.is_empty());
    let wrong = ascii("float", 3, faces, &data.replace("1 2\n", "1 3\n"));
    assert_eq!(fault(wrong), "line 14: expected a vertex index of at least 0 and below 3, found 3");
}

#[test]
fn no_faces_make_a_cloud_whose_confidences_sort() {
    for name in ["confidence", "quality"] {
        let file = format!(
            "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
             property float r\nproperty float g\nproperty float b\nproperty float {name}\n\
             element face 0\nproperty list uchar int vertex_indices\nend_header\n\
             1 2 3 0 0.5 1 0.9\n4 5 6 2 -1 0 0.2\n7 8 9 0 0 0 -1\n1 1 1 0 0 0 nan\n"
        );
        let all = seen(file.as_bytes());
        assert_eq!(all.points.len(), 4, "by default all are taken");
        assert_eq!([0, 1].map(|n| all.points[n].color), [Some([0, 128, 255]), Some([255, 0, 0])]);
        let options = ReadOptions { min_confidence: 0.5, ..ReadOptions::default() };
        assert_eq!(seen_with(file.as_bytes(), &options, read).unwrap().positions(), [[1.0, 2.0, 3.0]], "{name}");
    }
}

#[test]
fn colors_of_other_types_are_left_out() {
    let mixed = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n\
                 property uchar red\nproperty uchar green\nproperty int blue\nend_header\n0 0 0 1 2 3\n";
    assert_eq!(seen(mixed.as_bytes()).points[0].color, None);
    let diffuse = mixed.replace("int blue", "uchar blue").replace("uchar ", "uchar diffuse_");
    assert_eq!(seen(diffuse.as_bytes()).points[0].color, Some([1, 2, 3]));
}

#[test]
fn more_records_than_one_chunk_are_all_read() {
    let count = 20_000;
    let header = format!(
        "ply\nformat binary_little_endian 1.0\nelement vertex {count}\n\
         property float x\nproperty float y\nproperty float z\nend_header\n"
    );
    let mut file = header.into_bytes();
    for n in 0..count {
        file.extend(bytes(&[('f', n.into()), ('f', 0.5), ('f', 0.25)], false));
    }
    let seen = seen(&file);
    assert_eq!(seen.points.len(), count as usize);
    assert!(seen.points.iter().enumerate().all(|(n, point)| point.position.x == n as f64));
}

#[test]
fn an_empty_cloud_is_a_cloud() {
    assert!(seen(ascii("float", 0, "", "").as_bytes()).points.is_empty());
}

#[test]
fn headers_that_are_none() {
    let vertex = "element vertex 1\nproperty float x\nproperty float y\nproperty float z\n";
    let cases = [
        ("", "byte 0: expected a line end_header, found the end of the file"),
        ("PK\u{3}\u{4}", "line 1: expected ply, found \"PK\\u{3}\\u{4}\""),
        ("ply\nformat ascii 1.0\n", "byte 21: expected a line end_header, found the end of the file"),
        ("ply\nend_header\n", "the header: the line format is missing"),
        (
            "ply\nformat ascii 2.0\n",
            "line 2: expected format ascii, binary_little_endian or binary_big_endian, and 1.0, found \"format ascii 2.0\"",
        ),
        ("ply\nformat ascii 1.0\nend_header\n", "the header: the element vertex is missing"),
        ("ply\nelement a 0\nwhatever\n", "line 3: expected a header line, found \"whatever\""),
        ("ply\nproperty\n", "line 2: expected a header line, found \"property\""),
        ("ply\nelement vertex -1\n", "line 2: expected \"element NAME COUNT\", found \"element vertex -1\""),
        (
            "ply\nelement vertex 99999999999999999999\n",
            "line 2: expected \"element NAME COUNT\", found \"element vertex 99999999999999999999\"",
        ),
        ("ply\nproperty float x\n", "line 2: expected an element before its properties, found \"property float x\""),
        (
            "ply\nelement vertex 1\nproperty long x\n",
            "line 3: expected \"property TYPE NAME\" or \"property list TYPE TYPE NAME\", found \"property long x\"",
        ),
        (
            "ply\nelement face 1\nproperty list float int vertex_indices\n",
            "line 3: expected \"property TYPE NAME\" or \"property list TYPE TYPE NAME\", found \"property list float int vertex_indices\"",
        ),
        (
            "ply\nelement vertex 1\nelement vertex 1\n",
            "line 3: expected an element with another name, found \"element vertex 1\"",
        ),
        (
            "ply\nformat ascii 1.0\nelement vertex 1\nend_header\n0\n",
            "the header: the element vertex has no properties",
        ),
        (
            "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nend_header\n0\n",
            "the header: the element vertex needs the numbers x, y and z",
        ),
    ];
    for (file, message) in cases {
        assert_eq!(fault(file), message);
    }
    let no_list =
        format!("ply\nformat ascii 1.0\n{vertex}element face 1\nproperty int vertex_indices\nend_header\n0 0 0\n0\n");
    let message = "the header: the element face needs a list of integers vertex_indices or vertex_index";
    assert_eq!(fault(no_list), message);
}

#[test]
fn endless_headers_are_not_read_to_their_end() {
    let comments = format!("ply\n{}", "comment\n".repeat(20_000));
    assert_eq!(fault(comments), "lines of a header: at most 10000 are read, found 10001");
    let line = format!("ply\ncomment {}", "x".repeat(100_000));
    assert_eq!(fault(line), "byte 4: the line is longer than 65536 bytes");
    let elements: String = (0..300).map(|n| format!("element e{n} 0\n")).collect();
    assert_eq!(fault(format!("ply\n{elements}")), "elements of a header: at most 256 are read, found 257");
    let properties: String = (0..1100).map(|n| format!("property char p{n}\n")).collect();
    let message = "properties of an element: at most 1024 are read, found 1025";
    assert_eq!(fault(format!("ply\nelement e 0\n{properties}")), message);
}

#[test]
fn counts_that_the_file_cannot_hold_are_refused_before_anything_is_set_aside() {
    let vertex = "property float x\nproperty float y\nproperty float z\n";
    let binary = format!("ply\nformat binary_little_endian 1.0\nelement vertex 4000000000\n{vertex}end_header\n");
    let message = "byte 124: 4000000000 x vertex is declared, which needs at least 48000000000 bytes, but 0 are left";
    assert_eq!(fault(binary), message);
    let most = format!("ply\nformat ascii 1.0\nelement vertex 18446744073709551615\n{vertex}end_header\n0 0 0\n");
    let message =
        "18446744073709551615 x vertex is declared, which needs at least 18446744073709551615 bytes, but 6 are left";
    assert!(fault(most).ends_with(message));
    let faces = "element face 1000000\nproperty list uchar int vertex_indices\n";
    let message = "1000000 x face is declared, which needs at least 2000006 bytes, but 13 are left";
    assert!(fault(ascii("float", 1, faces, "0 0 0\n3 0 0 0")).ends_with(message));
}

#[test]
fn lists_longer_than_the_file_or_negative_are_refused() {
    let header = "ply\nformat binary_little_endian 1.0\nelement vertex 1\nproperty float x\nproperty float y\nproperty float z\n\
                  element face 1\nproperty list int int vertex_indices\nend_header\n";
    let start = header.len() + 12;
    let mut file = [header.as_bytes(), &[0; 12]].concat();
    file.extend(bytes(&[('i', 3.0), ('i', 0.0), ('i', 0.0)], false));
    assert_eq!(fault(&file), format!("byte {start}: expected a list length from 0 to 2, found 3"));
    file.truncate(start);
    file.extend(bytes(&[('i', -1.0), ('i', 0.0)], false));
    assert_eq!(fault(&file), format!("byte {start}: expected a list length from 0 to 1, found -1"));
    let text = |data: &str| ascii("float", 1, "element face 1\nproperty list int int vertex_indices\n", data);
    assert_eq!(fault(text("0 0 0\n4 0 0 0\n")), "line 11: expected a list length from 0 to 3, found 4");
    assert_eq!(
        fault(text("0 0 0\n3 0 0 -1\n")),
        "line 11: expected a vertex index of at least 0 and below 1, found -1"
    );
}

#[test]
fn data_that_are_none() {
    let cases = [
        ("0 0 0\n1 0 zero\n0 1 0\n3 0 1 2\n", "line 11: expected a number of type F32, found \"zero\""),
        ("0 0 0\n1 0 \u{e9}\n0 1 0\n3 0 1 2\n", "line 11: expected a number of type F32, found \"é\""),
        ("0 0 0\n1 0 nan\n0 1 0\n3 0 1 2\n", "line 11: expected finite coordinates, found [1, 0, NaN]"),
        ("0 0 0\n1e99 0 0\n0 1 0\n3 0 1 2\n", "line 11: expected finite coordinates, found [inf, 0, 0]"),
        ("0 0 0\n1 0 0\n0 1 0\n3 0 1\n         ", "line 14: expected a number, found the end of the file"),
        ("0 0 0\n1 0 0\n0 1 0\n256 1 2 3\n", "line 13: expected a number of type U8, found \"256\""),
    ];
    for (data, message) in cases {
        let file = ascii("float", 3, TRIANGLE, data);
        assert_eq!(fault(&file), message, "{data}");
    }
    let long = format!("0 0 {}", "1".repeat(2000));
    assert_eq!(fault(ascii("float", 1, "", &long)), "line 8: the number is longer than 1024 characters");
    let header = "ply\nformat binary_big_endian 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\nend_header\n";
    let values = bytes(&[('f', 0.0), ('f', 0.0), ('f', 0.0), ('f', 0.0), ('f', f64::INFINITY), ('f', 0.0)], true);
    let message = format!("byte {}: expected finite coordinates, found [0, inf, 0]", header.len() + 12);
    assert_eq!(fault([header.as_bytes(), &values].concat()), message);
}

#[test]
fn a_visitor_can_end_it() {
    struct Stopping;
    impl super::Visitor for Stopping {
        fn point(&mut self, _: super::super::Point) -> Result<(), Fault> {
            Err(Fault::Stopped)
        }
        fn triangle(&mut self, _: [super::super::Point; 3]) -> Result<(), Fault> {
            Err(Fault::Stopped)
        }
        fn cell(&mut self, _: &strivec_format::geometry::Aabb, _: Option<[u8; 3]>) -> Result<(), Fault> {
            Ok(())
        }
    }
    let file = mesh("ascii", true);
    let result = read(&mut super::Input::from_bytes(&file), &ReadOptions::default(), &mut Stopping);
    assert!(matches!(result, Err(Fault::Stopped)));
}

/// A triangle whose header lines end in CR, as those of old Macintosh programs do.
#[test]
fn lines_may_end_in_cr_alone() {
    let head = |format: &str| {
        format!(
            "ply\nformat {format} 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n\
             element face 1\nproperty list uchar int vertex_indices\nend_header\n"
        )
        .replace('\n', "\r")
    };
    let corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    let text = head("ascii") + "0 0 0\r1 0 0\r0 1 0\r3 0 1 2\r";
    assert_eq!(triangles(&seen(text.as_bytes())), [corners]);
    let wrong = text.replace("3 0 1 2", "3 0 1 9");
    assert_eq!(fault(wrong), "line 13: expected a vertex index of at least 0 and below 3, found 9");
    let mut binary = head("binary_little_endian").into_bytes();
    binary.extend(corners.iter().flatten().flat_map(|&value| (value as f32).to_le_bytes()));
    binary.push(3);
    binary.extend([0_i32, 1, 2].iter().flat_map(|corner| corner.to_le_bytes()));
    assert_eq!(triangles(&seen(&binary)), [corners]);
}

#[test]
fn signatures_and_surplus_words_are_skipped() {
    let file = "ply\nformat ascii 1.0\nMade by hand\nelement vertex 3\nproperty float x\nproperty float y\n\
                property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n\
                0 0 0 9 8\n1 0 0 7\n0 1 0\n3 0 1 2 0.5 0.5\n";
    assert_eq!(triangles(&seen(file.as_bytes())), [[[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]]);
}

#[test]
fn concave_polygons_keep_their_dents() {
    let file = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n\
                element face 1\nproperty list uchar int vertex_indices\nend_header\n\
                0 0 0\n4 0 0\n2 2 0\n2 4 0\n4 1 2 3 0\n";
    let [a, b] = triangles(&seen(file.as_bytes()))[..] else { panic!() };
    assert_eq!(
        [a, b],
        [[[0.0, 0.0, 0.0], [4.0, 0.0, 0.0], [2.0, 2.0, 0.0]], [[2.0, 2.0, 0.0], [2.0, 4.0, 0.0], [0.0; 3]]]
    );
}

/// Two splats as their training writes them, the second one transparent.
fn splats() -> Vec<u8> {
    let names = "x y z nx f_dc_0 f_dc_1 f_dc_2 f_rest_0 opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3";
    let properties: String = names.split(' ').map(|name| format!("property float {name}\n")).collect();
    let mut file =
        format!("ply\nformat binary_little_endian 1.0\nelement vertex 2\n{properties}end_header\n").into_bytes();
    for opacity in [4.0_f32, -4.0] {
        // A quarter turn about z, of any length.
        let values = [1., 2., 3., 9., 9., 0., -9., 9., opacity, -1., -2., -30., 3., 0., 0., 3.];
        file.extend(values.into_iter().flat_map(f32::to_le_bytes));
    }
    file
}

#[test]
fn splats_have_extent_color_and_opacity() {
    let all = seen(&splats());
    let [(center, axes)] = all.splats[..] else { panic!("{all:?}") };
    assert_eq!((center.position.to_array(), center.color), ([1.0, 2.0, 3.0], Some([255, 128, 0])));
    let expected = [[0.0, 2.0 * (-1.0_f64).exp(), 0.0], [-2.0 * (-2.0_f64).exp(), 0.0, 0.0], [0.0; 3]];
    for (axis, expected) in axes.iter().zip(expected) {
        assert!(axis.distance(expected.into()) < 1e-6, "{axes:?}");
    }
    assert_eq!(all.left_out, [LeftOut::Transparent]);
    let read_with = |options| seen_with(&splats(), &options, read).unwrap().splats.len();
    assert_eq!(read_with(ReadOptions { min_opacity: 0.0, ..ReadOptions::default() }), 2);
    assert_eq!(read_with(ReadOptions { min_opacity: 0.0, min_confidence: 0.5, ..ReadOptions::default() }), 1);
    assert_eq!(read_with(ReadOptions { min_confidence: 0.99, ..ReadOptions::default() }), 0);
}

/// One packed splat: at three quarters of its chunk's range along each axis.
#[test]
fn packed_splats_are_unpacked() {
    let limits = ["min", "max"].map(|limit| {
        ["x", "y", "z", "scale_x", "scale_y", "scale_z", "r", "g", "b"]
            .map(|axis| format!("property float {limit}_{axis}\n"))
            .concat()
    });
    let packed =
        ["position", "rotation", "scale", "color"].map(|name| format!("property uint packed_{name}\n")).concat();
    let head = format!(
        "ply\nformat binary_little_endian 1.0\nelement chunk 1\n{}{}element vertex 1\n{packed}end_header\n",
        limits[0], limits[1]
    );
    let mut file = head.into_bytes();
    let ranges =
        [[-1.0, -1.0, -1.0, -3.0, -3.0, -3.0, 0.0, 0.0, 0.0], [3.0, 3.0, 3.0, -1.0, -1.0, -1.0, 1.0, 0.5, 1.0]];
    file.extend(ranges.into_iter().flatten().flat_map(f32::to_le_bytes));
    let thirds = |share: f64| {
        let [x, y] = [share * 2047.0, share * 1023.0].map(|v| v.round() as u32);
        x << 21 | y << 11 | x
    };
    // No rotation: w is the largest, the others are half of ten bits.
    let identity = 512 << 20 | 512 << 10 | 512;
    let words: [u32; 4] = [thirds(0.75), identity, thirds(0.5), 0xff80_00cc];
    file.extend(words.into_iter().flat_map(u32::to_le_bytes));
    let seen = seen(&file);
    let [(center, axes)] = seen.splats[..] else { panic!("{seen:?}") };
    assert!(center.position.distance([2.0; 3].into()) < 0.005, "{center:?}");
    assert_eq!(center.color, Some([255, 64, 0]));
    let half = 2.0 * (-2.0_f64).exp();
    assert!((0..3).all(|n| (axes[n][n] - half).abs() < 0.01), "{axes:?}");
}
