//! How much memory a piece of work held at its peak, where the system tells.

use std::fs;

/// The process's resident memory when the work began.
#[derive(Clone, Copy, Debug)]
pub struct MemoryMark {
    resident: Option<u64>,
}

impl MemoryMark {
    /// Begins now: the system's high-water mark is set back to what is resident.
    pub fn set() -> Self {
        Self { resident: status("VmRSS:") }.again()
    }

    /// Forgets the peak and keeps the mark: for work on something that was made since then, which counts, while what
    /// making it took besides does not.
    pub fn again(self) -> Self {
        // "5" forgets the peak (proc_pid_clear_refs(5)). Where that is refused an older peak would pass for this one's.
        let reset = fs::write("/proc/self/clear_refs", "5").is_ok();
        Self { resident: self.resident.filter(|_| reset) }
    }

    /// By how many bytes resident memory has been above the mark at most; `None` where the system does not tell.
    ///
    /// Memory that the process held before and has used again is not in it.
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
        // sandboxes do not let a process forget its peak.
        if let Some(peak) = mark.peak() {
            assert!(peak > 100 << 20, "{peak}");
        }
    }
}
