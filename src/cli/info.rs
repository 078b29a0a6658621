//! `strivec info`: the contents of scene files.

use std::path::{Path, PathBuf};

use serde::Serialize;

use super::scale_table::ScaleRow;
use super::table::{Table, plural, short};
use super::{Context, Error, scale_table, scene_file};
use strivec_format::container;
use strivec_format::container::{Contents, Metadata};
use strivec_format::digits::grouped;
use strivec_format::escape::{escaped, escaped_path};
use strivec_format::model::{Coverage, Scene};

const EXAMPLES: &str = "\
Examples:
  strivec info lego.strivec
  strivec info a.strivec b.strivec --json";

/// The arguments.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Args {
    /// Scene files, or - for standard input
    #[arg(required = true, value_name = "FILE")]
    files: Vec<PathBuf>,
}

/// The result, as `--json` prints it.
#[derive(Debug, Serialize, schemars::JsonSchema)]
pub(super) struct Info {
    file: PathBuf,
    bytes: u64,
    parameters: u64,
    /// Parameters stored in the file: components that are all zero are not stored.
    nonzero_parameters: u64,
    scales: Vec<ScaleRow>,
    /// Weights and biases.
    decoder_parameters: u64,
    decoder_mode: &'static str,
    coverage: &'static str,
    /// Smallest and largest corner in model units.
    bounds: [[f64; 3]; 2],
    /// Width of the shell around the inner cube, if the scene is unbounded.
    shell: Option<f64>,
    /// Model units a dataset unit.
    scale: f64,
    /// Near and far end of rays, in model units.
    near_far: [f64; 2],
    /// Length of a step of the march, in model units.
    step: f64,
    background: [f32; 3],
    /// Degree of the sky, which is behind the scene instead of the background.
    sky_degree: Option<u32>,
    /// Vertices per axis, and how many of all are set.
    occupancy: Option<([u32; 3], u64)>,
    dataset: String,
    preset: String,
    steps: u64,
    seed: u64,
    tool: String,
    /// What the file holds, and how many bytes each takes.
    sections: Vec<(String, u64)>,
    /// The sections that were skipped because the reader could not use them, and why.
    warnings: Vec<String>,
}

/// Prints the contents of the files, then the errors.
pub(super) fn run(args: &Args, session: &Context) -> Result<(), Error> {
    let one = |path: &PathBuf| {
        let (scene_file, bytes) = scene_file::read(path, &session.console)?;
        let contents = container::sections(&bytes).map_err(|e| Error::container(path, e))?;
        Ok(Info::new(path.clone(), bytes.len() as u64, &scene_file.scene, &scene_file.metadata, &contents))
    };
    let (infos, errors): (Vec<_>, Vec<_>) = args.files.iter().map(one).partition(Result::is_ok);
    let infos: Vec<Info> = infos.into_iter().flatten().collect();
    let errors = errors.into_iter().filter_map(Result::err).collect();
    match infos.as_slice() {
        [] => {}
        // A single file is an object in JSON, several are an array.
        [info] if args.files.len() == 1 => session.console.result(info, Info::text)?,
        all => session.console.result(&all, |all| all.iter().map(Info::text).collect::<Vec<_>>().join("\n"))?,
    }
    session.console.fail_with(errors)
}

/// The facts of a scene and its metadata, whose file has the name `name` and these `bytes`, in the JSON of `strivec info --json`.
///
/// # Errors
///
/// If the bytes are no scene file.
pub fn info_of(name: &Path, bytes: &[u8], scene: &Scene, metadata: &Metadata) -> Result<String, Error> {
    let contents = container::sections(bytes).map_err(|e| Error::container(name, e))?;
    let info = Info::new(name.to_path_buf(), bytes.len() as u64, scene, metadata, &contents);
    serde_json::to_string(&info).map_err(|e| Error::Runtime(e.to_string()))
}

impl Info {
    pub(super) fn new(file: PathBuf, bytes: u64, scene: &Scene, metadata: &Metadata, contents: &Contents) -> Self {
        let provenance = scene.provenance.clone();
        Self {
            file,
            bytes,
            parameters: scene.parameter_count(),
            nonzero_parameters: scene.nonzero_parameter_count(),
            scales: scale_table::rows(scene),
            decoder_parameters: scene.decoder.parameter_count(),
            decoder_mode: scene.decoder.mode.name(),
            coverage: match scene.rules.coverage {
                Coverage::All => "all scales",
                Coverage::Any => "any scale",
            },
            bounds: [scene.bounds.min.to_array(), scene.bounds.max.to_array()],
            shell: scene.rules.contraction.map(|contraction| contraction.shell),
            scale: scene.frame.model_from_dataset.scale,
            near_far: [scene.frame.near, scene.frame.far],
            step: scene.rules.step,
            background: scene.frame.background,
            sky_degree: scene.rules.sky.as_ref().map(|sky| sky.degree),
            occupancy: scene.occupancy.as_ref().map(|grid| (grid.vertices.to_array(), grid.count())),
            dataset: provenance.dataset,
            preset: provenance.preset,
            steps: provenance.steps,
            seed: provenance.seed,
            tool: provenance.tool,
            sections: contents.sections.iter().map(|s| (s.to_string(), s.length)).collect(),
            warnings: metadata.skipped.iter().map(ToString::to_string).collect(),
        }
    }

    fn made_by(&self) -> String {
        let [tool, preset] = [&self.tool, &self.preset].map(|text| escaped(text));
        format!("{tool}, preset {preset}, {}, seed {}", plural(self.steps as usize, "step"), self.seed)
    }

    pub(super) fn text(&self) -> String {
        let corner = |c: [f64; 3]| format!("({:.3}, {:.3}, {:.3})", c[0], c[1], c[2]);
        let occupancy = match &self.occupancy {
            Some(([x, y, z], set)) => format!("{x}x{y}x{z} vertices, {} set", grouped(*set)),
            None => "none".to_owned(),
        };
        let bounds = format!("{} to {}", corner(self.bounds[0]), corner(self.bounds[1]));
        let bounds = match self.shell {
            None => bounds,
            Some(shell) => {
                format!("{bounds}: the cube of ±1, and all the rest contracted to a shell of {}", short(shell))
            }
        };
        let background = match self.sky_degree {
            None => self.background.map(|c| short(c.into())).join(", "),
            Some(degree) => format!("a sky of degree {degree}"),
        };
        let [near, far] = self.near_far;
        let lines = [
            ("file", format!("{}, {} bytes", escaped_path(&self.file), grouped(self.bytes))),
            ("made by", self.made_by()),
            ("dataset", escaped(&self.dataset)),
            ("bounds", bounds),
            ("scale", format!("{} model units per dataset unit", short(self.scale))),
            (
                "march",
                format!(
                    "{} to {}, step {}, in space covered by {}",
                    short(near),
                    short(far),
                    short(self.step),
                    self.coverage
                ),
            ),
            ("background", background),
            ("occupancy", occupancy),
            ("decoder", format!("{} parameters, {}", grouped(self.decoder_parameters), self.decoder_mode)),
            (
                "parameters",
                format!("{}, {} of them stored", grouped(self.parameters), grouped(self.nonzero_parameters)),
            ),
        ];
        let head: String = lines.iter().map(|(name, value)| format!("{name:<10}  {value}\n")).collect();
        let mut sections = Table::new(["section", "bytes"]);
        for (name, bytes) in &self.sections {
            sections.row([name.clone(), grouped(*bytes)]);
        }
        format!("{head}\n{}\n{}", scale_table::text(&self.scales), sections.text())
    }
}
