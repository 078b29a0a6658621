//! The search space: the values of each knob alone, then the combinations that could lie on the Pareto front.

use super::candidate::{Candidate, Engine};
use super::measured::Measured;
use strivec_field::render::{Approximation, RenderSettings};
use strivec_format::model::{DecoderMode, Scene};

/// A knob: one setting that trades speed for quality, and its values besides the exact one.
pub(super) struct Knob {
    pub(super) name: &'static str,
    pub(super) candidates: Vec<Candidate>,
}

/// The scene, sources, engines and numbers of threads that a sweep combines.
pub(super) struct SearchSpace<'a> {
    /// The candidate that all others are compared with: the file as it is, on all threads.
    pub(super) base: Candidate,
    pub(super) scene: &'a Scene,
    /// Number of scenes: the file's own, those of other files and of other encodings.
    pub(super) sources: usize,
    pub(super) engines: Vec<Engine>,
    pub(super) threads: Vec<usize>,
}

/// All knobs. Each candidate differs from the base in one setting.
pub(super) fn knobs(space: &SearchSpace<'_>) -> Vec<Knob> {
    let SearchSpace { base, scene, sources, engines, threads } = space;
    let approximations = |name, values: Vec<Approximation>| Knob {
        name,
        candidates: (values.into_iter())
            .map(|approximation| Candidate { settings: RenderSettings { approximation, divisor: 1 }, ..base.clone() })
            .collect(),
    };
    let exact = Approximation::default();
    let mut all = vec![
        approximations("step", [1.5, 2.0, 3.0, 4.0].map(|by| Approximation { step_scale: by, ..exact }).into()),
        approximations(
            "smallest weight",
            [1e-3, 3e-3, 1e-2, 3e-2].map(|w| Approximation { min_weight: Some(w), ..exact }).into(),
        ),
        approximations(
            "termination",
            [1e-2, 3e-2, 1e-1].map(|t| Approximation { min_transmittance: Some(t), ..exact }).into(),
        ),
        approximations(
            "decoder",
            (DecoderMode::ALL.into_iter())
                .filter(|mode| *mode != scene.decoder.mode && scene.features() >= mode.min_features())
                .map(|mode| Approximation { decoder: Some(mode), ..exact })
                .collect(),
        ),
    ];
    let others = |name, candidates: Vec<Candidate>| Knob { name, candidates };
    all.push(others(
        "resolution",
        [2, 4]
            .map(|divisor| Candidate {
                settings: RenderSettings { divisor, ..RenderSettings::default() },
                ..base.clone()
            })
            .into(),
    ));
    all.push(others("file", (1..*sources).map(|source| Candidate { source, ..base.clone() }).collect()));
    all.push(others("arithmetic", engines.iter().map(|&engine| Candidate { engine, ..base.clone() }).collect()));
    all.push(others("threads", threads.iter().map(|&threads| Candidate { threads, ..base.clone() }).collect()));
    all.retain(|knob| !knob.candidates.is_empty());
    all
}

/// A value that may be combined with those of other knobs, and its measurement alone.
struct KnobValue {
    candidate: Candidate,
    /// Share of the base's time.
    time: f64,
    /// Mean squared error minus the base's.
    error: f64,
}

/// Largest share of the base's time of a value that is combined.
const MIN_GAIN: f64 = 0.97;
/// Largest loss of a combined value alone, in dB.
const MAX_LOSS: f64 = 6.0;
/// Number of values of a knob that are combined.
const VALUES: usize = 3;

