//! OBJ files as programs write them, and such as no reader should trust.

use super::super::testing::{Seen, seen_with};
use super::super::{Point, ReadOptions};
use super::read;

fn seen(file: impl AsRef<[u8]>) -> Seen {
    seen_with(file.as_ref(), &ReadOptions::default(), read).unwrap()
}

fn fault(file: impl AsRef<[u8]>) -> String {
    seen_with(file.as_ref(), &ReadOptions::default(), read).unwrap_err().to_string()
}

/// The x of every triangle's corners: the vertices below have their number there.
fn corners(seen: &Seen) -> Vec<[f64; 3]> {
    seen.triangles.iter().map(|corners| corners.map(|corner| corner.position.x)).collect()
}

const VERTICES: &str = "v 1 4 0\nv 2 +1. 0.5\nv 3 0 -0.25\nv 4 1e-0 0\nv 5 4 0\n";

#[test]
fn polygons_become_fans_whatever_their_corners_name() {
    let file = format!(
        "# made by hand\nmtllib none.mtl\no thing\n{VERTICES}vt 0 0\nvn 0 0 1\ng part\nusemtl red\ns off\n\
         f 1 2 3\nf 1/1 2/1 3/1 4/1\nf 1//1 2//1 3//1 4//1 5//1\n  f\t-5/1/1 -4/1/1   -1/-1/-1 # the last\n"
    );
    let seen = seen(file);
    let expected = [
        [1.0, 2.0, 3.0],
        [1.0, 2.0, 3.0],
        [1.0, 3.0, 4.0],
        [1.0, 2.0, 3.0],
        [1.0, 3.0, 4.0],
        [1.0, 4.0, 5.0],
        [1.0, 2.0, 5.0],
    ];
    assert_eq!(corners(&seen), expected);
    assert_eq!(seen.triangles[2][2].position.to_array(), [4.0, 1.0, 0.0]);
    assert_eq!((seen.triangles[0][0].color, seen.points.len()), (None, 0));
}

#[test]
fn some_vertices_may_have_colors() {
    let file = "v 1 0 0 1 0 0\nv 2 0 0\nv 6 0 0 2\nf 1 2 3\n";
    assert_eq!(corners(&seen(file)), [[1.0, 2.0, 3.0]]);
    assert_eq!(seen(file).triangles[0].map(|corner| corner.color), [[255, 0, 0], [255; 3], [255; 3]].map(Some));
    let uncolored = seen("v 1 0 0\nv 2 0 0 1 0 0\nv 3 0 0\nf 1 2 3\n");
    assert_eq!(uncolored.triangles[0].map(|corner| corner.color), [None; 3]);
}

#[test]
fn colors_stay_with_their_vertices() {
    let seen = seen("v 1 0 0 1 0 0\nv 2 0 0 0 1 0\nv 3 0 0 0.5 2 -1\nf 3 1 2\n");
    assert_eq!(
        seen.triangles[0].map(|corner| corner.color),
        [Some([128, 255, 0]), Some([255, 0, 0]), Some([0, 255, 0])]
    );
}

#[test]
fn a_dent_stays_open() {
    // A triangle of area 8 with a dent of area 4; a fan from the first corner covers the dent.
    let seen = seen("v 0 0 0\nv 4 0 0\nv 2 2 0\nv 2 4 0\nf 2 3 4 1\nf 1/1 2/2 3/3 4/4\nf 1 2 4\n");
    let area = |[a, b, c]: [Point; 3]| 0.5 * (b.position - a.position).cross(c.position - a.position).length();
    let areas: Vec<f64> = seen.triangles.into_iter().map(area).collect();
    assert_eq!(areas.len(), 5);
    assert_eq!(areas.iter().sum::<f64>(), 2.0 * 6.0 + 8.0);
}

#[test]
fn utf16_is_named() {
    for mark in [b"\xff\xfe", b"\xfe\xff"] {
        assert_eq!(fault([mark, &b"v\0 \0"[..]].concat()), "text in UTF-16 is not supported: save it as UTF-8");
    }
}

#[test]
fn weights_divide() {
    assert_eq!(corners(&seen("v 2 0 0 2\nv 2 0 0 1\nv 1 0 0 0.25\nf 1 2 3\n")), [[1.0, 2.0, 4.0]]);
}

#[test]
fn lines_go_on_after_a_backslash_and_comments_need_not_be_utf8() {
    let mut file = b"\xef\xbb\xbf# caf\xe9\r\n".to_vec();
    file.extend(VERTICES.replace('\n', " # \u{e9}\r\n").bytes());
    file.extend(b"o stra\xdfe\r\nf 1 2 \\\r\n3 \\\r\n 4\r\n");
    assert_eq!(corners(&seen(file)), [[1.0, 2.0, 3.0], [1.0, 3.0, 4.0]]);
}

