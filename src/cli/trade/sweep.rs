//! Measures candidates in turns, so that a temporary slowdown of the machine affects all of them.

use std::time::Instant;

use super::candidate::{Candidate, Engine};
use super::measured::{Log, Measured, Visit};
use super::pareto::below_front;
use super::views::{SweepCamera, SweepCameras};
use crate::backend::{BackendOptions, Prepared};
use crate::console::Console;
use crate::progress::Progress;
use crate::render::colors;
use crate::table::plural;
use crate::{Context, Error};
use strivec_field::render::{Approximation, upsample_bilinear};
use strivec_format::model::Scene;
use strivec_measure::{Error as MeasureError, mse, ssim};

/// A scene that candidates render.
pub(super) struct SweepScene {
    pub(super) name: String,
    pub(super) scene: Scene,
    /// Size of its file.
    pub(super) bytes: u64,
}

impl Engine {
    /// A renderer of `scene`.
    pub(super) fn prepare(
        self,
        scene: Scene,
        approximation: &Approximation,
        console: &Console,
    ) -> Result<Prepared, Error> {
        BackendOptions::new(self.backend, self.half).prepare(scene, approximation, console)
    }
}

/// A sweep in progress.
pub(super) struct Sweep<'a> {
    pub(super) sources: &'a [SweepScene],
    pub(super) views: &'a SweepCameras,
    pub(super) base: Candidate,
    pub(super) log: Log,
    pub(super) session: &'a Context,
}

impl Sweep<'_> {
    /// Renders `rounds` pictures of each of `candidates` and of the base, `shrunk` times smaller. A round is one view
    /// by every candidate; each round begins with another candidate. Pictures in the log are not rendered again.
    pub(super) fn measure(
        &mut self,
        task: &str,
        candidates: &[Candidate],
        shrunk: u32,
        rounds: usize,
    ) -> Result<(), Error> {
        let mut all = vec![self.base.clone()];
        all.extend(candidates.iter().filter(|c| **c != self.base).cloned());
        let session = self.session;
        let progress = Progress::start(&session.console, task, (all.len() * rounds) as u64);
        // Messages about each of many renderers would hide the progress.
        let quiet = Console::new("strivec", true, false);
        let names: Vec<String> = self.sources.iter().map(|source| source.name.clone()).collect();
        let mut done = 0;
        for round in 0..rounds {
            let whole = &self.views.views[round % self.views.views.len()];
            let view = whole.shrunk(shrunk);
            for candidate in &all {
                if !self.log.has(candidate, shrunk, round) {
                    let visit = self.visit(candidate, shrunk, round, &view, &quiet)?;
                    self.log.add(visit)?;
                }
                done += 1;
                progress.set(done, || format!("round {}, {}", round + 1, candidate.name(&self.base, &names)));
            }
            let next = all.len() / rounds;
            all.rotate_left(next);
        }
        progress.finish(&format!("{task}: {}", plural(all.len() * rounds, "picture")));
        Ok(())
    }

    fn visit(
        &self,
        candidate: &Candidate,
        shrunk: u32,
        round: usize,
        view: &SweepCamera,
        quiet: &Console,
    ) -> Result<Visit, Error> {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(candidate.threads).build();
        let pool =
            pool.map_err(|e| Error::Runtime(format!("cannot start {}: {e}", plural(candidate.threads, "thread"))))?;
        pool.install(|| {
            let approximation = &candidate.settings.approximation;
            let scene = self.sources[candidate.source].scene.clone();
            let start = Instant::now();
            let mut renderer = candidate.engine.prepare(scene, approximation, quiet)?;
            let preparing_ms = 1e3 * start.elapsed().as_secs_f64();
            let camera = view.camera.downscaled(candidate.settings.divisor);
            // A small picture first, so that the measured one waits for no first use of memory.
            renderer.render(&camera.downscaled(8.min(camera.width.min(camera.height))))?;
            let start = Instant::now();
            let small = renderer.render(&camera)?;
            let size = [view.camera.width, view.camera.height];
            let picture = colors(&upsample_bilinear(&small, size));
            let milliseconds = 1e3 * start.elapsed().as_secs_f64();
            let differences = picture.iter().zip(&view.exact).flat_map(|(a, b)| (0..3).map(|c| (a[c] - b[c]).abs()));
            Ok(Visit {
                candidate: candidate.clone(),
                shrunk,
                round,
                milliseconds,
                preparing_ms,
                error: mse(&picture, &view.truth)?,
                ssim: match ssim(size, &picture, &view.truth) {
                    Err(MeasureError::SmallerThanWindow { .. }) => None,
                    other => Some(other?),
                },
                largest: f64::from(differences.fold(0.0, f32::max)),
                memory_bytes: renderer.memory_bytes(),
            })
        })
    }

    /// The measurements of those of `candidates` that have any.
    pub(super) fn known(&self, candidates: &[Candidate], shrunk: u32) -> Vec<(Candidate, Measured)> {
        let measured = |c: &Candidate| Some((c.clone(), self.log.measured(c, &self.base, shrunk)?));
        candidates.iter().filter_map(measured).collect()
    }

    /// The `keep` candidates closest to the Pareto front. Successive halving: each round keeps half of the candidates
    /// and doubles the number of pictures and their size.
    pub(super) fn halve(
        &mut self,
        mut candidates: Vec<Candidate>,
        keep: usize,
        rounds: usize,
    ) -> Result<Vec<Candidate>, Error> {
        let mut shrunk = FIRST_LOOK;
        let mut looks = 1;
        while candidates.len() > keep && shrunk > 1 {
            self.measure("combinations", &candidates, shrunk, looks.min(rounds))?;
            let known = self.known(&candidates, shrunk);
            let points: Vec<[f64; 2]> = known.iter().map(|(_, m)| [m.ratio, m.psnr]).collect();
            let below = below_front(&points);
            let mut order: Vec<usize> = (0..known.len()).collect();
            order.sort_by(|&a, &b| below[a].total_cmp(&below[b]));
            order.truncate((known.len() / 2).max(keep));
            order.sort_unstable();
            candidates = order.into_iter().map(|n| known[n].0.clone()).collect();
            (shrunk, looks) = (shrunk / 2, looks * 2);
        }
        candidates.truncate(keep);
        Ok(candidates)
    }
}

/// Factor by which the first pictures of combinations are smaller.
const FIRST_LOOK: u32 = 4;
