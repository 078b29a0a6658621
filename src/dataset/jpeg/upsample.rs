//! Rows of a component at the picture's size, with the filters that libjpeg chooses ("fancy upsampling", `jdsample.c`): a
//! triangle over the nearest two samples along each axis that is halved, else the nearest sample.

use super::frame::{Component, Frame};

/// The least columns for which libjpeg filters along them.
const MIN_FILTERED: usize = 3;

/// A component with the filter to the picture's size.
pub(super) struct Upsampler<'a> {
    samples: &'a [u8],
    stride: usize,
    /// Columns and rows that belong to the picture.
    size: [usize; 2],
    /// How many times larger the picture is.
    factors: [usize; 2],
    filter: Filter,
}

#[derive(Clone, Copy)]
enum Filter {
    Nearest,
    Columns,
    Rows,
    Both,
}

impl<'a> Upsampler<'a> {
    pub(super) fn new(frame: &Frame, component: &Component, samples: &'a [u8]) -> Self {
        let size = component.size.map(|extent| extent as usize);
        let factors = [0, 1].map(|axis| (frame.finest[axis] / component.sampling[axis]) as usize);
        let filter = match factors {
            [2, 1] if size[0] >= MIN_FILTERED => Filter::Columns,
            [1, 2] => Filter::Rows,
            [2, 2] if size[0] >= MIN_FILTERED => Filter::Both,
            _ => Filter::Nearest,
        };
        Self { samples, stride: component.stride(), size, factors, filter }
    }

    /// Writes row number `row` of the picture to `output`, which may be wider than the picture.
    pub(super) fn write_row(&self, row: usize, output: &mut [u8]) {
        let near = self.row(row / self.factors[1]);
        match self.filter {
            Filter::Nearest => {
                for (to, &sample) in output.chunks_mut(self.factors[0]).zip(near) {
                    to.fill(sample);
                }
            }
            Filter::Columns => along_columns(near.len(), |column| i32::from(near[column]), 2, [1, 2], output),
            Filter::Rows => {
                let bias = if row.is_multiple_of(2) { 1 } else { 2 };
                for ((to, &near), &far) in output.iter_mut().zip(near).zip(self.far(row)) {
                    *to = ((3 * i32::from(near) + i32::from(far) + bias) >> 2) as u8;
                }
            }
            Filter::Both => {
                let far = &self.far(row)[..near.len()];
                let sum = |column: usize| 3 * i32::from(near[column]) + i32::from(far[column]);
                along_columns(near.len(), sum, 4, [8, 7], output);
            }
        }
    }

    /// The samples of a row that belong to the picture.
    fn row(&self, row: usize) -> &'a [u8] {
        &self.samples[row.min(self.size[1] - 1) * self.stride..][..self.size[0]]
    }

    /// The row of samples that is second nearest to row number `row` of the picture.
    fn far(&self, row: usize) -> &'a [u8] {
        let near = row / 2;
        self.row(if row.is_multiple_of(2) { near.saturating_sub(1) } else { near + 1 })
    }
}

/// Writes two samples for each of `count` columns: three parts of its value and one of the neighbor's on this side, of which
/// the last `shift` bits are left out. `biases` round the left and the right sample.
#[inline(always)]
fn along_columns(count: usize, value: impl Fn(usize) -> i32, shift: u32, biases: [i32; 2], output: &mut [u8]) {
    let mut before = value(0);
    let mut this = before;
    for (column, to) in output.chunks_mut(2).enumerate().take(count) {
        let after = value((column + 1).min(count - 1));
        to[0] = ((3 * this + before + biases[0]) >> shift) as u8;
        if let Some(to) = to.get_mut(1) {
            *to = ((3 * this + after + biases[1]) >> shift) as u8;
        }
        (before, this) = (this, after);
    }
}
