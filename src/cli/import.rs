//! `strivec import`: a scene of another program.

use std::path::{Path, PathBuf};

use serde::Serialize;

use super::named_value::one_of;
use super::output::check_scene_name;
use super::{Error, Session, check_output, numbers, write_atomically};
use crate::container::{self, EncodeOptions, Metadata};
use crate::digits::grouped;
use crate::escape::escaped_path;
use crate::import::{Fault, Input};
use crate::interop::{SceneOptions, tensorf};
use crate::model::UpAxis;

const EXAMPLES: &str = "\
Examples:
  strivec import tensorf_lego_VM.th -o lego.strivec --dataset lego
  strivec eval lego.strivec data/lego --split test

FILE is a checkpoint of TensoRF: a TensorVMSplit or a TensorCP with the shading modes MLP_Fea or MLP. Pictures are TensoRF's but for \
rounding, and the file loses nothing. A checkpoint does not say what was behind the scene: the default is white, as its Blender \
scenes have it.";

/// The arguments.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Args {
    /// The checkpoint
    file: PathBuf,
    /// Scene file to write
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// The color behind the scene, from 0 to 1
    #[arg(long, value_name = "R,G,B", default_value = "1,1,1", value_parser = color)]
    background: [f32; 3],
    /// The axis that points up
    #[arg(long, value_name = "AXIS", value_parser = one_of(UpAxis::ALL, UpAxis::name), default_value = "z")]
    up: UpAxis,
    /// The dataset's name, which the file keeps
    #[arg(long, value_name = "NAME", default_value = "")]
    dataset: String,
}

/// The result, as `--json` prints it.
#[derive(Serialize)]
struct Report<'a> {
    output: &'a Path,
    /// `tensorf-vm` or `tensorf-cp`.
    kind: String,
    resolution: [u32; 3],
    density_rank: u32,
    appearance_rank: u32,
    parameters: u64,
    bytes: u64,
}

/// Reads the checkpoint and writes the scene.
pub(super) fn run(args: &Args, session: &Session) -> Result<(), Error> {
    check_scene_name(&args.output)?;
    check_output(&args.output, session.force)?;
    let options = SceneOptions { background: args.background, up: args.up, dataset: args.dataset.clone() };
    let malformed = |fault: Fault| Error::from(fault.of(&args.file));
    let mut input = Input::open(&args.file).map_err(malformed)?;
    let scene = tensorf::read(&mut input, &options).map_err(malformed)?;
    let bytes = container::encode_scene_file(&scene, &Metadata::default(), &EncodeOptions::lossless(&scene))
        .map_err(|e| Error::container(&args.output, e))?;
    write_atomically(&args.output, &bytes, session.force)?;
    let scale = &scene.scales[0];
    let report = Report {
        output: &args.output,
        kind: scene.provenance.preset.clone(),
        resolution: scale.cloud.resolution,
        density_rank: scale.factors.density_rank(),
        appearance_rank: scale.factors.appearance_rank(),
        parameters: scene.parameter_count(),
        bytes: bytes.len() as u64,
    };
    session.console.result(&report, |report| {
        let [x, y, z] = report.resolution;
        format!(
            "{}: {}, {x} x {y} x {z} cells, ranks {}+{}, {} parameters, {} bytes",
            escaped_path(report.output),
            report.kind,
            report.density_rank,
            report.appearance_rank,
            grouped(report.parameters),
            grouped(report.bytes)
        )
    })
}

fn color(text: &str) -> Result<[f32; 3], String> {
    let color = numbers::numbers::<3>(text)?;
    if color.iter().all(|c| (0.0..=1.0).contains(c)) {
        Ok(color.map(|c| c as f32))
    } else {
        Err("not three numbers from 0 to 1".into())
    }
}
