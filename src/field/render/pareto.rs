//! Render settings on the Pareto front of time and PSNR, as `strivec trade` measures them and stores them in a file's
//! notes.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::Approximation;
use strivec_format::Invalid;
use strivec_format::psnr::psnr_of_mse;

/// The key of the note.
pub const TRADE_NOTE: &str = "trade";
/// Version of the note's format.
const VERSION: u32 = 1;
/// Largest PSNR loss, in dB, of the settings named `fast`.
const FAST_LOSS: f64 = 2.0;
/// Largest number of points of a stored front.
const MAX_POINTS: usize = 256;

/// Fields that approximations had once. Notes of that time hold them, as null in points that do not use them.
const REMOVED: [&str; 4] = ["top_k", "scales", "components", "density_cache"];

/// Settings of a renderer.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RenderSettings {
    /// Approximations of the field and the march.
    pub approximation: Approximation,
    /// Pictures are rendered this many times smaller and upsampled bilinearly.
    pub divisor: u32,
}

impl Default for RenderSettings {
    fn default() -> Self {
        Self { approximation: Approximation::default(), divisor: 1 }
    }
}

/// Render settings with their time and PSNR.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ParetoPoint {
    /// The point's names, of `fast`, `balanced` and `best`. Each name belongs to one point.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub names: Vec<String>,
    /// The render settings.
    pub settings: RenderSettings,
    /// The median time of a picture, in milliseconds.
    pub milliseconds: f64,
    /// PSNR in dB, the mean over the views.
    pub psnr: f64,
}

/// The settings that no other dominates in time and PSNR, fastest first.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ParetoFront {
    /// Version of the note's format, 1.
    pub version: u32,
    /// The machine of the measurement, with its number of threads or its graphics device.
    pub machine: String,
    /// The renderer: `cpu`, `gpu` or `gpu-half`.
    pub backend: String,
    /// Columns and rows of the pictures.
    pub size: [u32; 2],
    /// The ground truth of the PSNR: a dataset and split, or the scene's own pictures.
    pub against: String,
    /// The points of the front, fastest first.
    pub points: Vec<ParetoPoint>,
}

/// Selection of a point of a [`ParetoFront`].
#[derive(Clone, Debug, PartialEq)]
pub enum QualitySelector {
    /// The settings of this name.
    Name(String),
    /// The settings of the highest PSNR that reach this number of pictures per second.
    FramesPerSecond(f64),
    /// The fastest settings of at least this PSNR, in dB.
    Psnr(f64),
}

impl ParetoFront {
    /// The front in a file's `notes`; `None` if there is none.
    ///
    /// # Errors
    ///
    /// If the note is not a valid front of version 1.
    pub fn from_notes(notes: &BTreeMap<String, String>) -> Option<Result<Self, Invalid>> {
        notes.get(TRADE_NOTE).map(|text| Self::parse(text))
    }

    fn parse(text: &str) -> Result<Self, Invalid> {
        let note = format!("note {TRADE_NOTE}");
        let trade: Self = serde_json::from_str(text)
            .and_then(|mut front| {
                drop_removed(&mut front);
                serde_json::from_value(front)
            })
            .map_err(|e| Invalid::new(&note, "a Pareto front as JSON", e))?;
        if trade.version != VERSION {
            return Err(Invalid::new(note + " version", VERSION.to_string(), trade.version));
        }
        if !(1..=MAX_POINTS).contains(&trade.points.len()) {
            return Err(Invalid::new(note + " points", format!("1 to {MAX_POINTS}"), trade.points.len()));
        }
        for (n, point) in trade.points.iter().enumerate() {
            let ParetoPoint { settings: RenderSettings { divisor, .. }, milliseconds, psnr, .. } = *point;
            if !(milliseconds > 0.0 && milliseconds.is_finite() && psnr.is_finite() && (1..=16).contains(&divisor)) {
                let found = format!("{milliseconds} ms, {psnr} dB, divisor {divisor}");
                return Err(Invalid::new(
                    format!("{note} point {n}"),
                    "a positive time, a finite PSNR and a divisor of 1 to 16",
                    found,
                ));
            }
        }
        Ok(trade)
    }

    /// The front as the text of a note.
    pub fn to_note(&self) -> String {
        serde_json::to_string(self).expect("plain data")
    }

