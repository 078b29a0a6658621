//! Results as CSV: a row for each file and view.

use std::path::Path;

use super::metric::Metric;
use strivec_format::escape::{escaped, escaped_path};
use strivec_measure::Report;

/// The measures of each view of each file, whose metrics are the same.
pub(super) fn csv(reports: &[(&Path, &Report)]) -> String {
    let Some((_, first)) = reports.first() else { return String::new() };
    let metrics = Metric::of(first);
    let names: Vec<&str> = metrics.iter().map(|metric| metric.name).collect();
    let mut text = format!("file,view,mse,{}\n", names.join(","));
    for (file, report) in reports {
        for view in &report.views {
            let numbers = metrics.iter().map(|metric| metric.of_view(view).map_or_else(String::new, |v| v.to_string()));
            let numbers: Vec<String> = numbers.collect();
            let (file, name) = (quoted(&escaped_path(file)), quoted(&escaped(&view.name)));
            text += &format!("{file},{name},{},{}\n", view.mse, numbers.join(","));
        }
    }
    text
}

/// Characters with which a field begins that spreadsheets take for a formula.
const FORMULA: [char; 6] = ['=', '+', '-', '@', '\t', '\r'];

/// `text` as a field, in quotes if it needs them. An apostrophe before a formula makes it text.
pub(crate) fn quoted(text: &str) -> String {
    let apostrophe = if text.starts_with(FORMULA) { "'" } else { "" };
    let field = format!("{apostrophe}{text}");
    if field.contains([',', '"']) { format!("\"{}\"", field.replace('"', "\"\"")) } else { field }
}

#[cfg(test)]
mod tests {
    use super::*;
    use strivec_measure::ViewReport;

    #[test]
    fn formulas_become_texts() {
        for (text, field) in [
            ("=1+2", "'=1+2"),
            ("+1", "'+1"),
            ("-1.png", "'-1.png"),
            ("@a", "'@a"),
            ("\ta", "'\ta"),
            ("\ra", "'\ra"),
            ("=a(\"b\",c)", "\"'=a(\"\"b\"\",c)\""),
            ("a=-1", "a=-1"),
        ] {
            assert_eq!(quoted(text), field, "{text:?}");
        }
    }

    #[test]
    fn each_view_has_a_row_and_names_are_quoted() {
        let view =
            |name: &str, color: f32| ViewReport::new(name, [2, 1], &[[color; 3]; 2], &[[0.5; 3]; 2], None).unwrap();
        let report = Report::new(vec![view("a,\"b\"\n", 0.5), view("c", 0.75)]).unwrap();
        let text = csv(&[(Path::new("x.strivec"), &report)]);
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines[0], "file,view,mse,psnr,psnr_after_color_fit,ssim");
        assert!(lines[1].starts_with("x.strivec,\"a,\"\"b\"\"\\n\",0,inf,"), "{text}");
        assert!(lines[2].starts_with("x.strivec,c,0.0625,12.04") && lines[2].ends_with(','), "{text}");
        assert_eq!(lines.len(), 3);
    }
}
