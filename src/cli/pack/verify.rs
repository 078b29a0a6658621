//! `strivec-pack verify`.

use std::path::{Path, PathBuf};

use serde::Serialize;

use super::input::{self, Inputs};
use crate::cli::{Error, Session};
use crate::container::{Limits, SceneFile};
use crate::escape::{escaped, escaped_path};
use crate::measure::{ProbeReport, check_probes, probe_density_error};
use crate::render::{CpuRenderer, ReferenceRenderer, Renderer};

/// Arguments of `strivec-pack verify`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  strivec-pack verify --render lego.strivec")]
pub(super) struct Args {
    #[command(flatten)]
    inputs: Inputs,
    /// Render the file's probes with every renderer and compare
    #[arg(long)]
    render: bool,
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
    warnings: Vec<String>,
    renderers: Vec<RendererRow>,
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
pub(super) fn run(args: &Args, session: &Session) -> Result<(), Error> {
    let (mut rows, mut errors) = (Vec::new(), Vec::new());
    for path in args.inputs.paths()? {
        let (row, error) = verify(&path, args, args.inputs.limits.limits());
        errors.extend(error);
        rows.push(row);
    }
    session.console.result(&rows, |rows| rows.iter().map(Row::text).collect())?;
    session.console.fail_with(errors)
}

fn verify(path: &Path, args: &Args, limits: Limits) -> (Row, Option<Error>) {
    let mut row = Row { file: path.into(), error: None, warnings: Vec::new(), renderers: Vec::new() };
    let document = match input::read(path, limits) {
        Ok((document, _)) => document,
        Err(error) => {
            row.error = Some(error.to_string());
            return (row, Some(error));
        }
    };
    row.warnings = warnings(&document);
    let mut failed = Vec::new();
    if args.render
        && let Some(probes) = &document.metadata.probes
    {
        let reference = ReferenceRenderer::new(&document.scene);
        let fast = CpuRenderer::<f32>::new(&document.scene);
        let renderers: [(&'static str, &dyn Renderer); 2] = [("reference", &reference), ("cpu", &fast)];
        for (name, renderer) in renderers {
            let ProbeReport { compared, count, largest_color_difference, largest_depth_difference, failed: wrong } =
                check_probes(renderer, probes);
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
        let error = probe_density_error(&document.scene, probes);
        if error > probes.density_tolerance {
            failed
                .push(format!("density features are {error:e} from the probes', beyond {}", probes.density_tolerance));
        }
    }
    if args.strict {
        failed.append(&mut row.warnings);
    }
    let Some(message) = failed.into_iter().next() else { return (row, None) };
    row.error = Some(format!("{}: {message}", path.display()));
    let error = row.error.clone().map(Error::Malformed);
    (row, error)
}

/// Warnings: valid content that a careful writer avoids.
fn warnings(document: &SceneFile) -> Vec<String> {
    let metadata = &document.metadata;
    let mut warnings = Vec::new();
    match &metadata.probes {
        None => warnings.push("no probes: pictures cannot be checked".into()),
        Some(probes) if probes.probes.len() < 64 => {
            warnings.push(format!("{} probes; 64 are usual", probes.probes.len()));
        }
        Some(_) => {}
    }
    if document.scene.scales.len() > 1 && metadata.prefixes.iter().all(Option::is_none) {
        warnings.push("no prefix corrections: pictures of fewer scales are wrong".into());
    }
    if document.scene.occupancy.is_none() {
        warnings.push("no occupancy: rendering will be slow".into());
    }
    warnings.extend(metadata.skipped.iter().map(|message| format!("skipped a section: {message}")));
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