#[test]
fn groups_of_many_faces_are_cut_without_a_loss() {
    let count = (1 << 20) / 3 + 1000;
    let mut file = VERTICES.to_string();
    for n in 0..count {
        file.push_str(if n % 2 == 0 { "f 1 2 3\n" } else { "f 3 4 5\n" });
    }
    let corners = corners(&seen(file));
    assert_eq!(corners.len(), count);
    let expected = |n| if n % 2 == 0 { [1.0, 2.0, 3.0] } else { [3.0, 4.0, 5.0] };
    assert!(corners.iter().enumerate().all(|(n, corners)| *corners == expected(n)));
}

#[test]
fn without_polygons_the_vertices_are_points() {
    for more in ["", "p 1 2\nl 1 2 3\n", "f 1\nf 1 2\n"] {
        let seen = seen(format!("{VERTICES}v 6 0 0 0 0 1\n{more}"));
        assert_eq!(seen.points.len(), 6, "{more}");
        assert_eq!(seen.points[1].position.to_array(), [2.0, 1.0, 0.5]);
        assert_eq!([0, 5].map(|n| seen.points[n].color), [None, Some([0, 0, 255])]);
        assert!(seen.triangles.is_empty());
    }
}

#[test]
fn of_a_mesh_the_vertices_alone_can_be_had() {
    let options = ReadOptions { vertices: true, ..ReadOptions::default() };
    let seen = seen_with(format!("{VERTICES}f 1 2 3\n").as_bytes(), &options, read).unwrap();
    assert_eq!((seen.points.len(), seen.triangles.len()), (5, 0));
}

#[test]
fn what_is_no_obj() {
    let wrong = |found: &str| format!("line 2: expected v and 3, 4 or 6 numbers, found \"{found}\"");
    let cases = [
        ("", "the file: it has no vertices".into()),
        ("PK\u{3}\u{4}\0\0", "the file: it has no vertices".into()),
        ("# a\nv 1 2\n", wrong("v 1 2")),
        ("# a\nv 1 2 3 4 5\n", wrong("v 1 2 3 4 5")),
        ("# a\nv 1 2 3 4 5 6 7\n", wrong("v 1 2 3 4 5 6 7")),
        ("# a\nv 1 2 x\n", wrong("v 1 2 x")),
        ("# a\nv 1 2 \u{e9}\n", wrong("v 1 2 é")),
        ("# a\nv 1 2 3 red green blue\nf 1 1 1\n", wrong("v 1 2 3 red green blue")),
        ("v 1 nan 2\n", "line 1: expected finite coordinates, found [1, NaN, 2]".into()),
        ("v 1 1e999 2\nf 1 1 1\n", "line 1: expected finite coordinates, found [1, inf, 2]".into()),
        ("v 1 2 3 0\nf 1 1 1\n", "line 1: expected finite coordinates, found [inf, inf, inf]".into()),
        (
            "v 0 0 0\ncstype bezier\nsurf 0 1 0 1 1 1 1 1\n",
            "the free-form surface in line 3 is not supported: export it as polygons".into(),
        ),
    ];
    for (file, message) in cases {
        assert_eq!(fault(file), message, "{file}");
    }
}

#[test]
fn corners_that_are_no_vertices_above() {
    for corner in
        ["0", "2", "-2", "x", "/1/1", "1.0", "-9223372036854775808", "9223372036854775807", "99999999999999999999"]
    {
        let message = format!("line 2: expected the index of one of the 1 vertices above, found \"{corner}\"");
        assert_eq!(fault(format!("v 0 0 0\nf 1 1 {corner}\nv 1 1 1\n")), message);
    }
}

/// Indices at which `tobj` overflows: they are not shown to it.
#[test]
fn textures_and_normals_may_be_nonsense() {
    let file = format!("{VERTICES}vt 0 0\nvn 0 0 0\nf 1/-9223372036854775807/-99 2/0/0 3/7/99999999999999999999\n");
    assert_eq!(corners(&seen(file)), [[1.0, 2.0, 3.0]]);
}

#[test]
fn statements_end() {
    let line = format!("v {}", "1".repeat(17 << 20));
    assert_eq!(fault(&line), "byte 0: the line is longer than 16777216 bytes");
    let joined = format!("v {}", "11111111\\\n".repeat(2 << 20));
    assert!(fault(joined).starts_with("bytes of a statement: at most 16777216 are read, found 1677"));
}
