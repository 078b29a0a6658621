//! `--video`: encode frames as a video with an installed encoder program.
//!
//! The program is looked for before any picture is rendered. It reads the frames in their folder and writes into a
//! hidden folder there; only a whole video takes the name that was asked for.

use std::io;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use super::{Error, write_atomically};

/// A video to encode, with its encoder.
pub(super) struct Video {
    file: PathBuf,
    format: VideoFormat,
    encoder: VideoEncoder,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum VideoFormat {
    Mp4,
    Webp,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum VideoEncoder {
    Ffmpeg,
    Img2webp,
}

impl VideoFormat {
    /// The format by the extension of `file`.
    fn from_path(path: &Path) -> Result<Self, Error> {
        let is = |known: &str| path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case(known));
        if is("mp4") {
            Ok(Self::Mp4)
        } else if is("webp") {
            Ok(Self::Webp)
        } else {
            Err(Error::Usage(format!("--video {}: the name must end in .mp4 or .webp", path.display())))
        }
    }

    /// The name of ffmpeg's encoder.
    fn codec(self) -> &'static str {
        match self {
            Self::Mp4 => "libx264",
            Self::Webp => "libwebp_anim",
        }
    }

    /// An installed encoder, else a description of the search.
    fn encoder(self) -> Result<VideoEncoder, &'static str> {
        if self == Self::Webp && VideoEncoder::Img2webp.output(&["-version"]).is_ok() {
            return Ok(VideoEncoder::Img2webp);
        }
        let Ok(listed) = VideoEncoder::Ffmpeg.output(&["-hide_banner", "-loglevel", "error", "-encoders"]) else {
            return Err("none");
        };
        let listed = String::from_utf8_lossy(&listed.stdout);
        let known = listed.split_whitespace().any(|word| word == self.codec());
        if known { Ok(VideoEncoder::Ffmpeg) } else { Err("an ffmpeg without that encoder") }
    }
}

impl VideoEncoder {
    fn program(self) -> &'static str {
        match self {
            Self::Ffmpeg => "ffmpeg",
            Self::Img2webp => "img2webp",
        }
    }

    fn output(self, arguments: &[&str]) -> io::Result<Output> {
        Command::new(self.program()).args(arguments).stdin(Stdio::null()).output()
    }
}

impl Video {
    /// How to make the video `file` of pictures of `size`.
    ///
    /// Fails if the format is unknown or does not allow the size, or no program for it is installed.
    pub(super) fn plan(file: &Path, size: [u32; 2]) -> Result<Self, Error> {
        let format = VideoFormat::from_path(file)?;
        if format == VideoFormat::Mp4 && size.iter().any(|extent| extent % 2 == 1) {
            let [width, height] = size;
            let message = format!("--video: MP4 needs an even width and height; --size is {width}x{height}");
            return Err(Error::Usage(message));
        }
        let encoder = format.encoder().map_err(|found| {
            let expected = match format {
                VideoFormat::Mp4 => "the program ffmpeg with its encoder libx264 on PATH",
                VideoFormat::Webp => "the program img2webp, or ffmpeg with its encoder libwebp_anim, on PATH",
            };
            let package = if format == VideoFormat::Mp4 { "ffmpeg" } else { "webp" };
            Error::Runtime(format!(
                "--video needs {expected}; found {found}. Install it (on Debian: apt-get install {package}), or leave out \
                 --video to keep the frames as PNG files"
            ))
        })?;
        Ok(Self { file: file.to_path_buf(), format, encoder })
    }

