//! `strivec bench query`: densities and features at points.

use std::convert::Infallible;
use std::hint::black_box;
use std::path::PathBuf;

use glam::DVec3;
use serde::Serialize;

use super::repeats::Repeats;
use super::{render, report};
use crate::cli::table::Table;
use crate::cli::{Error, Session, quantity};
use crate::digits::grouped;
use crate::field::Field;
use crate::measure::bench::Spread;
use crate::model::Scene;
use crate::random::Random;

const EXAMPLES: &str = "\
Examples:
  strivec bench query
  strivec bench query lego.strivec --points 100k --threads-list 1,2";
/// Most points.
const MAX_POINTS: u64 = 100_000_000;

/// The arguments.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Args {
    /// Scene file [default: a ball made in memory]
    file: Option<PathBuf>,
    /// Number of random points in the bounds
    #[arg(long, value_name = "N", default_value = "1M", value_parser = points)]
    points: u64,
    #[command(flatten)]
    repeats: Repeats,
}

fn points(text: &str) -> Result<u64, String> {
    let count = quantity::count(text)?;
    if (1..=MAX_POINTS).contains(&count) { Ok(count) } else { Err("not a number from 1 to 100M".into()) }
}

/// The result, as `--json` prints it.
#[derive(Serialize)]
pub(super) struct Report {
    subject: String,
    points: u64,
    rows: Vec<Row>,
}

#[derive(Serialize)]
struct Row {
    what: &'static str,
    threads: usize,
    seconds: Spread,
    /// Share of the points that the scene covers.
    covered_share: f64,
}

/// Measures on all numbers of threads.
pub(super) fn measure(args: &Args, session: &Session) -> Result<Report, Error> {
    let (scene, subject) = render::subject(args.file.as_ref(), &session.console)?;
    let (points, field) = (points_in(&scene, args.points), Field::<f32>::new(&scene));
    let rows = args.repeats.in_each_pool(|| {
        let row = |what, width, query: &dyn Fn(&mut [f32])| {
            let query = || {
                let mut values = vec![0.0; points.len() * width];
                query(&mut values);
                values
            };
            let values = query();
            let covered = values.chunks_exact(width).filter(|values| values.iter().any(|&v| v != 0.0)).count();
            let covered_share = covered as f64 / points.len() as f64;
            let Ok((seconds, _)) = args.repeats.runs().time(|| {
                black_box(query());
                Ok::<_, Infallible>(())
            });
            Row { what, threads: rayon::current_num_threads(), seconds, covered_share }
        };
        let densities = |values: &mut [f32]| field.densities(|n| points[n], values);
        let features = |values: &mut [f32]| field.appearances(|n| points[n], values);
        Ok([row("density", 1, &densities), row("features", field.decoder.features, &features)])
    })?;
    Ok(Report { subject, points: args.points, rows: rows.into_iter().flatten().collect() })
}

/// Random points in the scene's bounds, the same at every call.
fn points_in(scene: &Scene, count: u64) -> Vec<DVec3> {
    let (random, bounds) = (Random::new(0, "points"), &scene.bounds);
    let point = |n| DVec3::from_array([0, 1, 2].map(|axis| random.uniform(3 * n + axis)));
    (0..count).map(|n| bounds.min + point(n) * (bounds.max - bounds.min)).collect()
}

impl Report {
    /// The report as text.
    pub(super) fn text(&self) -> String {
        let mut table = Table::new(["query", "threads", "ms", "quartiles", "M points/s", "covered"]);
        for row in &self.rows {
            table.row([
                row.what.to_owned(),
                row.threads.to_string(),
                report::ms(row.seconds.median),
                report::quartiles(&row.seconds),
                format!("{:.2}", 1e-6 * self.points as f64 / row.seconds.median),
                report::percent(row.covered_share),
            ]);
        }
        format!("{}, {} points\n{}", self.subject, grouped(self.points), table.text())
    }
}
