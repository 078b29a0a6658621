use super::*;
use crate::testing::{Seen, seen_with};

fn read_of(bytes: &[u8]) -> Result<Seen, Fault> {
    seen_with(bytes, &ReadOptions::default(), read)
}

fn positions(text: &str) -> Vec<[f64; 3]> {
    read_of(text.as_bytes()).unwrap().positions()
}

fn error(bytes: &[u8]) -> String {
    read_of(bytes).unwrap_err().to_string()
}

#[test]
fn every_separator_means_the_same() {
    let expected = vec![[1.0, -2.5, 3e2], [4.0, 5.0, 6.0]];
    for text in [
        "1 -2.5 3e2\n4 5 6\n",
        "  1\t -2.5  3e2 \r\n4\t5\t6",
        "1,-2.5,3e2\n4,5,6\n",
        "1;-2.5;3e2;\n4;5;6;\n",
        "1 | -2.5 | 3e2\n\n4|5|6\n",
        "\u{feff}1, -2.5, 3e2\n# a remark\n// another\n4, 5, 6\n",
        "1;-2.5;3e2;0.7;kitchen;9;8;7\n4;5;6;0.7;;9;8;7\n",
        "1 -2.5 3e2 17\n4 5 6 NaN\n",
        "\"1\",\"-2.5\",\"3e2\"\n4,5,6\n",
    ] {
        assert_eq!(positions(text), expected, "{text:?}");
    }
}

#[test]
fn names_say_which_column_is_what() {
    let expected = vec![[1.0, 2.0, 3.0]];
    for text in [
        "z,Y,x\n3,2,1\n",
        "X;Y;Z\n1;2;3\n",
        "//X Y Z\n1 2 3\n",
        "# x y z\n1 2 3\n",
        "label\tX\tY\tZ\nchair\t1\t2\t3\n",
        // A comment of four words names no three columns.
        "# z y x order\n1 2 3\n",
    ] {
        assert_eq!(positions(text), expected, "{text:?}");
    }
}

#[test]
fn colors_are_bytes_shares_or_words() {
    let color = |text: &str| read_of(text.as_bytes()).unwrap().points[0].color;
    assert_eq!(color("1 2 3 255 0 7\n"), Some([255, 0, 7]));
    assert_eq!(color("3\n1 2 3 -1200 255 0 7\n1 2 3 0 0 0 0\n1 2 3 0 0 0 0\n"), Some([255, 0, 7]));
    assert_eq!(color("1 2 3 0.6 0 0.8\n"), None);
    // Intensity and color, or color and opacity?
    assert_eq!(color("1 2 3 255 0 7 255\n"), None);
    // One line of the first thousand that is no color is enough.
    assert_eq!(color("1 2 3 1 0 0\n1 2 3 0 0 -1\n"), None);
    assert_eq!(color("x,y,z,intensity,r,g,b\n1,2,3,9,255,0,7\n"), Some([255, 0, 7]));
    assert_eq!(color("x,y,z,blue,green,red\n1,2,3,0.5,0,1\n"), Some([255, 0, 128]));
    assert_eq!(color("x,y,z,red,green,blue\n1,2,3,65535,0,1791\n"), Some([255, 0, 6]));
    assert_eq!(
        error(b"x,y,z,r,g,b\n1,2,3,-4,0,0\n"),
        "the columns red, green and blue: the first thousand lines are neither integers up to 255 or 65535, \
         nor numbers up to 1"
    );
}

#[test]
fn the_scale_of_colors_holds_for_lines_after_the_first_thousand() {
    let mut text = "0 0 0 1 2 3\n".repeat(1500);
    text.push_str("0 0 0 300 -3 4.6\n");
    let seen = read_of(text.as_bytes()).unwrap();
    assert_eq!(seen.points.len(), 1501);
    assert_eq!(seen.points[1499].color, Some([1, 2, 3]));
    assert_eq!(seen.points[1500].color, Some([255, 0, 4]));
}

#[test]
fn points_of_little_confidence_are_left_out() {
    let options = ReadOptions { min_confidence: 0.5, ..ReadOptions::default() };
    let seen = seen_with(b"x,y,z,conf\n1,2,3,0.4\n4,5,6,0.5\n", &options, read).unwrap();
    assert_eq!(seen.positions(), [[4.0, 5.0, 6.0]]);
    assert_eq!(error(b"x,y,z,conf\n1,2,3,nan\n"), "line 2: expected a confidence that is a number, found NaN");
}

#[test]
fn hostile_lines_are_named() {
    for (text, expected) in [
        (&b""[..], "the file: it has no lines of numbers"),
        (b"# nothing\n\n", "the file: it has no lines of numbers"),
        (b"1 2 3\n1 2\n", "line 2: expected 3 columns, as in line 1, found 2"),
        (b"1 2 3\n1 2 3 4\n", "line 2: expected 3 columns, as in line 1, found 4"),
        (b"1 2\n", "line 1: expected at least 3 columns, found 2"),
        (b"x y z\n1 2\n", "line 2: expected at least 3 columns, found 2"),
        (b"1 2 x\n", "line 1: expected a number, found \"x\""),
        (b"1 2 \xff\n", "line 1: expected a number, found bytes that are not UTF-8"),
        (b"1 2 3\nnan 2 3\n", "line 2: expected finite coordinates, found [NaN, 2, 3]"),
        (b"1 inf 3\n", "line 1: expected finite coordinates, found [1, inf, 3]"),
        (b"1 1e999 3\n", "line 1: expected finite coordinates, found [1, inf, 3]"),
        (b"1,5;2;3\n", "line 1: a decimal comma is not supported: write numbers with a decimal point"),
        (b"a b c\n1 2 3\n", "line 1: expected numbers, or the names of columns with x, y and z, found \"a b c\""),
        (b"x y z\nx y z\n", "line 2: expected a number, found \"x\""),
        (b"3\n1 2 3\n", "line 2: expected 3 points, as declared in the first line, found 1"),
        (b"99999999999999999999\n", "line 1: expected a number of points, found \"99999999999999999999\""),
        (b"\xff\xfe1\0", "text in UTF-16 is not supported: save it as UTF-8"),
    ] {
        assert_eq!(error(text), expected);
    }
    let endless = vec![b'1'; MAX_LINE + 2];
    assert_eq!(error(&endless), "byte 0: the line is longer than 65536 bytes");
}

#[test]
fn text_outside_the_needed_columns_may_be_anything() {
    let seen = read_of(b"x;y;z;name\n1;2;3;caf\xe9\n").unwrap();
    assert_eq!(seen.positions(), [[1.0, 2.0, 3.0]]);
}

#[test]
fn normals_and_colors_are_those_that_the_format_names() {
    let of = |text: &str, read| seen_with(text.as_bytes(), &ReadOptions::default(), read);
    assert_eq!(of("1 2 3 1 0 0\n", read_normals).unwrap().points[0].color, None);
    assert_eq!(of("1 2 3 1 0 0.5\n", read_colors).unwrap().points[0].color, Some([255, 0, 128]));
    assert_eq!(of("1 2 3 255 0 7\n", read_colors).unwrap().points[0].color, Some([255, 0, 7]));
    assert_eq!(of("1 2 3\n", read_colors).unwrap_err().to_string(), "line 1: expected at least 6 columns, found 3");
    assert_eq!(of("x y z\n", read_normals).unwrap_err().to_string(), "line 1: expected a number, found \"x\"");
}
