//! `strivec bench render`: frames by stage.

use std::path::PathBuf;

use serde::Serialize;

use super::repeats::Repeats;
use super::report;
use crate::bench::lab::{Measured, MemoryMark, ball, frames};
use crate::console::Console;
use crate::table::plural;
use crate::viewpoints::Viewpoints;
use crate::{Context, Error, picture_size, scene_file};
use strivec_format::model::Scene;
use strivec_train::TrainConfig;

const EXAMPLES: &str = "\
Examples:
  strivec bench render
  strivec bench render lego.strivec --size 800x800 --threads-list 1,2";
/// Preset of the ball, at its finest resolution.
const BALL_PRESET: &str = "24";

/// The arguments.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Args {
    /// Scene file [default: a ball made in memory]
    file: Option<PathBuf>,
    /// Size of the frame, the first of an orbit, in pixels
    #[arg(long, value_name = "WxH", default_value = "400x400", value_parser = picture_size::parse)]
    size: [u32; 2],
    #[command(flatten)]
    repeats: Repeats,
}

/// The result, as `--json` prints it.
#[derive(Serialize)]
pub(super) struct Report {
    subject: String,
    size: [u32; 2],
    frames: Vec<Measured>,
}

impl Args {
    /// A small frame of the ball.
    pub(super) fn quick() -> Self {
        Self { file: None, size: [200, 200], repeats: Repeats::quick(3) }
    }
}

/// `file`'s scene or the ball, and its name.
pub(super) fn subject(file: Option<&PathBuf>, console: &Console) -> Result<(Scene, String), Error> {
    if let Some(file) = file {
        let scene = scene_file::read(file, console)?.0.scene;
        scene_file::check_memory(file, &scene)?;
        return Ok((scene, file.display().to_string()));
    }
    let config = TrainConfig::preset(BALL_PRESET).map_err(|e| Error::Runtime(e.to_string()))?;
    Ok((ball(&config, config.schedule.upsample_at.len())?, format!("a ball, preset {BALL_PRESET}")))
}

/// Measures on all numbers of threads.
pub(super) fn measure(args: &Args, session: &Context) -> Result<Report, Error> {
    let (scene, name) = subject(args.file.as_ref(), &session.console)?;
    let camera = Viewpoints::first_of_orbit(&scene, args.size);
    let frames = args.repeats.in_each_pool(|| {
        session.console.say(&format!("bench: rendering, {}", plural(rayon::current_num_threads(), "thread")));
        Ok(frames(&scene, &camera, args.repeats.runs(), MemoryMark::set()))
    })?;
    Ok(Report { subject: name, size: args.size, frames })
}

impl Report {
    /// The report as text.
    pub(super) fn text(&self) -> String {
        let mut text = String::new();
        for frame in &self.frames {
            text += &format!(
                "rendering {}, {}x{}, {}\n{}, {}\n{}\n",
                self.subject,
                self.size[0],
                self.size[1],
                plural(frame.threads, "thread"),
                report::seconds(&frame.seconds),
                report::memory(frame.peak_bytes),
                report::stages(frame),
            );
        }
        text + &report::scaling(&self.frames.iter().collect::<Vec<_>>())
    }
}