/// Up to `most` combinations of values that could lie on the Pareto front, the likeliest first. The estimate multiplies
/// the shares of time and adds the errors of single values. `scene_error` is added to all errors: the scene's own mean
/// squared error if pictures are compared with the scene's exact pictures, else 0.
pub(super) fn combinations(
    knobs: &[Knob],
    base: &Measured,
    alone: &[(Candidate, Measured)],
    most: usize,
    scene_error: f64,
) -> Vec<Candidate> {
    let most_error = (base.error + scene_error) * 10f64.powf(MAX_LOSS / 10.0);
    // Threads and arithmetic depend on the machine and are measured alone.
    let combined = knobs.iter().filter(|knob| !matches!(knob.name, "threads" | "arithmetic"));
    let values: Vec<Vec<KnobValue>> = combined
        .map(|knob| {
            let measured = |c: &Candidate| alone.iter().find(|(other, _)| other == c).map(|(_, m)| m);
            let mut values: Vec<KnobValue> = (knob.candidates.iter())
                .filter_map(|candidate| {
                    let found = measured(candidate)?;
                    let (time, error) = (found.ratio, found.error - base.error);
                    let is_useful = time < MIN_GAIN && found.error + scene_error < most_error;
                    is_useful.then(|| KnobValue { candidate: candidate.clone(), time, error })
                })
                .collect();
            // Keep the values that save the most time per error.
            let worth = |value: &KnobValue| -value.time.ln() / value.error.max(1e-9);
            values.sort_by(|a, b| worth(b).total_cmp(&worth(a)));
            values.truncate(VALUES);
            values
        })
        .filter(|values| !values.is_empty())
        .collect();

    let mut found: Vec<(Candidate, f64, f64, usize)> = Vec::new();
    for values in &values {
        let mut more = Vec::new();
        for value in values {
            more.push((value.candidate.clone(), value.time, value.error, 1));
            more.extend(found.iter().filter_map(|(c, time, error, parts)| {
                Some((joined(c, &value.candidate)?, time * value.time, error + value.error, parts + 1))
            }));
        }
        found.extend(more);
    }
    // Single values are measured already.
    found.retain(|(_, _, _, parts)| *parts > 1);
    let mut chosen = Vec::new();
    // Take the front of the estimates, then the front of the rest, and so on.
    while chosen.len() < most && !found.is_empty() {
        found.sort_by(|a, b| a.1.total_cmp(&b.1).then(a.2.total_cmp(&b.2)));
        let (mut front, mut rest) = (Vec::new(), Vec::new());
        let mut least = f64::INFINITY;
        for entry in found {
            if entry.2 < least {
                least = entry.2;
                front.push(entry);
            } else {
                rest.push(entry);
            }
        }
        // Evenly along the front if it has more points than needed.
        let wanted = most - chosen.len();
        let step = (front.len() as f64 / wanted as f64).max(1.0);
        let picked = (0..front.len().min(wanted)).map(|n| front[(n as f64 * step) as usize].0.clone());
        chosen.extend(picked);
        found = rest;
    }
    chosen
}

/// The settings of both candidates; `None` if both set the same knob.
fn joined(a: &Candidate, b: &Candidate) -> Option<Candidate> {
    let (p, q) = (a.settings.approximation, b.settings.approximation);
    fn either<T>(a: Option<T>, b: Option<T>) -> Option<Option<T>> {
        match (a, b) {
            (Some(_), Some(_)) => None,
            (a, b) => Some(a.or(b)),
        }
    }
    let one = |a: f64, b: f64| if a != 1.0 && b != 1.0 { None } else { Some(a * b) };
    let approximation = Approximation {
        step_scale: one(p.step_scale, q.step_scale)?,
        min_weight: either(p.min_weight, q.min_weight)?,
        min_transmittance: either(p.min_transmittance, q.min_transmittance)?,
        decoder: either(p.decoder, q.decoder)?,
    };
    let divisor = one(f64::from(a.settings.divisor), f64::from(b.settings.divisor))? as u32;
    let source = match (a.source, b.source) {
        (0, source) | (source, 0) => source,
        _ => return None,
    };
    // Each file has its own decoder mode.
    if source != 0 && approximation.decoder.is_some() {
        return None;
    }
    Some(Candidate { source, settings: RenderSettings { approximation, divisor }, ..a.clone() })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bench::lab::Spread;
    use strivec_format::psnr::psnr_of_mse;

    #[test]
    fn losses_are_judged_relative_to_the_error_of_the_scene() {
        let base = Candidate { source: 0, settings: RenderSettings::default(), engine: Engine::CPU, threads: 1 };
        let with = |approximation| Candidate { settings: RenderSettings { approximation, divisor: 1 }, ..base.clone() };
        let exact = Approximation::default();
        let knob = |name, approximation| Knob { name, candidates: vec![with(approximation)] };
        let knobs = [
            knob("step", Approximation { step_scale: 2.0, ..exact }),
            knob("smallest weight", Approximation { min_weight: Some(0.01), ..exact }),
            knob("decoder", Approximation { decoder: Some(DecoderMode::Residual), ..exact }),
        ];
        let measured = |ratio, error| Measured {
            milliseconds: Spread::of(&[100.0 * ratio]).unwrap(),
            ratio,
            preparing_ms: 0.0,
            error,
            psnr: psnr_of_mse(error).min(99.0),
            ssim: None,
            largest: 0.0,
            memory_bytes: 1,
        };
        let alone: Vec<_> = (knobs.iter().zip([1e-5, 1e-4, 1e-2]))
            .map(|(knob, error)| (knob.candidates[0].clone(), measured(0.7, error)))
            .collect();
        // Compared with the scene's exact pictures; the scene has 36 dB.
        let of_own = combinations(&knobs, &measured(1.0, 0.0), &alone, 8, 2.5e-4);
        assert_eq!(of_own.len(), 1);
        let RenderSettings { approximation, .. } = of_own[0].settings;
        assert_eq!((approximation.step_scale, approximation.min_weight), (2.0, Some(0.01)));
        assert_eq!(approximation.decoder, None, "it loses more than 6 dB");
    }
}
