//! `strivec bench placement`: placement of many tensors on a prior, and their lookup.

use std::hint::black_box;
use std::time::Instant;

use serde::Serialize;

use crate::cli::table::Table;
use crate::cli::{Error, quantity};
use crate::digits::grouped;
use crate::field::{Field, Samples};
use crate::measure::bench::{MemoryMark, ball_on, shell, voxel_for};
use crate::model::Scene;
use crate::prior::{self, ScaleShape};
use crate::random::Random;
use crate::train::TrainConfig;

const EXAMPLES: &str = "\
Examples:
  strivec bench placement
  strivec bench placement --tensors 1M --json

One scale of tensors of rank 1 on a spherical shell, edges 1.5 pitches. Lookups are density features at random points near \
tensors, one after the other: each finds the four nearest tensors and reads their vectors. Memory is the peak that a stage \
adds, if the system reports it.";
/// Number of lookups.
const LOOKUPS: u64 = 1_000_000;

/// The arguments.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Args {
    /// Approximate numbers of tensors, 1000 to 10M
    #[arg(long, value_name = "N,N,…", value_delimiter = ',', default_value = "10k,100k,1M", value_parser = tensors)]
    tensors: Vec<u64>,
}

fn tensors(text: &str) -> Result<u64, String> {
    let count = quantity::count(text)?;
    if (1000..=10_000_000).contains(&count) { Ok(count) } else { Err("not a number from 1000 to 10M".into()) }
}

/// The result, as `--json` prints it.
#[derive(Serialize)]
pub(super) struct Report {
    rows: Vec<Row>,
}

#[derive(Serialize)]
struct Row {
    tensors: usize,
    /// Placement: from occupied cells to a cloud.
    place: Cost,
    /// The fast field of the cloud, mainly its index.
    index: Cost,
    /// Seconds per lookup.
    lookup_seconds: f64,
    /// Share of the points that are covered.
    covered_share: f64,
}

#[derive(Serialize)]
struct Cost {
    seconds: f64,
    bytes: Option<u64>,
}

impl Cost {
    fn of<R>(work: impl FnOnce() -> R) -> (R, Self) {
        let (memory, start) = (MemoryMark::set(), Instant::now());
        let made = work();
        (made, Self { seconds: start.elapsed().as_secs_f64(), bytes: memory.peak() })
    }
}

/// Measures placement, index and lookup.
pub(super) fn measure(args: &Args) -> Result<Report, Error> {
    Ok(Report { rows: args.tensors.iter().map(|&count| row(count)).collect::<Result<_, _>>()? })
}

fn row(count: u64) -> Result<Row, Error> {
    let voxel = voxel_for(count);
    let shape = ScaleShape::cubic(voxel, 1.5 * voxel, 2);
    let mut config = TrainConfig::preset("fast").map_err(|e| Error::Runtime(e.to_string()))?;
    config.scales.truncate(1);
    for scale in &mut config.scales {
        (scale.pitch, scale.edge, scale.resolutions) = (shape.pitch, shape.edge, vec![shape.resolution]);
        (scale.density_rank, scale.appearance_rank, scale.top_k) = (1, 1, 4);
    }
    let boxes = shell(voxel);
    let (cloud, place) = Cost::of(|| prior::place_on_boxes(&boxes, &shape));
    drop(cloud.map_err(|e| Error::Runtime(e.to_string()))?);
    let scene = ball_on(&boxes, &config, 0)?;
    let (field, index) = Cost::of(|| Field::<f32>::new(&scene));
    let (lookup_seconds, covered_share) = look_up(&scene, &field);
    Ok(Row { tensors: scene.scales[0].cloud.len(), place, index, lookup_seconds, covered_share })
}

/// Seconds per point, and the share of points that are covered.
fn look_up(scene: &Scene, field: &Field<f32>) -> (f64, f64) {
    let cloud = &scene.scales[0].cloud;
    let centers: Vec<_> = cloud.centers().collect();
    let random = Random::new(0, "lookups");
    let positions: Vec<_> = (0..LOOKUPS)
        .map(|n| {
            let center = centers[random.below(4 * n, centers.len() as u64) as usize];
            let offset = [1, 2, 3].map(|axis| 2.0 * random.uniform(4 * n + axis) - 1.0);
            field.relative(center + glam::DVec3::from(offset) * cloud.half_edge)
        })
        .collect();
    let mut samples = Samples::default();
    let start = Instant::now();
    let covered = positions.iter().filter(|&&p| black_box(field.density_feature(p, &mut samples)).is_some()).count();
    (start.elapsed().as_secs_f64() / LOOKUPS as f64, covered as f64 / LOOKUPS as f64)
}

impl Report {
    /// The report as text.
    pub(super) fn text(&self) -> String {
        let columns = ["tensors", "placement, s", "MB", "index, s", "MB", "lookup, ns"];
        let mut table = Table::new(columns);
        let megabytes = |bytes: Option<u64>| bytes.map_or_else(|| "-".to_owned(), |b| format!("{:.0}", b as f64 / 1e6));
        for row in &self.rows {
            table.row([
                grouped(row.tensors as u64),
                format!("{:.3}", row.place.seconds),
                megabytes(row.place.bytes),
                format!("{:.3}", row.index.seconds),
                megabytes(row.index.bytes),
                format!("{:.0}", 1e9 * row.lookup_seconds),
            ]);
        }
        table.text()
    }
}