    /// A front of `points`, none of which dominates another, fastest first. Names three of them: `best` has the highest
    /// PSNR; `fast` is the fastest within 2 dB of it; `balanced` is the farthest above the line between these two.
    ///
    /// For these names, `scene_error` is added to the points' mean squared errors: 0 if the points were compared with
    /// photographs; the approximate mean squared error of the scene if they were compared with the scene's own
    /// pictures.
    pub fn new(
        machine: String,
        backend: String,
        size: [u32; 2],
        against: String,
        mut points: Vec<ParetoPoint>,
        scene_error: f64,
    ) -> Self {
        points.truncate(MAX_POINTS);
        if let Some(chosen) = named(&points, scene_error) {
            for (name, n) in ["fast", "balanced", "best"].into_iter().zip(chosen) {
                points[n].names.push(name.to_owned());
            }
        }
        Self { version: VERSION, machine, backend, size, against, points }
    }

    /// The point that `selector` selects for pictures of `size` pixels.
    ///
    /// # Errors
    ///
    /// If no point matches.
    pub fn pick(&self, selector: &QualitySelector, size: [u32; 2]) -> Result<&ParetoPoint, Invalid> {
        let pixels = |[width, height]: [u32; 2]| f64::from(width) * f64::from(height);
        // Time is proportional to the number of pixels.
        let scale = pixels(size) / pixels(self.size).max(1.0);
        let all = || {
            let points = self.points.iter();
            points
                .map(|p| format!("{:.1} ms at {:.2} dB", scale * p.milliseconds, p.psnr))
                .collect::<Vec<_>>()
                .join(", ")
        };
        match selector {
            QualitySelector::Name(name) => {
                let names = || self.points.iter().flat_map(|p| p.names.clone()).collect::<Vec<_>>().join(", ");
                let found = self.points.iter().find(|p| p.names.contains(name));
                found.ok_or_else(|| Invalid::new("the quality", format!("one of {}", names()), name))
            }
            QualitySelector::FramesPerSecond(fps) => {
                let fast = self.points.iter().filter(|p| scale * p.milliseconds * fps <= 1000.0);
                let best = fast.max_by(|a, b| a.psnr.total_cmp(&b.psnr));
                best.ok_or_else(|| {
                    Invalid::new(
                        "the number of frames per second",
                        format!("one that a stored point reaches ({})", all()),
                        fps,
                    )
                })
            }
            QualitySelector::Psnr(least) => {
                let good = self.points.iter().filter(|p| p.psnr >= *least);
                let fastest = good.min_by(|a, b| a.milliseconds.total_cmp(&b.milliseconds));
                fastest.ok_or_else(|| {
                    Invalid::new("the least PSNR", format!("one that a stored point reaches ({})", all()), least)
                })
            }
        }
    }
}

/// Drops [`REMOVED`] fields from the `front` of a note, and the points that use one of them.
fn drop_removed(front: &mut Value) {
    let Some(points) = front.get_mut("points").and_then(Value::as_array_mut) else { return };
    points.retain_mut(|point| {
        let fields = point.pointer_mut("/settings/approximation").and_then(Value::as_object_mut);
        fields.is_none_or(|fields| REMOVED.iter().all(|name| fields.remove(*name).is_none_or(|value| value.is_null())))
    });
}

/// The indices of the points of a front named fast, balanced and best; `None` if there are no points.
fn named(points: &[ParetoPoint], scene_error: f64) -> Option<[usize; 3]> {
    let psnrs: Vec<f64> = points.iter().map(|p| psnr_of_mse(10f64.powf(-p.psnr / 10.0) + scene_error)).collect();
    let best = (0..points.len()).max_by(|&a, &b| psnrs[a].total_cmp(&psnrs[b]))?;
    let fast = psnrs.iter().position(|p| *p >= psnrs[best] - FAST_LOSS)?;
    let logarithms: Vec<f64> = points.iter().map(|p| p.milliseconds.ln()).collect();
    let part = |of: &[f64], n: usize| {
        let (from, to) = (of[fast], of[best]);
        if to > from { (of[n] - from) / (to - from) } else { 0.0 }
    };
    let above = |n: usize| part(&psnrs, n) - part(&logarithms, n);
    let balanced = (fast..=best).max_by(|&a, &b| above(a).total_cmp(&above(b)))?;
    Some([fast, balanced, best])
}

#[cfg(test)]
mod tests {
    use super::*;

