//! The memory of pictures, checked before it is taken: an allocation that fails ends the process.

use super::RendererError;

/// Bytes for each pixel: the picture, a copy of another size, its colors and an encoded file.
const PIXEL_BYTES: u64 = 64;

/// Checks that a picture of `size` (columns and rows) fits into the memory that the system has left, if it says how much.
///
/// # Errors
///
/// [`RendererError::Picture`].
pub fn check_picture(size: [u32; 2]) -> Result<(), RendererError> {
    check_picture_within(size, available().unwrap_or(u64::MAX))
}

fn check_picture_within(size: [u32; 2], available: u64) -> Result<(), RendererError> {
    let needed = size.map(u64::from).iter().product::<u64>().saturating_mul(PIXEL_BYTES);
    if needed <= available { Ok(()) } else { Err(RendererError::Picture { size, needed, available }) }
}

/// Bytes of memory that can be taken before the system swaps or ends processes; `None` if it does not report them.
fn available() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/meminfo").ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix("MemAvailable:"))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()?.checked_mul(1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_that_do_not_fit_are_refused_with_their_bytes() {
        assert_eq!(check_picture_within([800, 800], 1 << 30), Ok(()));
        let error = check_picture_within([100_000, 100_000], 1 << 30).unwrap_err();
        let expected = "a picture of 100000x100000 pixels needs 610352 MiB of memory, and 1024 MiB are available; \
                        render a smaller one";
        assert_eq!(error.to_string(), expected);
        assert!(check_picture_within([u32::MAX; 2], u64::MAX - 1).is_err());
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn the_system_reports_its_memory() {
        assert!(available().is_some_and(|bytes| bytes > 1 << 20));
        assert!(check_picture([u32::MAX; 2]).is_err());
    }
}
