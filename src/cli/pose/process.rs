//! Running a program: its output goes to a log file, which is followed for progress.

use std::fs::File;
use std::io::Read;
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use super::super::Error;

/// The time between two looks at the log.
const POLL: Duration = Duration::from_millis(50);
/// Lines of the log that an error shows.
const SHOWN_LINES: usize = 8;
/// Bytes of a line of the log that an error shows.
const SHOWN_LENGTH: usize = 300;

/// Runs `command` to its end; its output is the new content of `log`, of which `line` receives each line. `task` names
/// the stage in errors.
///
/// # Errors
///
/// If the program cannot be started or fails, with the last lines of the log; if `interrupted` becomes true, after the
/// program was ended.
pub(super) fn run(
    task: &str,
    mut command: Command,
    log: &Path,
    interrupted: &AtomicBool,
    line: &mut dyn FnMut(&str),
) -> Result<(), Error> {
    let program = Path::new(command.get_program()).display().to_string();
    let output = File::create(log).map_err(Error::io("write", log))?;
    let errors = output.try_clone().map_err(Error::io("write", log))?;
    let mut reader = File::open(log).map_err(Error::io("read", log))?;
    command.stdin(Stdio::null()).stdout(output).stderr(errors);
    let start = |e| Error::Runtime(format!("{task}: cannot start {program}: {e}"));
    let mut child = command.spawn().map_err(start)?;
    let mut unread = Vec::new();
    let status = loop {
        if interrupted.load(Ordering::SeqCst) {
            // Safe at any time: SQLite discards half a transaction, and models are moved into place when complete.
            let _ = child.kill();
            let _ = child.wait();
            return Err(stopped(task));
        }
        let ended = child.try_wait().map_err(|e| Error::Runtime(format!("{task}: cannot wait for {program}: {e}")))?;
        reader.read_to_end(&mut unread).map_err(Error::io("read", log))?;
        let whole = unread.iter().rposition(|b| *b == b'\n').map_or(0, |last| last + 1);
        String::from_utf8_lossy(&unread[..whole]).lines().for_each(&mut *line);
        unread.drain(..whole);
        match ended {
            Some(status) => break status,
            None => std::thread::sleep(POLL),
        }
    };
    // Ctrl-C in a terminal reaches the program as well.
    if interrupted.load(Ordering::SeqCst) && !status.success() {
        return Err(stopped(task));
    }
    if status.success() {
        return Ok(());
    }
    Err(with_end_of(log, &format!("{task}: {program} failed ({status})")))
}

/// The error of an interrupted `task`.
pub(super) fn stopped(task: &str) -> Error {
    Error::Runtime(format!("{task}: interrupted; the same command resumes"))
}

/// The error `problem` with the path of `log` and its last lines.
pub(super) fn with_end_of(log: &Path, problem: &str) -> Error {
    let text = std::fs::read(log).unwrap_or_default();
    let text = String::from_utf8_lossy(&text);
    let lines: Vec<&str> = text.lines().filter(|line| !line.trim().is_empty()).collect();
    let last = &lines[lines.len().saturating_sub(SHOWN_LINES)..];
    if last.is_empty() {
        return Error::Runtime(format!("{problem}; its log {} is empty", log.display()));
    }
    let error = Error::Runtime(format!("{problem}; its log {} ends with:", log.display()));
    let lines = last.iter().map(|line| line.chars().take(SHOWN_LENGTH).collect()).collect();
    Error::WithLines { error: Box::new(error), lines }
}

/// The steps done and their total in a line of COLMAP such as `Processed file [3/50]`, `Matching block [1/5, 2/5]` or
/// `Processing block [1/5, 2/5]`, which has only begun.
pub(super) fn counter(line: &str) -> Option<[u64; 2]> {
    let (before, rest) = line.rsplit_once('[')?;
    let begun = u64::from(before.contains("Processing"));
    let (inside, _) = rest.split_once(']')?;
    let pair = |text: &str| {
        let (at, of) = text.trim().split_once('/')?;
        Some([at.parse::<u64>().ok()?, of.parse::<u64>().ok()?])
    };
    match inside.split_once(',') {
        None => pair(inside).map(|[at, of]| [at.saturating_sub(begun), of]),
        Some((row, column)) => {
            let ([row, rows], [column, columns]) = (pair(row)?, pair(column)?);
            let done = row.checked_sub(1)?.checked_mul(columns)?.checked_add(column)?.saturating_sub(begun);
            Some([done, rows.checked_mul(columns)?])
        }
    }
}

/// The pictures registered so far in a line of COLMAP such as `Registering image #12 (13)` or
/// `Registering image #12 (num_reg_frames=13)`.
pub(super) fn registered(line: &str) -> Option<u64> {
    let (_, rest) = line.split_once("Registering image #")?;
    let (_, inside) = rest.rsplit_once('(')?;
    let digits: String = inside.chars().filter(char::is_ascii_digit).collect();
    digits.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn progress_is_read_from_lines_of_colmap() {
        assert_eq!(counter("Processed file [3/50]"), Some([3, 50]));
        assert_eq!(counter("I20261123 06:43 140 feature_extraction.cc:270] Processed file [1/50]"), Some([1, 50]));
        assert_eq!(counter("Matching block [2/5, 1/5] in 3.2s"), Some([6, 25]));
        assert_eq!(counter("I2026 pairing.cc:214] Processing block [2/5, 1/5]"), Some([5, 25]));
        assert_eq!(counter("Processing image [3/50]"), Some([2, 50]));
        assert_eq!(counter("Matching image [0/9, 0/9]"), None);
        for other in ["", "[", "[]", "[1/]", "[a/b]", "][", "Features:  9154"] {
            assert_eq!(counter(other), None, "{other}");
        }
        assert_eq!(registered("Registering image #12 (13)"), Some(13));
        assert_eq!(registered("I2026 x.cc:1] Registering image #12 (num_reg_frames=14)"), Some(14));
        assert_eq!(registered("  => Image sees 5 / 90 points"), None);
    }
}
