//! The log of a sweep: each rendered picture is a line of a file, so that an interrupted sweep resumes; and the mean
//! over the pictures of a candidate.

use std::fs::{self, File, OpenOptions};
use std::io::Write as _;
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::candidate::Candidate;
use crate::Error;
use crate::bench::lab::Spread;
use strivec_format::psnr::psnr_of_mse;

/// PSNR in dB that tables give for identical pictures, whose PSNR is infinite.
pub(super) const SAME: f64 = 99.0;

/// The measurement of one picture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Visit {
    pub(super) candidate: Candidate,
    /// Factor by which the picture is smaller than the view: above 1 in the first rounds of combinations.
    pub(super) shrunk: u32,
    /// Number of the round, which selects the view.
    pub(super) round: usize,
    pub(super) milliseconds: f64,
    /// Time to prepare the renderer.
    pub(super) preparing_ms: f64,
    /// Mean squared error of the picture to the view.
    pub(super) error: f64,
    pub(super) ssim: Option<f64>,
    /// The largest difference of a channel to the exact picture.
    pub(super) largest: f64,
    /// Memory of the renderer's scene.
    pub(super) memory_bytes: u64,
}

/// The measurement of a candidate over all its visits.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct Measured {
    /// Milliseconds of a picture.
    pub(super) milliseconds: Spread,
    /// Share of the base's time: the median over rounds, in each of which both render the same view.
    pub(super) ratio: f64,
    pub(super) preparing_ms: f64,
    /// Mean squared error, the mean over views.
    pub(super) error: f64,
    /// PSNR in dB, the mean over views.
    pub(super) psnr: f64,
    pub(super) ssim: Option<f64>,
    pub(super) largest: f64,
    pub(super) memory_bytes: u64,
}

/// All visits so far.
pub(super) struct Log {
    visits: Vec<Visit>,
    file: File,
}

/// The identity of a sweep. A log resumes only the sweep that it belongs to.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Belongs {
    pub(super) version: u32,
    /// CRC-32 of each scene file.
    pub(super) files: Vec<u32>,
    /// Dataset, split, views, size.
    pub(super) views: String,
}

impl Log {
    /// Opens the log in the file `path`, or creates it. Fails if it belongs to another sweep, unless `force`.
    pub(super) fn open(path: &Path, belongs: &Belongs, force: bool) -> Result<Self, Error> {
        let mut visits = Vec::new();
        let text = match fs::read_to_string(path) {
            Ok(text) if !force => text,
            Err(e) if e.kind() != std::io::ErrorKind::NotFound => return Err(Error::io("read", path)(e)),
            _ => String::new(),
        };
        let mut lines = text.lines();
        if let Some(first) = lines.next() {
            if serde_json::from_str::<Belongs>(first).ok().as_ref() != Some(belongs) {
                let message =
                    "the log belongs to another sweep; choose another folder with --out, or overwrite it with --force";
                return Err(Error::Usage(format!("{}: {message}", path.display())));
            }
            // The last line is incomplete if the process died.
            visits = lines.map_while(|line| serde_json::from_str(line).ok()).collect();
        }
        let head = serde_json::to_string(belongs).expect("plain data");
        let lines = visits.iter().map(|v: &Visit| serde_json::to_string(v).expect("plain data"));
        let whole: String = std::iter::once(head).chain(lines).map(|line| line + "\n").collect();
        fs::write(path, whole).map_err(Error::io("write", path))?;
        let file = OpenOptions::new().append(true).open(path).map_err(Error::io("write", path))?;
        Ok(Self { visits, file })
    }

    pub(super) fn has(&self, candidate: &Candidate, shrunk: u32, round: usize) -> bool {
        self.of(candidate, shrunk).any(|visit| visit.round == round)
    }

    pub(super) fn add(&mut self, visit: Visit) -> Result<(), Error> {
        let line = serde_json::to_string(&visit).expect("plain data") + "\n";
        self.file
            .write_all(line.as_bytes())
            .map_err(|e| Error::Io(format!("cannot write the log of the sweep: {e}")))?;
        self.visits.push(visit);
        Ok(())
    }

    fn of<'a>(&'a self, candidate: &'a Candidate, shrunk: u32) -> impl Iterator<Item = &'a Visit> {
        self.visits.iter().filter(move |visit| visit.shrunk == shrunk && visit.candidate == *candidate)
    }

    /// The measurement of `candidate` relative to `base`; `None` if it has no visits.
    pub(super) fn measured(&self, candidate: &Candidate, base: &Candidate, shrunk: u32) -> Option<Measured> {
        let visits: Vec<&Visit> = self.of(candidate, shrunk).collect();
        let milliseconds = Spread::of(&visits.iter().map(|v| v.milliseconds).collect::<Vec<_>>())?;
        let ratios: Vec<f64> = (visits.iter())
            .filter_map(|visit| {
                let same_round = self.of(base, shrunk).find(|of_base| of_base.round == visit.round)?;
                Some(visit.milliseconds / same_round.milliseconds)
            })
            .collect();
        let count = visits.len() as f64;
        let mean = |of: &dyn Fn(&Visit) -> f64| visits.iter().map(|v| of(v)).sum::<f64>() / count;
        let last = visits.last()?;
        Some(Measured {
            milliseconds,
            ratio: Spread::of(&ratios)?.median,
            preparing_ms: Spread::of(&visits.iter().map(|v| v.preparing_ms).collect::<Vec<_>>())?.median,
            error: mean(&|v| v.error),
            psnr: mean(&|v| psnr_of_mse(v.error).min(SAME)),
            ssim: visits.iter().map(|v| v.ssim).sum::<Option<f64>>().map(|sum| sum / count),
            largest: visits.iter().map(|v| v.largest).fold(0.0, f64::max),
            memory_bytes: last.memory_bytes,
        })
    }
}
