//! The result of `strivec pose`: what was registered, and which pictures were left out.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use serde::Serialize;

use super::super::Error;
use super::super::table::plural;
use super::folder::{CaptureFolder, FinishedStage, SPARSE};
use super::model::{self, Model};
use strivec_format::digits::grouped;
use strivec_format::escape::{escaped, escaped_path};

/// Left-out pictures that the text lists.
const LISTED: usize = 20;
/// Reasons for which COLMAP computes no pose of a picture.
const CAUSES: &str = "usual causes of a picture without a pose: it is blurred, dark or without texture, it overlaps too little with the \
others, or it shows repeated structures or moving objects; logs/ has COLMAP's messages";

/// The result, as `--json` prints it.
#[derive(Debug, Serialize)]
pub(super) struct Report {
    folder: PathBuf,
    program: String,
    pictures: usize,
    /// Pictures in the largest model.
    pub(super) registered: usize,
    /// Points of the largest model.
    points: u64,
    /// Mean over these points, in pixels.
    reprojection_error: Option<f64>,
    /// Registered pictures of each model; the largest is in `sparse/0`.
    models: Vec<usize>,
    pub(super) left_out: Vec<UnplacedPicture>,
    /// Files of the folder that are not used, with the reason.
    skipped: Vec<String>,
    stages: Vec<FinishedStage>,
    /// Sum of the stages.
    seconds: f64,
}

/// A picture that is not in the largest model.
#[derive(Debug, Serialize)]
pub(super) struct UnplacedPicture {
    pub(super) name: String,
    pub(super) reason: String,
}

impl Report {
    /// The result in `capture` of the pictures `names`.
    ///
    /// # Errors
    ///
    /// If COLMAP's files cannot be read.
    pub(super) fn read(
        capture: &CaptureFolder,
        program: String,
        names: &[String],
        skipped: Vec<String>,
    ) -> Result<Self, Error> {
        let models = model::read_all(capture.folder())?;
        let Some(largest) = models.first() else {
            let sparse = capture.path(SPARSE);
            return Err(Error::Malformed(format!("{}: no model; --force begins anew", sparse.display())));
        };
        let stages = capture.stages().to_vec();
        Ok(Self {
            folder: capture.folder().to_path_buf(),
            program,
            pictures: names.len(),
            registered: largest.names.len(),
            points: largest.points,
            reprojection_error: largest.reprojection_error,
            models: models.iter().map(|model| model.names.len()).collect(),
            left_out: left_out(names, &models),
            skipped,
            seconds: stages.iter().map(|stage| stage.seconds).sum(),
            stages,
        })
    }

    /// The result as text.
    pub(super) fn text(&self) -> String {
        let mut text = String::new();
        for UnplacedPicture { name, reason } in self.left_out.iter().take(LISTED) {
            text += &format!("left out: {}: {reason}\n", escaped(name));
        }
        if self.left_out.len() > LISTED {
            text += &format!("left out: {} more; --json lists them\n", self.left_out.len() - LISTED);
        }
        if !self.left_out.is_empty() {
            text += &format!("{CAUSES}\n");
        }
        if let [_, others @ ..] = &self.models[..]
            && !others.is_empty()
        {
            let others: Vec<String> = others.iter().map(usize::to_string).collect();
            let count = plural(self.models.len(), "separate model");
            text += &format!(
                "{count}: {SPARSE}/0 is the largest; the others, from {SPARSE}/1 on, have {} pictures\n",
                others.join(", ")
            );
        }
        let seconds: Vec<String> =
            self.stages.iter().map(|stage| format!("{:.0} s {}", stage.seconds, task(stage))).collect();
        text += &format!("{:.0} s: {}\n", self.seconds, seconds.join(", "));
        text + &format!("{}: {}", escaped_path(&self.folder), self.summary())
    }

    /// Registered pictures, points and error in one line.
    fn summary(&self) -> String {
        let error = self.reprojection_error.map_or_else(|| "unknown".into(), |error| format!("{error:.2} pixels"));
        format!(
            "{} of {} registered, {}, mean reprojection error {error}",
            grouped(self.registered as u64),
            plural(self.pictures, "picture"),
            plural(self.points as usize, "point")
        )
    }
}

/// The registered pictures, as the stage of mapping reports them.
pub(super) fn mapping_found(capture: &Path, pictures: usize) -> Result<String, Error> {
    let models = model::read_all(capture)?;
    let Some(largest) = models.first() else { return Ok("no model".into()) };
    let others = if models.len() > 1 { format!(" in the largest of {} models", models.len()) } else { String::new() };
    Ok(format!("{} of {} registered{others}", largest.names.len(), plural(pictures, "picture")))
}

fn left_out(names: &[String], models: &[Model]) -> Vec<UnplacedPicture> {
    let none = BTreeSet::new();
    let registered = models.first().map_or(&none, |model| &model.names);
    let row = |name: &String| {
        let reason = match models.iter().position(|model| model.names.contains(name)) {
            Some(model) => format!("in the separate model {SPARSE}/{model}: few matches to the largest"),
            None => "no pose".to_owned(),
        };
        UnplacedPicture { name: name.clone(), reason }
    };
    names.iter().filter(|name| !registered.contains(*name)).map(row).collect()
}

fn task(stage: &FinishedStage) -> String {
    super::options::name_of(stage.stage)
}
