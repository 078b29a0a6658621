//! Colors in columns of numbers, whose range is derived from the numbers.

use crate::{Fault, Point, Visitor};

/// Points that are held until the range is known.
const JUDGED: usize = 1000;

/// Range of the numbers of a color.
#[derive(Clone, Copy)]
enum ColorRange {
    /// 0 to 255.
    Bytes,
    /// 0 to 1.
    Shares,
    /// 0 to 65535.
    Words,
    /// The columns are a normal, not a color.
    None,
}

/// Assigns colors to points.
pub(super) struct Colors {
    scale: Option<ColorRange>,
    /// True if the columns are named as colors.
    named: bool,
    held: Vec<(Point, [f64; 3])>,
}

impl Colors {
    /// `exist`: the columns exist. `named`: they are named as colors.
    pub(super) fn new(exist: bool, named: bool) -> Self {
        Self { scale: (!exist).then_some(ColorRange::None), named, held: Vec::new() }
    }

    /// True if [`Colors::point`] needs the numbers.
    pub(super) fn wanted(&self) -> bool {
        !matches!(self.scale, Some(ColorRange::None))
    }

    /// Passes `point` to `visitor`, now or after the range is known. `numbers` must be given if they are wanted.
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

    /// Passes the held points to `visitor`.
    pub(super) fn finish(&mut self, visitor: &mut dyn Visitor) -> Result<(), Fault> {
        if self.held.is_empty() {
            return Ok(());
        }
        let scale = self.judge()?;
        self.scale = Some(scale);
        std::mem::take(&mut self.held).into_iter().try_for_each(|(point, n)| visitor.point(scale.colored(point, n)))
    }

    fn judge(&self) -> Result<ColorRange, Fault> {
        let all = |fits: fn(f64) -> bool| self.held.iter().flat_map(|(_, numbers)| *numbers).all(fits);
        if all(|n| n.fract() == 0.0 && (0.0..=255.0).contains(&n)) {
            return Ok(ColorRange::Bytes);
        }
        if !self.named {
            return Ok(ColorRange::None);
        }
        if all(|n| (0.0..=1.0).contains(&n)) {
            return Ok(ColorRange::Shares);
        }
        if all(|n| n.fract() == 0.0 && (0.0..=65535.0).contains(&n)) {
            return Ok(ColorRange::Words);
        }
        Err(Fault::broken(
            "the columns red, green and blue",
            "the first thousand lines are neither integers up to 255 or 65535, nor numbers up to 1",
        ))
    }
}

impl ColorRange {
    /// `point` with its color; later numbers may be out of range and are clamped.
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
