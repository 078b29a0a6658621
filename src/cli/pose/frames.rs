//! Frames of a video by ffmpeg: the sharpest of each interval.
//!
//! A first pass decodes small gray frames through a pipe and measures each. A second pass writes the chosen ones at full
//! size. Both passes resample to the same rate, so that the same number means the same frame.

use std::fs;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};

use serde::Deserialize;

use super::super::Error;
use super::super::progress::Progress;
use super::process::{self, stopped, with_end_of};

/// Edge of the square that frames are scaled to for measuring, in pixels; it does not depend on the video's rotation.
const EDGE: usize = 640;
/// Frames per second that are measured, at most.
const MAX_RATE: f64 = 30.0;
const INSTALL: &str = "install it: apt install ffmpeg";

/// A video.
#[derive(Debug)]
pub(super) struct SourceVideo {
    path: PathBuf,
    /// Seconds.
    length: f64,
    /// Frames per second, as ffmpeg reads it.
    rate_text: String,
    rate: f64,
}

#[derive(Deserialize)]
struct VideoProbe {
    #[serde(default)]
    streams: Vec<ProbeStream>,
    #[serde(default)]
    format: ProbeFormat,
}

#[derive(Deserialize)]
struct ProbeStream {
    avg_frame_rate: Option<String>,
    duration: Option<String>,
}

#[derive(Default, Deserialize)]
struct ProbeFormat {
    duration: Option<String>,
}

impl SourceVideo {
    /// The video in the file `path`.
    ///
    /// # Errors
    ///
    /// If ffmpeg or ffprobe is not installed, or the file is no video.
    pub(super) fn open(path: &Path) -> Result<Self, Error> {
        // Absolute, because a name may begin like an option.
        let path = std::path::absolute(path).map_err(Error::io("read", path))?;
        let missing = |name: &str| Error::Runtime(format!("a video needs {name}, which is not installed; {INSTALL}"));
        let version = Command::new("ffmpeg").arg("-version").stdin(Stdio::null()).output();
        version.map_err(|_| missing("ffmpeg"))?;
        let mut command = Command::new("ffprobe");
        command.args(["-v", "error", "-select_streams", "v:0", "-of", "json", "-show_entries"]);
        command.args(["stream=avg_frame_rate,duration:format=duration", "-i"]).arg(&path).stdin(Stdio::null());
        let output = command.output().map_err(|_| missing("ffprobe"))?;
        let no_video = |why: &str| {
            let message = format!("{}: neither a folder of photographs nor a video: {why}", path.display());
            Error::Malformed(message)
        };
        if !output.status.success() {
            let problem = String::from_utf8_lossy(&output.stderr);
            let last = problem.lines().rfind(|line| !line.trim().is_empty()).unwrap_or("no message");
            return Err(no_video(last.rsplit(": ").next().unwrap_or(last)));
        }
        let probe: VideoProbe = serde_json::from_slice(&output.stdout).map_err(|e| no_video(&e.to_string()))?;
        let Some(stream) = probe.streams.first() else { return Err(no_video("it has no pictures")) };
        let seconds = |text: &Option<String>| text.as_deref()?.parse().ok().filter(|s: &f64| s.is_finite() && *s > 0.0);
        let Some(length) = seconds(&stream.duration).or_else(|| seconds(&probe.format.duration)) else {
            return Err(no_video("it has no length"));
        };
        let (rate_text, rate) = rate_of(stream.avg_frame_rate.as_deref().unwrap_or_default());
        Ok(Self { path, length, rate_text, rate })
    }

    /// A text that changes if the video does.
    pub(super) fn fingerprint(&self) -> Result<String, Error> {
        let metadata = fs::metadata(&self.path).map_err(Error::io("read", &self.path))?;
        let modified = metadata.modified().ok().and_then(|time| time.duration_since(std::time::UNIX_EPOCH).ok());
        let seconds = modified.map_or(0, |since| since.as_secs());
        Ok(format!("a video of {} bytes, modified at {seconds}", metadata.len()))
    }

    /// Frames in the video, estimated from its length.
    pub(super) fn frames(&self) -> u64 {
        (self.length * self.rate).ceil() as u64
    }

