//! Sheets of several pictures.

use super::Error;

/// Pixels between two pictures of a sheet.
const GAP: u32 = 4;
/// The color of the gaps.
const GAP_COLOR: [f32; 3] = [0.5; 3];

/// A picture of colors without opacity and depth.
#[derive(Clone, Debug, PartialEq)]
pub struct Sheet {
    /// Columns and rows.
    pub size: [u32; 2],
    /// \[rows\]\[columns\], row-major from the top left.
    pub colors: Vec<[f32; 3]>,
}

impl Sheet {
    /// A picture of `colors` of `size` (columns, rows).
    ///
    /// # Errors
    ///
    /// [`Error::Size`] if their number differs from `size`.
    pub fn new(size: [u32; 2], colors: Vec<[f32; 3]>) -> Result<Self, Error> {
        Error::unless_size(size, colors.len())?;
        Ok(Self { size, colors })
    }
}

/// `pictures` from left to right with a gray gap between them, aligned at the top.
pub fn side_by_side(pictures: &[Sheet]) -> Sheet {
    let gaps = GAP * pictures.len().saturating_sub(1) as u32;
    let width = pictures.iter().map(|p| p.size[0]).sum::<u32>() + gaps;
    let height = pictures.iter().map(|p| p.size[1]).max().unwrap_or(0);
    let mut colors = vec![GAP_COLOR; width as usize * height as usize];
    let mut left = 0;
    for picture in pictures {
        let columns = picture.size[0] as usize;
        for row in 0..picture.size[1] as usize {
            let to = row * width as usize + left;
            colors[to..to + columns].copy_from_slice(&picture.colors[row * columns..(row + 1) * columns]);
        }
        left += columns + GAP as usize;
    }
    Sheet { size: [width, height], colors }
}

/// `rows` of pictures below each other with a gray gap between them, aligned at the left.
pub fn stacked(rows: &[Sheet]) -> Sheet {
    let width = rows.iter().map(|p| p.size[0]).max().unwrap_or(0);
    let mut sheet = Sheet { size: [width, 0], colors: Vec::new() };
    for (i, row) in rows.iter().enumerate() {
        if i > 0 {
            sheet.append_rows(GAP);
        }
        let first = sheet.size[1] as usize;
        sheet.append_rows(row.size[1]);
        let columns = row.size[0] as usize;
        for y in 0..row.size[1] as usize {
            let to = (first + y) * width as usize;
            sheet.colors[to..to + columns].copy_from_slice(&row.colors[y * columns..(y + 1) * columns]);
        }
    }
    sheet
}

impl Sheet {
    fn append_rows(&mut self, rows: u32) {
        self.size[1] += rows;
        self.colors.resize(self.size[0] as usize * self.size[1] as usize, GAP_COLOR);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn filled(size: [u32; 2], color: f32) -> Sheet {
        Sheet::new(size, vec![[color; 3]; (size[0] * size[1]) as usize]).unwrap()
    }

    #[test]
    fn a_row_keeps_every_pixel_and_fills_the_rest_with_the_gap() {
        let row = side_by_side(&[filled([2, 3], 0.0), filled([1, 2], 1.0)]);
        assert_eq!(row.size, [7, 3]);
        let line = |y: usize| row.colors[y * 7..(y + 1) * 7].iter().map(|c| c[0]).collect::<Vec<_>>();
        assert_eq!(line(1), [0.0, 0.0, 0.5, 0.5, 0.5, 0.5, 1.0]);
        assert_eq!(line(2), [0.0, 0.0, 0.5, 0.5, 0.5, 0.5, 0.5]);
    }

    #[test]
    fn a_column_keeps_every_pixel() {
        let column = stacked(&[filled([2, 1], 0.0), filled([1, 1], 1.0)]);
        assert_eq!(column.size, [2, 6]);
        assert_eq!(column.colors[10..].iter().map(|c| c[0]).collect::<Vec<_>>(), [1.0, 0.5]);
    }

    #[test]
    fn a_wrong_number_of_colors_is_refused() {
        assert!(matches!(Sheet::new([2, 2], vec![[0.0; 3]; 3]), Err(Error::Size { expected: 4, found: 3 })));
    }
}
