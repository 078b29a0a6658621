//! `strivec import`: a scene of another program.

use std::path::{Path, PathBuf};

use serde::Serialize;

use super::named_value::one_of;
use super::output::check_scene_name;
use super::state_file::beside;
use super::table::plural;
use super::{Context, Error, check_output, numbers, write_atomically};
use strivec_checkpoints::authors;
use strivec_checkpoints::authors::{Config, Model, Places};
use strivec_checkpoints::{SceneOptions, tensorf};
use strivec_format::container;
use strivec_format::container::{EncodeOptions, Metadata};
use strivec_format::digits::grouped;
use strivec_format::escape::escaped_path;
use strivec_format::model::{Scene, UpAxis};
use strivec_import::{Fault, Input};

const EXAMPLES: &str = "\
Examples:
  strivec import tensorf_lego_VM.th -o lego.strivec --dataset lego
  strivec import lego.th --config lego.txt --points lego_points.txt -o lego.strivec
  strivec import lego.th --config lego.txt --points lego_points_0.4_vox.txt --points lego_points_0.2_vox.txt -o lego.strivec
  strivec import lego_vm.th --config lego.txt --meta lego_vm_meta.pkl -o lego.strivec
  strivec eval lego.strivec data/lego --split test

FILE is a checkpoint of TensoRF or of the Strivec authors' program, with the shading modes MLP_Fea or MLP. The file loses nothing. A \
checkpoint does not say what was behind the scene: the default is white, as Blender's scenes have it.

TensoRF: a TensorVMSplit or a TensorCP. Pictures are TensoRF's but for rounding.

Strivec's authors: a StrivecCP_hier or a Strivec_DBase. Their checkpoints lack the tensors' places and the rules: --config is the \
program's configuration. The places are, of a StrivecCP_hier, --points: the prior's points (`pointfile`), from which centers are \
derived as the program derives them with `vox_range`; or one file of centers for each scale, coarsest first, which the program \
writes as NAME_RANGE_vox.txt. To save the centers from a running program:
  for l, p in enumerate(tensorf.pnt_xyz): numpy.savetxt(f'lego_centers_{l}.txt', p.cpu().numpy(), delimiter=';')
Of a Strivec_DBase, --meta: its side file. Without these options, NAME.txt, NAME_centers_0.txt and so on, and NAME_meta.pkl beside \
NAME.th are read, as `strivec export --as authors` writes them. The program chooses neighbors for cells of a grid, a scene for each \
sample: pictures differ where such a cell crosses a face of a tensor.";

/// The arguments.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Args {
    /// The checkpoint
    file: PathBuf,
    /// Scene file to write
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Strivec's authors: the configuration [default: NAME.txt beside the checkpoint]
    #[arg(long, value_name = "FILE")]
    config: Option<PathBuf>,
    /// Strivec's authors: the prior's points, or the centers of a scale, once for each [default: NAME_centers_0.txt, …]
    #[arg(long, value_name = "FILE")]
    points: Vec<PathBuf>,
    /// Strivec's authors: the side file of a Strivec_DBase [default: NAME_meta.pkl]
    #[arg(long, value_name = "FILE")]
    meta: Option<PathBuf>,
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
    /// `tensorf-vm`, `tensorf-cp`, `strivec-vm` or `strivec-cp`.
    kind: String,
    scales: usize,
    tensors: usize,
    /// Cells of the tensors of the first scale, whose ranks follow.
    resolution: [u32; 3],
    density_rank: u32,
    appearance_rank: u32,
    parameters: u64,
    bytes: u64,
}

