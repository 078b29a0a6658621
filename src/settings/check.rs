//! Ranges of settings that their types do not express.

use std::ops::RangeInclusive;

use glam::DVec3;

use super::{
    BootstrapOptions, ConfigError, DecoderConfig, FinishConfig, LeanConfig, PhotographConfig, ScaleConfig, SpaceConfig,
    TrainConfig,
};
use strivec_format::container::{FEATURES, FREQUENCIES, LAYER_WIDTH, LAYERS, RANK, RESOLUTION};
use strivec_format::geometry::Aabb;
use strivec_format::model::Sky;
use strivec_format::{Invalid, Place};

/// Rays of a step: of a million, rays, gradients and samples take some gigabytes.
const BATCH_RAYS: RangeInclusive<u64> = 1..=1 << 20;
/// The most candidates for a ray of a step.
const MAX_CANDIDATES: u32 = 16;

impl TrainConfig {
    /// Checks that all values are in range.
    ///
    /// # Errors
    ///
    /// If a field is out of range; the error names the first such field.
    pub fn check(&self) -> Result<(), ConfigError> {
        for (place, value) in [
            ("schedule.steps", self.schedule.steps as f64),
            ("optimizer.factor_learning_rate", self.optimizer.factor_learning_rate),
            ("optimizer.network_learning_rate", self.optimizer.network_learning_rate),
            ("optimizer.sky_learning_rate", self.optimizer.sky_learning_rate),
            ("optimizer.learning_rate_decay", self.optimizer.learning_rate_decay),
            ("optimizer.factor_deviation", self.optimizer.factor_deviation),
            ("space.half_extent", self.space.half_extent),
        ] {
            positive(place, value)?;
        }
        within("sampling.batch_rays", BATCH_RAYS, self.sampling.batch_rays as u64)?;
        let DecoderConfig { features, feature_frequencies, direction_frequencies, hidden, .. } = &self.decoder;
        within("decoder.features", FEATURES, (*features).into())?;
        within("decoder.feature_frequencies", FREQUENCIES, (*feature_frequencies).into())?;
        within("decoder.direction_frequencies", FREQUENCIES, (*direction_frequencies).into())?;
        hidden.iter().try_for_each(|&width| within("decoder.hidden", LAYER_WIDTH, width.into()))?;
        if hidden.len() as u64 >= *LAYERS.end() {
            return Err(error("decoder.hidden", &format!("fewer than {} widths", LAYERS.end()), hidden.len()));
        }
        let least = self.decoder.mode.min_features();
        if self.decoder.features < least {
            let expected = format!("at least {least} if `decoder.mode` is {}", self.decoder.mode.name());
            return Err(error("decoder.features", &expected, self.decoder.features));
        }
        for (place, value) in [
            ("optimizer.factor_decay", self.optimizer.factor_decay),
            ("loss.density_l1", self.loss.density_l1),
            ("loss.density_variation", self.loss.density_variation),
            ("loss.appearance_variation", self.loss.appearance_variation),
            ("loss.distance_weight", self.loss.distance_weight),
            ("sampling.color_roulette", self.sampling.color_roulette),
            ("sampling.density_roulette", self.sampling.density_roulette),
            ("lean.max_loss", self.lean.max_loss),
        ] {
            if !(value >= 0.0 && value.is_finite()) {
                return Err(error(place, "a number of at least 0", value));
            }
        }
        let LeanConfig { during: [from, until], rounds, .. } = self.lean;
        if !(from >= 0.0 && from < until && until <= 1.0) {
            return Err(error("lean.during", "two ascending numbers in [0, 1]", format!("{from} and {until}")));
        }
        positive("lean.rounds", f64::from(rounds))?;
        if !(0.0..=1.0).contains(&self.optimizer.cooldown) {
            return Err(error("optimizer.cooldown", "a number in [0, 1]", self.optimizer.cooldown));
        }
        let FinishConfig { from, min_transmittance, min_weight, min_alpha, max_loss } = self.finish;
        positive("finish.max_loss", max_loss)?;
        for (place, value) in [
            ("finish.from", from),
            ("finish.min_transmittance", min_transmittance),
            ("finish.min_weight", min_weight),
            ("finish.min_alpha", min_alpha),
        ] {
            if !(0.0..=1.0).contains(&value) {
                return Err(error(place, "a number in [0, 1]", value));
            }
        }
        let candidates = self.sampling.ray_candidates;
        if !(1..=MAX_CANDIDATES).contains(&candidates) {
            return Err(error("sampling.ray_candidates", &format!("1 to {MAX_CANDIDATES}"), candidates));
        }
        self.check_model()?;
        self.space.check()?;
        self.photographs.check()?;
        self.bootstrap.check()?;
        if self.scales.is_empty() {
            return Err(error("scales", "a list of at least one scale", "empty"));
        }
        self.scales.iter().enumerate().try_for_each(|(i, scale)| scale.check(i, self.schedule.upsample_at.len()))
    }

