//! The similarity between two reconstructions of the same cameras.

use glam::{DMat3, DQuat, DVec3};

use super::{Camera, Similarity};

/// Squarings of the matrix whose largest eigenvector is the rotation: its power is 2 to this.
const SQUARINGS: u32 = 32;

/// The similarity that best maps the cameras `from` to the cameras `to`, of the same number and order: centers by least
/// squares (Horn, "Closed-form solution of absolute orientation using unit quaternions", 1987), in which the cameras'
/// axes count as points at the distance of the centers' deviation, so that centers may lie on a line. `None` for fewer
/// than two cameras, or if the centers of either side coincide.
pub fn align_cameras(from: &[Camera], to: &[Camera]) -> Option<Similarity> {
    if from.len() != to.len() || from.len() < 2 {
        return None;
    }
    let mean = |cameras: &[Camera]| cameras.iter().map(|c| c.position).sum::<DVec3>() / cameras.len() as f64;
    let means = [mean(from), mean(to)];
    let deviation = |cameras: &[Camera], mean: DVec3| {
        (cameras.iter().map(|c| c.position.distance_squared(mean)).sum::<f64>() / cameras.len() as f64).sqrt()
    };
    let spread = [deviation(from, means[0]), deviation(to, means[1])];
    if !(spread[0] > 0.0 && spread[1] > 0.0 && spread.iter().all(|s| s.is_finite())) {
        return None;
    }
    let mut covariance = DMat3::ZERO;
    let mut add = |a: DVec3, b: DVec3| covariance += DMat3::from_cols(b * a.x, b * a.y, b * a.z);
    for (a, b) in from.iter().zip(to) {
        add((a.position - means[0]) / spread[0], (b.position - means[1]) / spread[1]);
        (0..3).for_each(|axis| add(a.world_from_camera.col(axis), b.world_from_camera.col(axis)));
    }
    let rotation = rotation_of(&covariance);
    let along = |(a, b): (&Camera, &Camera)| (rotation * (a.position - means[0])).dot(b.position - means[1]);
    let products: f64 = from.iter().zip(to).map(along).sum();
    let scale = products / (spread[0] * spread[0] * from.len() as f64);
    (scale > 0.0).then(|| Similarity { scale, rotation, translation: means[1] - scale * (rotation * means[0]) })
}

/// The rotation R of the largest trace of Rᵀ·`covariance`, which is Σ b·aᵀ: Horn's quaternion, the eigenvector of the
/// largest eigenvalue of a symmetric matrix.
fn rotation_of(covariance: &DMat3) -> DQuat {
    let at = |row: usize, column: usize| covariance.col(column)[row];
    let trace = at(0, 0) + at(1, 1) + at(2, 2);
    let mut matrix = [[0.0; 4]; 4];
    for row in 0..3 {
        for column in 0..3 {
            matrix[row][column] = at(row, column) + at(column, row) - if row == column { trace } else { 0.0 };
        }
        let [next, last] = [(row + 1) % 3, (row + 2) % 3];
        matrix[row][3] = at(last, next) - at(next, last);
        matrix[3][row] = matrix[row][3];
    }
    matrix[3][3] = trace;
    // All eigenvalues become positive, so that the largest is the one of largest size.
    let size = matrix.as_flattened().iter().map(|v| v * v).sum::<f64>().sqrt();
    (0..4).for_each(|i| matrix[i][i] += size);
    // The columns of a high power are along the eigenvector.
    for _ in 0..SQUARINGS {
        let square = |row: usize, column: usize| (0..4).map(|k| matrix[row][k] * matrix[k][column]).sum::<f64>();
        let mut squared: [[f64; 4]; 4] = std::array::from_fn(|row| std::array::from_fn(|column| square(row, column)));
        let size = squared.as_flattened().iter().map(|v| v * v).sum::<f64>().sqrt();
        squared.as_flattened_mut().iter_mut().for_each(|v| *v /= size);
        matrix = squared;
    }
    let column = (0..4).max_by(|&a, &b| matrix[a][a].total_cmp(&matrix[b][b])).expect("four columns");
    DQuat::from_array(matrix[column]).normalize()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cameras(place: impl Fn(f64) -> DVec3) -> Vec<Camera> {
        let camera = |n: u32| {
            let n = f64::from(n);
            let position = place(n);
            let direction = DVec3::new((1.7 * n).cos(), (1.7 * n).sin(), 0.4 * (2.3 * n).sin());
            Camera::looking_at([4, 3], 5.0, position, position + direction, DVec3::Z)
        };
        (0..9).map(camera).collect()
    }

    #[test]
    fn a_similarity_is_found_again_from_centers_on_a_curve_and_on_a_line() {
        let map = Similarity {
            scale: 0.3,
            rotation: DQuat::from_rotation_z(2.7) * DQuat::from_rotation_x(1.2),
            translation: DVec3::new(10.0, -20.0, 3.0),
        };
        for place in [|n: f64| DVec3::new(n.cos(), n.sin(), 0.1 * n), |n: f64| DVec3::new(n, 2.0 * n, -n)] {
            let from = cameras(place);
            let mut to: Vec<Camera> = from.iter().map(|camera| camera.mapped(&map)).collect();
            let error = |to: &[Camera]| {
                let found = align_cameras(&from, to).expect("nine cameras in different places");
                let missed = |(a, b): (&Camera, &Camera)| {
                    let a = a.mapped(&found);
                    a.position.distance(b.position) + a.degrees_to(b)
                };
                from.iter().zip(to).map(missed).fold(0.0, f64::max)
            };
            assert!(error(&to) < 1e-9, "{:e}", error(&to));
            to[4].position.x += 0.01;
            assert!(error(&to) > 1e-3, "a moved camera shows");
        }
    }

    #[test]
    fn cameras_in_one_place_have_no_scale() {
        let still = cameras(|_| DVec3::ONE);
        let moving = cameras(DVec3::splat);
        assert_eq!(align_cameras(&still, &moving), None);
        assert_eq!(align_cameras(&moving[..1], &moving[..1]), None);
    }
}
