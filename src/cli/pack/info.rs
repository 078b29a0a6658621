//! `strivec-pack info`.

use std::collections::BTreeMap;
use std::path::PathBuf;

use serde::Serialize;

use super::input::{self, Inputs, LimitArgs};
use crate::console::Console;
use crate::info::Info;
use crate::table::Table;
use crate::{Context, Error};
use strivec_format::container;
use strivec_format::container::Metadata;
use strivec_format::digits::grouped;
use strivec_format::escape::escaped;

/// Arguments of `strivec-pack info`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  strivec-pack info lego.strivec")]
pub(super) struct Args {
    #[command(flatten)]
    inputs: Inputs,
}

/// The contents of a file and the bytes of its parts.
#[derive(Debug, Serialize, schemars::JsonSchema)]
#[schemars(rename = "FileInfo")]
pub(super) struct Row {
    #[serde(flatten)]
    info: Info,
    version: String,
    /// Bytes of header, table and padding.
    framing_bytes: u64,
    /// \[kind and scale\] bytes in the file, and their share of the file.
    budget: BTreeMap<String, (u64, f64)>,
    license: Option<String>,
    notes: BTreeMap<String, String>,
    probes: usize,
    cameras: usize,
    /// PSNR in dB to the pictures before encoding.
    psnr_to_before: Option<f64>,
    /// PSNR in dB over photographs of a dataset.
    test_psnr: Option<f64>,
    /// PSNR in dB of the pictures of 1, 2, … scales to those of all.
    psnr_of_prefixes: Vec<f64>,
    unknown_sections: Vec<String>,
}

/// Prints the contents of files, then the errors.
pub(super) fn run(args: &Args, session: &Context) -> Result<(), Error> {
    let (mut rows, mut errors) = (Vec::new(), Vec::new());
    for path in args.inputs.paths()? {
        match Row::read(path.clone(), args.inputs.limits, &session.console) {
            Ok(row) => rows.push(row),
            Err(error) => errors.push(error),
        }
    }
    if !rows.is_empty() {
        session.console.result(&rows, |rows| rows.iter().map(Row::text).collect::<Vec<_>>().join("\n"))?;
    }
    session.console.fail_with(errors)
}

impl Row {
    fn read(path: PathBuf, limits: LimitArgs, console: &Console) -> Result<Self, Error> {
        let (document, bytes) = input::read(&path, limits, console)?;
        let contents = container::sections(&bytes).map_err(|e| Error::container(&path, e))?;
        Ok(Self::new(path, bytes.len() as u64, document, &contents))
    }

    fn new(path: PathBuf, bytes: u64, document: container::SceneFile, contents: &container::Contents) -> Self {
        let mut budget: BTreeMap<String, (u64, f64)> = BTreeMap::new();
        for section in &contents.sections {
            let scale = section.scale.map_or_else(String::new, |scale| format!(" of scale {scale}"));
            let entry = budget.entry(format!("{}{scale}", section.kind)).or_default();
            entry.0 += section.length;
            entry.1 += section.length as f64 / bytes as f64;
        }
        let info = Info::new(path, bytes, &document.scene, &document.metadata, contents);
        let Metadata { license, quality, probes, cameras, notes, unknown, .. } = document.metadata;
        let quality = quality.unwrap_or_default();
        Self {
            info,
            version: contents.version.to_string(),
            framing_bytes: bytes - contents.sections.iter().map(|s| s.length).sum::<u64>(),
            budget,
            license,
            notes,
            probes: probes.map_or(0, |p| p.probes.len()),
            cameras: cameras.len(),
            psnr_to_before: quality.encoded,
            test_psnr: quality.test,
            psnr_of_prefixes: quality.prefixes.into_iter().flatten().collect(),
            unknown_sections: unknown.iter().map(|u| u.section.to_string()).collect(),
        }
    }

    fn text(&self) -> String {
        let mut budget = Table::new(["kind", "bytes", "of the file"]);
        for (kind, (bytes, share)) in &self.budget {
            budget.row([kind.clone(), grouped(*bytes), format!("{:.2} %", 100.0 * share)]);
        }
        let mut lines = vec![format!("version     {}", self.version)];
        lines.extend(self.license.iter().map(|l| format!("license     {}", escaped(l))));
        lines.extend(self.psnr_to_before.map(|p| format!("encoded     {p:.1} dB to the pictures before")));
        lines.extend(self.test_psnr.map(|p| format!("test        {p:.2} dB")));
        if !self.psnr_of_prefixes.is_empty() {
            let each: Vec<_> = self.psnr_of_prefixes.iter().map(|p| format!("{p:.1}")).collect();
            lines.push(format!("prefixes    {} dB to the whole", each.join(", ")));
        }
        lines.push(format!("probes      {}", self.probes));
        lines.extend(self.notes.iter().map(|(key, value)| format!("note        {}: {}", escaped(key), escaped(value))));
        lines.extend(self.unknown_sections.iter().map(|name| format!("unknown     {name}")));
        format!("{}\n{}\n\n{}", self.info.text(), lines.join("\n"), budget.text())
    }
}