    /// The program that will be run.
    pub(super) fn program(&self) -> &'static str {
        self.encoder.program()
    }

    /// Makes the video of `frames`, pictures in `folder` whose names are numbers from 0 between `frame_` and `.png`.
    pub(super) fn encode(&self, folder: &Path, frames: &[PathBuf], fps: f64, force: bool) -> Result<(), Error> {
        let names: Vec<String> = (frames.iter())
            .filter_map(|frame| frame.file_name())
            .map(|name| name.to_string_lossy().into_owned())
            .collect();
        let digits = names.first().map_or(0, |name| name.len() - "frame_.png".len());
        let hidden = tempfile::Builder::new().prefix(".video.").suffix(".partial").tempdir_in(folder);
        let hidden = hidden.map_err(Error::io("write to", folder))?;
        // Names without a folder, so that the program cannot misread a character of the folder's name.
        let inside = Path::new(hidden.path().file_name().unwrap_or_default());
        let (script, video) = (inside.join("frames.txt"), inside.join("video"));
        let mut command = Command::new(self.program());
        command.current_dir(folder).stdin(Stdio::null());
        match self.encoder {
            VideoEncoder::Ffmpeg => {
                let pattern = format!("frame_%0{digits}d.png");
                command.args(["-hide_banner", "-loglevel", "error", "-nostdin", "-y", "-framerate", &fps.to_string()]);
                command.args(["-start_number", "0", "-i", &pattern, "-frames:v", &frames.len().to_string()]);
                command.args(["-c:v", self.format.codec()]).args(self.format.settings()).arg(&video);
            }
            VideoEncoder::Img2webp => {
                let whole = folder.join(&script);
                std::fs::write(&whole, img2webp_script(&names, fps, &video)).map_err(Error::io("write", &whole))?;
                command.arg(&script);
            }
        }
        let failed = |found: &str| {
            let kept = format!("the frames are in {}", folder.display());
            Error::Runtime(format!("{}: {} failed: {found}; {kept}", self.file.display(), self.program()))
        };
        let output = command.output().map_err(|error| failed(&error.to_string()))?;
        if !output.status.success() {
            let complaint = String::from_utf8_lossy(&output.stderr);
            let last = complaint.lines().map(str::trim).rfind(|line| !line.is_empty()).unwrap_or("no message");
            return Err(failed(&format!("{}: {last}", output.status)));
        }
        let bytes = std::fs::read(folder.join(&video)).map_err(|error| failed(&error.to_string()))?;
        write_atomically(&self.file, &bytes, force)
    }
}

impl VideoFormat {
    /// ffmpeg's settings: a format that every player supports, at a quality with hardly visible losses.
    fn settings(self) -> &'static [&'static str] {
        match self {
            // Colors in BT.709, with the tags for it: without tags some players assume another standard.
            Self::Mp4 => &[
                "-vf",
                "scale=out_color_matrix=bt709:out_range=tv,format=yuv420p",
                "-crf",
                "18",
                "-colorspace",
                "bt709",
                "-color_primaries",
                "bt709",
                "-color_trc",
                "bt709",
                "-movflags",
                "+faststart",
                "-f",
                "mp4",
            ],
            Self::Webp => &["-lossless", "0", "-quality", "90", "-loop", "0", "-f", "webp"],
        }
    }
}

/// The arguments in a file, because a command line may be too short for all frames. A frame lasts whole milliseconds,
/// rounded so that their sum is exact.
fn img2webp_script(names: &[String], fps: f64, video: &Path) -> String {
    let until = |n: usize| (1000.0 * n as f64 / fps).round() as u64;
    let frame = |(n, name): (usize, &String)| format!("-d {} {name}\n", until(n + 1) - until(n));
    let frames: String = names.iter().enumerate().map(frame).collect();
    // The program reads slashes on every system.
    let video = video.to_string_lossy().replace('\\', "/");
    format!("-loop 0 -lossy -q 90\n{frames}-o {video}\n")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_videos_format_is_its_extension() {
        assert_eq!(VideoFormat::from_path(Path::new("a.b/c.MP4")).unwrap(), VideoFormat::Mp4);
        assert_eq!(VideoFormat::from_path(Path::new("c.webp")).unwrap(), VideoFormat::Webp);
        for wrong in ["mp4", "a.gif", "a.mp4/b", ""] {
            assert_eq!(VideoFormat::from_path(Path::new(wrong)).unwrap_err().exit_code(), 1, "{wrong}");
        }
    }

    #[test]
    fn frames_of_whole_milliseconds_last_as_long_as_they_should() {
        let names: Vec<String> = (0..30).map(|n| format!("frame_{n:04}.png")).collect();
        let script = img2webp_script(&names, 30.0, Path::new(".video.x/video"));
        assert!(script.starts_with("-loop 0 -lossy -q 90\n-d 33 frame_0000.png\n-d 34 frame_0001.png\n"), "{script}");
        assert!(script.ends_with(" frame_0029.png\n-o .video.x/video\n"), "{script}");
        let milliseconds: u64 = script.split("-d ").skip(1).map(|rest| rest[..2].parse::<u64>().unwrap()).sum();
        assert_eq!(milliseconds, 1000);
    }
}
