//! Approximations: options that trade exactness for speed. All are off by default.

use strivec_format::model::{DecoderMode, Rules, Scene};
use strivec_format::{Invalid, Place};

/// The approximations of a renderer. By default there are none: pictures agree with the reference's within tolerance.
///
/// A threshold above the scene's own skips samples that the scene would shade, or ends rays early. The weight of these
/// samples goes to the shaded samples of the ray; if it were lost, pictures would darken, and the background would
/// shine through: 38.8 instead of 40.4 dB at a transmittance of 0.03
/// (docs/experiments/2026-11-29-raised-thresholds.md).
///
/// Let T be a ray's transmittance at its end, Tₛ and wₛ the scene's thresholds, and S the sum of the weights of the
/// shaded samples. If the ray ended early, T' = min(T, Tₛ) is left of it; otherwise T' = T. The weights
/// of the shaded samples are multiplied by 1 + (T − T' + Σ w) / S, over the samples that are not shaded and whose
/// weight exceeds wₛ. The background shows with T', and opacity is 1 − T'. If no sample is shaded, nothing changes;
/// with the scene's own thresholds no bit does.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Approximation {
    /// The factor by which march steps, and the intervals they stand for, are longer than the scene's, 0.25 to 64.
    pub step_scale: f64,
    /// The weight that a sample must exceed to be shaded, in [0, 1); `None`: the scene's.
    pub min_weight: Option<f64>,
    /// The transmittance below which rays end, in [0, 1); `None`: the scene's.
    pub min_transmittance: Option<f64>,
    /// The decoder's mode; `None`: the scene's.
    pub decoder: Option<DecoderMode>,
}

impl Default for Approximation {
    fn default() -> Self {
        Self { step_scale: 1.0, min_weight: None, min_transmittance: None, decoder: None }
    }
}

/// The thresholds of a scene's own rules, where an approximation may raise them (see [`Approximation`]).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct OwnThresholds {
    pub(super) min_weight: f64,
    pub(super) min_transmittance: f64,
}

impl OwnThresholds {
    /// The thresholds of `rules`.
    pub(super) fn of(rules: &Rules) -> Self {
        Self { min_weight: rules.min_weight, min_transmittance: rules.min_transmittance }
    }
}

impl Approximation {
    /// True if no approximation is on.
    pub fn is_exact(&self) -> bool {
        *self == Self::default()
    }

    /// Checks every option against `scene`.
    ///
    /// # Errors
    ///
    /// If an option is out of range. The error names the first one.
    pub fn check(&self, scene: &Scene) -> Result<(), Invalid> {
        if let Some(mode) = self.decoder.filter(|mode| scene.features() < mode.min_features()) {
            let [features, needed] = [scene.features(), mode.min_features()];
            let expected = format!("a mode for {features} appearance features");
            let found = format!("{}, which needs {needed}", mode.name());
            return Err(Invalid::new(Place::option("decoder"), expected, found));
        }
        let fraction = |v: f64| (0.0..1.0).contains(&v);
        for (option, value, valid, expected) in [
            ("step_scale", Some(self.step_scale), (0.25..=64.0).contains(&self.step_scale), "0.25 to 64"),
            ("min_weight", self.min_weight, self.min_weight.is_none_or(fraction), "a number in [0, 1)"),
            (
                "min_transmittance",
                self.min_transmittance,
                self.min_transmittance.is_none_or(fraction),
                "a number in [0, 1)",
            ),
        ] {
            if let Some(found) = value.filter(|_| !valid) {
                return Err(Invalid::new(Place::option(option), expected, found));
            }
        }
        Ok(())
    }

    /// Applies what a scene can store: every approximation except raised thresholds, which need the scene's own.
    /// `scene` must have passed [`Scene::check`] and [`Self::check`].
    pub fn applied(&self, mut scene: Scene) -> Scene {
        let own = self.reduce(&mut scene);
        let rules = &mut scene.rules;
        rules.min_weight = rules.min_weight.min(own.min_weight);
        rules.min_transmittance = rules.min_transmittance.min(own.min_transmittance);
        scene
    }

    /// True if a threshold is above that of `scene`.
    pub fn raises_thresholds(&self, scene: &Scene) -> bool {
        let own = OwnThresholds::of(&scene.rules);
        self.min_weight.is_some_and(|w| w > own.min_weight)
            || self.min_transmittance.is_some_and(|t| t > own.min_transmittance)
    }

    /// Applies every approximation to `scene`. Returns the thresholds it had.
    pub(super) fn reduce(&self, scene: &mut Scene) -> OwnThresholds {
        let own = OwnThresholds::of(&scene.rules);
        let rules = &mut scene.rules;
        rules.step *= self.step_scale;
        rules.min_weight = self.min_weight.unwrap_or(rules.min_weight);
        rules.min_transmittance = self.min_transmittance.unwrap_or(rules.min_transmittance);
        scene.decoder.mode = self.decoder.unwrap_or(scene.decoder.mode);
        own
    }
}
