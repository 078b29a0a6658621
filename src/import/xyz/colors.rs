//! Colors in columns of numbers, whose scale only the numbers tell.

use crate::import::{Fault, Point, Visitor};

/// Points that are held back until the scale is known.
const JUDGED: usize = 1000;

/// How numbers become colors.
#[derive(Clone, Copy)]
enum Scale {
    /// They are bytes.
    Bytes,
    /// They are shares of one.
    Shares,
    /// They have 16 bits.
    Words,
    /// They are none: a normal.
    None,
}

/// Gives points their colors.
pub(super) struct Colors {
    scale: Option<Scale>,
    /// Whether names say that the columns are colors.
    named: bool,
    held: Vec<(Point, [f64; 3])>,
}

impl Colors {
    /// Of columns that `exist` or not.
    pub(super) fn new(exist: bool, named: bool) -> Self {
        Self { scale: (!exist).then_some(Scale::None), named, held: Vec::new() }
    }

    /// Whether numbers are needed.
    pub(super) fn wanted(&self) -> bool {
        !matches!(self.scale, Some(Scale::None))
    }

    /// Hands on `point`, at once or later; `numbers` are there where they are wanted.
    pub(super) fn point(
        &mut self,
        point: Point,
        numbers: Option<[f64; 3]>,
        visitor: &mut dyn Visitor,
    ) -> Result<(), Fault> {
        match (self.scale, numbers) {
            (Some(scale), Some(numbers)) => visitor.point(scale.colored(point, numbers)),
            (None, Some(numbers)) => {
                self.held.push((point, numbers));
                if self.held.len() < JUDGED { Ok(()) } else { self.finish(visitor) }
            }
            (_, None) => visitor.point(point),
        }
    }

    /// Hands on the points that are still held.
    pub(super) fn finish(&mut self, visitor: &mut dyn Visitor) -> Result<(), Fault> {
        if self.held.is_empty() {
            return Ok(());
        }
        let scale = self.judge()?;
        self.scale = Some(scale);
        std::mem::take(&mut self.held).into_iter().try_for_each(|(point, n)| visitor.point(scale.colored(point, n)))
    }

    fn judge(&self) -> Result<Scale, Fault> {
        let all = |fits: fn(f64) -> bool| self.held.iter().flat_map(|(_, numbers)| *numbers).all(fits);
        if all(|n| n.fract() == 0.0 && (0.0..=255.0).contains(&n)) {
            return Ok(Scale::Bytes);
        }
        if !self.named {
            return Ok(Scale::None);
        }
        if all(|n| (0.0..=1.0).contains(&n)) {
            return Ok(Scale::Shares);
        }
        if all(|n| n.fract() == 0.0 && (0.0..=65535.0).contains(&n)) {
            return Ok(Scale::Words);
        }
        Err(Fault::malformed(
            "the columns red, green and blue",
            "integers to 255 or to 65535, or numbers to 1",
            "something else in the first thousand lines",
        ))
    }
}

impl Scale {
    /// Later numbers may be out of range: they are clamped.
    fn colored(self, point: Point, numbers: [f64; 3]) -> Point {
        let color = match self {
            Self::None => return point,
            Self::Bytes => numbers,
            Self::Shares => numbers.map(|n| (255.0 * n).round()),
            Self::Words => numbers.map(|n| (n / 256.0).floor()),
        };
        Point { color: Some(color.map(|n| n.clamp(0.0, 255.0) as u8)), ..point }
    }
}
