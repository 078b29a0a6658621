//! Visits of a sweep: one picture of one candidate each, kept on disk as they are made; and what they come to.

use std::fs::{self, File, OpenOptions};
use std::io::Write as _;
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::candidate::Candidate;
use crate::cli::Error;
use crate::measure::bench::Spread;
use crate::psnr::psnr_of_mse;

/// PSNR in dB of pictures that are the same, which is infinite, in tables.
pub(super) const SAME: f64 = 99.0;

/// One picture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Visit {
    pub(super) candidate: Candidate,
    /// Pictures are this many times smaller than asked for: those of a first look.
    pub(super) shrunk: u32,
    /// Which round, and so which view.
    pub(super) round: usize,
    pub(super) milliseconds: f64,
    /// Until the first picture could begin.
    pub(super) preparing_ms: f64,
    /// Of the picture against the view.
    pub(super) error: f64,
    pub(super) ssim: Option<f64>,
    /// The largest difference of a channel to the exact picture's.
    pub(super) largest: f64,
    /// Of the model, with what was made for it.
    pub(super) memory_bytes: u64,
}

/// What a candidate's visits come to.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct Measured {
    /// Of a picture.
    pub(super) milliseconds: Spread,
    /// Of the base's time: the median over rounds, in each of which both drew the same view shortly after one another.
    pub(super) ratio: f64,
    pub(super) preparing_ms: f64,
    /// The mean over views.
    pub(super) error: f64,
    /// In dB, the mean over views.
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

/// What a log belongs to; another sweep's is not continued.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Belongs {
    pub(super) version: u32,
    /// CRC-32 of each scene file.
    pub(super) files: Vec<u32>,
    /// Dataset, split, views, size.
    pub(super) views: String,
}

impl Log {
    /// The log in the file `path`, begun there if there is none. Fails where it is another sweep's.
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
                let message = "expected the log of this sweep, found another's: name another folder, or give --force";
                return Err(Error::Usage(format!("{}: {message}", path.display())));
            }
            // The last line may have been cut off.
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
            .map_err(|e| Error::Io(format!("the sweep's log: cannot write it: {e}")))?;
        self.visits.push(visit);
        Ok(())
    }

    fn of<'a>(&'a self, candidate: &'a Candidate, shrunk: u32) -> impl Iterator<Item = &'a Visit> {
        self.visits.iter().filter(move |visit| visit.shrunk == shrunk && visit.candidate == *candidate)
    }

    /// What `candidate`'s visits come to, beside those of `base`; `None` where there are none.
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
