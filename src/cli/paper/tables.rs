//! The tables: which trainings are their rows, and what the paper says of them.

use std::collections::HashMap;

use clap::ValueEnum;
use serde::Serialize;

use super::figures::{Figures, OfScene, of_synthetic, of_tanks};
use crate::train::{ScaleConfig, TrainConfig};

/// Tables of the paper.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Name {
    /// The main table: 12, 24 and 48 components, TensoRF-CP, TensoRF-VM
    Main,
    /// Tensors of one size, and of two and three
    Scales,
    /// Tensors of vectors against tensors of vectors and matrices
    Factors,
    /// 12, 24, 48 and 96 components
    Components,
    /// Where tensors are placed: by a coarse volume, by one stopped early, by a coarse model of its own, and pruned
    Geometry,
    /// Time of training and of a picture
    Speed,
    /// The dataset turned about z by 5° and 45°
    Rotation,
    /// ScanNet
    Scannet,
    /// Tanks and Temples
    Tanks,
}

/// The settings of all presets, by name.
pub(super) type Presets = HashMap<&'static str, TrainConfig>;

/// A row: a training, and the paper's figures of it.
pub(super) struct Row {
    /// Its name in the table.
    pub(super) name: String,
    pub(super) training: Training,
    /// The means over the paper's scenes.
    pub(super) means: Figures,
    pub(super) scenes: Vec<OfScene>,
    /// The name of the training that this one is the turned one of.
    pub(super) unturned: Option<String>,
}

/// A training of a scene.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Training {
    /// A folder's name, the same in all tables that have it.
    pub(super) name: String,
    pub(super) config: TrainConfig,
    /// How far the dataset is turned about z.
    pub(super) degrees: f64,
    /// The prior is the scene's own coarse model.
    pub(super) bootstraps: bool,
}

impl Training {
    fn new(name: impl Into<String>, config: TrainConfig) -> Self {
        Self { name: name.into(), config, degrees: 0.0, bootstraps: false }
    }

    fn of_preset(name: &str, presets: &Presets) -> Self {
        Self::new(name, presets[name].clone())
    }
}

impl Row {
    fn new(name: impl Into<String>, training: Training, means: Figures) -> Self {
        Self { name: name.into(), training, means, scenes: Vec::new(), unturned: None }
    }
}

/// `config` with the scales `numbers` alone.
fn with_scales(config: &TrainConfig, numbers: &[usize]) -> TrainConfig {
    let scales: Vec<ScaleConfig> = numbers.iter().map(|&n| config.scales[n].clone()).collect();
    TrainConfig { scales, ..config.clone() }
}

const TENSORF_CP: &str = "TensoRF-CP";
const TENSORF_VM: &str = "TensoRF-VM";

/// "Comparisons of our method with other radiance-based models" and "Ablation study on the number of tensor components".
const OF_12: Figures = Figures::psnr(32.94).ssim(0.961).vgg(0.049).alex(0.028).millions(4.87);
const OF_24: Figures = Figures::psnr(33.24).ssim(0.963).vgg(0.046).alex(0.026).millions(7.07).minutes(34.3);
const OF_48: Figures = Figures::psnr(33.55).ssim(0.965).vgg(0.044).alex(0.025).millions(13.52).minutes(35.7);
const OF_96: Figures = Figures::psnr(33.59).ssim(0.965).vgg(0.043).alex(0.024).millions(21.01);
const OF_CP: Figures = Figures::psnr(31.56).ssim(0.949).vgg(0.076).alex(0.041).millions(0.98).minutes(25.2);
const OF_VM: Figures = Figures::psnr(33.14).ssim(0.963).vgg(0.047).alex(0.027).millions(17.95).minutes(17.4);

impl Name {
    /// The rows, from `presets`.
    pub(super) fn rows(self, presets: &Presets) -> Vec<Row> {
        match self {
            Self::Main => [("12", OF_12), ("24", OF_24), ("48", OF_48), ("tensorf-cp", OF_CP), ("tensorf-vm", OF_VM)]
                .map(|(name, means)| synthetic(name, presets, means))
                .into(),
            Self::Components => {
                let rows = [("12", OF_12), ("24", OF_24), ("48", OF_48), ("96", OF_96)];
                rows.map(|(name, means)| synthetic(name, presets, means)).into()
            }
            Self::Scales => scales(presets),
            Self::Factors => factors(presets),
            Self::Geometry => geometry(presets),
            Self::Speed => speed(presets),
            Self::Rotation => rotation(presets),
            Self::Scannet => scannet(presets),
            Self::Tanks => tanks(presets),
        }
    }