    /// The sharpest frame of each of up to `count` intervals, at least `min_gap` seconds apart; `log` receives ffmpeg's
    /// messages.
    pub(super) fn sharpest(
        &self,
        count: usize,
        min_gap: f64,
        log: &Path,
        progress: &Progress<'_>,
        interrupted: &AtomicBool,
    ) -> Result<Vec<usize>, Error> {
        let messages = fs::File::create(log).map_err(Error::io("write", log))?;
        let mut command = self.decoder();
        let filter = format!("fps={},scale={EDGE}:{EDGE}:flags=area,format=gray", self.rate_text);
        command.args(["-vf", &filter, "-r", &self.rate_text, "-f", "rawvideo", "-"]);
        command.stdout(Stdio::piped()).stderr(messages);
        let failed = |e: std::io::Error| Error::Runtime(format!("frames: cannot run ffmpeg: {e}"));
        let mut child = command.spawn().map_err(failed)?;
        let Some(mut pipe) = child.stdout.take() else { return Err(Error::Runtime("frames: no pipe".into())) };
        let mut frame = vec![0; EDGE * EDGE];
        let mut sharpness = Vec::new();
        while pipe.read_exact(&mut frame).is_ok() {
            if interrupted.load(Ordering::SeqCst) {
                break;
            }
            sharpness.push(laplacian_variance(&frame, EDGE));
            progress.set(sharpness.len() as u64, String::new);
        }
        drop(pipe);
        if interrupted.load(Ordering::SeqCst) {
            let _ = child.kill();
            let _ = child.wait();
            return Err(stopped("pictures"));
        }
        let status = child.wait().map_err(failed)?;
        if !status.success() || sharpness.is_empty() {
            return Err(with_end_of(log, &format!("pictures: ffmpeg failed ({status})")));
        }
        Ok(choose(&sharpness, self.rate, count, min_gap))
    }

    /// Writes the frames `chosen`, in ascending order, as JPEG files into `images`, under the names `frame_names`
    /// returns.
    pub(super) fn extract(
        &self,
        chosen: &[usize],
        images: &Path,
        log: &Path,
        progress: &Progress<'_>,
        interrupted: &AtomicBool,
    ) -> Result<(), Error> {
        let terms: Vec<String> = chosen.iter().map(|n| format!("eq(n,{n})")).collect();
        // Without new times, ffmpeg would repeat frames to fill the gaps between them.
        let filter = format!("fps={0},select='{1}',setpts=N/({0})/TB", self.rate_text, terms.join("+"));
        let mut command = self.decoder();
        command.args(["-vf", &filter, "-r", &self.rate_text, "-q:v", "2", "-f", "image2", "-start_number", "0"]);
        command.args(["-nostats", "-progress", "pipe:1", "-frames:v", &chosen.len().to_string()]);
        command.arg("frame_%05d.jpg").current_dir(images);
        let mut line = |line: &str| {
            if let Some(done) = line.strip_prefix("frame=").and_then(|count| count.trim().parse().ok()) {
                progress.set(done, String::new);
            }
        };
        process::run("pictures", command, log, interrupted, &mut line)?;
        match frame_names(chosen.len()).find(|name| !images.join(name).is_file()) {
            Some(name) => Err(with_end_of(log, &format!("pictures: ffmpeg has not written {name}"))),
            None => Ok(()),
        }
    }

    /// ffmpeg with the video as input.
    fn decoder(&self) -> Command {
        let mut command = Command::new("ffmpeg");
        command.args(["-hide_banner", "-loglevel", "error", "-nostdin", "-y", "-i"]).arg(&self.path);
        command.args(["-map", "0:v:0"]).stdin(Stdio::null());
        command
    }
}

/// The names of `count` frames, in order.
pub(super) fn frame_names(count: usize) -> impl Iterator<Item = String> {
    (0..count).map(|n| format!("frame_{n:05}.jpg"))
}

