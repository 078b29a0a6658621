//! Approximations fitted to a scene, and the named render settings in its file.

use std::collections::BTreeMap;

use crate::container::{Prefix, first_scales};
use crate::model::Scene;
use crate::render::{Approximation, ParetoFront, RenderSettings};

/// Removes the scales of `scene` that `approximation` leaves out, and corrects the others by the file's `prefixes`.
/// Returns the scene, and the rest of the approximation for a renderer. The approximation may exceed the scene, as two
/// compared scenes share it: neighbors are then clamped, and a decoder mode that the scene lacks is dropped.
pub fn adapted(scene: &Scene, prefixes: &[Option<Prefix>], approximation: &Approximation) -> (Scene, Approximation) {
    let most = scene.scales.iter().map(|s| s.top_k).max().unwrap_or(1);
    let left = Approximation {
        top_k: approximation.top_k.map(|n| n.min(most)),
        scales: None,
        decoder: approximation.decoder.filter(|mode| scene.features() >= mode.min_features()),
        ..*approximation
    };
    (first_scales(scene.clone(), prefixes, approximation.scales), left)
}

/// The render settings that a file's `notes` store by name, as written by `strivec trade --store`; none if they are
/// malformed.
pub fn named_choices(notes: &BTreeMap<String, String>) -> Vec<(String, RenderSettings)> {
    let front = ParetoFront::from_notes(notes).and_then(Result::ok);
    let points = front.map(|front| front.points).unwrap_or_default();
    points.into_iter().flat_map(|p| p.names.into_iter().map(move |name| (name, p.settings))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::{ParetoPoint, TRADE_NOTE};

    #[test]
    fn scenes_are_adapted_to_and_files_name_choices() {
        let scene = crate::container::decode(include_bytes!("../../fixtures/v1/f32.strivec")).unwrap();
        let wild = Approximation { top_k: Some(99), scales: Some(1), ..Approximation::default() };
        let (one, left) = adapted(&scene, &[], &wild);
        assert_eq!(one.scales.len(), 1);
        assert!(left.check(&one).is_ok(), "{left:?}");
        assert_eq!(adapted(&scene, &[], &Approximation::default()).0, scene);

        let choice = RenderSettings { approximation: wild, divisor: 2 };
        let point = ParetoPoint { names: Vec::new(), settings: choice, milliseconds: 1.0, psnr: 30.0 };
        let front = ParetoFront::new("here".into(), "cpu".into(), [8, 8], "itself".into(), vec![point], 0.0);
        let notes = BTreeMap::from([(TRADE_NOTE.to_owned(), front.to_note())]);
        assert_eq!(named_choices(&notes), ["fast", "balanced", "best"].map(|name| (name.to_owned(), choice)));
        assert!(named_choices(&BTreeMap::new()).is_empty());
    }
}
