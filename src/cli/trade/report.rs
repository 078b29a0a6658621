//! The result of a sweep as a table, JSON, CSV, plots and pictures.

use std::path::Path;

use serde::Serialize;

use super::candidate::Candidate;
use super::measured::{Measured, SAME};
use super::pareto::front;
use super::plot::{self, Plot};
use super::sweep::SweepScene;
use super::views::SweepCameras;
use crate::evaluation::quoted;
use crate::render::colors;
use crate::table::Table;
use crate::{Context, Error, write_atomically};
use strivec_field::render::{ParetoFront, ParetoPoint, upsample_bilinear};
use strivec_format::escape::escaped;
use strivec_measure::{ERROR_FULL, Sheet, color_png, error_map, side_by_side, stacked};

/// How to read the times of the table.
const TIMES_NOTE: &str = "
* no other point is both faster and better
time: share of the exact picture's time, median over rounds; ms: this share of the exact picture's median; \
quartiles: as measured
";

/// All measurements.
#[derive(Serialize)]
pub(super) struct Report {
    pub(super) file: String,
    /// The dataset and split, or the scene's own pictures, that pictures were compared with.
    pub(super) against: String,
    pub(super) size: [u32; 2],
    pub(super) machine: String,
    pub(super) rows: Vec<Row>,
    /// The Pareto front of the first backend, as `--store` writes it.
    pub(super) front: ParetoFront,
}

/// A candidate and its measurement.
#[derive(Serialize)]
pub(super) struct Row {
    /// The knob that the candidate changes.
    knob: &'static str,
    name: String,
    /// Size of its scene's file.
    bytes: u64,
    /// No other candidate is both faster and better.
    is_on_time_front: bool,
    /// No other candidate has both a smaller file and a better picture.
    is_on_size_front: bool,
    #[serde(flatten)]
    measured: Measured,
    candidate: Candidate,
}

