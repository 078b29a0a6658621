//! The result of `strivec pose`: what was registered, and which pictures were left out for which likely cause.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use serde::Serialize;

use super::super::Error;
use super::super::table::plural;
use super::database::{self, Features};
use super::folder::{Capture, DATABASE, Finished, SPARSE};
use super::model::{self, Model};
use crate::digits::grouped;
use crate::escape::{escaped, escaped_path};

/// Features below which a picture has few in any scene.
const FEW_FEATURES: u64 = 200;
/// Partners below which a picture has few; two pictures must share points with a third.
const FEW_PARTNERS: usize = 3;
/// Verified matches that COLMAP needs to use a pair.
pub(super) const MIN_MATCHES: u64 = 15;
/// Left-out pictures that the text lists.
const LISTED: usize = 20;

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
    pub(super) left_out: Vec<LeftOut>,
    /// Files of the folder that are not used, with the reason.
    skipped: Vec<String>,
    stages: Vec<Finished>,
    /// Sum of the stages.
    seconds: f64,
}

/// A picture that is not in the largest model.
#[derive(Debug, Serialize)]
pub(super) struct LeftOut {
    pub(super) name: String,
    features: u64,
    /// Pictures that it matches.
    partners: usize,
    /// Verified matches with the best of them.
    matches: u64,
    pub(super) cause: String,
}

impl Report {
    /// The result in `capture` of the pictures `names`.
    ///
    /// # Errors
    ///
    /// If COLMAP's files cannot be read.
    pub(super) fn read(
        capture: &Capture,
        program: String,
        names: &[String],
        skipped: Vec<String>,
    ) -> Result<Self, Error> {
        let models = model::read_all(capture.folder())?;
        let Some(largest) = models.first() else {
            let sparse = capture.path(SPARSE);
            return Err(Error::Malformed(format!("{}: no model; --force begins anew", sparse.display())));
        };
        let features = database::read(&capture.path(DATABASE))?;
        let stages = capture.stages().to_vec();
        Ok(Self {
            folder: capture.folder().to_path_buf(),
            program,
            pictures: names.len(),
            registered: largest.names.len(),
            points: largest.points,
            reprojection_error: largest.reprojection_error,
            models: models.iter().map(|model| model.names.len()).collect(),
            left_out: left_out(names, &models, &features),
            skipped,
            seconds: stages.iter().map(|stage| stage.seconds).sum(),
            stages,
        })
    }

    /// The result as text.
    pub(super) fn text(&self) -> String {
        let mut text = String::new();
        for LeftOut { name, cause, .. } in self.left_out.iter().take(LISTED) {
            text += &format!("left out: {}: {cause}\n", escaped(name));
        }
        if self.left_out.len() > LISTED {
            text += &format!("left out: {} more; --json lists them\n", self.left_out.len() - LISTED);
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

/// Features per picture, as the stage of features reports them.
pub(super) fn features_found(database: &Path, pictures: usize) -> Result<String, Error> {
    let mut counts: Vec<u64> = database::read(database)?.values().map(|features| features.count).collect();
    counts.retain(|count| *count > 0);
    counts.sort_unstable();
    let [least, .., most] = counts[..] else {
        return Ok(format!("features in {} of {}", counts.len(), plural(pictures, "picture")));
    };
    let median = counts[counts.len() / 2];
    let (median, least, most) = (grouped(median), grouped(least), grouped(most));
    let pictures = plural(pictures, "picture");
    Ok(format!("{median} features per picture (median; {least} to {most}) in {} of {pictures}", counts.len()))
}

/// Matched pairs, as the stage of matching reports them.
pub(super) fn matching_found(database: &Path) -> Result<String, Error> {
    let features = database::read(database)?;
    let sides: usize = features.values().map(partners).sum();
    let pairs = features.len() * features.len().saturating_sub(1) / 2;
    Ok(format!("{} of {} match", grouped(sides as u64 / 2), plural(pairs, "pair")))
}

/// The pictures that `features` matches well enough.
fn partners(features: &Features) -> usize {
    features.matches.values().filter(|count| **count >= MIN_MATCHES).count()
}

fn left_out(names: &[String], models: &[Model], features: &BTreeMap<String, Features>) -> Vec<LeftOut> {
    let none = BTreeSet::new();
    let registered = models.first().map_or(&none, |model| &model.names);
    let mut counts: Vec<u64> = features.values().map(|features| features.count).collect();
    counts.sort_unstable();
    let median = counts.get(counts.len() / 2).copied().unwrap_or_default();
    let row = |name: &String| {
        let own = features.get(name).cloned().unwrap_or_default();
        let model = models.iter().position(|model| model.names.contains(name));
        let cause = match (features.contains_key(name), model) {
            (false, _) => "COLMAP has not read it; see logs/features.log".into(),
            (true, Some(model)) => format!("in the separate model {SPARSE}/{model}: few matches to the largest"),
            (true, None) => cause(&own, median),
        };
        let (partners, matches) = (partners(&own), own.matches.values().copied().max().unwrap_or_default());
        LeftOut { name: name.clone(), features: own.count, partners, matches, cause }
    };
    names.iter().filter(|name| !registered.contains(*name)).map(row).collect()
}

/// Why a picture with features may not be registered; `median` is that of the features of all pictures.
fn cause(own: &Features, median: u64) -> String {
    let (count, partners) = (own.count, partners(own));
    if count < FEW_FEATURES || count < median / 4 {
        let (count, median) = (grouped(count), grouped(median));
        format!("few features ({count}; median {median}): blurred, dark or without texture")
    } else if partners < FEW_PARTNERS {
        format!("matches {} only: too little overlap with the others", plural(partners, "picture"))
    } else {
        format!(
            "matches {}, but no pose fits: repeated structures, moving objects or too little parallax",
            plural(partners, "picture")
        )
    }
}

fn task(stage: &Finished) -> String {
    super::options::name_of(stage.stage)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn with(count: u64, matches: &[(&str, u64)]) -> Features {
        Features { count, matches: matches.iter().map(|(name, n)| ((*name).to_owned(), *n)).collect() }
    }

    #[test]
    fn causes_follow_from_features_and_matches() {
        let many = [("a", 90), ("b", 40), ("c", 15)];
        assert!(cause(&with(150, &many), 300).starts_with("few features (150; median 300)"));
        assert!(cause(&with(1000, &many), 8000).starts_with("few features (1 000; median 8 000)"));
        assert!(cause(&with(8000, &[("a", 90), ("b", 14)]), 8000).starts_with("matches 1 picture only"));
        assert!(cause(&with(8000, &many), 8000).starts_with("matches 3 pictures, but no pose fits"));
    }
}
