//! A way to render, as it is swept: everything that can be traded, and its name.

use serde::{Deserialize, Serialize};

use crate::cli::backend::Backend;
use crate::render::{Approximation, RenderSettings};

/// A point of the sweep. All of it decides which it is.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct Candidate {
    /// Which of the scenes: the file's own is 0.
    pub(super) source: usize,
    pub(super) settings: RenderSettings,
    pub(super) engine: Engine,
    pub(super) threads: usize,
}

/// What computes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Engine {
    pub(super) backend: Backend,
    pub(super) half: bool,
}

impl Engine {
    pub(super) const CPU: Self = Self { backend: Backend::Cpu, half: false };

    /// As a file's note has it.
    pub(super) fn name(self) -> &'static str {
        match (self.backend, self.half) {
            (Backend::Cpu, _) => "cpu",
            (Backend::CpuF64, _) => "cpu-f64",
            (Backend::Gpu, false) => "gpu",
            (Backend::Gpu, true) => "gpu-half",
            (Backend::Reference, _) => "reference",
        }
    }
}

impl Candidate {
    /// What tells it from `base`, in words; `sources` are the scenes' names.
    pub(super) fn name(&self, base: &Self, sources: &[String]) -> String {
        let mut parts = Vec::new();
        if self.source != base.source {
            parts.push(sources[self.source].clone());
        }
        let Approximation { neighbors, scales, components, step_scale, .. } = self.settings.approximation;
        let Approximation { min_weight, min_transmittance, decoder, density_cache, .. } = self.settings.approximation;
        parts.extend(neighbors.map(|n| format!("M {n}")));
        parts.extend(scales.map(|n| format!("scales {n}")));
        parts.extend(components.map(|share| format!("components {:.0} %", 100.0 * share)));
        if step_scale != 1.0 {
            parts.push(format!("step x{step_scale}"));
        }
        parts.extend(min_weight.map(|w| format!("color > {w}")));
        parts.extend(min_transmittance.map(|t| format!("end < {t}")));
        parts.extend(decoder.map(|mode| format!("decoder {}", mode.name())));
        parts.extend(density_cache.map(|cells| format!("cache {cells}")));
        if self.settings.divisor != 1 {
            parts.push(format!("1/{} size", self.settings.divisor));
        }
        if self.engine != base.engine {
            parts.push(self.engine.name().to_owned());
        }
        if self.threads != base.threads {
            parts.push(format!("{} threads", self.threads));
        }
        if parts.is_empty() { "exact".to_owned() } else { parts.join(", ") }
    }
}
