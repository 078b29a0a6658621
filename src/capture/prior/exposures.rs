//! How bright photographs are beside each other, by places that several of them show.

use rayon::prelude::*;

use super::location::known_places;
use crate::dataset::Photograph;
use strivec_format::geometry::Camera;

/// Places of a photograph that are looked for in all others, about.
const PLACES: usize = 400;
/// The share by which the distances of a place, in a photograph and in another, may differ.
const AGREEMENT: f64 = 0.02;
/// Luminances, from 0 to 1, that say something of an exposure: neither noise nor clipped.
const TELLING: [f64; 2] = [0.08, 0.92];
/// The least number of places from which two photographs are compared.
const ENOUGH: usize = 20;
/// Rounds of relaxation.
const ROUNDS: usize = 200;

/// \[view\] the logarithm of base 2 of how much brighter the photograph is than the median one, in its encoded luminance, by
/// places that it shares with others at known distances; `None` if it shares too few.
pub fn brightness(views: &[Photograph]) -> Vec<Option<f64>> {
    let pairs: Vec<Vec<(usize, f64)>> = (0..views.len()).into_par_iter().map(|n| differences(views, n)).collect();
    // Both directions of each pair.
    let mut edges = vec![Vec::new(); views.len()];
    for (n, of_view) in pairs.iter().enumerate() {
        for &(m, difference) in of_view {
            edges[n].push((m, difference));
            edges[m].push((n, -difference));
        }
    }
    let mut values = vec![0.0; views.len()];
    for _ in 0..ROUNDS {
        for n in 0..values.len() {
            let of_others = edges[n].iter().map(|&(m, difference): &(usize, f64)| values[m] + difference);
            values[n] = median(of_others.collect()).unwrap_or(0.0);
        }
    }
    let is_known = |n: &usize| !edges[*n].is_empty();
    let middle = median((0..values.len()).filter(is_known).map(|n| values[n]).collect()).unwrap_or(0.0);
    (0..values.len()).map(|n| is_known(&n).then(|| values[n] - middle)).collect()
}

/// The other views that show enough of what view `n` shows, and how much brighter than theirs it is.
fn differences(views: &[Photograph], n: usize) -> Vec<(usize, f64)> {
    let view = &views[n];
    if view.distances.is_empty() {
        return Vec::new();
    }
    let Camera { width, height, .. } = view.camera;
    let stride = (f64::from(width) * f64::from(height) / PLACES as f64).sqrt().ceil().max(1.0) as u32;
    let places = known_places(&view.camera, &view.distances, stride);
    let places: Vec<_> = places.filter_map(|([x, y], place)| Some((place, luminance(view, x, y)?))).collect();
    let of_other = |other: &Photograph| {
        let differences = places.iter().filter_map(|&(place, here)| {
            let at = other.camera.project(place).filter(|&at| other.camera.is_inside(at))?;
            let (column, row) = (at.x as u32, at.y as u32);
            let distance = f64::from(*other.distances.get((row * other.camera.width + column) as usize)?);
            let expected = other.camera.position.distance(place);
            let is_same = (distance - expected).abs() < AGREEMENT * expected;
            is_same.then(|| luminance(other, column, row).map(|there| (here / there).log2()))?
        });
        let differences: Vec<f64> = differences.collect();
        (differences.len() >= ENOUGH).then(|| median(differences))?
    };
    let others = views.iter().enumerate().filter(|(m, other)| *m > n && !other.distances.is_empty());
    others.filter_map(|(m, other)| Some((m, of_other(other)?))).collect()
}

/// The mean luminance of the pixels around one; `None` if it says nothing.
fn luminance(view: &Photograph, column: u32, row: u32) -> Option<f64> {
    let Camera { width, height, .. } = view.camera;
    let around = |n: u32, count: u32| n.saturating_sub(1)..(n + 2).min(count);
    let pixels = around(row, height).flat_map(|row| around(column, width).map(move |column| row * width + column));
    let [mut sum, mut count] = [0.0, 0.0];
    for pixel in pixels {
        let [r, g, b] = view.pixels.color(pixel as usize, [0.0; 3]).map(f64::from);
        (sum, count) = (sum + 0.299 * r + 0.587 * g + 0.114 * b, count + 1.0);
    }
    let mean = sum / count;
    (TELLING[0]..TELLING[1]).contains(&mean).then_some(mean)
}

/// The middle one of `values`.
fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;
    use crate::dataset::Pixels;

    /// Photographs of the wall y = 0 from beside each other, each so many times as bright as the wall.
    fn photographs(gains: &[f32]) -> Vec<Photograph> {
        let view = |(n, &gain): (usize, &f32)| {
            let at = DVec3::new(0.2 * n as f64, -3.0, 0.0);
            let camera = Camera::looking_at([60, 60], 60.0, at, DVec3::new(0.5, 0.0, 0.0), DVec3::Z);
            let rays = || camera.rays(0..60).map(|ray| ray.map(|ray| (ray, 3.0 / ray.direction.y)));
            let color = |x: f64| [gain * (0.4 + 0.1 * (3.0 * x).sin()) as f32; 3];
            let colors = rays().map(|ray| ray.map_or([0.0; 3], |(ray, t)| color(ray.at(t).x)));
            let pixels = Pixels::opaque(colors.collect::<Vec<_>>());
            let distances = rays().map(|ray| ray.map_or(0.0, |(_, t)| t as f32)).collect();
            Photograph { distances, ..Photograph::new(n.to_string(), camera, pixels) }
        };
        gains.iter().enumerate().map(view).collect()
    }

    #[test]
    fn a_shared_wall_tells_how_bright_photographs_are() {
        let gains = [1.0, 0.5, 1.0, 1.5, 1.0];
        let found = brightness(&photographs(&gains));
        for (gain, found) in gains.into_iter().zip(&found) {
            let stops = found.expect("a wall that others show");
            assert!((stops - f64::from(gain.log2())).abs() < 0.02, "{gain}: {stops} of {found:?}");
        }
    }

    #[test]
    fn what_shares_no_known_surface_has_no_brightness() {
        let mut views = photographs(&[1.0, 0.7, 1.0]);
        views[1].distances.clear();
        assert_eq!(brightness(&views).iter().map(Option::is_some).collect::<Vec<_>>(), [true, false, true]);
        assert_eq!(brightness(&photographs(&[1.0])), [None]);
        assert_eq!(brightness(&[]), []);
    }
}
