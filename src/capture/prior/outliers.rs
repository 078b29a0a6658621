//! Statistical outlier removal (Rusu et al., "Towards 3D Point Cloud Based Object Maps",
//! 2008).

use glam::DVec3;
use rayon::prelude::*;

use strivec_format::geometry::Aabb;

/// The rule for outliers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outliers {
    /// Number of nearest neighbors whose mean distance is taken, at least 1.
    pub neighbors: usize,
    /// A point is an outlier if its mean distance exceeds the mean over all points by more than this number of standard
    /// deviations.
    pub deviations: f64,
}

/// Points in a leaf of the tree.
const LEAF: usize = 16;

/// \[point\]: true if the point is kept. Takes 21 bytes per point besides `points`.
pub(super) fn inliers(points: &[DVec3], rule: &Outliers) -> Vec<bool> {
    let neighbors = rule.neighbors.min(points.len().saturating_sub(1));
    if neighbors == 0 {
        return vec![true; points.len()];
    }
    let tree = Tree::new(points);
    // In the tree's order, so that consecutive searches share cache lines.
    let ordered: Vec<f64> = (tree.order.par_iter())
        .map_with(Vec::new(), |nearest, &n| {
            // The nearest point is the point itself.
            tree.nearest(points[n as usize], neighbors + 1, nearest);
            nearest.iter().map(|d| d.sqrt()).sum::<f64>() / neighbors as f64
        })
        .collect();
    let mut distances = vec![0.0; points.len()];
    tree.order.iter().zip(ordered).for_each(|(&n, distance)| distances[n as usize] = distance);
    // In order, so that the sum does not depend on the number of threads.
    let count = distances.len() as f64;
    let mean = distances.iter().sum::<f64>() / count;
    let variance = distances.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / count;
    let most = mean + rule.deviations * variance.sqrt();
    distances.into_iter().map(|d| d <= most).collect()
}

/// A k-d tree in place: each part is split at its median along its longest axis. The trees of crates limit how many
/// points may share a coordinate; scans have no such limit.
struct Tree<'a> {
    points: &'a [DVec3],
    /// Indices of points, in the order of the tree.
    order: Vec<u32>,
    /// Split axis, at the index of the median of each part.
    axes: Vec<u8>,
}

impl<'a> Tree<'a> {
    fn new(points: &'a [DVec3]) -> Self {
        let mut tree = Self { points, order: (0..points.len() as u32).collect(), axes: vec![0; points.len()] };
        split(points, &mut tree.order, &mut tree.axes);
        tree
    }

    /// The squared distances of the `count` points nearest to `at`, ascending.
    fn nearest(&self, at: DVec3, count: usize, nearest: &mut Vec<f64>) {
        nearest.clear();
        self.search(0..self.order.len(), at, count, nearest);
    }

    fn search(&self, part: std::ops::Range<usize>, at: DVec3, count: usize, nearest: &mut Vec<f64>) {
        if part.len() <= LEAF {
            self.order[part].iter().for_each(|&n| insert(nearest, count, at.distance_squared(self.points[n as usize])));
            return;
        }
        let middle = part.start + part.len() / 2;
        let divider = self.points[self.order[middle] as usize];
        let axis = usize::from(self.axes[middle]);
        let beyond = at[axis] - divider[axis];
        insert(nearest, count, at.distance_squared(divider));
        let (lower, upper) = (part.start..middle, middle + 1..part.end);
        let (near, far) = if beyond < 0.0 { (lower, upper) } else { (upper, lower) };
        self.search(near, at, count, nearest);
        // Strict, so that points at equal positions are not all searched.
        if nearest.len() < count || beyond * beyond < nearest[count - 1] {
            self.search(far, at, count, nearest);
        }
    }
}

/// Inserts a distance into the `count` smallest ones, which ascend.
fn insert(nearest: &mut Vec<f64>, count: usize, distance: f64) {
    if nearest.len() == count {
        if distance >= nearest[count - 1] {
            return;
        }
        nearest.pop();
    }
    let place = nearest.partition_point(|&d| d <= distance);
    nearest.insert(place, distance);
}

fn split(points: &[DVec3], part: &mut [u32], axes: &mut [u8]) {
    if part.len() <= LEAF {
        return;
    }
    let size = Aabb::from_points(part.iter().map(|&n| points[n as usize])).size();
    let axis = (0..3).max_by(|&a, &b| size[a].total_cmp(&size[b])).unwrap_or(0);
    let middle = part.len() / 2;
    part.select_nth_unstable_by(middle, |&a, &b| {
        let key = |n: u32| points[n as usize][axis];
        key(a).total_cmp(&key(b)).then(a.cmp(&b))
    });
    axes[middle] = axis as u8;
    let (lower, upper) = part.split_at_mut(middle);
    let (lower_axes, upper_axes) = axes.split_at_mut(middle);
    rayon::join(|| split(points, lower, lower_axes), || split(points, &mut upper[1..], &mut upper_axes[1..]));
}

#[cfg(test)]
mod tests {
    use super::*;
    use strivec_format::random::Random;

    fn cloud(count: u64) -> Vec<DVec3> {
        let random = Random::new(0, "outliers");
        (0..count)
            .map(|i| DVec3::new(random.uniform(3 * i), random.uniform(3 * i + 1), 0.01 * random.uniform(3 * i + 2)))
            .collect()
    }

    #[test]
    fn neighbors_are_those_that_a_search_through_all_finds() {
        let points = cloud(700);
        let tree = Tree::new(&points);
        let mut nearest = Vec::new();
        for &at in points.iter().step_by(7).chain([&DVec3::splat(3.0)]) {
            tree.nearest(at, 9, &mut nearest);
            let mut all: Vec<_> = points.iter().map(|p| p.distance_squared(at)).collect();
            all.sort_by(f64::total_cmp);
            assert_eq!(nearest, all[..9]);
        }
    }

    #[test]
    fn points_apart_are_found_and_others_kept() {
        let mut points = cloud(5000);
        let far: Vec<_> =
            (0..100).map(|i| DVec3::new(0.01 * f64::from(i), 0.5, 1.0 + 0.1 * f64::from(i % 7))).collect();
        points.extend(&far);
        let kept = inliers(&points, &Outliers { neighbors: 8, deviations: 2.0 });
        assert!(kept[5000..].iter().filter(|&&k| k).count() == 0);
        assert!(kept[..5000].iter().filter(|&&k| !k).count() < 25);
    }

    #[test]
    fn clouds_in_one_place_and_single_points_stay_and_end() {
        let rule = Outliers { neighbors: 8, deviations: 1.0 };
        assert_eq!(inliers(&vec![DVec3::ONE; 200_000], &rule), vec![true; 200_000]);
        assert_eq!(inliers(&[DVec3::ONE], &rule), [true]);
        assert!(inliers(&[], &rule).is_empty());
    }
}
