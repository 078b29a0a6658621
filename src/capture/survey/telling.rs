//! A survey in words: what was decided, by what, and the setting that decides otherwise.

use std::fmt;

use glam::DVec3;

use strivec_format::OptionName;
use strivec_format::digits::rounded;
use strivec_format::geometry::Aabb;

use super::{Basis, Survey, WIDE};
use crate::prior::OPEN;

/// The parts of a survey that settings have said.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Given {
    /// True if settings have the range of rays.
    pub near_far: bool,
    /// True if settings make the scene bounded or unbounded.
    pub unbounded: bool,
}

/// A line of a survey. Its option has the name of [`named_by`](strivec_format::named_by).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Line {
    text: String,
    /// The option that decides otherwise, and what it does.
    option: Option<(&'static str, &'static str)>,
}

impl fmt::Display for Line {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.text)?;
        let Some((option, does)) = self.option else { return Ok(()) };
        write!(f, " ({} {does})", OptionName(option))
    }
}

impl Survey {
    /// At most six lines for people, each with a label: what is in the survey and why. Of remarks, the first is told.
    pub fn lines(&self, given: Given) -> Vec<(&'static str, Line)> {
        let plain = |text| Line { text, option: None };
        let mut lines =
            vec![("kind", plain(self.kind.to_string())), ("rays", self.rays(given)), ("space", self.space(given))];
        if let Some(footprints) = self.footprints {
            let [near, middle, far] = footprints.map(|width| rounded(width, width));
            let text = format!("a pixel is {middle} wide at half of what is seen, {near} to {far} at most of it");
            lines.push(("detail", Line { text, option: Some(("downscale", "makes photographs smaller")) }));
        }
        if let Some((first, others)) = self.remarks.split_first() {
            let rest = if others.is_empty() { String::new() } else { format!("; {} more", others.len()) };
            lines.push(("doubtful", plain(format!("{first}{rest}"))));
        }
        lines
    }

    fn rays(&self, given: Given) -> Line {
        let [near, far] = self.near_far.map(|end| rounded(end, self.near_far[1]));
        if given.near_far {
            return Line { text: format!("from {near} to {far}, as the settings say"), option: None };
        }
        let why = match self.basis {
            Basis::Distances => "what the photographs show lies between",
            Basis::Points => "the dataset's points lie between",
            Basis::Files => "by the dataset's files",
            Basis::Cameras => "by where the cameras look, as nothing else is known",
        };
        Line { text: format!("from {near} to {far}: {why}"), option: Some(("space.near_far", "sets it")) }
    }

    fn space(&self, given: Given) -> Line {
        let place = |bounds: &Aabb| {
            let unit = bounds.size().max_element();
            let corner = |at: DVec3| at.to_array().map(|v| rounded(v, unit)).join(" ");
            format!("{} to {}", corner(bounds.min), corner(bounds.max))
        };
        let what = match (self.is_wide, &self.bounds) {
            (true, _) => format!("unbounded around {}", place(&self.inner_box)),
            (false, Some(bounds)) => format!("bounded, {}", place(bounds)),
            (false, None) => "bounded by the rays of all cameras".into(),
        };
        let why = match (self.width, self.open_share) {
            _ if given.unbounded => "as the settings say".into(),
            (Some(times), _) if times > WIDE => {
                format!("photographs show what is {times:.1} times as wide as where the cameras look")
            }
            (_, Some(share)) if share > OPEN => {
                format!("{:.0} % of the photographs' rays pass all that is known", 100.0 * share)
            }
            (Some(times), _) => {
                format!("what photographs show is {times:.1} times as wide as where the cameras look")
            }
            (None, _) => "what is farther is not known".into(),
        };
        let option = (!given.unbounded).then_some(("space.unbounded", "decides otherwise"));
        Line { text: format!("{what}: {why}"), option }
    }
}
