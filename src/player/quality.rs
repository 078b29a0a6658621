//! Approximations fitted to a scene, and the named render settings in its file.

use std::collections::BTreeMap;

use strivec_field::render::{Approximation, ParetoFront, RenderSettings};
use strivec_format::model::Scene;

/// `approximation` without a decoder mode that `scene` lacks: two compared scenes share an approximation.
pub fn adapted(scene: &Scene, approximation: &Approximation) -> Approximation {
    let decoder = approximation.decoder.filter(|mode| scene.features() >= mode.min_features());
    Approximation { decoder, ..*approximation }
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
    use strivec_field::render::{ParetoPoint, TRADE_NOTE};
    use strivec_format::model::DecoderMode;

    #[test]
    fn scenes_are_adapted_to_and_files_name_choices() {
        let scene = strivec_format::container::decode(include_bytes!(concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/../../fixtures/v1/f32.strivec"
        )))
        .unwrap();
        let wild = Approximation { step_scale: 2.0, decoder: Some(DecoderMode::Residual), ..Approximation::default() };
        assert_eq!(adapted(&scene, &wild), wild);
        let mut narrow = scene.clone();
        narrow.scales.iter_mut().for_each(|scale| scale.appearance_matrix.features = 1);
        assert_eq!(adapted(&narrow, &wild), Approximation { decoder: None, ..wild });

        let choice = RenderSettings { approximation: wild, divisor: 2 };
        let point = ParetoPoint { names: Vec::new(), settings: choice, milliseconds: 1.0, psnr: 30.0 };
        let front = ParetoFront::new("here".into(), "cpu".into(), [8, 8], "itself".into(), vec![point], 0.0);
        let notes = BTreeMap::from([(TRADE_NOTE.to_owned(), front.to_note())]);
        assert_eq!(named_choices(&notes), ["fast", "balanced", "best"].map(|name| (name.to_owned(), choice)));
        assert!(named_choices(&BTreeMap::new()).is_empty());
    }
}
