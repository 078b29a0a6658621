//! A candidate of the sweep: a scene, render settings, a renderer and a number of threads; and its name.

use serde::{Deserialize, Serialize};

use crate::backend::Backend;
use crate::table::plural;
use strivec_field::render::{Approximation, RenderSettings};

/// A candidate of the sweep. Two are the same if all fields are equal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Candidate {
    /// Number of the scene; 0 is the file's own.
    pub(super) source: usize,
    pub(super) settings: RenderSettings,
    pub(super) engine: Engine,
    pub(super) threads: usize,
}

/// The renderer and its arithmetic.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Engine {
    pub(super) backend: Backend,
    pub(super) half: bool,
}

impl Engine {
    pub(super) const CPU: Self = Self { backend: Backend::Cpu, half: false };

    /// The name in the file's note and in tables.
    pub(super) fn name(self) -> &'static str {
        match (self.backend, self.half) {
            (Backend::Cpu, _) => "cpu",
            (Backend::Gpu, false) => "gpu",
            (Backend::Gpu, true) => "gpu-half",
            (Backend::Reference, _) => "reference",
        }
    }
}

impl Candidate {
    /// The differences to `base` as text; `sources` are the scenes' names.
    pub(super) fn name(&self, base: &Self, sources: &[String]) -> String {
        let mut parts = Vec::new();
        if self.source != base.source {
            parts.push(sources[self.source].clone());
        }
        let Approximation { step_scale, min_weight, min_transmittance, decoder } = self.settings.approximation;
        if step_scale != 1.0 {
            parts.push(format!("step x{step_scale}"));
        }
        parts.extend(min_weight.map(|w| format!("weight > {w}")));
        parts.extend(min_transmittance.map(|t| format!("T < {t}")));
        parts.extend(decoder.map(|mode| format!("decoder {}", mode.name())));
        if self.settings.divisor != 1 {
            parts.push(format!("1/{} size", self.settings.divisor));
        }
        if self.engine != base.engine {
            parts.push(self.engine.name().to_owned());
        }
        if self.threads != base.threads {
            parts.push(plural(self.threads, "thread"));
        }
        if parts.is_empty() { "exact".to_owned() } else { parts.join(", ") }
    }
}
