//! What `strivec-player` is told.

use std::path::PathBuf;

const EXAMPLES: &str = "\
Examples:
  strivec-player lego.strivec
  strivec-player https://example.org/lego.strivec
  strivec-player scenes
  strivec-player lego.strivec --compare small.strivec --data lego

Files can also be dropped on the window. H shows the keys.";

/// Look at .strivec scenes.
#[derive(Debug, Default, clap::Parser)]
#[command(name = "strivec-player", version, after_help = EXAMPLES)]
pub(super) struct Arguments {
    /// A scene, the address of one, or a folder of scenes
    #[arg(value_name = "FILE|URL|FOLDER")]
    pub(super) place: Option<String>,
    /// Another scene beside the first
    #[arg(long, value_name = "FILE|URL", requires = "place")]
    pub(super) compare: Option<String>,
    /// Folder of the dataset that the scene was trained on, for its photographs
    #[arg(long, value_name = "FOLDER")]
    pub(super) data: Option<PathBuf>,
    /// As the file's point of this name, as `strivec trade --store` has written it: fast, balanced or best
    #[arg(long, value_name = "NAME")]
    pub(super) quality: Option<String>,
    /// What draws
    #[arg(long, value_enum, default_value_t)]
    pub(super) renderer: Renderer,
    /// Factors of 16 bits on the graphics device: half the memory
    #[arg(long)]
    pub(super) half: bool,
    /// Milliseconds that a picture may take while the camera moves
    #[arg(long, value_name = "MS", default_value_t = 40, value_parser = clap::value_parser!(u32).range(5..=2000))]
    pub(super) frame_time: u32,
    /// Size of the window
    #[arg(long, value_name = "WxH", default_value = "1280x800", value_parser = size)]
    pub(super) size: Option<[u32; 2]>,
    /// Say on the terminal how long pictures took, and what is shown as messages
    #[arg(long)]
    pub(super) timing: bool,
}

/// What draws pictures.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum Renderer {
    /// The graphics device; the processor where there is none, or one that is software
    #[default]
    Auto,
    /// The graphics device
    Gpu,
    /// The processor; the graphics device only shows its pictures
    Cpu,
    /// The processor, pictures and window: without a graphics device at all
    Memory,
}

fn size(text: &str) -> Result<[u32; 2], String> {
    let parsed = text.split_once('x').and_then(|(w, h)| Some([w.parse().ok()?, h.parse().ok()?]));
    parsed
        .filter(|s: &[u32; 2]| s.iter().all(|v| (64..=16384).contains(v)))
        .ok_or_else(|| "expected WxH, as in 1280x800".into())
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[test]
    fn every_example_can_be_typed() {
        for line in EXAMPLES.lines().filter_map(|line| line.strip_prefix("  ")) {
            Arguments::try_parse_from(line.split_whitespace()).unwrap();
        }
        assert!(Arguments::try_parse_from(["strivec-player", "--size", "10x10"]).is_err());
        assert!(Arguments::try_parse_from(["strivec-player", "--compare", "a"]).is_err());
    }
}
