//! A survey in words: what was decided, by what, and the setting that decides otherwise.

use std::fmt;

use glam::DVec3;

use strivec_format::OptionName;
use strivec_format::geometry::Aabb;

use super::{Basis, ENOUGH_KNOWN, Survey, WIDE};

/// The parts of a survey that settings have said.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Given {
    /// True if settings have the range of rays.
    pub near_far: bool,
    /// True if settings make the scene bounded or unbounded.
    pub unbounded: bool,
}

/// A line of a survey. Settings have the names of [`named_by`](strivec_format::named_by).
#[derive(Clone, Debug)]
pub struct Line<'a> {
    survey: &'a Survey,
    given: Given,
    text: fn(&Survey, Given) -> String,
}

impl fmt::Display for Line<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&(self.text)(self.survey, self.given))
    }
}

impl Survey {
    /// At most six lines for people, each with a label: what is in the survey and why. Of remarks, the first is told.
    pub fn lines(&self, given: Given) -> Vec<(&'static str, Line<'_>)> {
        let line = |text| Line { survey: self, given, text };
        let mut lines = vec![
            ("kind", line(|survey: &Self, _| survey.kind.to_string())),
            ("rays", line(Self::rays)),
            ("space", line(Self::space)),
        ];
        if self.footprints.is_some() {
            lines.push(("detail", line(Self::detail)));
        }
        if !self.remarks.is_empty() {
            lines.push(("doubtful", line(Self::doubts)));
        }
        lines
    }

    fn detail(&self, _: Given) -> String {
        let [near, middle, far] = self.footprints.unwrap_or_default().map(|width| digits(width, width));
        let text = format!("a pixel is {middle} wide at half of what is seen, {near} to {far} at most of it");
        format!("{text} ({} makes photographs smaller)", OptionName("downscale"))
    }

    fn doubts(&self, _: Given) -> String {
        let Some((first, others)) = self.remarks.split_first() else { return String::new() };
        let rest = if others.is_empty() { String::new() } else { format!("; {} more", others.len()) };
        format!("{first}{rest}")
    }

    fn rays(&self, given: Given) -> String {
        let [near, far] = self.near_far.map(|end| digits(end, self.near_far[1]));
        let why = match self.basis {
            _ if given.near_far => return format!("from {near} to {far}, as the settings say"),
            Basis::Distances => "what the photographs show lies between",
            Basis::Points => "the dataset's points lie between",
            Basis::Files => "by the dataset's files",
            Basis::Cameras => "by where the cameras look, as nothing else is known",
        };
        format!("from {near} to {far}: {why} ({} sets it)", OptionName("space.near_far"))
    }

    fn space(&self, given: Given) -> String {
        let place = |bounds: &Aabb| {
            let unit = bounds.size().max_element();
            let corner = |at: DVec3| at.to_array().map(|v| digits(v, unit)).join(" ");
            format!("{} to {}", corner(bounds.min), corner(bounds.max))
        };
        let what = match (self.is_wide, &self.bounds) {
            (true, _) => format!("unbounded around {}", place(&self.inner_box)),
            (false, Some(bounds)) => format!("bounded, {}", place(bounds)),
            (false, None) => "bounded by the rays of all cameras".into(),
        };
        let decides = format!("({} decides otherwise)", OptionName("space.unbounded"));
        let share = self.known_share.filter(|&share| share < ENOUGH_KNOWN);
        let why = match (self.width, share) {
            _ if given.unbounded => "as the settings say".into(),
            (Some(times), _) if times > WIDE => {
                format!("photographs show what is {times:.1} times as wide as where the cameras look {decides}")
            }
            (_, Some(share)) => {
                format!("where {:.0} % of the photographs' pixels are is not known {decides}", 100.0 * (1.0 - share))
            }
            (Some(times), None) => {
                format!("what photographs show is {times:.1} times as wide as where the cameras look {decides}")
            }
            (None, None) => format!("what is farther is not known {decides}"),
        };
        format!("{what}: {why}")
    }
}

/// `value` with four digits of a number of about `unit`.
fn digits(value: f64, unit: f64) -> String {
    let places = (3.0 - unit.abs().max(1e-12).log10().floor()).clamp(0.0, 12.0) as usize;
    let text = format!("{value:.places$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').into() } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_the_digits_of_their_unit() {
        assert_eq!(digits(1234.567, 1000.0), "1235");
        assert_eq!(digits(1.5, 10.0), "1.5");
        assert_eq!(digits(0.001_234_56, 0.001), "0.001235");
        assert_eq!(digits(0.0, 0.0), "0");
    }
}
