//! Tables on the terminal.

pub(super) use strivec_format::digits::{plural, short};
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
}
