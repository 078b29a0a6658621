//! `strivec bench against`: compares this build with another in turns; can fail if this one is slower.

use std::path::{Path, PathBuf};
use std::time::Instant;

use serde::Serialize;

use super::process::{json_of, output_of, this_build};
use super::report;
use crate::bench::lab::{BuildComparison, by_turns};
use crate::numbers::{POSITIVE, in_range};
use crate::table::{Table, plural};
use crate::{Context, Error};

const EXAMPLES: &str = "\
Examples:
  strivec bench against ../before/target/release/strivec
  strivec bench against old/strivec --rounds 9 --fail-above 1.05
  strivec bench against old/strivec --fail-above 1.05 -- eval lego.strivec lego --every 20
  strivec bench against old/strivec --value /seconds_per_view -- eval lego.strivec lego --every 20 --json

Without a command, `bench train` and `bench render` of the two builds are compared. A command runs several times; give --force \
to one that writes files.";

/// The arguments.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Args {
    /// Executable of the other build
    other: PathBuf,
    /// Runs of each build, alternating
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u16).range(1..))]
    rounds: u16,
    /// Fail with exit code 4 if this build's median is more than R times the other's [default: never]
    #[arg(long, value_name = "R", value_parser = in_range(POSITIVE, "a positive ratio"))]
    fail_above: Option<f64>,
    /// Compare this number of the command's JSON, such as /points/0/seconds/median [default: the wall time]
    #[arg(long, value_name = "POINTER", requires = "command")]
    value: Option<String>,
    /// Command that both builds run, after --
    #[arg(last = true, value_name = "COMMAND")]
    command: Vec<String>,
}

/// A command that both builds run.
struct Task {
    name: String,
    arguments: Vec<String>,
    /// JSON pointer to the time in its output; `None` for the wall time.
    value: Option<String>,
}

/// The result, as `--json` prints it.
#[derive(Serialize)]
struct Report<'a> {
    other: &'a Path,
    comparisons: Vec<Row>,
}

#[derive(Serialize)]
struct Row {
    name: String,
    #[serde(flatten)]
    comparison: BuildComparison,
}

/// Compares and prints; fails if the limit is exceeded.
pub(super) fn run(args: &Args, session: &Context) -> Result<(), Error> {
    let this = this_build()?;
    let mut comparisons = Vec::new();
    for task in tasks(args) {
        session.console.say(&format!("bench: {}, {}", task.name, plural(args.rounds.into(), "round")));
        let [this, other] = by_turns(args.rounds.into(), || task.seconds(&this), || task.seconds(&args.other))?;
        let comparison = BuildComparison::of(&this, &other).ok_or_else(|| Error::Runtime("no rounds".into()))?;
        comparisons.push(Row { name: task.name, comparison });
    }
    let report = Report { other: &args.other, comparisons };
    session.console.result(&report, Report::text)?;
    check(&report, args.fail_above)
}

/// The given command, else a training step and a frame.
fn tasks(args: &Args) -> Vec<Task> {
    if !args.command.is_empty() {
        let (name, arguments) = (args.command.join(" "), args.command.clone());
        return vec![Task { name, arguments, value: args.value.clone() }];
    }
    let threads = rayon::current_num_threads().to_string();
    let task = |name: &str, arguments: &[&str], value: &str| Task {
        name: name.into(),
        arguments: [arguments, &["--threads", &threads, "--quiet", "--json"]]
            .concat()
            .iter()
            .map(ToString::to_string)
            .collect(),
        value: Some(value.into()),
    };
    vec![
        task("training step", &["bench", "train", "--upsampled", "5"], "/points/0/seconds/median"),
        task("frame", &["bench", "render", "--size", "200x200"], "/frames/0/seconds/median"),
    ]
}

impl Task {
    /// Runs `executable` once.
    fn seconds(&self, executable: &Path) -> Result<f64, Error> {
        let start = Instant::now();
        match &self.value {
            None => output_of(executable, &self.arguments).map(|_| start.elapsed().as_secs_f64()),
            Some(pointer) => {
                let json = json_of(executable, &self.arguments)?;
                number(&json, pointer).map_err(Error::malformed(executable))
            }
        }
    }
}

/// The positive number at `pointer` in `json`.
fn number(json: &serde_json::Value, pointer: &str) -> Result<f64, String> {
    let value = json.pointer(pointer);
    let positive = value.and_then(serde_json::Value::as_f64).filter(|v| *v > 0.0);
    positive.ok_or_else(|| {
        let found = value.map_or_else(|| "nothing".to_owned(), ToString::to_string);
        format!("the output at {pointer} is not a positive number but {found}")
    })
}

fn check(report: &Report<'_>, limit: Option<f64>) -> Result<(), Error> {
    let Some(limit) = limit else { return Ok(()) };
    let slower = report.comparisons.iter().filter(|row| row.comparison.is_above(limit));
    let slower: Vec<_> = slower.map(|row| format!("{}: {:.3}", row.name, row.comparison.ratio)).collect();
    if slower.is_empty() {
        return Ok(());
    }
    let other = report.other.display();
    Err(Error::Runtime(format!("slower than {limit} times {other}: {}", slower.join(", "))))
}

impl Report<'_> {
    fn text(&self) -> String {
        let mut table = Table::new(["this against other", "this, ms", "other, ms", "ratio", "quartiles", "range"]);
        for row in &self.comparisons {
            let BuildComparison { this, other, ratio, rounds } = &row.comparison;
            let between = |[low, high]: [f64; 2]| format!("{low:.3} to {high:.3}");
            table.row([
                row.name.clone(),
                report::ms(this.median),
                report::ms(other.median),
                format!("{ratio:.3}"),
                between(rounds.quartiles),
                between(rounds.range),
            ]);
        }
        table.text()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn report(this: &[f64], other: &[f64]) -> Report<'static> {
        let comparison = BuildComparison::of(this, other).unwrap();
        Report { other: Path::new("old"), comparisons: vec![Row { name: "step".into(), comparison }] }
    }

    #[test]
    fn a_planted_slowdown_is_exit_code_4_and_names_the_task() {
        let slower = report(&[1.2, 1.25, 1.19], &[1.0, 1.04, 1.0]);
        let error = check(&slower, Some(1.05)).unwrap_err();
        assert_eq!(error.exit_code(), 4);
        assert_eq!(error.to_string(), "slower than 1.05 times old: step: 1.200");
        assert!(check(&slower, None).is_ok() && check(&slower, Some(1.25)).is_ok());
        assert!(check(&report(&[1.0, 1.04, 1.0], &[1.02, 1.0, 1.01]), Some(1.05)).is_ok());
    }

    #[test]
    fn numbers_are_found_at_the_pointer() {
        let json = serde_json::json!({"points": [{"seconds": {"median": 0.25}}], "none": null});
        assert_eq!(number(&json, "/points/0/seconds/median"), Ok(0.25));
        for (pointer, found) in [("/points/1", "nothing"), ("/none", "null"), ("/points/0", "{\"seconds\"")] {
            let error = number(&json, pointer).unwrap_err();
            assert!(error.contains(pointer) && error.contains(found), "{error}");
        }
    }
}
