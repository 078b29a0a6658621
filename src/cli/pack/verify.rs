//! `strivec-pack verify`.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use serde::Serialize;

use super::input::{Inputs, LimitArgs};
use crate::{Context, Error, scene_file};
use strivec_field::Field;
use strivec_format::container;
use strivec_format::container::SceneFile;
use strivec_format::escape::{escaped, escaped_path};
use strivec_measure::{CheckedProbes, ProbeLimits, ProbeReport, check_probes_within};

/// Arguments of `strivec-pack verify`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  strivec-pack verify --render lego.strivec")]
pub(super) struct Args {
    #[command(flatten)]
    inputs: Inputs,
    /// Render the file's probes with every renderer and compare
    #[arg(long)]
    render: bool,
    /// Time limit for a file's probes, in seconds; 0 for none
    #[arg(long, value_name = "SECONDS", default_value_t = 8.0, requires = "render")]
    time: f64,
    /// Treat warnings as errors
    #[arg(long)]
    strict: bool,
}

/// The result for a file.
#[derive(Debug, Serialize, schemars::JsonSchema)]
#[schemars(rename = "VerifiedFile")]
pub(super) struct Row {
    file: PathBuf,
    /// The first error, if any.
    error: Option<String>,
    /// The class of the error that refused the file, as section 7 of the specification names it.
    class: Option<&'static str>,
    /// The sections that were skipped because the reader could not use them.
    skipped: Vec<SkippedRow>,
    warnings: Vec<String>,
    renderers: Vec<RendererRow>,
}

/// An ancillary section that the reader could not use.
#[derive(Debug, Serialize, schemars::JsonSchema)]
#[schemars(rename = "SkippedSection")]
struct SkippedRow {
    section: String,
    /// The class of its error, as section 7 of the specification names it.
    class: Option<&'static str>,
    error: String,
}

/// How a renderer compares with the probes.
#[derive(Debug, Serialize, schemars::JsonSchema)]
#[schemars(rename = "RendererCheck")]
struct RendererRow {
    renderer: &'static str,
    probes: usize,
    compared: usize,
    failed: usize,
    largest_color_difference: f64,
    largest_depth_difference: f64,
}

/// Checks all files, prints the results, then the errors.
pub(super) fn run(args: &Args, session: &Context) -> Result<(), Error> {
    let (mut rows, mut errors) = (Vec::new(), Vec::new());
    for path in args.inputs.paths()? {
        let (row, error) = verify(&path, args, args.inputs.limits);
        errors.extend(error);
        rows.push(row);
    }
    session.console.result(&rows, |rows| rows.iter().map(Row::text).collect())?;
    session.console.fail_with(errors)
}

fn verify(path: &Path, args: &Args, limits: LimitArgs) -> (Row, Option<Error>) {
    let start = Instant::now();
    let mut row = Row {
        file: path.into(),
        error: None,
        class: None,
        skipped: Vec::new(),
        warnings: Vec::new(),
        renderers: Vec::new(),
    };
    let read = scene_file::read_bytes(path).and_then(|bytes| {
        let document = container::decode_scene_file(&bytes, limits.of_file(bytes.len())).map_err(|error| {
            row.class = error.class();
            Error::container(path, error)
        });
        Ok((document?, bytes.len()))
    });
    let (document, length) = match read {
        Ok(read) => read,
        Err(error) => {
            row.error = Some(error.to_string());
            return (row, Some(error));
        }
    };
    row.warnings = warnings(&document);
    let mut failed = Vec::new();
    for skipped in &document.metadata.skipped {
        let (section, error) = (skipped.name.clone(), skipped.error.to_string());
        row.skipped.push(SkippedRow { section, class: skipped.error.class(), error });
        if !skipped.is_valid() {
            failed.push(skipped.to_string());
        }
    }
    if args.render
        && let Some(probes) = &document.metadata.probes
    {
        let limits = ProbeLimits {
            memory: limits.of_file(length).memory.saturating_sub(document.scene.memory_bytes()),
            deadline: Duration::try_from_secs_f64(args.time)
                .ok()
                .filter(|time| !time.is_zero())
                .and_then(|time| start.checked_add(time)),
        };
        let CheckedProbes { traced, reference, cpu, density_error } =
            match check_probes_within(&document.scene, probes, limits) {
                Ok(checked) => checked,
                Err(error) => {
                    let message = format!("{}: probes: {error} with --memory", path.display());
                    row.error = Some(message.clone());
                    return (row, Some(Error::Memory(message)));
                }
            };
        for (name, report) in [("reference", reference), ("cpu", cpu)] {
            let ProbeReport { compared, count, largest_color_difference, largest_depth_difference, failed: wrong } =
                report;
            if wrong > 0 {
                failed.push(format!("{wrong} of {compared} probes are beyond their tolerance in renderer {name}"));
            }
            row.renderers.push(RendererRow {
                renderer: name,
                probes: count,
                compared,
                failed: wrong,
                largest_color_difference,
                largest_depth_difference,
            });
        }
        if density_error > probes.density_tolerance {
            failed.push(format!(
                "density features are {density_error:e} from the probes', beyond {}",
                probes.density_tolerance
            ));
        }
        let count = probes.probes.len();
        if failed.is_empty() && traced < count {
            let message = format!(
                "{}: only {traced} of {count} probes could be checked with a time limit of {} s; allow more with --time SECONDS, or \
                 0 for no limit",
                path.display(),
                args.time
            );
            row.error = Some(message.clone());
            return (row, Some(Error::Runtime(message)));
        }
    }
    if args.strict {
        failed.append(&mut row.warnings);
    }
    if failed.is_empty() {
        return (row, None);
    }
    row.error = Some(format!("{}: {}", path.display(), failed.join("; ")));
    let error = row.error.clone().map(Error::Malformed);
    (row, error)
}

/// Warnings: valid content that a careful writer avoids.
fn warnings(document: &SceneFile) -> Vec<String> {
    let metadata = &document.metadata;
    let mut warnings = Vec::new();
    match &metadata.probes {
        None => warnings.push("no probes: pictures cannot be checked".into()),
        Some(probes) if probes.probes.len() < 16 => {
            warnings.push(format!("{} probes; at least 16 are usual", probes.probes.len()));
        }
        Some(_) => {}
    }
    if document.scene.scales.len() > 1 && metadata.prefixes.iter().all(Option::is_none) {
        warnings.push("no prefix corrections: pictures of fewer scales are wrong".into());
    }
    if document.scene.occupancy.is_none() {
        warnings.push("no occupancy: rendering will be slow".into());
    }
    if let Err(error) = Field::<f32>::check_memory(&document.scene) {
        warnings.push(format!("pictures are refused: {error} with --memory"));
    }
    warnings.extend(metadata.skipped.iter().filter(|skipped| skipped.is_valid()).map(ToString::to_string));
    warnings.extend(metadata.unknown.iter().map(|u| format!("section {} is unknown to this reader", u.section)));
    warnings
}

impl Row {
    fn text(&self) -> String {
        let mut text = match &self.error {
            None => format!("{}: valid\n", escaped_path(&self.file)),
            Some(_) => format!("{}: failed\n", escaped_path(&self.file)),
        };
        for row in &self.renderers {
            let RendererRow { renderer, probes, compared, .. } = row;
            let (color, depth) = (row.largest_color_difference, row.largest_depth_difference);
            text += &format!(
                "  {renderer}: {compared} of {probes} probes compared, color {color:.1e}, depth {depth:.1e}\n"
            );
        }
        for warning in &self.warnings {
            text += &format!("  warning: {}\n", escaped(warning));
        }
        text
    }
}
