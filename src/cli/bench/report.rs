//! Measurements as text.

use crate::cli::table::{Table, plural};
use crate::measure::bench::{Measured, Peak, Rate, Spread};

/// The machine's limits.
pub(super) fn peak(peak: &Peak) -> String {
    let mut table = Table::new(["peak", "one thread", &plural(peak.threads, "thread"), "unit"]);
    let mut row = |name: String, rate: Rate, unit: &str| {
        table.row([name, format!("{:.1}", 1e-9 * rate.one), format!("{:.1}", 1e-9 * rate.all), unit.to_owned()]);
    };
    row("multiply-adds in registers".into(), peak.registers, "GFLOP/s");
    for product in &peak.products {
        let [rows, inner, columns] = product.shape;
        row(format!("product {rows}x{inner} by {inner}x{columns}"), product.flops, "GFLOP/s");
    }
    row("copy, read and write".into(), peak.copy, "GB/s");
    table.text()
}

/// The stages of a step or frame. Rates and shares are those of one thread during the stage.
pub(super) fn stages(measured: &Measured) -> String {
    let total = &measured.stages.total;
    if measured.stages.rows.is_empty() {
        return "no stages were recorded\n".into();
    }
    let columns = ["stage", "core ms", "share", "GFLOP", "GB", "GFLOP/s", "of peak", "of copy", "bound by"];
    let mut table = Table::new(columns);
    for row in &measured.stages.rows {
        table.row([
            row.stage.to_owned(),
            format!("{:.1}", row.core_ms),
            percent(row.share),
            format!("{:.3}", row.gflop),
            format!("{:.3}", row.gb),
            format!("{:.1}", row.gflops_per_core),
            percent(row.flop_share),
            percent(row.bandwidth_share),
            row.bound.name().to_owned(),
        ]);
    }
    let is_cached = measured.stages.rows.iter().any(|row| row.flop_share.max(row.bandwidth_share) > 1.0);
    let note = if is_cached {
        "Shares above 100 %: the stage reads from caches, which are faster than the copy.\n"
    } else {
        ""
    };
    format!(
        "{}total: {:.1} ms on {}, {} of it idle or not recorded; {:.2} GFLOP take {:.1} ms at the peak: {}; stages at the nearer of \
         their limits: {}\n{note}",
        table.text(),
        total.wall_ms,
        plural(total.threads, "thread"),
        percent(total.idle_share),
        total.gflop,
        total.flop_limit_ms,
        percent(total.flop_share),
        percent(total.limit_share),
    )
}

/// The speedup of one measurement on several numbers of threads.
pub(super) fn scaling(measured: &[&Measured]) -> String {
    let Some(first) = measured.first().filter(|_| measured.len() > 1) else { return String::new() };
    let mut table = Table::new(["threads", "ms", "speedup", "efficiency"]);
    for m in measured {
        let speed = first.seconds.median / m.seconds.median;
        let promised = m.threads as f64 / first.threads as f64;
        table.row([m.threads.to_string(), ms(m.seconds.median), format!("{speed:.2}"), percent(speed / promised)]);
    }
    table.text()
}

/// Median and quartiles of seconds.
pub(super) fn seconds(spread: &Spread) -> String {
    format!("{} ms (quartiles {}, {})", ms(spread.median), quartiles(spread), plural(spread.count, "run"))
}

/// The quartiles of seconds, in milliseconds.
pub(super) fn quartiles(spread: &Spread) -> String {
    let [low, high] = spread.quartiles;
    format!("{} to {}", ms(low), ms(high))
}

/// Bytes of memory at the peak, if known.
pub(super) fn memory(bytes: Option<u64>) -> String {
    bytes.map_or_else(|| "memory unknown".into(), |b| format!("{:.0} MB at the peak", 1e-6 * b as f64))
}

/// Seconds as milliseconds.
pub(super) fn ms(seconds: f64) -> String {
    format!("{:.1}", 1e3 * seconds)
}

/// A share of 1.
pub(super) fn percent(share: f64) -> String {
    format!("{:.1} %", 100.0 * share)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::bench::{Bound, StageRow, StageTable, Total};

    fn measured(threads: usize, milliseconds: f64, rows: Vec<StageRow>) -> Measured {
        let total = Total {
            wall_ms: milliseconds,
            threads,
            core_ms: 150.0,
            idle_share: 0.25,
            gflop: 8.0,
            flop_limit_ms: 40.0,
            flop_share: 0.4,
            limit_share: 0.6,
        };
        let seconds = Spread::of(&[1e-3 * milliseconds]).expect("one");
        Measured { threads, seconds, stages: StageTable { rows, total }, peak_bytes: Some(5_000_000) }
    }

    fn decoder() -> StageRow {
        StageRow {
            stage: "decoder",
            core_ms: 150.0,
            share: 1.0,
            gflop: 8.0,
            gb: 0.5,
            gflops_per_core: 53.3,
            flop_share: 0.533,
            bandwidth_share: 0.3,
            bound: Bound::Arithmetic,
        }
    }

    #[test]
    fn a_stage_is_a_line_and_the_total_the_last() {
        let text = stages(&measured(2, 100.0, vec![decoder()]));
        assert!(!text.contains("above 100 %"), "{text}");
        let words = |line: usize| text.lines().nth(line).unwrap().split_whitespace().collect::<Vec<_>>().join(" ");
        assert_eq!(words(1), "decoder 150.0 100.0 % 8.000 0.500 53.3 53.3 % 30.0 % arithmetic");
        assert_eq!(
            words(2),
            "total: 100.0 ms on 2 threads, 25.0 % of it idle or not recorded; 8.00 GFLOP take 40.0 ms at the peak: 40.0 %; stages at the nearer of their limits: 60.0 %"
        );
        assert_eq!(stages(&measured(2, 100.0, Vec::new())), "no stages were recorded\n");
    }

    #[test]
    fn a_note_explains_shares_above_the_copy() {
        let gather = StageRow { bandwidth_share: 2.0, ..decoder() };
        let text = stages(&measured(1, 100.0, vec![gather]));
        assert!(text.ends_with("Shares above 100 %: the stage reads from caches, which are faster than the copy.\n"));
        assert!(text.contains("100.0 ms on 1 thread,"), "{text}");
    }

    #[test]
    fn scaling_is_relative_to_the_first() {
        let (one, two) = (measured(1, 90.0, Vec::new()), measured(2, 50.0, Vec::new()));
        let text = scaling(&[&one, &two]);
        let last: Vec<_> = text.lines().last().unwrap().split_whitespace().collect();
        assert_eq!(last.join(" "), "2 50.0 1.80 90.0 %");
        assert_eq!(scaling(&[&one]), "");
    }
}