/// Frames per second of ffprobe's fraction, at most [`MAX_RATE`], as text and as a number.
fn rate_of(fraction: &str) -> (String, f64) {
    let parts = fraction.split_once('/');
    let value = parts.and_then(|(a, b)| Some(a.parse::<f64>().ok()? / b.parse::<f64>().ok()?));
    match value.filter(|rate| *rate > 0.0 && *rate <= MAX_RATE) {
        Some(rate) => (fraction.to_owned(), rate),
        None => (MAX_RATE.to_string(), MAX_RATE),
    }
}

/// Variance of the Laplacian of a gray picture `width` pixels wide: high if edges are sharp.
fn laplacian_variance(gray: &[u8], width: usize) -> f64 {
    let (mut sum, mut squares, mut count) = (0_i64, 0_i64, 0_i64);
    for (above, (row, below)) in
        gray.chunks_exact(width).zip(gray.chunks_exact(width).skip(1).zip(gray.chunks_exact(width).skip(2)))
    {
        for x in 1..width.saturating_sub(1) {
            let around = [row[x - 1], row[x + 1], above[x], below[x]].map(i64::from).iter().sum::<i64>();
            let laplacian = 4 * i64::from(row[x]) - around;
            sum += laplacian;
            squares += laplacian * laplacian;
            count += 1;
        }
    }
    let mean = sum as f64 / count.max(1) as f64;
    squares as f64 / count.max(1) as f64 - mean * mean
}

/// The sharpest frame of each of up to `count` equal intervals of a video of `rate` frames per second, at least
/// `min_gap` seconds apart, in ascending order.
fn choose(sharpness: &[f64], rate: f64, count: usize, min_gap: f64) -> Vec<usize> {
    let gap = ((min_gap * rate).ceil() as usize).max(1);
    let intervals = count.min(sharpness.len().div_ceil(gap)).max(1);
    let mut chosen: Vec<usize> = Vec::with_capacity(intervals);
    for interval in 0..intervals {
        let at = |n: usize| n * sharpness.len() / intervals;
        let from = at(interval).max(chosen.last().map_or(0, |last| last + gap));
        // The first of equally sharp ones.
        let sharpest = (from..at(interval + 1)).reduce(|a, b| if sharpness[b] > sharpness[a] { b } else { a });
        chosen.extend(sharpest);
    }
    chosen
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sharpest_frame_of_each_interval_is_chosen() {
        let sharpness = [1.0, 5.0, 2.0, 9.0, 9.5, 1.0, 3.0, 3.0];
        assert_eq!(choose(&sharpness, 1.0, 2, 0.0), [3, 4]);
        assert_eq!(choose(&sharpness, 1.0, 2, 2.0), [3, 6], "too close to the one before");
        assert_eq!(choose(&sharpness, 1.0, 8, 0.0), [0, 1, 2, 3, 4, 5, 6, 7]);
        assert_eq!(choose(&sharpness, 1.0, 100, 4.0), [3, 7]);
        assert_eq!(choose(&sharpness[..1], 30.0, 100, 4.0), [0]);
        let many: Vec<f64> = (0..901).map(|n| f64::from(n * 7919 % 31)).collect();
        let chosen = choose(&many, 30.0, 150, 0.1);
        assert_eq!(chosen.len(), 150);
        assert!(chosen.windows(2).all(|pair| pair[1] >= pair[0] + 3), "{chosen:?}");
    }

    #[test]
    fn blur_lowers_the_laplacians_variance() {
        let edge: Vec<u8> = (0..64).map(|n| if n % 8 < 4 { 0 } else { 200 }).collect();
        let blurred: Vec<u8> = (0..64).map(|n| [0, 0, 50, 75, 125, 150, 200, 200][n % 8]).collect();
        assert!(laplacian_variance(&edge, 8) > 10.0 * laplacian_variance(&blurred, 8));
        assert_eq!(laplacian_variance(&[77; 64], 8), 0.0);
        assert_eq!(laplacian_variance(&[77; 2], 1), 0.0);
    }

    #[test]
    fn rates_above_thirty_and_unknown_ones_are_thirty() {
        assert_eq!(rate_of("30000/1001"), ("30000/1001".to_owned(), 30_000.0 / 1001.0));
        for text in ["60/1", "0/0", "", "x"] {
            assert_eq!(rate_of(text), ("30".to_owned(), 30.0), "{text}");
        }
    }
}
