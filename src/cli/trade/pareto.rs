//! The Pareto front: points that no other point dominates.

/// Numbers of the `points` \[cost, quality\] that no other dominates, by ascending cost. Of equal points only the
/// first.
pub(super) fn front(points: &[[f64; 2]]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..points.len()).collect();
    order.sort_by(|&a, &b| points[a][0].total_cmp(&points[b][0]).then(points[b][1].total_cmp(&points[a][1])));
    let mut best = f64::NEG_INFINITY;
    order.retain(|&n| {
        let is_better = points[n][1] > best;
        best = best.max(points[n][1]);
        is_better
    });
    order
}

/// The distance in quality of each of `points` below the front at its cost, interpolated between the front's points: 0
/// on the front.
pub(super) fn below_front(points: &[[f64; 2]]) -> Vec<f64> {
    let front = front(points);
    let height = |x: f64| {
        let next = front.partition_point(|&n| points[n][0] <= x);
        let [before, after] =
            [next.checked_sub(1), Some(next)].map(|n| n.and_then(|n| front.get(n)).map(|&n| points[n]));
        match (before, after) {
            (Some([x0, y0]), Some([x1, y1])) if x1 > x0 => y0 + (x / x0).ln() / (x1 / x0).ln() * (y1 - y0),
            (Some([_, y]), _) | (None, Some([_, y])) => y,
            (None, None) => 0.0,
        }
    };
    // A dominated point may lie above the line between two points of the front; its distance is 0.
    points
        .iter()
        .enumerate()
        .map(|(n, p)| if front.contains(&n) { 0.0 } else { (height(p[0]) - p[1]).max(0.0) })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_dominated_points_are_left_out() {
        let points = [[10.0, 30.0], [5.0, 20.0], [7.0, 19.0], [10.0, 29.0], [20.0, 31.0], [20.0, 31.0]];
        assert_eq!(front(&points), [1, 0, 4]);
        let below = below_front(&points);
        assert_eq!((below[1], below[0], below[4]), (0.0, 0.0, 0.0));
        assert!(below[2] > 4.0 && below[2] < 6.0 && below[3] == 1.0, "{below:?}");
        assert!(front(&[]).is_empty());
    }
}
