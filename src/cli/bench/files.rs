//! `strivec bench files`: encoding, decoding, writing, reading and upsampling of scenes.

use std::fs;
use std::hint::black_box;
use std::path::{Path, PathBuf};

use serde::Serialize;
use tempfile::TempDir;

use super::repeats::Repeats;
use super::{render, report};
use crate::bench::lab::{Runs, Spread};
use crate::table::{Table, plural};
use crate::viewpoints::Viewpoints;
use crate::{Context, Error, write_atomically};
use strivec_field::Field;
use strivec_field::render::{CpuRenderer, Pixel, Renderer};
use strivec_format::container;
use strivec_format::container::{EncodeOptions, Encoding};
use strivec_format::model::{Block, Scene};
use strivec_train as train;

const EXAMPLES: &str = "\
Examples:
  strivec bench files
  strivec bench files lego.strivec --runs 9 --threads-list 1,2";

/// The arguments.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Args {
    /// Scene file [default: a ball made in memory]
    file: Option<PathBuf>,
    #[command(flatten)]
    repeats: Repeats,
}

/// The result, as `--json` prints it.
#[derive(Serialize)]
pub(super) struct Report {
    subject: String,
    parameters: u64,
    rows: Vec<Row>,
}

#[derive(Serialize)]
struct Row {
    name: String,
    threads: usize,
    seconds: Spread,
    /// Bytes of the file, or of the factors after upsampling.
    bytes: u64,
    /// Bytes that MB/s refer to: the parameters as 32-bit floats for encoding and decoding, else `bytes`.
    handled_bytes: u64,
}

impl Args {
    /// A short measurement on the ball.
    pub(super) fn quick() -> Self {
        Self { file: None, repeats: Repeats::quick(3) }
    }
}

/// Measures on all numbers of threads.
pub(super) fn measure(args: &Args, session: &Context) -> Result<Report, Error> {
    let (scene, subject) = render::subject(args.file.as_ref(), &session.console)?;
    let folder = TempDir::new().map_err(|e| Error::Io(format!("cannot make a temporary folder: {e}")))?;
    let rows = args.repeats.in_each_pool(|| {
        session.console.say(&format!("bench: files, {}", plural(rayon::current_num_threads(), "thread")));
        FileRows::measure(&scene, &subject, args, &folder.path().join("scene.strivec"))
    })?;
    Ok(Report { subject, parameters: scene.parameter_count(), rows: rows.into_iter().flatten().collect() })
}

struct FileRows {
    runs: Runs,
    threads: usize,
    rows: Vec<Row>,
}

impl FileRows {
    fn measure(scene: &Scene, subject: &str, args: &Args, path: &Path) -> Result<Vec<Row>, Error> {
        let mut rows = Self { runs: args.repeats.runs(), threads: rayon::current_num_threads(), rows: Vec::new() };
        let raw = size_of::<f32>() as u64 * scene.parameter_count();
        let refused = |e: container::Error| Error::Runtime(format!("{subject}: {e}"));
        let mut half = Vec::new();
        for (name, factors) in [("f32", Encoding::F32), ("grid8", Encoding::Grid(8)), ("f16", Encoding::F16)] {
            let options = EncodeOptions::uniform(factors);
            let (seconds, mut encoded) = rows.runs.time(|| container::encode(scene, &options).map_err(refused))?;
            half = encoded.pop().unwrap_or_default();
            let bytes = half.len() as u64;
            rows.add(format!("encode, {name}"), seconds, bytes, raw);
            let (seconds, _) = rows.runs.time(|| container::decode(&half).map(black_box).map(drop).map_err(refused))?;
            rows.add(format!("decode, {name}"), seconds, bytes, raw);
        }
        let bytes = half.len() as u64;
        let (seconds, _) = rows.runs.time(|| write_atomically(path, &half, true))?;
        rows.add("write f16, durably".into(), seconds, bytes, bytes);
        let read = |path: &Path| fs::read(path).map_err(Error::io("read", path));
        let (seconds, _) = rows.runs.time(|| read(path).map(black_box).map(drop))?;
        rows.add("read f16, cached by the system".into(), seconds, bytes, bytes);
        if let Some(file) = &args.file {
            let whole = read(file)?;
            let bytes = whole.len() as u64;
            let (seconds, _) =
                rows.runs.time(|| container::decode(&whole).map(black_box).map(drop).map_err(refused))?;
            rows.add("decode the file itself".into(), seconds, bytes, raw);
            let (seconds, _) = rows.runs.time(|| first_pixel(file, &read(file)?).map(black_box).map(drop))?;
            rows.add("open the file, to the first pixel".into(), seconds, bytes, raw);
        }
        let (seconds, made) = rows.runs.time(|| Ok::<_, Error>(upsampled(scene)))?;
        rows.add("upsample by 1.5".into(), seconds, made[0], made[0]);
        Ok(rows.rows)
    }

    fn add(&mut self, name: String, seconds: Spread, bytes: u64, handled_bytes: u64) {
        self.rows.push(Row { name, threads: self.threads, seconds, bytes, handled_bytes });
    }
}

/// The middle pixel of a picture of the whole scene.
fn first_pixel(path: &Path, file: &[u8]) -> Result<Pixel, Error> {
    let mut scene = container::decode(file).map_err(|e| Error::container(path, e))?;
    let ray = Viewpoints::first_of_orbit(&scene, [1, 1]).ray(0, 0);
    Ok(CpuRenderer::from_field(Field::<f32>::from_scene(&mut scene)?).trace(ray.as_slice())[0])
}

/// Bytes of the factors that upsampling makes.
fn upsampled(scene: &Scene) -> u64 {
    let entries = scene.scales.iter().map(|scale| {
        let from = scale.cloud.resolution;
        // By about half, like the first upsamplings of a schedule.
        let to = from.map(|d| d + d.div_ceil(2));
        let upsampled =
            |block: &Block| black_box(train::upsample(block.form, &block.values, block.rank as usize, from, to)).len();
        scale.factors.blocks().map(upsampled).sum::<usize>()
    });
    (size_of::<f32>() * entries.sum::<usize>()) as u64
}

impl Report {
    /// The report as text.
    pub(super) fn text(&self) -> String {
        let mut table = Table::new(["files", "threads", "ms", "quartiles", "MB", "MB/s"]);
        for row in &self.rows {
            table.row([
                row.name.clone(),
                row.threads.to_string(),
                report::ms(row.seconds.median),
                report::quartiles(&row.seconds),
                format!("{:.2}", 1e-6 * row.bytes as f64),
                format!("{:.0}", 1e-6 * row.handled_bytes as f64 / row.seconds.median),
            ]);
        }
        let millions = 1e-6 * self.parameters as f64;
        format!(
            "{}, {millions:.1} M parameters; MB/s of encoding and decoding refer to these as f32\n{}",
            self.subject,
            table.text()
        )
    }
}
