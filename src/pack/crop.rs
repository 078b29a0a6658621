//! Cropping to a box.

use glam::DVec3;

use crate::container::SceneFile;
use crate::geometry::Aabb;
use crate::model::BrokenInvariant;

/// The part of `file` inside `within`, in model units: the tensors that reach into the box, and the intersection of
/// the bounds, unless the scene is contracted. Inside, pictures stay the same.
///
/// # Errors
///
/// If nothing is left.
pub fn crop(mut file: SceneFile, within: &Aabb) -> Result<SceneFile, BrokenInvariant> {
    let SceneFile { scene, encoding, .. } = &mut file;
    let region = scene.rules.contracted_box(within).intersection(&scene.bounds);
    scene.bounds = scene.rules.cropped_bounds(&scene.bounds, within);
    for (s, scale) in scene.scales.iter_mut().enumerate() {
        let reaches = |center: DVec3| {
            let covered = Aabb::around(center, scale.cloud.half_edge).intersection(&region);
            covered.min.cmple(covered.max).all()
        };
        let kept: Vec<usize> = (0..scale.cloud.len()).filter(|&n| reaches(scale.cloud.center(n))).collect();
        for factors in [&mut encoding.density, &mut encoding.appearance] {
            if let Some(factors) = factors.get_mut(s) {
                factors.keep_tensors(&kept, scale.cloud.len());
            }
        }
        scale.keep_tensors(&kept);
    }
    scene.check()?;
    Ok(file)
}
