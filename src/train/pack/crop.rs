//! Cropping to a box, or to the coarsest scales.

use glam::DVec3;

use strivec_format::Invalid;
use strivec_format::container::{SceneFile, first_scales};
use strivec_format::geometry::Aabb;

/// The part of `file` inside `within`, in model units: the tensors that reach into the box, and the intersection of
/// the bounds, unless the scene is contracted. Inside, pictures stay the same.
///
/// # Errors
///
/// If nothing is left.
pub fn crop(mut file: SceneFile, within: &Aabb) -> Result<SceneFile, Invalid> {
    let SceneFile { scene, encoding, .. } = &mut file;
    let region = scene.rules.contracted_box(within);
    scene.bounds = scene.rules.cropped_bounds(&scene.bounds, within);
    for (s, scale) in scene.scales.iter_mut().enumerate() {
        let reaches = |center: DVec3| {
            let covered = Aabb::around(center, scale.cloud.half_edge).intersection(&region);
            covered.min.cmple(covered.max).all()
        };
        let kept: Vec<usize> = (0..scale.cloud.len()).filter(|&n| reaches(scale.cloud.center(n))).collect();
        encoding.keep_tensors(s, &kept, scale.cloud.len());
        scale.keep_tensors(&kept);
    }
    scene.check()?;
    Ok(file)
}

/// The `count` coarsest scales of `file`, with its correction for the missing ones. The corrections of fewer scales
/// become those of the corrected scene.
pub fn keep_scales(file: SceneFile, count: usize) -> SceneFile {
    let SceneFile { scene, mut metadata, encoding } = file;
    if count == 0 || count >= scene.scales.len() {
        return SceneFile { scene, metadata, encoding };
    }
    let scene = first_scales(scene, &metadata.prefixes, Some(count as u32));
    if let Some(quality) = &mut metadata.quality {
        quality.prefixes.clear();
    }
    let mut prefixes = metadata.prefixes.into_iter();
    metadata.prefixes = prefixes.by_ref().take(count - 1).collect();
    if let Some(Some(applied)) = prefixes.next() {
        metadata.prefixes.iter_mut().flatten().for_each(|prefix| *prefix = prefix.after(&applied));
    }
    SceneFile { scene, metadata, encoding }
}