    /// The source of the paper's figures.
    pub(super) fn source(self) -> &'static str {
        match self {
            Self::Geometry => {
                "the paper has no table of it: 48 components keep their quality with any prior, and pruning changes 0.03 dB"
            }
            Self::Rotation => "the paper: 30 000 steps on an RTX 3090; chair and lego",
            Self::Scannet => "the paper: 100 000 steps on an RTX 3090; means over ScanNet's scenes 101 and 241",
            Self::Tanks => "the paper: 30 000 steps on an RTX 3090; means over five scenes of Tanks and Temples",
            _ => "the paper: 30 000 steps on an RTX 3090; means over the eight scenes of NeRF Synthetic",
        }
    }
}

/// The row of a preset on NeRF Synthetic.
fn synthetic(name: &str, presets: &Presets, means: Figures) -> Row {
    Row { scenes: of_synthetic(name), ..Row::new(title(name), Training::of_preset(name, presets), means) }
}

/// A preset's name in the paper.
fn title(name: &str) -> &str {
    match name {
        "tensorf-cp" => TENSORF_CP,
        "tensorf-vm" => TENSORF_VM,
        name => name,
    }
}

/// "Ablation under different scale settings": edges of tensors.
fn scales(presets: &Presets) -> Vec<Row> {
    let part = |name: &str, numbers: &[usize], means| {
        Row::new(name, Training::new(format!("48, {name}"), with_scales(&presets["48"], numbers)), means)
    };
    vec![
        part("0.6", &[0], Figures::psnr(32.22).ssim(0.957).millions(1.75).minutes(18.22)),
        part("0.3", &[1], Figures::psnr(32.73).ssim(0.961).millions(4.15).minutes(21.31)),
        part("0.15", &[2], Figures::psnr(31.96).ssim(0.952).millions(10.20).minutes(28.55)),
        part("0.6 + 0.3", &[0, 1], Figures::psnr(33.11).ssim(0.963).millions(6.20).minutes(30.12)),
        Row { name: "0.6 + 0.3 + 0.15".into(), ..synthetic("48", presets, OF_48) },
    ]
}

/// Appendix A, "Comparisons on our method pairing with different factorization strategies".
fn factors(presets: &Presets) -> Vec<Row> {
    let cloud = |rank: u32, means| {
        Row::new(format!("VM-Cloud (0.3), {rank}"), Training::of_preset(&format!("vm-cloud-{rank}"), presets), means)
    };
    let single = Training::new("96, 0.3", with_scales(&presets["96"], &[1]));
    vec![
        Row { name: "three scales, 24".into(), ..synthetic("24", presets, OF_24) },
        Row::new("one scale (0.3), 96", single, Figures::psnr(33.02).ssim(0.963).millions(9.15)),
        cloud(6, Figures::psnr(32.59).ssim(0.959).millions(11.36)),
        cloud(12, Figures::psnr(32.99).ssim(0.962).millions(21.64)),
    ]
}

/// Appendix B, "Ablation Studies on Initial Geometry".
fn geometry(presets: &Presets) -> Vec<Row> {
    let base = Training::of_preset("48", presets);
    let mut stopped = Training::new("48, stopped early", base.config.clone());
    stopped.config.prior.steps.iter_mut().for_each(|steps| *steps = (*steps / EARLY).max(1));
    let own = Training { bootstraps: true, ..Training::new("48, own coarse model", base.config.clone()) };
    let pruned = Training::new("48, pruned", TrainConfig { prune: true, ..base.config.clone() });
    let rows = [("coarse volume", base), ("stopped early", stopped), ("own coarse model", own), ("pruned", pruned)];
    rows.map(|(name, training)| Row::new(name, training, Figures::default())).into()
}

/// The divisor of the steps of a coarse volume that is stopped early.
const EARLY: u32 = 4;

