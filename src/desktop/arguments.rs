//! Arguments of `strivec-player`.

use std::path::PathBuf;

use strivec_cli::version::version;

const EXAMPLES: &str = "\
Examples:
  strivec-player lego.strivec
  strivec-player https://example.org/lego.strivec
  strivec-player scenes
  strivec-player lego.strivec --compare small.strivec --data lego

Files and folders can be dropped on the window. H shows the keys.

Exit codes: 0 closed, 1 usage, 2 unreadable file, 3 malformed file, 4 anything else, 5 unsupported file or too \
little memory.";

/// Show .strivec scenes in a window
#[derive(Debug, Default, clap::Parser)]
#[command(name = "strivec-player", version = version(), after_help = EXAMPLES)]
pub(super) struct Arguments {
    /// Scene to show: a file, its URL, or a folder of files
    #[arg(value_name = "FILE|URL|FOLDER")]
    pub(super) place: Option<String>,
    /// Second scene, to compare with the first
    #[arg(long, value_name = "FILE|URL", requires = "place")]
    pub(super) compare: Option<String>,
    /// Folder of the scene's dataset, to show its cameras and photographs
    #[arg(long, value_name = "FOLDER")]
    pub(super) data: Option<PathBuf>,
    /// Quality setting stored in the file by `strivec trade --store`: fast, balanced or best [default: exact]
    #[arg(long, value_name = "NAME")]
    pub(super) quality: Option<String>,
    /// Device that renders the pictures
    #[arg(long, value_enum, default_value_t)]
    pub(super) renderer: RendererChoice,
    /// Store factors in 16 bits on the graphics device, in half the memory
    #[arg(long)]
    pub(super) half: bool,
    /// Time of a picture while the camera moves, in milliseconds
    #[arg(long, value_name = "MS", default_value_t = 40, value_parser = clap::value_parser!(u32).range(5..=2000))]
    pub(super) frame_time: u32,
    /// Size of the window, in points
    #[arg(long, value_name = "WxH", default_value = "1280x800", value_parser = size)]
    pub(super) size: Option<[u32; 2]>,
    /// Print the time of each picture, and all messages, on the terminal
    #[arg(long)]
    pub(super) timing: bool,
}

/// Device that renders the pictures.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub(super) enum RendererChoice {
    /// The graphics device; the CPU if there is none, or only a software one
    #[default]
    Auto,
    /// The graphics device
    Gpu,
    /// The CPU; the graphics device displays its pictures
    Cpu,
    /// The CPU alone, without a graphics device
    Memory,
}

fn size(text: &str) -> Result<[u32; 2], String> {
    let parsed = text.split_once('x').and_then(|(w, h)| Some([w.parse().ok()?, h.parse().ok()?]));
    parsed
        .filter(|s: &[u32; 2]| s.iter().all(|v| (64..=16384).contains(v)))
        .ok_or_else(|| "not a size: use WIDTHxHEIGHT from 64 to 16384, as 1280x800".into())
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
