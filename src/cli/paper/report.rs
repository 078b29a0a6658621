//! The table, beside the paper's.

use serde::Serialize;

use super::figures::Figures;
use super::tables::{Name, Row};
use super::training::{Outcome, Scene};
use crate::cli::table::{Table, plural};

/// The results, as `--json` prints them.
#[derive(Serialize)]
pub(super) struct Report {
    table: Name,
    downscale: u32,
    seed: u64,
    scenes: Vec<String>,
    rows: Vec<ReportRow>,
}

#[derive(Serialize)]
struct ReportRow {
    name: String,
    preset: String,
    steps: u64,
    /// By scene.
    outcomes: Vec<Outcome>,
    /// The paper's by scene.
    paper: Vec<Option<Figures>>,
    /// Means over scenes.
    mean: Figures,
    /// The paper's means, over its own scenes.
    paper_mean: Figures,
    /// How much higher the PSNR is, in dB, than without the turn, by scene and in the paper.
    by_turn: Option<Vec<[Option<f64>; 2]>>,
}

impl Report {
    /// The results of `rows` of `table`, by row and scene, from photographs downscaled so many times.
    pub(super) fn new(table: Name, downscale: u32, rows: &[Row], scenes: &[Scene], outcomes: &[Vec<Outcome>]) -> Self {
        let paper = |row: &Row| -> Vec<Option<Figures>> {
            let of_scene = |scene: &Scene| row.scenes.iter().find(|(name, _)| *name == scene.name).map(|of| of.1);
            scenes.iter().map(of_scene).collect()
        };
        let psnrs = |n: usize| -> Vec<[Option<f64>; 2]> {
            let ours = outcomes[n].iter().map(|outcome| outcome.figures.psnr);
            ours.zip(paper(&rows[n])).map(|(ours, paper)| [ours, paper.and_then(|figures| figures.psnr)]).collect()
        };
        let by_turn = |n: usize| -> Option<Vec<[Option<f64>; 2]>> {
            let unturned = rows[n].unturned.as_ref()?;
            let base = psnrs(rows.iter().position(|row| row.training.name == *unturned)?);
            let change =
                |([a, b], [c, d]): ([Option<f64>; 2], [Option<f64>; 2])| [(a, c), (b, d)].map(|(x, y)| Some(x? - y?));
            Some(psnrs(n).into_iter().zip(base).map(change).collect())
        };
        let seed = rows.first().map_or(0, |row| row.training.config.seed);
        let rows = (0..rows.len())
            .map(|n| ReportRow {
                name: rows[n].name.clone(),
                preset: rows[n].training.config.preset.clone(),
                steps: rows[n].training.config.steps,
                outcomes: outcomes[n].clone(),
                paper: paper(&rows[n]),
                mean: Figures::mean(outcomes[n].iter().map(|outcome| &outcome.figures)),
                paper_mean: rows[n].means,
                by_turn: by_turn(n),
            })
            .collect();
        let scenes = scenes.iter().map(|scene| scene.name.clone()).collect();
        Self { table, downscale, seed, scenes, rows }
    }

    /// As text: each figure beside the paper's.
    pub(super) fn text(&self) -> String {
        let columns: Vec<&Column> =
            COLUMNS.iter().filter(|column| self.rows.iter().any(|row| column.is_in(row))).collect();
        let turns = self.rows.iter().any(|row| row.by_turn.is_some());
        let headings = columns.iter().flat_map(|column| [column.heading, "paper"]);
        let of_turn = ["by turn", "paper"].into_iter().filter(|_| turns);
        let mut table = Table::new(["", "scene", "MB"].into_iter().chain(of_turn.clone()).chain(headings));
        let has_means = self.rows.iter().any(|row| row.paper_mean != Figures::default());
        for row in &self.rows {
            for (n, (outcome, paper)) in row.outcomes.iter().zip(&row.paper).enumerate() {
                let changes = row.by_turn.as_ref().map_or([None; 2], |changes| changes[n]);
                let changes = changes.map(|change| change.map_or("-".into(), |change| format!("{change:+.2}")));
                let megabytes = format!("{:.2}", outcome.bytes as f64 / 1e6);
                let figures = texts(&columns, &outcome.figures, &paper.unwrap_or_default());
                let start = [row.name.clone(), self.scenes[n].clone(), megabytes].into_iter();
                table.row(start.chain(changes.into_iter().filter(|_| turns)).chain(figures));
            }
            if has_means {
                let bytes: u64 = row.outcomes.iter().map(|outcome| outcome.bytes).sum();
                let megabytes = format!("{:.2}", bytes as f64 / row.outcomes.len() as f64 / 1e6);
                let start = [row.name.clone(), "mean".into(), megabytes].into_iter();
                let empty = of_turn.clone().map(|_| String::new());
                table.row(start.chain(empty).chain(texts(&columns, &row.mean, &row.paper_mean)));
            }
        }
        let views = self.rows.first().and_then(|row| row.outcomes.first()).map_or(0, |outcome| outcome.views);
        let mut steps: Vec<String> = self.rows.iter().map(|row| plural(row.steps as usize, "step")).collect();
        steps.dedup();
        format!(
            "1/{} size, {}, seed {}, {}\n{}\n{}",
            self.downscale,
            steps.join(", "),
            self.seed,
            plural(views, "view"),
            self.table.source(),
            table.text()
        )
    }
}

/// A column.
struct Column {
    heading: &'static str,
    decimals: usize,
    of: fn(&Figures) -> Option<f64>,
}

const COLUMNS: [Column; 7] = [
    Column { heading: "PSNR", decimals: 2, of: |figures| figures.psnr },
    Column { heading: "SSIM", decimals: 4, of: |figures| figures.ssim },
    Column { heading: "LPIPS vgg", decimals: 4, of: |figures| figures.lpips_vgg },
    Column { heading: "LPIPS alex", decimals: 4, of: |figures| figures.lpips_alex },
    Column { heading: "parameters, M", decimals: 2, of: |figures| figures.millions },
    Column { heading: "minutes", decimals: 1, of: |figures| figures.minutes },
    Column { heading: "s per view", decimals: 2, of: |figures| figures.seconds },
];

impl Column {
    /// It was measured.
    fn is_in(&self, row: &ReportRow) -> bool {
        row.outcomes.iter().any(|outcome| (self.of)(&outcome.figures).is_some())
    }
}

/// The cells of figures beside the paper's.
fn texts(columns: &[&Column], ours: &Figures, paper: &Figures) -> Vec<String> {
    let text = |column: &Column, figures| {
        (column.of)(figures).map_or_else(|| "-".to_owned(), |value| format!("{value:.*}", column.decimals))
    };
    columns.iter().flat_map(|column| [text(column, ours), text(column, paper)]).collect()
}
