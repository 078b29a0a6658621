//! Arguments of one or several numbers.

use std::ops::RangeInclusive;

use strivec_format::geometry::Aabb;

/// All positive numbers.
pub(super) const POSITIVE: RangeInclusive<f64> = f64::MIN_POSITIVE..=f64::MAX;

/// Reads a number in `range`; anything else is not `what`.
pub(super) fn in_range(
    range: RangeInclusive<f64>,
    what: &'static str,
) -> impl Fn(&str) -> Result<f64, String> + Clone + Send + Sync {
    move |text| text.parse().ok().filter(|value| range.contains(value)).ok_or_else(|| format!("not {what}"))
}

/// `N` comma-separated finite numbers.
pub(super) fn numbers<const N: usize>(text: &str) -> Result<[f64; N], String> {
    let wrong = || format!("not {N} comma-separated numbers");
    let numbers = text.split(',').map(|number| number.trim().parse().ok().filter(|v: &f64| v.is_finite()));
    numbers.collect::<Option<Vec<_>>>().and_then(|all| all.try_into().ok()).ok_or_else(wrong)
}

/// A box as its smallest and its largest corner.
pub(super) fn boxed(text: &str) -> Result<Aabb, String> {
    let [x0, y0, z0, x1, y1, z1] = numbers::<6>(text)?;
    let corners = Aabb { min: [x0, y0, z0].into(), max: [x1, y1, z1].into() };
    if corners.is_solid() { Ok(corners) } else { Err("not the smallest corner, then a larger one".into()) }
}