impl Row {
    /// Rows from knobs, candidates and measurements; `sources` are the scenes.
    pub(super) fn all(
        measured: Vec<(&'static str, Candidate, Measured)>,
        base: &Candidate,
        sources: &[SweepScene],
    ) -> Vec<Self> {
        let names: Vec<String> = sources.iter().map(|source| source.name.clone()).collect();
        let front_by = |x: &dyn Fn(&(&'static str, Candidate, Measured)) -> f64| {
            front(&measured.iter().map(|row| [x(row), row.2.psnr]).collect::<Vec<_>>())
        };
        let by_time = front_by(&|row| row.2.ratio);
        let by_size = front_by(&|row| sources[row.1.source].bytes as f64);
        (measured.into_iter().enumerate())
            .map(|(n, (knob, candidate, measured))| Self {
                knob,
                name: candidate.name(base, &names),
                bytes: sources[candidate.source].bytes,
                is_on_time_front: by_time.contains(&n),
                is_on_size_front: by_size.contains(&n),
                measured,
                candidate,
            })
            .collect()
    }
}

/// The Pareto front of candidates with `base`'s scene, engine and threads, the fastest first.
pub(super) fn stored_front(rows: &[Row], base: &Candidate) -> Vec<ParetoPoint> {
    let own: Vec<&Row> = (rows.iter())
        .filter(|row| {
            let c = &row.candidate;
            c.source == base.source && c.engine == base.engine && c.threads == base.threads
        })
        .collect();
    let points: Vec<[f64; 2]> = own.iter().map(|row| [row.measured.ratio, row.measured.psnr]).collect();
    // Ratios to the base's time in the same rounds are comparable; medians over different views are not.
    let whole = own.iter().find(|row| row.candidate == *base).map_or(1.0, |row| row.measured.milliseconds.median);
    (front(&points).into_iter())
        .map(|n| ParetoPoint {
            names: Vec::new(),
            settings: own[n].candidate.settings,
            milliseconds: whole * own[n].measured.ratio,
            psnr: own[n].measured.psnr,
        })
        .collect()
}

impl Report {
    /// A table with one line per candidate; those on the front are marked.
    pub(super) fn text(&self) -> String {
        let mut table = Table::new([
            "",
            "knob",
            "setting",
            "ms",
            "quartiles",
            "time",
            "PSNR",
            "SSIM",
            "largest",
            "file MB",
            "memory MB",
        ]);
        // The exact picture's median times the ratio, as in the stored points.
        let exact = self.rows.first().map_or(0.0, |row| row.measured.milliseconds.median);
        for row in &self.rows {
            let m = &row.measured;
            let mark = if row.is_on_time_front { "*" } else { "" };
            let psnr = if m.psnr >= SAME { "same".to_owned() } else { format!("{:.2}", m.psnr) };
            table.row([
                mark.to_owned(),
                row.knob.to_owned(),
                row.name.clone(),
                format!("{:.0}", exact * m.ratio),
                format!("{:.0}-{:.0}", m.milliseconds.quartiles[0], m.milliseconds.quartiles[1]),
                format!("{:.2}", m.ratio),
                psnr,
                m.ssim.map_or_else(|| "-".to_owned(), |v| format!("{v:.4}")),
                format!("{:.3}", m.largest),
                format!("{:.2}", row.bytes as f64 / 1e6),
                format!("{:.0}", m.memory_bytes as f64 / 1e6),
            ]);
        }
        let mut text = format!("{}, {}x{}, {}\n", self.against, self.size[0], self.size[1], self.machine);
        text += &table.text();
        text += TIMES_NOTE;
        for point in self.front.points.iter().filter(|p| !p.names.is_empty()) {
            let names = point.names.join(", ");
            text += &format!("{names}: {:.0} ms, {:.2} dB\n", point.milliseconds, point.psnr);
        }
        text
    }

    /// The rows as CSV.
    fn csv(&self) -> String {
        let mut text = "knob,name,milliseconds,first_quartile,third_quartile,time_ratio,psnr,ssim,largest_error,file_bytes,memory_bytes,on_front\n".to_owned();
        for row in &self.rows {
            let m = &row.measured;
            let ssim = m.ssim.map_or_else(String::new, |v| v.to_string());
            let [first, third] = m.milliseconds.quartiles;
            text += &format!(
                "{},{},{},{first},{third},{},{},{ssim},{},{},{},{}\n",
                row.knob,
                quoted(&escaped(&row.name)),
                m.milliseconds.median,
                m.ratio,
                m.psnr,
                m.largest,
                row.bytes,
                m.memory_bytes,
                row.is_on_time_front
            );
        }
        text
    }

    /// Writes `trade.json`, `trade.csv`, and the plots of time and of size, into `folder`.
    pub(super) fn write(&self, folder: &Path) -> Result<(), Error> {
        let json = serde_json::to_string_pretty(self).expect("plain data") + "\n";
        write_atomically(&folder.join("trade.json"), json.as_bytes(), true)?;
        write_atomically(&folder.join("trade.csv"), self.csv().as_bytes(), true)?;
        type Of<T> = fn(&Row) -> T;
        let plots: [(&str, &'static str, Of<f64>, Of<bool>); 2] = [
            ("time", "milliseconds per picture", |row| row.measured.milliseconds.median, |row| row.is_on_time_front),
            ("size", "file size, MB", |row| row.bytes as f64 / 1e6, |row| row.is_on_size_front),
        ];
        for (name, axis, value, is_on_front) in plots {
            let points = self.rows.iter().filter(|row| name == "time" || row.knob == "file" || row.knob == "exact");
            let plot = Plot {
                title: format!("{}: {name} against PSNR, {}", self.file, self.against),
                axes: [axis, "PSNR, dB"],
                points: points
                    .map(|row| plot::PlotPoint {
                        at: [value(row), row.measured.psnr],
                        name: row.name.clone(),
                        is_on_front: is_on_front(row),
                    })
                    .collect(),
            };
            write_atomically(
                &folder.join(format!("{name}.svg")),
                plot.svg().map_err(Error::Runtime)?.as_bytes(),
                true,
            )?;
            let (size, colors) = plot.picture().map_err(Error::Runtime)?;
            write_atomically(&folder.join(format!("{name}.png")), &color_png(size, &colors)?, true)?;
        }
        Ok(())
    }

    /// Writes `pictures.png`: for each named point a row of rendering, expected picture and difference.
    pub(super) fn write_pictures(
        &self,
        folder: &Path,
        source: &SweepScene,
        base: &Candidate,
        views: &SweepCameras,
        session: &Context,
    ) -> Result<(), Error> {
        let view = &views.views[0];
        let size = [view.camera.width, view.camera.height];
        let mut rows = Vec::new();
        for point in self.front.points.iter().filter(|p| !p.names.is_empty()) {
            let approximation = &point.settings.approximation;
            let scene = source.scene.clone();
            let mut renderer = base.engine.prepare(scene, approximation, &session.console)?;
            let small = renderer.render(&view.camera.downscaled(point.settings.divisor))?;
            let drawn = colors(&upsample_bilinear(&small, size));
            let difference = error_map(&drawn, &view.truth, ERROR_FULL)?;
            let pictures = [drawn, view.truth.clone(), difference].map(|colors| Sheet { size, colors });
            rows.push(side_by_side(&pictures));
        }
        let sheet = stacked(&rows);
        write_atomically(&folder.join("pictures.png"), &color_png(sheet.size, &sheet.colors)?, true)
    }
}