/// Reads the checkpoint and writes the scene.
pub(super) fn run(args: &Args, session: &Context) -> Result<(), Error> {
    check_scene_name(&args.output)?;
    let _reserved = check_output(&args.output, session.force)?;
    let options = SceneOptions { background: args.background, up: args.up, dataset: args.dataset.clone() };
    let scene = read(args, &options)?;
    let bytes = container::encode_scene_file(&scene, &Metadata::default(), &EncodeOptions::lossless(&scene))
        .map_err(|e| Error::container(&args.output, e))?;
    write_atomically(&args.output, &bytes, session.force)?;
    let scale = &scene.scales[0];
    let report = Report {
        output: &args.output,
        kind: scene.provenance.preset.clone(),
        scales: scene.scales.len(),
        tensors: scene.scales.iter().map(|scale| scale.cloud.len()).sum(),
        resolution: scale.cloud.resolution,
        density_rank: scale.factors.density_rank(),
        appearance_rank: scale.factors.appearance_rank(),
        parameters: scene.parameter_count(),
        bytes: bytes.len() as u64,
    };
    session.console.result(&report, |report| {
        let [x, y, z] = report.resolution;
        format!(
            "{}: {}, {}, {}, {x} x {y} x {z} cells, ranks {}+{}, {} parameters, {} bytes",
            escaped_path(report.output),
            report.kind,
            plural(report.scales, "scale"),
            plural(report.tensors, "tensor"),
            report.density_rank,
            report.appearance_rank,
            grouped(report.parameters),
            grouped(report.bytes)
        )
    })
}

/// Reads the checkpoint, and what is beside it.
fn read(args: &Args, options: &SceneOptions) -> Result<Scene, Error> {
    let input = |path: &Path| Input::open(path).map_err(|fault| fault.of(path));
    let malformed = |path: &Path| {
        let path = path.to_path_buf();
        move |fault: Fault| Error::from(fault.of(&path))
    };
    let failed = || malformed(&args.file);
    let model = authors::model(&mut input(&args.file)?).map_err(failed())?;
    check_options(args, model)?;
    let Some(model) = model else {
        return tensorf::read(&mut input(&args.file)?, options).map_err(failed());
    };
    let stem = args.file.with_extension("");
    let beside = |end: &str| beside(&stem, end);
    let given = |path: &Option<PathBuf>, option: &str, end: &str| {
        let path = path.clone().unwrap_or_else(|| beside(end));
        if path.is_file() { Ok(path) } else { Err(missing(args, option, &path)) }
    };
    let path = given(&args.config, "config", ".txt")?;
    let config = Config::read(&mut input(&path)?).map_err(malformed(&path))?;
    let places = match model {
        Model::Vm => {
            let path = given(&args.meta, "meta", "_meta.pkl")?;
            Places::from_meta(&mut input(&path)?).map_err(malformed(&path))?
        }
        Model::Cp => {
            let centers = (0..).map(|l| beside(&format!("_centers_{l}.txt"))).take_while(|path| path.is_file());
            let files = if args.points.is_empty() { centers.collect() } else { args.points.clone() };
            if files.is_empty() {
                return Err(missing(args, "points", &beside("_centers_0.txt")));
            }
            let points: Result<_, _> = files.iter().map(|path| authors::read_points(path)).collect();
            Places::Points(points?)
        }
    };
    authors::read(&mut input(&args.file)?, &config, &places, options).map_err(failed())
}

/// Fails if an option is for checkpoints of another class.
fn check_options(args: &Args, model: Option<Model>) -> Result<(), Error> {
    let checkpoint = args.file.display();
    for (is_given, takes, option, class) in [
        (args.config.is_some(), model.is_some(), "config", "the Strivec authors' program"),
        (!args.points.is_empty(), model == Some(Model::Cp), "points", "a StrivecCP_hier"),
        (args.meta.is_some(), model == Some(Model::Vm), "meta", "a Strivec_DBase"),
    ] {
        if is_given && !takes {
            return Err(Error::Usage(format!(
                "{checkpoint}: --{option} is for a checkpoint of {class}; this is another"
            )));
        }
    }
    Ok(())
}

/// The error of a file that the checkpoint needs.
fn missing(args: &Args, option: &str, path: &Path) -> Error {
    let checkpoint = args.file.display();
    let found = format!("no file {}", path.display());
    Error::Usage(format!("{checkpoint}: a checkpoint of Strivec's authors needs --{option}; {found}"))
}

fn color(text: &str) -> Result<[f32; 3], String> {
    let color = numbers::numbers::<3>(text)?;
    if color.iter().all(|c| (0.0..=1.0).contains(c)) {
        Ok(color.map(|c| c as f32))
    } else {
        Err("not three numbers from 0 to 1".into())
    }
}
