//! Measurements as text.

use crate::bench::lab::{Measured, Spread};
use crate::table::{Table, plural};
use strivec_format::digits::grouped;

/// The stages of a step or frame.
pub(super) fn stages(measured: &Measured) -> String {
    let total = &measured.stages.total;
    if measured.stages.rows.is_empty() {
        return "no stages were recorded\n".into();
    }
    let mut table = Table::new(["stage", "core ms", "share"]);
    for row in &measured.stages.rows {
        table.row([row.stage.to_owned(), format!("{:.1}", row.core_ms), percent(row.share)]);
    }
    let count = |count: f64| grouped(count.round() as u64);
    format!(
        "{}total: {:.1} ms on {}, {} of it idle or not recorded; {} rays, {} samples evaluated, {} shaded\n",
        table.text(),
        total.wall_ms,
        plural(total.threads, "thread"),
        percent(total.idle_share),
        count(total.rays),
        count(total.evaluated),
        count(total.shaded),
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
    use crate::bench::lab::{StageRow, StageTable, Total};

    fn measured(threads: usize, milliseconds: f64, rows: Vec<StageRow>) -> Measured {
        let total = Total {
            wall_ms: milliseconds,
            threads,
            core_ms: 150.0,
            idle_share: 0.25,
            rays: 4096.0,
            evaluated: 90_000.4,
            shaded: 20_000.0,
        };
        let seconds = Spread::of(&[1e-3 * milliseconds]).expect("one");
        Measured { threads, seconds, stages: StageTable { rows, total }, peak_bytes: Some(5_000_000) }
    }

    #[test]
    fn a_stage_is_a_line_and_the_total_the_last() {
        let decoder = StageRow { stage: "decoder", core_ms: 150.0, share: 1.0 };
        let text = stages(&measured(2, 100.0, vec![decoder]));
        let words = |line: usize| text.lines().nth(line).unwrap().split_whitespace().collect::<Vec<_>>().join(" ");
        assert_eq!(words(1), "decoder 150.0 100.0 %");
        assert_eq!(
            words(2),
            "total: 100.0 ms on 2 threads, 25.0 % of it idle or not recorded; 4 096 rays, 90 000 samples evaluated, 20 000 shaded"
        );
        assert_eq!(stages(&measured(2, 100.0, Vec::new())), "no stages were recorded\n");
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
