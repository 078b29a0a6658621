//! `strivec bench files`: scenes to bytes and back, to the disk and back, and to finer factors.

use std::fs;
use std::hint::black_box;
use std::path::PathBuf;

use serde::Serialize;
use tempfile::TempDir;

use super::{Repeats, render, report};
use crate::cli::table::Table;
use crate::cli::{Error, Session, write_atomically};
use crate::container::{self, EncodeOptions, Encoding};
use crate::measure::bench::Spread;
use crate::train;

const EXAMPLES: &str = "\
Examples:
  strivec bench files
  strivec bench files lego.strivec --runs 9";

/// The arguments.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Args {
    /// The scene [default: a ball that is made in memory]
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
    seconds: Spread,
    /// Of the file; of the factors that are made, for upsampling.
    bytes: u64,
}

impl Args {
    /// The ball, a few times.
    pub(super) fn quick() -> Self {
        Self { file: None, repeats: Repeats::quick(3) }
    }
}

/// Measures each way.
pub(super) fn measure(args: &Args, session: &Session) -> Result<Report, Error> {
    let (scene, subject) = render::subject(args.file.as_ref())?;
    session.console.say("bench: files");
    let (runs, mut rows) = (args.repeats.runs(), Vec::new());
    let folder = TempDir::new().map_err(|e| Error::Io(format!("folder for temporary files: cannot make it: {e}")))?;
    let path = folder.path().join("scene.strivec");
    for (name, factors) in [("f16", Encoding::F16), ("f32", Encoding::F32)] {
        let options = EncodeOptions::uniform(factors);
        let refused = |e: container::Error| Error::Runtime(format!("{subject}: {e}"));
        let mut row = |what: &str, seconds: Spread, bytes: u64| {
            rows.push(Row { name: format!("{what}, {name}"), seconds, bytes });
        };
        let (seconds, mut encoded) = runs.time(|| container::encode(&scene, &options).map_err(refused))?;
        let bytes = encoded.pop().unwrap_or_default();
        row("encode", seconds, bytes.len() as u64);
        let (seconds, _) = runs.time(|| container::decode(&bytes).map(black_box).map(drop).map_err(refused))?;
        row("decode", seconds, bytes.len() as u64);
        let (seconds, _) = runs.time(|| write_atomically(&path, &bytes, true))?;
        row("write, durably", seconds, bytes.len() as u64);
        let (seconds, _) = runs.time(|| fs::read(&path).map(black_box).map(drop).map_err(Error::io("read", &path)))?;
        row("read, from the system's cache", seconds, bytes.len() as u64);
    }
    let (seconds, made) = runs.time(|| {
        let entries = scene.scales.iter().map(|scale| {
            let from = scale.cloud.resolution;
            // As a schedule's first upsamplings do, by about half.
            let to = from.map(|d| d + d.div_ceil(2));
            let [density, appearance] = [
                (&scale.factors.density, scale.factors.density_rank),
                (&scale.factors.appearance, scale.factors.appearance_rank),
            ]
            .map(|(factors, rank)| black_box(train::upsample(factors, rank as usize, from, to)).len());
            density + appearance
        });
        Ok::<_, Error>(size_of::<f32>() * entries.sum::<usize>())
    })?;
    rows.push(Row { name: "upsample, half as fine again".into(), seconds, bytes: made[0] as u64 });
    Ok(Report { subject, parameters: scene.parameter_count(), rows })
}

impl Report {
    /// For people.
    pub(super) fn text(&self) -> String {
        let mut table = Table::new(["files", "ms", "quartiles", "MB", "MB/s"]);
        for row in &self.rows {
            let [low, high] = row.seconds.quartiles;
            let megabytes = 1e-6 * row.bytes as f64;
            table.row([
                row.name.clone(),
                report::ms(row.seconds.median),
                format!("{} to {}", report::ms(low), report::ms(high)),
                format!("{megabytes:.2}"),
                format!("{:.0}", megabytes / row.seconds.median),
            ]);
        }
        format!("{}, {:.1} M parameters\n{}", self.subject, 1e-6 * self.parameters as f64, table.text())
    }
}
