//! Selection of views of a split.

use std::ops::Range;
use std::path::Path;

use super::Error;
use super::dataset::DatasetOptions;
use strivec_capture::dataset;
use strivec_capture::dataset::LoadOptions;

/// Views by their number in the split, from 0.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct ViewSelection {
    /// Use views A up to, but not including, B only, counted from 0 [default: all]
    #[arg(long, value_name = "A..B", value_parser = parse_range)]
    views: Option<Range<usize>>,
    /// Use every Nth view only, beginning with the first [default: 1]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    every: Option<u32>,
    #[command(flatten)]
    dataset: DatasetOptions,
}

impl ViewSelection {
    /// Options to load the selected views, downscaled `downscale` times.
    pub(super) fn options(&self, downscale: u32) -> LoadOptions {
        let (views, every) = (self.views.clone(), self.every.unwrap_or(1) as usize);
        LoadOptions { views, every, ..self.dataset.load_options(downscale) }
    }
}

/// `options` to load at most `count` views of `split`, evenly spaced over all.
pub(super) fn evenly_spaced(
    folder: &Path,
    split: &str,
    count: usize,
    options: &LoadOptions,
) -> Result<LoadOptions, Error> {
    let all = LoadOptions { every: 1, ..options.clone() };
    let number = dataset::load_cameras(folder, split, None, &all)?.len();
    Ok(LoadOptions { every: number.div_ceil(count).max(1), ..all })
}

fn parse_range(text: &str) -> Result<Range<usize>, String> {
    let wrong = || "not a range of two numbers, as in 0..20".to_owned();
    let (start, end) = text.split_once("..").ok_or_else(wrong)?;
    Ok(start.parse().map_err(|_| wrong())?..end.parse().map_err(|_| wrong())?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_are_two_numbers() {
        assert_eq!(parse_range("2..9"), Ok(2..9));
        assert!(parse_range("5").is_err() && parse_range("a..b").is_err() && parse_range("-1..2").is_err());
    }
}
