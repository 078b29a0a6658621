//! Which views of a split are evaluated.

use std::ops::Range;

use super::Error;

/// Views by their number in the split, from 0.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct ViewSelection {
    /// Only the views from number A up to, not including, number B
    #[arg(long, value_name = "A..B", value_parser = parse_range)]
    views: Option<Range<usize>>,
    /// Only every Nth view, the first included
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    every: Option<u32>,
}

impl ViewSelection {
    /// The chosen ones of `all`, in order.
    pub(super) fn of<T>(&self, all: Vec<T>) -> Result<Vec<T>, Error> {
        let count = all.len();
        let range = self.views.clone().unwrap_or(0..count);
        if range.is_empty() || range.end > count {
            let found = format!("{}..{}", range.start, range.end);
            return Err(Error::Usage(format!("--views: expected a range within 0..{count}, found {found}")));
        }
        let every = self.every.unwrap_or(1) as usize;
        Ok(all.into_iter().skip(range.start).take(range.len()).step_by(every).collect())
    }
}

fn parse_range(text: &str) -> Result<Range<usize>, String> {
    let wrong = || "expected two numbers, as in 0..20".to_owned();
    let (start, end) = text.split_once("..").ok_or_else(wrong)?;
    Ok(start.parse().map_err(|_| wrong())?..end.parse().map_err(|_| wrong())?)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chosen(views: Option<&str>, every: Option<u32>) -> Result<Vec<u32>, Error> {
        let views = views.map(|text| parse_range(text).unwrap());
        ViewSelection { views, every }.of((0..10).collect())
    }

    #[test]
    fn range_and_stride_combine() {
        assert_eq!(chosen(None, None).unwrap().len(), 10);
        assert_eq!(chosen(Some("2..9"), Some(3)).unwrap(), [2, 5, 8]);
        assert_eq!(chosen(None, Some(100)).unwrap(), [0]);
    }

    #[test]
    fn ranges_outside_are_refused() {
        assert!(chosen(Some("5..11"), None).is_err());
        assert!(chosen(Some("5..5"), None).is_err());
        assert!(parse_range("5").is_err() && parse_range("a..b").is_err() && parse_range("-1..2").is_err());
    }
}
