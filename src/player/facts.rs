//! Facts about a file, as text for the panel.

use strivec_format::container::{Contents, SceneFile};
use strivec_format::digits::grouped;
use strivec_format::escape::escaped;
use strivec_format::model::Coverage;

/// A line of the panel.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fact {
    /// Subject of the line.
    pub name: String,
    /// Text of the line; untrusted texts are escaped.
    pub value: String,
}

/// The facts of a file of `bytes` bytes.
pub fn facts(file: &SceneFile, contents: &Contents, bytes: u64) -> Vec<Fact> {
    let scene = &file.scene;
    let provenance = &scene.provenance;
    let tensors: usize = scene.scales.iter().map(|s| s.cloud.len()).sum();
    let mut facts = vec![
        fact("file", format!("{:.2} MB", bytes as f64 / 1e6)),
        fact("version", format!("{}.{}", contents.version.major, contents.version.minor)),
        fact("parameters", millions(scene.parameter_count())),
        fact("tensors", grouped(tensors as u64)),
    ];
    for (n, scale) in scene.scales.iter().enumerate() {
        let [x, y, z] = (2.0 * scale.cloud.half_edge).to_array();
        let [dx, dy, dz] = scale.cloud.resolution;
        let factors = &scale.factors;
        let value = format!(
            "{} of {x:.3} x {y:.3} x {z:.3}, {dx} x {dy} x {dz} cells, ranks {} + {}, top-k {}",
            grouped(scale.cloud.len() as u64),
            factors.density_rank(),
            factors.appearance_rank(),
            scale.top_k
        );
        facts.push(fact(&format!("scale {n}"), value));
    }
    let coverage = match scene.rules.coverage {
        Coverage::All => "every scale covers",
        Coverage::Any => "any scale covers",
    };
    facts.push(fact("field", format!("where {coverage}, decoded {}", scene.decoder.mode.name())));
    if let Some(sky) = &scene.rules.sky {
        facts.push(fact("sky", format!("degree {}", sky.degree)));
    }
    if let Some(quality) = &file.metadata.quality {
        let decibels = |value: Option<f64>| value.map(|v| format!("{v:.2} dB"));
        if let Some(value) = decibels(quality.encoded) {
            facts.push(fact("encoding", format!("{value} against pictures before encoding")));
        }
        if let Some(value) = decibels(quality.test) {
            facts.push(fact("test views", format!("{value}, {}", quality.dataset)));
        }
    }
    for (name, value) in [
        ("dataset", provenance.dataset.clone()),
        ("preset", provenance.preset.clone()),
        ("steps", if provenance.steps > 0 { grouped(provenance.steps) } else { String::new() }),
        ("made by", provenance.tool.clone()),
        ("license", file.metadata.license.clone().unwrap_or_default()),
    ] {
        if !value.is_empty() {
            facts.push(fact(name, value));
        }
    }
    facts.extend(file.metadata.skipped.iter().map(|skipped| fact("warning", skipped.to_string())));
    facts
}

fn fact(name: &str, value: String) -> Fact {
    const MAX_CHARACTERS: usize = 200;
    Fact { name: name.to_owned(), value: escaped(&value).chars().take(MAX_CHARACTERS).collect() }
}

fn millions(count: u64) -> String {
    format!("{:.2} million", count as f64 / 1e6)
}