    /// Checks the rules of the field.
    fn check_model(&self) -> Result<(), ConfigError> {
        let bounds = self.model.contraction.map_or(Aabb { min: DVec3::ZERO, max: DVec3::ONE }, |c| c.bounds());
        if self.model.sky.is_some() {
            return Err(error("model.sky", "absent, as `photographs.sky_degree` sets the sky", "a sky"));
        }
        self.model.check(&bounds).map_err(|broken| {
            let field = broken.place.to_string().trim_start_matches("rules ").replace("'s ", ".");
            error(&format!("model.{field}"), &broken.expected, broken.found)
        })
    }
}

impl SpaceConfig {
    /// Checks that all values are in range.
    fn check(&self) -> Result<(), ConfigError> {
        if let Some([near, far]) = self.near_far
            && !(near >= 0.0 && near < far && far.is_finite())
        {
            return Err(error("space.near_far", "two numbers with 0 <= near < far", format!("{near} and {far}")));
        }
        if let Some([min, max]) = self.inner_box
            && !(Aabb { min, max }).is_solid()
        {
            return Err(error("space.inner_box", "a finite box of positive size", format!("{min} to {max}")));
        }
        Ok(())
    }
}

impl PhotographConfig {
    /// Checks that all values are in range.
    fn check(&self) -> Result<(), ConfigError> {
        if !self.background.iter().all(|c| (0.0..=1.0).contains(c)) {
            let found = format!("{:?}", self.background);
            return Err(error("photographs.background", "three numbers in [0, 1]", found));
        }
        let sky_degree = self.sky_degree.unwrap_or(0);
        if sky_degree > Sky::MAX_DEGREE {
            return Err(error("photographs.sky_degree", &format!("0 to {}", Sky::MAX_DEGREE), sky_degree));
        }
        if sky_degree > 0 && self.random_background {
            let expected = "0 if `photographs.random_background` is on, as a sky has one color in a direction";
            return Err(error("photographs.sky_degree", expected, sky_degree));
        }
        Ok(())
    }
}

impl ScaleConfig {
    /// Checks the scale of index `i` in a run with this many upsamplings.
    fn check(&self, i: usize, upsamplings: usize) -> Result<(), ConfigError> {
        let place = |field: &str| format!("scales[{i}].{field}");
        for a in 0..3 {
            positive(&place("pitch"), self.pitch[a])?;
            positive(&place("edge"), self.edge[a])?;
            if self.edge[a] < self.pitch[a] {
                let expected =
                    format!("at least the pitch {}, as there are gaps between tensors otherwise", self.pitch[a]);
                return Err(error(&place("edge"), &expected, self.edge[a]));
            }
        }
        within(&place("density_rank"), RANK, self.density_rank.into())?;
        within(&place("appearance_rank"), RANK, self.appearance_rank.into())?;
        if self.resolutions.len() != upsamplings + 1 {
            let expected = format!("a list of {}, one more than `schedule.upsample_at` has", upsamplings + 1);
            return Err(error(&place("resolutions"), &expected, self.resolutions.len()));
        }
        self.resolutions.iter().flatten().try_for_each(|&d| within(&place("resolutions"), RESOLUTION, d.into()))
    }
}

impl BootstrapOptions {
    /// Checks that all values are in range.
    pub fn check(&self) -> Result<(), ConfigError> {
        let is_fraction = |v: f64| (0.0..1.0).contains(&v);
        let are_steps_valid =
            (1..=4).contains(&self.steps.len()) && !self.steps.contains(&0) && self.total_steps() <= 1 << 30;
        for (field, is_valid, expected, found) in [
            (
                "steps",
                are_steps_valid,
                "1 to 4 positive numbers with a sum of at most 2^30",
                format!("{:?}", self.steps),
            ),
            ("batch_rays", BATCH_RAYS.contains(&(self.batch_rays as u64)), "1 to 1048576", self.batch_rays.to_string()),
            ("components", (1..=256).contains(&self.components), "1 to 256", self.components.to_string()),
            ("resolution", (8..=256).contains(&self.resolution), "8 to 256", self.resolution.to_string()),
            ("occupied_alpha", is_fraction(self.occupied_alpha), "in [0, 1)", self.occupied_alpha.to_string()),
            (
                "min_visibility_weight",
                is_fraction(self.min_visibility_weight),
                "in [0, 1)",
                self.min_visibility_weight.to_string(),
            ),
            ("visibility_rays", self.visibility_rays > 0, "at least 1", self.visibility_rays.to_string()),
        ] {
            if !is_valid {
                return Err(error(&format!("bootstrap.{field}"), expected, found));
            }
        }
        Ok(())
    }
}

/// Fails unless `found` lies within `range`, so that nothing whose size a setting declares is made that no file can hold.
fn within(place: &str, range: RangeInclusive<u64>, found: u64) -> Result<(), ConfigError> {
    if range.contains(&found) {
        return Ok(());
    }
    Err(error(place, &format!("{} to {}", range.start(), range.end()), found))
}

fn positive(place: &str, value: f64) -> Result<(), ConfigError> {
    if value > 0.0 && value.is_finite() { Ok(()) } else { Err(error(place, "a positive number", value)) }
}

fn error(place: &str, expected: &str, found: impl ToString) -> ConfigError {
    Invalid::new(Place::Option(place.to_owned().into()), expected, found.to_string()).into()
}
