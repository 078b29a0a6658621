//! Options of `strivec pose` that decide the result.

use std::path::PathBuf;

use clap::ValueEnum;

/// Pictures beyond which not all pairs are matched.
pub(super) const MAX_EXHAUSTIVE: usize = 100;

/// The options.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Reconstruction")]
pub(super) struct Options {
    /// Camera model of COLMAP, such as PINHOLE, SIMPLE_RADIAL, OPENCV or OPENCV_FISHEYE
    #[arg(long, value_name = "MODEL", default_value = "OPENCV", value_parser = camera_model)]
    pub(super) camera_model: String,
    /// Estimate a camera for each picture [default: one camera for all pictures]
    #[arg(long)]
    pub(super) camera_each: bool,
    /// Features per picture, at most
    #[arg(long, value_name = "N", default_value_t = 8192, value_parser = clap::value_parser!(u32).range(100..=100_000))]
    pub(super) max_features: u32,
    /// Pairs of pictures to match
    #[arg(long, value_enum, default_value_t)]
    pub(super) matching: Matching,
    /// Vocabulary tree of COLMAP, for loop detection in sequential matching [default: no loop detection]
    #[arg(long, value_name = "FILE")]
    pub(super) vocab_tree: Option<PathBuf>,
    /// Method that computes poses from matches
    #[arg(long, value_enum, default_value_t)]
    pub(super) mapper: Mapper,
    /// Extract and match features on a GPU; COLMAP must be built with CUDA [default: CPU]
    #[arg(long)]
    pub(super) gpu: bool,
}

/// Pairs of pictures to match.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(super) enum Matching {
    /// Exhaustive up to 100 pictures, else sequential
    #[default]
    Auto,
    /// All pairs
    Exhaustive,
    /// Each picture with those 1, 2, 4, … 512 further on, in the order of names
    Sequential,
}

impl Matching {
    /// The pairs for `pictures`.
    pub(super) fn of(self, pictures: usize) -> Self {
        match self {
            Self::Auto if pictures <= MAX_EXHAUSTIVE => Self::Exhaustive,
            Self::Auto => Self::Sequential,
            given => given,
        }
    }
}

/// Methods that compute poses from matches.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub(super) enum Mapper {
    /// One picture after the other
    #[default]
    Incremental,
    /// All pictures at once: faster with many pictures, less reliable; needs pycolmap 4, COLMAP 4 or glomap
    Global,
}

/// The name of a value of an option.
pub(super) fn name_of(value: impl ValueEnum) -> String {
    value.to_possible_value().map_or_else(String::new, |value| value.get_name().to_owned())
}

fn camera_model(text: &str) -> Result<String, String> {
    let is_name = !text.is_empty() && text.bytes().all(|b| b.is_ascii_uppercase() || b.is_ascii_digit() || b == b'_');
    if is_name { Ok(text.to_owned()) } else { Err("not the name of a camera model, as in OPENCV".into()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hundred_pictures_are_matched_exhaustively_and_more_are_not() {
        assert_eq!([100, 101].map(|n| Matching::Auto.of(n)), [Matching::Exhaustive, Matching::Sequential]);
        assert_eq!(Matching::Exhaustive.of(1000), Matching::Exhaustive);
        assert_eq!(Matching::Sequential.of(3), Matching::Sequential);
    }

    #[test]
    fn camera_models_are_names() {
        assert_eq!(camera_model("THIN_PRISM_FISHEYE"), Ok("THIN_PRISM_FISHEYE".into()));
        for wrong in ["", "opencv", "OPENCV --help", "-1"] {
            assert!(camera_model(wrong).is_err(), "{wrong}");
        }
    }
}
