//! `strivec-pack convert`.

use std::path::{Path, PathBuf};

use serde::Serialize;

use super::encoding::{LayoutArgs, Plain};
use super::input::{self, Inputs, Outputs};
use super::rewriting::{Edit, rewritten};
use crate::approximations::stored_settings;
use crate::{Context, Error};
use strivec_field::render::{ParetoFront, QualitySelector, RenderSettings};
use strivec_format::container::{SceneFile, VERSION};
use strivec_format::digits::grouped;
use strivec_format::escape::escaped_path;

/// Arguments of `strivec-pack convert`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  strivec-pack convert lego.strivec -o lego16.strivec --encoding f16\n  strivec-pack convert lego.strivec -o streamed.strivec --chunk-tensors 128\n\nSections whose contents do not change are copied byte for byte."
)]
pub(super) struct Args {
    #[command(flatten)]
    inputs: Inputs,
    /// File to write, folder for several inputs or a pattern, or - for standard output
    #[arg(long, short)]
    output: PathBuf,
    /// Encoding of the factors; matrices, decoder, and factors that have it stay as they are
    #[arg(long, value_enum, default_value_t = Plain::Keep)]
    encoding: Plain,
    #[command(flatten)]
    layout: LayoutArgs,
    /// Apply the stored render settings of this name to the scene: fast, balanced or best
    #[arg(long, value_name = "NAME")]
    quality: Option<String>,
    /// Format version to write
    #[arg(long, value_name = "MAJOR.MINOR", default_value_t = VERSION.to_string())]
    target_version: String,
    /// Dry run: print what would be written
    #[arg(long)]
    dry_run: bool,
}

/// A file that was written.
#[derive(Debug, Serialize, schemars::JsonSchema)]
#[schemars(rename = "WrittenFile")]
pub(super) struct Written {
    pub(super) input: PathBuf,
    pub(super) output: PathBuf,
    pub(super) bytes_before: u64,
    pub(super) bytes: u64,
}

impl Written {
    pub(super) fn text(rows: &[Self]) -> String {
        let line = |w: &Self| {
            let (before, after) = (grouped(w.bytes_before), grouped(w.bytes));
            format!("{} -> {}: {before} -> {after} bytes\n", escaped_path(&w.input), escaped_path(&w.output))
        };
        rows.iter().map(line).collect()
    }
}

/// Writes files in another encoding.
pub(super) fn run(args: &Args, session: &Context) -> Result<(), Error> {
    if args.target_version != VERSION.to_string() {
        let message = format!("--target-version {}: only {VERSION} can be written", args.target_version);
        return Err(Error::Unsupported(message));
    }
    args.layout.check()?;
    let edit = Edit { encoding: args.encoding, layout: &args.layout, session };
    rewrite(&args.inputs, &args.output, args.dry_run, session, |before, bytes, path| {
        let mut after = before.clone();
        if let Some(name) = &args.quality {
            after = bake(after, path, name, session)?;
        }
        rewritten(&before, bytes, after, &edit, path)
    })
}

/// Applies the stored render settings `name` to the scene.
fn bake(mut document: SceneFile, path: &Path, name: &str, session: &Context) -> Result<SceneFile, Error> {
    let size =
        ParetoFront::from_notes(&document.metadata.notes).and_then(Result::ok).map_or([1; 2], |trade| trade.size);
    let RenderSettings { approximation, divisor } =
        stored_settings(&QualitySelector::Name(name.to_owned()), &document, path, size)?;
    approximation.check(&document.scene)?;
    let raises_thresholds = approximation.raises_thresholds(&document.scene);
    document.scene = approximation.applied(document.scene);
    if divisor != 1 || raises_thresholds {
        let message = "a file cannot store smaller pictures or raised thresholds of weight and transmittance; pass them \
                       when rendering";
        session.console.say(&format!("{}: {message}", path.display()));
    }
    Ok(document)
}

/// Warns if a file became larger.
pub(super) fn warn_of_growth(path: &Path, before: usize, after: usize, session: &Context) {
    if after > before {
        let (before, after) = (grouped(before as u64), grouped(after as u64));
        let advice = "`strivec-pack pack` compresses it, --encoding sets another encoding";
        session.console.say(&format!("warning: {} grows from {before} to {after} bytes; {advice}", path.display()));
    }
}

/// Writes what `change` makes of each input, of its content and of its bytes.
pub(super) fn rewrite(
    inputs: &Inputs,
    output: &Path,
    dry_run: bool,
    session: &Context,
    change: impl Fn(SceneFile, &[u8], &Path) -> Result<Vec<u8>, Error>,
) -> Result<(), Error> {
    let paths = inputs.paths()?;
    let outputs = Outputs::new(&paths, inputs.are_several(), output, dry_run, session)?;
    let mut rows = Vec::new();
    for path in &paths {
        let (document, before) = input::read(path, inputs.limits, &session.console)?;
        let bytes = change(document, &before, path)?;
        let written = outputs.write(path, &bytes)?;
        warn_of_growth(path, before.len(), bytes.len(), session);
        let (bytes_before, bytes) = (before.len() as u64, bytes.len() as u64);
        rows.push(Written { input: path.clone(), output: written, bytes_before, bytes });
    }
    if outputs.takes_standard_output() { Ok(()) } else { session.console.result(&rows, |rows| Written::text(rows)) }
}
