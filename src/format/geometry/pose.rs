//! Camera poses as 4×4 matrices.

use glam::{DMat3, DVec3};

/// The largest deviation of an entry of RᵀR from the identity's: poses are often stored in f32 or rounded to a few
/// digits.
const TOLERANCE: f64 = 1e-3;

/// The first property of a pose that a matrix lacks.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("a pose must be {expected}; found {found}")]
pub struct NotRigid {
    /// The property that the matrix lacks.
    pub expected: &'static str,
    /// The deviation, or the values.
    pub found: String,
}

/// The rotation (columns: the camera's axes in the world) and the position of a row-major `world_from_camera` matrix.
///
/// The rotation is made exactly orthonormal, first column first.
///
/// # Errors
///
/// If a number is not finite, the last row is not 0 0 0 1, or the rotation part is mirrored or further than 1e-3 from
/// orthonormal.
pub fn rigid(rows: &[[f64; 4]; 4]) -> Result<(DMat3, DVec3), NotRigid> {
    let refused = |expected, found| Err(NotRigid { expected, found });
    if rows.as_flattened().iter().any(|v| !v.is_finite()) {
        return refused("a matrix of finite numbers", format!("{rows:?}"));
    }
    if rows[3].iter().zip([0.0, 0.0, 0.0, 1.0]).any(|(found, expected)| (found - expected).abs() > TOLERANCE) {
        return refused("one with the last row 0 0 0 1", format!("{:?}", rows[3]));
    }
    let column = |c: usize| DVec3::new(rows[0][c], rows[1][c], rows[2][c]);
    let stored = DMat3::from_cols(column(0), column(1), column(2));
    let gram = stored.transpose() * stored - DMat3::IDENTITY;
    let error = gram.abs().to_cols_array().into_iter().fold(0.0, f64::max);
    // Products of very large numbers overflow to NaN, which `f64::max` ignores.
    if gram.is_nan() || error > TOLERANCE {
        return refused(
            "an orthonormal rotation within 0.001",
            format!("a rotation whose RᵀR differs from the identity by {error:.3e}"),
        );
    }
    let determinant = stored.determinant();
    if determinant < 0.0 {
        return refused("a right-handed rotation", format!("a mirrored one of determinant {determinant:.3}"));
    }
    let x = stored.x_axis.normalize();
    let y = (stored.y_axis - x * x.dot(stored.y_axis)).normalize();
    Ok((DMat3::from_cols(x, y, x.cross(y)), column(3)))
}

#[cfg(test)]
mod tests {
    use super::*;

    const IDENTITY: [[f64; 4]; 4] =
        [[1.0, 0.0, 0.0, 5.0], [0.0, 1.0, 0.0, 6.0], [0.0, 0.0, 1.0, 7.0], [0.0, 0.0, 0.0, 1.0]];

    fn with(row: usize, column: usize, value: f64) -> [[f64; 4]; 4] {
        let mut rows = IDENTITY;
        rows[row][column] = value;
        rows
    }

    #[test]
    fn rounded_rotation_becomes_orthonormal() {
        let (rotation, position) = rigid(&with(0, 1, 4e-4)).unwrap();
        let gram = rotation.transpose() * rotation;
        assert!(gram.abs_diff_eq(DMat3::IDENTITY, 1e-15));
        assert!((rotation.determinant() - 1.0).abs() < 1e-15);
        assert_eq!(position, DVec3::new(5.0, 6.0, 7.0));
    }

    #[test]
    fn what_is_not_rigid_is_refused() {
        for (rows, expected) in [
            (with(0, 3, f64::NAN), "finite"),
            (with(1, 1, f64::INFINITY), "finite"),
            (with(3, 0, 0.5), "last row"),
            (with(0, 1, 0.01), "orthonormal"),
            (with(0, 0, 1e200), "orthonormal"),
            (with(0, 0, 0.0), "orthonormal"),
            (with(2, 2, -1.0), "right-handed"),
        ] {
            let message = rigid(&rows).unwrap_err().expected;
            assert!(message.contains(expected), "{message} for {rows:?}");
        }
    }
}
