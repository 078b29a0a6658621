//! `--path`: a camera path, as the frames of a video.

use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use super::Error;
use super::numbers::in_range;
use strivec_capture::dataset::NamedCamera;
use strivec_field::render::{MAX_KEYFRAMES_BYTES, read_keyframes};
use strivec_format::geometry::Camera;

/// Default number of frames of a turntable.
const TURNTABLE_FRAMES: u32 = 120;
const MAX_FRAMES: u32 = 100_000;
const FPS: f64 = 30.0;
/// Other viewpoint options. One of them or `--path` is required, and clap does not enforce a `requires` whose argument
/// conflicts with one that is present.
pub(super) const OTHERS: [&str; 3] = ["cameras", "orbit", "pose"];
/// The value of `--path` that names no file.
const TURNTABLE: &str = "turntable";

/// The path and its number of frames.
#[derive(Clone, Debug, clap::Args)]
#[group(skip)]
pub(super) struct CameraPathOptions {
    /// Render the frames of a video: a full turn around the scene (the word turntable), or the keyframes of a JSON file (docs/camera-paths.md)
    #[arg(long, value_name = "turntable|FILE")]
    path: Option<PathBuf>,
    /// Frames of --path [default: 120 for a turntable, the path's seconds times --fps for a file]
    #[arg(long, value_name = "N", conflicts_with_all = OTHERS,
        value_parser = clap::value_parser!(u32).range(1..=i64::from(MAX_FRAMES)))]
    frames: Option<u32>,
    /// Frames per second of --path
    #[arg(long, value_name = "F", default_value_t = FPS, conflicts_with_all = OTHERS,
        value_parser = in_range(0.1..=240.0, "a number of frames per second from 0.1 to 240"))]
    pub(super) fps: f64,
}

/// The value of `--path`.
pub(super) enum Way<'a> {
    /// Number of cameras on a circle.
    Turntable(u32),
    /// Through the keyframes of a file.
    Keyframes(&'a Path),
}

impl CameraPathOptions {
    /// The path, if any.
    pub(super) fn way(&self) -> Option<Way<'_>> {
        let path = self.path.as_deref()?;
        Some(if path == Path::new(TURNTABLE) {
            Way::Turntable(self.frames.unwrap_or(TURNTABLE_FRAMES))
        } else {
            Way::Keyframes(path)
        })
    }

    /// The cameras along the path through the keyframes in `file`, in the dataset's space, for frames of `size`:
    /// `--frames` cameras evenly from the first keyframe to the last, else one every 1/`--fps` seconds.
    pub(super) fn through_keyframes(&self, file: &Path, size: [u32; 2]) -> Result<Vec<NamedCamera>, Error> {
        let path = read_keyframes(&read_at_most(file)?).map_err(Error::malformed(file))?;
        let seconds = path.end() - path.start();
        let (count, step) = match self.frames {
            Some(count) => (count, seconds / f64::from((count - 1).max(1))),
            None => {
                // A rounding error must not drop the last frame.
                let count = (seconds * self.fps + 1e-6).floor() + 1.0;
                if count > f64::from(MAX_FRAMES) {
                    return Err(Error::Usage(format!(
                        "{}: {seconds} seconds at {} frames per second are {count} frames; at most {MAX_FRAMES} are supported",
                        file.display(),
                        self.fps
                    )));
                }
                (count as u32, 1.0 / self.fps)
            }
        };
        let cameras = (0..count).map(|n| path.at(path.start() + step * f64::from(n)).camera(size));
        Ok(numbered("frame", 4, cameras))
    }
}

/// Cameras named `PREFIX_NNN` by their numbers, of at least `digits` digits.
pub(super) fn numbered(
    prefix: &str,
    least_digits: usize,
    cameras: impl ExactSizeIterator<Item = Camera>,
) -> Vec<NamedCamera> {
    let digits = digits(cameras.len()).max(least_digits);
    let named = |(n, camera): (usize, Camera)| {
        let name = format!("{prefix}_{n:0digits$}");
        NamedCamera { path: name.clone(), name, camera }
    };
    cameras.enumerate().map(named).collect()
}

/// Digits of the last of `count` numbers from 0.
fn digits(count: usize) -> usize {
    count.saturating_sub(1).to_string().len()
}

/// Reads a file up to a limit: a device or a pipe has no length to check beforehand.
fn read_at_most(file: &Path) -> Result<Vec<u8>, Error> {
    let mut bytes = Vec::new();
    let opened = File::open(file).map_err(Error::io("read", file))?;
    opened.take(MAX_KEYFRAMES_BYTES + 1).read_to_end(&mut bytes).map_err(Error::io("read", file))?;
    Ok(bytes)
}
