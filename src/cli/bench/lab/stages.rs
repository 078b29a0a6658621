//! Time by stage.

use serde::Serialize;

use strivec_field::{Stage, Work};

/// One stage of a step or a frame.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StageRow {
    /// Name of the stage.
    pub stage: &'static str,
    /// Core milliseconds: summed over threads.
    pub core_ms: f64,
    /// Share of the core time of all stages.
    pub share: f64,
}

/// The whole step or frame.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Total {
    /// Mean wall time.
    pub wall_ms: f64,
    /// Number of threads.
    pub threads: usize,
    /// Core milliseconds of all stages.
    pub core_ms: f64,
    /// Share of wall time × threads outside of all stages: idle threads and unrecorded work.
    pub idle_share: f64,
    /// Rays marched.
    pub rays: f64,
    /// Samples whose density was computed.
    pub evaluated: f64,
    /// Samples that were shaded.
    pub shaded: f64,
}

/// All stages that ran, in their order, and the total.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StageTable {
    /// The stages; empty if none was recorded.
    pub rows: Vec<StageRow>,
    /// The total of a step or frame.
    pub total: Total,
}

impl StageTable {
    /// The table of `work`, the sum over `runs` steps or frames, each of `wall_seconds` on average, on `threads`. Stages
    /// that took no time are left out.
    pub fn new(work: &Work, runs: usize, threads: usize, wall_seconds: f64) -> Self {
        let per_run = 1.0 / runs.max(1) as f64;
        let all_seconds: f64 = work.seconds.iter().sum();
        let ran = Stage::ALL.into_iter().filter(|&stage| work.seconds_of(stage) > 0.0);
        let row = |stage: Stage| {
            let seconds = work.seconds_of(stage);
            StageRow { stage: stage.name(), core_ms: 1e3 * seconds * per_run, share: seconds / all_seconds }
        };
        let (wall_ms, core_ms) = (1e3 * wall_seconds, 1e3 * all_seconds * per_run);
        let [rays, evaluated, shaded] = [work.rays, work.evaluated, work.shaded].map(|count| count as f64 * per_run);
        let idle_share = 1.0 - core_ms / (wall_ms * threads as f64);
        Self {
            rows: ran.map(row).collect(),
            total: Total { wall_ms, threads, core_ms, idle_share, rays, evaluated, shaded },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn work(stages: &[(Stage, f64)]) -> Work {
        let mut work = Work { rays: 200, evaluated: 3000, shaded: 500, ..Work::default() };
        stages.iter().for_each(|&(stage, seconds)| work.seconds[stage as usize] = seconds);
        work
    }

    #[test]
    fn times_and_counts_are_those_of_one_run() {
        let stages = [(Stage::Decoder, 4.0), (Stage::DensityGather, 0.5)];
        let table = StageTable::new(&work(&stages), 2, 2, 1.25);
        let [gather, decoder] = &table.rows[..] else { panic!("two stages ran: {table:?}") };
        assert_eq!((gather.stage, decoder.stage), ("density gather", "decoder"));
        assert!((decoder.core_ms - 2000.0).abs() < 1e-9 && (gather.core_ms - 250.0).abs() < 1e-9, "{table:?}");
        assert!((decoder.share - 4.0 / 4.5).abs() < 1e-12, "{decoder:?}");
        let total = &table.total;
        // 2.25 core seconds of 2.5.
        assert!((total.idle_share - 0.1).abs() < 1e-9, "{total:?}");
        assert_eq!([total.rays, total.evaluated, total.shaded], [100.0, 1500.0, 250.0]);
    }

    #[test]
    fn stages_that_did_not_run_are_no_rows() {
        let table = StageTable::new(&work(&[]), 1, 2, 1.0);
        assert_eq!((table.rows.len(), table.total.core_ms, table.total.idle_share), (0, 0.0, 1.0));
    }
}