    fn trade() -> ParetoFront {
        let point = |milliseconds, psnr| ParetoPoint {
            names: Vec::new(),
            settings: RenderSettings::default(),
            milliseconds,
            psnr,
        };
        let points =
            vec![point(10.0, 20.0), point(20.0, 33.0), point(30.0, 34.5), point(90.0, 34.6), point(100.0, 35.0)];
        ParetoFront::new("a machine".into(), "cpu".into(), [80, 60], "lego, test".into(), points, 0.0)
    }

    #[test]
    fn points_get_their_names_and_come_back_from_a_note() {
        let trade = trade();
        let names: Vec<_> = trade.points.iter().map(|p| p.names.join(" ")).collect();
        assert_eq!(names, ["", "fast", "balanced", "", "best"]);
        let notes = BTreeMap::from([(TRADE_NOTE.to_owned(), trade.to_note())]);
        assert_eq!(ParetoFront::from_notes(&notes), Some(Ok(trade)));
        assert_eq!(ParetoFront::from_notes(&BTreeMap::new()), None);
        let alone = ParetoFront::new(String::new(), String::new(), [1, 1], String::new(), vec![notes_point()], 0.0);
        assert_eq!(alone.points[0].names, ["fast", "balanced", "best"]);
    }

    #[test]
    fn points_are_named_by_what_photographs_would_show() {
        // The scene's own pictures are matched to many dB, which photographs do not show.
        let mut points = trade().points;
        for (point, psnr) in points.iter_mut().zip([20.0, 41.0, 50.0, 58.0, 99.0]) {
            (point.psnr, point.names) = (psnr, Vec::new());
        }
        let own = ParetoFront::new(String::new(), String::new(), [1, 1], String::new(), points, 10f64.powf(-3.6));
        let names: Vec<_> = own.points.iter().map(|p| p.names.join(" ")).collect();
        assert_eq!(names, ["", "fast", "balanced", "", "best"]);
    }

    fn notes_point() -> ParetoPoint {
        trade().points.swap_remove(0)
    }

    #[test]
    fn points_are_selected_or_refused_with_a_list_of_all() {
        let trade = trade();
        let pick = |wish: QualitySelector, size| trade.pick(&wish, size).map(|p| p.milliseconds);
        assert_eq!(pick(QualitySelector::Name("fast".into()), [80, 60]), Ok(20.0));
        assert_eq!(pick(QualitySelector::FramesPerSecond(30.0), [80, 60]), Ok(30.0));
        assert_eq!(
            pick(QualitySelector::FramesPerSecond(30.0), [160, 60]),
            Ok(10.0),
            "twice as many pixels take twice as long"
        );
        assert_eq!(pick(QualitySelector::Psnr(34.0), [160, 60]), Ok(30.0));
        for wish in
            [QualitySelector::Name("wild".into()), QualitySelector::FramesPerSecond(200.0), QualitySelector::Psnr(40.0)]
        {
            let error = pick(wish, [80, 60]).unwrap_err();
            assert!(error.expected.contains("fast, balanced, best") || error.expected.contains("35.00 dB"), "{error}");
        }
    }

    #[test]
    fn stored_points_that_use_removed_settings_are_left_out() {
        let trade = trade();
        let with = |note: &str, text: String| note.replacen("\"step_scale\"", &(text + ",\"step_scale\""), 1);
        for name in REMOVED {
            let (off, on) = (format!("\"{name}\":null"), format!("\"{name}\":2"));
            assert_eq!(ParetoFront::parse(&with(&trade.to_note(), off)).as_ref(), Ok(&trade));
            let rest = ParetoFront::parse(&with(&trade.to_note(), on)).unwrap();
            assert_eq!(rest.points, trade.points[1..]);
        }
    }

    #[test]
    fn notes_that_are_no_trade_are_named() {
        let note = trade().to_note();
        for (from, to) in [
            ("\"version\":1", "\"version\":2"),
            ("\"milliseconds\":10.0", "\"milliseconds\":-1.0"),
            ("\"divisor\":1", "\"divisor\":99"),
            ("\"points\":[", "\"points\":[[]"),
            ("\"backend\"", "\"backhand\""),
        ] {
            assert!(note.contains(from), "{from} in {note}");
            let error = ParetoFront::parse(&note.replacen(from, to, 1)).unwrap_err();
            assert!(error.place.to_string().starts_with("note trade"), "{error}");
        }
    }
}
