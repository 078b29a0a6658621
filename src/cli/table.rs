//! Tables on the terminal.

pub(super) use strivec_format::digits::plural;
use strivec_format::escape::escaped;

/// Text in columns: the first aligned to the left, the others to the right.
pub(super) struct Table {
    rows: Vec<Vec<String>>,
}

impl Table {
    /// A table with the headings `columns` and no rows.
    pub(super) fn new<S: Into<String>>(columns: impl IntoIterator<Item = S>) -> Self {
        Self { rows: vec![columns.into_iter().map(|column| escaped(&column.into())).collect()] }
    }

    /// Adds a row with one cell per column, whose texts are escaped.
    pub(super) fn row(&mut self, cells: impl IntoIterator<Item = String>) {
        let row: Vec<String> = cells.into_iter().map(|cell| escaped(&cell)).collect();
        debug_assert_eq!(row.len(), self.rows[0].len(), "cells of a row");
        self.rows.push(row);
    }

    /// One line per row, two blanks between columns.
    pub(super) fn text(&self) -> String {
        let width = |column: usize| self.rows.iter().map(|row| row[column].chars().count()).max().unwrap_or(0);
        let widths: Vec<usize> = (0..self.rows[0].len()).map(width).collect();
        let line = |row: &Vec<String>| {
            let cell = |(i, text): (usize, &String)| match i {
                0 => format!("{text:<0$}", widths[0]),
                _ => format!("{text:>0$}", widths[i]),
            };
            row.iter().enumerate().map(cell).collect::<Vec<_>>().join("  ").trim_end().to_owned() + "\n"
        };
        self.rows.iter().map(line).collect()
    }
}

/// A number of at most four significant digits, or all digits before the point, without trailing zeros.
pub(super) fn short(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return value.to_string();
    }
    let decimals = (3 - value.abs().log10().floor() as i32).clamp(0, 17) as usize;
    let text = format!("{value:.decimals$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_as_wide_as_their_widest_cell() {
        let mut table = Table::new(["view", "PSNR"]);
        table.row(["r_10".into(), "7.1".into()]);
        table.row(["mean".into(), "31.25".into()]);
        assert_eq!(table.text(), "view   PSNR\nr_10    7.1\nmean  31.25\n");
    }

    #[test]
    fn one_thing_has_no_s() {
        assert_eq!([0, 1, 1000].map(|n| plural(n, "picture")), ["0 pictures", "1 picture", "1 000 pictures"]);
    }

    #[test]
    fn numbers_have_four_digits() {
        let found =
            [2.015564437074636, 0.47825338259999994, -0.949999988079071, 12345.678, 0.0, 1.5e-7, 2.0].map(short);
        assert_eq!(found, ["2.016", "0.4783", "-0.95", "12346", "0", "0.00000015", "2"]);
    }
}
