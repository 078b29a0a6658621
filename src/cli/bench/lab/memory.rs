//! Peak memory of a piece of work, if the system reports it.

use std::fs;

/// The process's resident memory when the work began.
#[derive(Clone, Copy, Debug)]
pub struct MemoryMark {
    resident: Option<u64>,
}

impl MemoryMark {
    /// Begins now: resets the system's high-water mark to the resident memory.
    pub fn set() -> Self {
        // "5" resets the peak (proc_pid_clear_refs(5)). If that fails, the peak may be an older one and is not
        // reported.
        let reset = fs::write("/proc/self/clear_refs", "5").is_ok();
        Self { resident: status("VmRSS:").filter(|_| reset) }
    }

    /// Peak of resident memory above the mark, in bytes; `None` if the system does not report it.
    ///
    /// Memory that the process held before and reused is not included.
    pub fn peak(self) -> Option<u64> {
        Some(status("VmHWM:")?.saturating_sub(self.resident?))
    }
}

/// A line of this process's status file, in bytes.
fn status(name: &str) -> Option<u64> {
    let text = fs::read_to_string("/proc/self/status").ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix(name))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok().map(|kilobytes| 1024 * kilobytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[cfg(target_os = "linux")]
    fn memory_that_was_given_back_is_still_in_the_peak() {
        let mark = MemoryMark::set();
        let large = std::hint::black_box(vec![1u8; 200 << 20]);
        drop(large);
        // Other tests of this process allocate and free meanwhile, so only the order of magnitude holds. Some
        // sandboxes do not let a process reset its peak.
        if let Some(peak) = mark.peak() {
            assert!(peak > 100 << 20, "{peak}");
        }
    }
}