/// "Speed v.s. Performance".
fn speed(presets: &Presets) -> Vec<Row> {
    let row = |name: &str, seconds: f64, picture: f64, millions, psnr| {
        let means = Figures::psnr(psnr).millions(millions).minutes(seconds / 60.0).seconds(picture);
        Row::new(title(name), Training::of_preset(name, presets), means)
    };
    vec![
        row("tensorf-cp", 1914.0, 2.01, 0.98, 31.56),
        row("tensorf-vm", 915.0, 1.60, 17.95, 33.14),
        row("fast", 959.0, 1.67, 6.20, 33.09),
    ]
}

/// "Comparisons of our method with TensoRF when considering rotation": degrees, chair and lego.
fn rotation(presets: &Presets) -> Vec<Row> {
    let methods = [
        ("tensorf-cp", [(0.0, 33.60, 34.50), (5.0, 32.90, 29.79), (45.0, 32.50, 28.57)]),
        ("tensorf-vm", [(0.0, 35.76, 36.46), (5.0, 34.91, 32.53), (45.0, 34.55, 32.31)]),
        ("48", [(0.0, 35.88, 36.52), (5.0, 35.72, 35.37), (45.0, 35.64, 34.97)]),
    ];
    let mut rows = Vec::new();
    for (name, angles) in methods {
        for (degrees, chair, lego) in angles {
            let mut row = Row::new(
                format!("{}, {degrees}°", title(name)),
                Training::of_preset(name, presets),
                Figures::default(),
            );
            if degrees != 0.0 {
                row.training = Training { name: format!("{name}, turned {degrees}"), degrees, ..row.training };
                row.unturned = Some(name.into());
            }
            row.scenes = vec![("chair", Figures::psnr(chair)), ("lego", Figures::psnr(lego))];
            rows.push(row);
        }
    }
    rows
}

/// "Quantitative comparison on two scenes in the ScanNet dataset".
fn scannet(presets: &Presets) -> Vec<Row> {
    let scan = Training::of_preset("scannet", presets);
    let steps = scan.config.steps;
    let tensorf = |name: &str| Training::new(format!("{name}, {steps} steps"), presets[name].clone().with_steps(steps));
    vec![
        Row::new(TENSORF_CP, tensorf("tensorf-cp"), Figures::psnr(27.54).ssim(0.751).alex(0.328).millions(0.97)),
        Row::new(TENSORF_VM, tensorf("tensorf-vm"), Figures::psnr(28.61).ssim(0.787).alex(0.290).millions(49.92)),
        Row::new("48", scan, Figures::psnr(29.05).ssim(0.792).alex(0.243).millions(12.82)),
    ]
}

/// "Quantitative comparison on scenes in the Tanks and Temples dataset"; LPIPS by VGG is the breakdown's mean.
fn tanks(presets: &Presets) -> Vec<Row> {
    let row = |name: &str, means| Row {
        scenes: of_tanks(name),
        ..Row::new(title(name), Training::of_preset(name, presets), means)
    };
    vec![
        row("tensorf-cp", Figures::psnr(27.59).ssim(0.897).vgg(0.181).alex(0.144).millions(0.97)),
        row("tensorf-vm", Figures::psnr(28.56).ssim(0.920).vgg(0.140).alex(0.125).millions(49.92)),
        row("48", Figures::psnr(28.70).ssim(0.922).vgg(0.136).alex(0.113).millions(14.11)),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn trainings_of_one_name_are_the_same_in_all_tables() {
        let presets = TrainConfig::PRESETS.map(|name| (name, TrainConfig::preset(name).unwrap())).into();
        let mut seen: HashMap<String, Training> = HashMap::new();
        for table in Name::value_variants() {
            let rows = table.rows(&presets);
            assert!(rows.len() > 1, "{table:?}");
            for row in rows {
                row.training.config.check().unwrap();
                let known = seen.entry(row.training.name.clone()).or_insert_with(|| row.training.clone());
                assert_eq!(*known, row.training, "{table:?} {}", row.name);
            }
        }
        let mut trainings: Vec<Training> = seen.into_values().collect();
        while let Some(mut training) = trainings.pop() {
            assert!(training.name.chars().all(|c| c.is_ascii_alphanumeric() || "-, .+".contains(c)), "a folder's name");
            let alike = trainings.iter().find(|other| {
                training.name.clone_from(&other.name);
                training == **other
            });
            assert!(alike.is_none(), "trained twice: {alike:?}");
        }
    }
}
