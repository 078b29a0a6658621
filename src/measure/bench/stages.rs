//! Time by stage, relative to the peak of the machine.

use serde::Serialize;

use super::{FieldShape, Peak};
use crate::field::{Stage, Work};

/// A stage that reaches this share of a limit is bound by it.
const BOUND_SHARE: f64 = 0.25;

/// The limit of a stage's speed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Bound {
    /// Arithmetic: the stage reaches a good share of the peak.
    Arithmetic,
    /// Loads and stores: the stage reaches a good share of the memory bandwidth, or exceeds it because of caches.
    Memory,
    /// Neither: latency of loads, mispredicted branches, moving data.
    Latency,
}

impl Bound {
    /// The name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Arithmetic => "arithmetic",
            Self::Memory => "loads, stores",
            Self::Latency => "latency",
        }
    }

    fn of(flop_share: f64, bandwidth_share: f64) -> Self {
        match flop_share.max(bandwidth_share) {
            largest if largest < BOUND_SHARE => Self::Latency,
            largest if largest == flop_share => Self::Arithmetic,
            _ => Self::Memory,
        }
    }
}

/// One stage of a step or a frame.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StageRow {
    /// Name of the stage.
    pub stage: &'static str,
    /// Core milliseconds: summed over threads.
    pub core_ms: f64,
    /// Share of the core time of all stages.
    pub share: f64,
    /// 10⁹ floating-point operations.
    pub gflop: f64,
    /// 10⁹ bytes touched.
    pub gb: f64,
    /// 10⁹ FLOP/s of a thread during the stage.
    pub gflops_per_core: f64,
    /// Share of the FLOP/s that a thread can reach while all run.
    pub flop_share: f64,
    /// Share of the bandwidth of a thread while all copy; above 1 if the data is in caches.
    pub bandwidth_share: f64,
    /// The limit of its speed.
    pub bound: Bound,
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
    /// 10⁹ floating-point operations.
    pub gflop: f64,
    /// Time of these operations on all threads at the peak.
    pub flop_limit_ms: f64,
    /// Time of the operations at the peak, as a share of the wall time.
    pub flop_share: f64,
    /// Share of wall time × threads that the stages need if each reaches the nearer of its limits, arithmetic or memory
    /// bandwidth. A stage above the memory bandwidth counts as being at it.
    pub limit_share: f64,
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
    /// The table of `work`, the sum over `runs` steps or frames of a field of `shape`, each of `wall_seconds` on
    /// average, on the threads of `peak`. Stages that took no time are left out.
    pub fn new(work: &Work, runs: usize, shape: &FieldShape, peak: &Peak, wall_seconds: f64) -> Self {
        let per_run = 1.0 / runs.max(1) as f64;
        let all_seconds: f64 = work.seconds.iter().sum();
        let (flops, bandwidth) = (peak.flops_per_thread(), peak.bytes_per_thread());
        let ran = Stage::ALL.into_iter().filter(|&stage| work.seconds_of(stage) > 0.0);
        let rows: Vec<StageRow> = ran
            .map(|stage| {
                let (seconds, cost) = (work.seconds_of(stage), shape.cost(stage, work, runs));
                let (flop_share, bandwidth_share) = (cost.flop / seconds / flops, cost.bytes / seconds / bandwidth);
                StageRow {
                    stage: stage.name(),
                    core_ms: 1e3 * seconds * per_run,
                    share: seconds / all_seconds,
                    gflop: 1e-9 * cost.flop * per_run,
                    gb: 1e-9 * cost.bytes * per_run,
                    gflops_per_core: 1e-9 * cost.flop / seconds,
                    flop_share,
                    bandwidth_share,
                    bound: Bound::of(flop_share, bandwidth_share),
                }
            })
            .collect();
        let gflop = rows.iter().map(|row| row.gflop).sum();
        let flop_limit_ms = 1e12 * gflop / (flops * peak.threads as f64);
        let (wall_ms, core_ms) = (1e3 * wall_seconds, 1e3 * all_seconds * per_run);
        let of_limits = rows.iter().map(|row| row.core_ms * row.flop_share.max(row.bandwidth_share).min(1.0));
        let limit_share = of_limits.sum::<f64>() / (wall_ms * peak.threads as f64);
        let total = Total {
            wall_ms,
            threads: peak.threads,
            core_ms,
            idle_share: 1.0 - core_ms / (wall_ms * peak.threads as f64),
            gflop,
            flop_limit_ms,
            flop_share: flop_limit_ms / wall_ms,
            limit_share,
        };
        Self { rows, total }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Rate, ScaleShape};
    use super::*;
    use crate::model::DecoderMode;

    /// Two threads of 100 GFLOP/s and 10 GB/s each.
    fn peak() -> Peak {
        let rate = |all: f64| Rate { one: all, all };
        Peak { threads: 2, registers: rate(200e9), products: Vec::new(), copy: rate(20e9) }
    }

    fn shape() -> FieldShape {
        FieldShape {
            scales: vec![ScaleShape { tensors: 1, density_factors: 1, appearance_factors: 1, appearance_rank: 1 }],
            features: 1,
            frequencies: [1, 1],
            layers: vec![[1000, 1000]],
            mode: DecoderMode::PerSample,
            first_layer_columns: 1000,
        }
    }

    fn work(stages: &[(Stage, f64)]) -> Work {
        let mut work = Work {
            decoded: 100_000,
            contributions: vec![1_000_000],
            density_components: 1_000_000,
            shaded_contributions: vec![1_000_000],
            appearance_components: 1_000_000,
            ..Work::default()
        };
        stages.iter().for_each(|&(stage, seconds)| work.seconds[stage as usize] = seconds);
        work
    }

    #[test]
    fn shares_are_of_a_thread_s_peak_and_bounds_follow_from_them() {
        // The decoder is 200.1 GFLOP and 0.8 GB; ordering 24 MB; the gather 13 MFLOP and 52 MB.
        let stages = [(Stage::DensityGather, 0.5), (Stage::Decoder, 4.0), (Stage::ContributionOrder, 0.0048)];
        let table = StageTable::new(&work(&stages), 2, &shape(), &peak(), 1.25);
        let [gather, decoder, order] = &table.rows[..] else { panic!("three stages ran: {table:?}") };
        assert_eq!((gather.stage, decoder.stage, order.stage), ("density gather", "decoder", "contribution order"));
        assert!((decoder.core_ms - 2000.0).abs() < 1e-9 && (decoder.gflop - 100.05).abs() < 0.01, "{decoder:?}");
        assert!((decoder.gflops_per_core - 50.026).abs() < 0.01 && (decoder.flop_share - 0.50026).abs() < 1e-4);
        assert!((order.bandwidth_share - 0.5).abs() < 1e-9, "{order:?}");
        assert_eq!([gather, decoder, order].map(|r| r.bound), [Bound::Latency, Bound::Arithmetic, Bound::Memory]);
        assert!((table.rows.iter().map(|r| r.share).sum::<f64>() - 1.0).abs() < 1e-12);

        let total = &table.total;
        assert!((total.flop_limit_ms - 500.26).abs() < 0.1, "100.05 GFLOP at 200: {total:?}");
        assert!((total.flop_share - 0.4002).abs() < 1e-4, "{total:?}");
        // 2.2524 core seconds of 2.5.
        assert!((total.idle_share - (1.0 - 2.2524 / 2.5)).abs() < 1e-9, "{total:?}");
        // The decoder's arithmetic 1.0005 core seconds, the order's loads and stores half of 2.4 core milliseconds, the
        // gather's 2.6.
        let limits = 1.0005 + 0.0012 + 0.0026;
        assert!((total.limit_share - limits / 2.5).abs() < 1e-4, "{total:?}");
    }

    #[test]
    fn a_stage_beyond_the_bandwidth_of_memory_counts_as_at_it() {
        let table = StageTable::new(&work(&[(Stage::ContributionOrder, 0.0012)]), 1, &shape(), &peak(), 0.0012);
        assert!((table.rows[0].bandwidth_share - 2.0).abs() < 1e-9, "{:?}", table.rows[0]);
        assert!((table.total.limit_share - 0.5).abs() < 1e-9, "{:?}", table.total);
    }

    #[test]
    fn stages_that_did_not_run_are_no_rows() {
        let table = StageTable::new(&work(&[]), 1, &shape(), &peak(), 1.0);
        assert_eq!((table.rows.len(), table.total.gflop, table.total.idle_share), (0, 0.0, 1.0));
    }
}
