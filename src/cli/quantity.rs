//! Sizes and numbers on the command line, with their units.

const SIZES: [(&str, f64); 6] =
    [("kB", 1e3), ("MB", 1e6), ("GB", 1e9), ("KiB", 1024.0), ("MiB", 1_048_576.0), ("B", 1.0)];
const COUNTS: [(&str, f64); 5] = [("k", 1e3), ("K", 1e3), ("M", 1e6), ("G", 1e9), ("", 1.0)];

/// Bytes, as in 2MB, 700kB or 1500000B; the unit is required.
pub(super) fn size(text: &str) -> Result<u64, String> {
    of_units(text, &SIZES)
        .ok_or_else(|| "not a size with a unit (B, kB, MB, GB, KiB or MiB), as in 2MB or 700kB".into())
}

/// A count, as in 500k, 3.5M or 1500000.
pub(super) fn count(text: &str) -> Result<u64, String> {
    of_units(text, &COUNTS).ok_or_else(|| "not a positive number, as in 500k, 3.5M or 1500000".into())
}

fn of_units(text: &str, units: &[(&str, f64)]) -> Option<u64> {
    let read = |(unit, times): &(&str, f64)| Some(text.strip_suffix(unit)?.trim().parse::<f64>().ok()? * times);
    units.iter().find_map(read).filter(|v| *v >= 1.0 && v.is_finite()).map(|v| v.round() as u64)
}

#[cfg(test)]
mod tests {
    use super::{count, size};

    #[test]
    fn units_multiply_and_nonsense_is_refused() {
        assert_eq!(
            ["2MB", "700 kB", "1.5KiB", "12B", "1500000B"].map(size),
            [Ok(2_000_000), Ok(700_000), Ok(1536), Ok(12), Ok(1_500_000)]
        );
        assert_eq!(["500k", "3.5M", "2.3M", "7"].map(count), [Ok(500_000), Ok(3_500_000), Ok(2_300_000), Ok(7)]);
        for wrong in ["", "MB", "0", "-1", "0.5", "2XB", "nan", "infMB"] {
            assert!(size(wrong).is_err() && count(wrong).is_err(), "{wrong}");
        }
        assert!(count("2MB").is_err());
        assert!(size("2").unwrap_err().contains("kB"));
    }
}
