//! `strivec-pack diff`.

use std::path::PathBuf;

use serde::Serialize;

use super::input::{self, LimitArgs};
use crate::{Context, Error, scene_file};
use strivec_format::container;
use strivec_format::model::{Scale, Scene};
use strivec_format::psnr::psnr_of_mse;
use strivec_recipe::JUDGED;
use strivec_train::pack::{ReferencePictures, probe_views};

/// Arguments of `strivec-pack diff`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  strivec-pack diff before.strivec after.strivec")]
pub(super) struct Args {
    /// First scene file
    before: PathBuf,
    /// Second scene file
    after: PathBuf,
    /// Compare the files' numbers only, without pictures
    #[arg(long)]
    no_pictures: bool,
    #[command(flatten)]
    limits: LimitArgs,
}

/// How two files differ.
#[derive(Debug, Serialize, schemars::JsonSchema)]
pub(super) struct Difference {
    same_bytes: bool,
    /// Sections that are in one of both, or not the same.
    sections: Vec<String>,
    /// The largest difference of a parameter; absent where scenes differ in shape.
    largest_parameter_difference: Option<f64>,
    /// PSNR in dB of one's pictures to the other's; absent where they are the same or were not compared.
    psnr: Option<f64>,
}

/// Compares two files; fails where they differ.
pub(super) fn run(args: &Args, session: &Context) -> Result<(), Error> {
    let read = |path| input::read(path, args.limits, &session.console);
    let ((before, before_bytes), (after, after_bytes)) = (read(&args.before)?, read(&args.after)?);
    let same_bytes = before_bytes == after_bytes;
    let mut sections = Vec::new();
    if !same_bytes {
        let list = |path, bytes| container::sections(bytes).map_err(|e| Error::container(path, e));
        let (a, b) = (list(&args.before, &before_bytes)?, list(&args.after, &after_bytes)?);
        let same = |x: &container::Section, y: &container::Section| {
            x.to_string() == y.to_string() && (x.codec, x.length, x.checksum) == (y.codec, y.length, y.checksum)
        };
        let missing_in = |from: &container::Contents, other: &container::Contents| -> Vec<String> {
            let lacks = |s: &&container::Section| !other.sections.iter().any(|o| same(s, o));
            from.sections.iter().filter(lacks).map(ToString::to_string).collect()
        };
        sections = missing_in(&a, &b);
        sections.extend(missing_in(&b, &a));
        sections.sort();
        sections.dedup();
    }
    let psnr = if same_bytes || args.no_pictures {
        None
    } else {
        scene_file::check_memory(&args.before, &before.scene)?;
        scene_file::check_memory(&args.after, &after.scene)?;
        let error = ReferencePictures::from_own_pictures(
            &before.scene,
            probe_views(&before.scene, before.metadata.views.as_ref(), &before.metadata.cameras, 6, JUDGED.1),
        )
        .mse(&after.scene);
        (error > 0.0).then(|| psnr_of_mse(error))
    };
    let largest_parameter_difference = largest_difference(&before.scene, &after.scene);
    let difference = Difference { same_bytes, sections, largest_parameter_difference, psnr };
    session.console.result(&difference, Difference::text)?;
    if same_bytes {
        return Ok(());
    }
    Err(Error::Differs(format!("{} and {} differ", args.before.display(), args.after.display())))
}

fn largest_difference(a: &Scene, b: &Scene) -> Option<f64> {
    let arrays = |scene: &Scene| -> Vec<Vec<f32>> {
        let scales = scene.scales.iter();
        let of_blocks = |s: &'_ Scale| s.factors.blocks().map(|block| block.values.clone()).collect::<Vec<_>>();
        let of_scales = scales.flat_map(|s| of_blocks(s).into_iter().chain([s.appearance_matrix.weights.clone()]));
        of_scales.chain(scene.decoder.layers.iter().flat_map(|l| [l.weights.clone(), l.bias.clone()])).collect()
    };
    let (a, b) = (arrays(a), arrays(b));
    let same_shape = a.len() == b.len() && a.iter().zip(&b).all(|(x, y)| x.len() == y.len());
    let pairs = a.iter().flatten().zip(b.iter().flatten());
    same_shape.then(|| pairs.map(|(x, y)| (f64::from(*x) - f64::from(*y)).abs()).fold(0.0, f64::max))
}

impl Difference {
    fn text(&self) -> String {
        if self.same_bytes {
            return "the same bytes\n".into();
        }
        let mut text = format!("sections: {}\n", self.sections.join(", "));
        text += &match self.largest_parameter_difference {
            Some(difference) => format!("parameters differ by at most {difference:e}\n"),
            None => "scenes of different shape\n".to_owned(),
        };
        text + &self.psnr.map_or_else(String::new, |psnr| format!("pictures: {psnr:.2} dB\n"))
    }
}
