//! `strivec-pack prune`, `crop` and `transform`.

use std::path::{Path, PathBuf};

use glam::DQuat;

use super::convert::rewrite;
use super::encoding::{LayoutArgs, Plain};
use super::input::Inputs;
use super::rewriting::{Edit, rewritten};
use crate::numbers::{boxed, numbers};
use crate::table::short;
use crate::{Context, Error, scene_file};
use strivec_format::container;
use strivec_format::container::SceneFile;
use strivec_format::geometry::{Aabb, Similarity};
use strivec_recipe::{JUDGED, PROBED};
use strivec_train::pack;
use strivec_train::pack::probe_views;

/// Inputs and outputs of edits.
#[derive(Debug, clap::Args)]
struct Files {
    #[command(flatten)]
    inputs: Inputs,
    /// File to write, folder for several inputs or a pattern, or - for standard output
    #[arg(long, short)]
    output: PathBuf,
    /// Dry run: print what would be written
    #[arg(long)]
    dry_run: bool,
}

impl Files {
    /// Writes what `change` makes of each file.
    fn rewrite(
        &self,
        session: &Context,
        change: impl Fn(SceneFile, &[u8], &Path) -> Result<Vec<u8>, Error>,
    ) -> Result<(), Error> {
        rewrite(&self.inputs, &self.output, self.dry_run, session, change)
    }
}

/// Output of an edited scene.
#[derive(Debug, clap::Args)]
struct EditTarget {
    #[command(flatten)]
    files: Files,
    /// Encoding of the factors; keep: the file's, but floats for numbers that it would round after the edit
    #[arg(long, value_enum, default_value_t = Plain::Keep)]
    encoding: Plain,
    #[command(flatten)]
    layout: LayoutArgs,
}

impl EditTarget {
    fn rewrite(
        &self,
        session: &Context,
        change: impl Fn(SceneFile, &Path) -> Result<SceneFile, Error>,
    ) -> Result<(), Error> {
        self.layout.check()?;
        let edit = Edit { encoding: self.encoding, layout: &self.layout, session };
        self.files.rewrite(session, |before, bytes, path| {
            let after = change(before.clone(), path)?;
            rewritten(&before, bytes, after, &edit, path)
        })
    }
}

/// Arguments of `strivec-pack prune`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  strivec-pack prune lego.strivec -o pruned.strivec")]
pub(super) struct PruneArgs {
    #[command(flatten)]
    target: EditTarget,
    /// Drop components whose absence adds at most this to the mean squared error of pictures
    #[arg(long, value_name = "ERROR", default_value_t = 1e-13)]
    error: f64,
    /// Random seed
    #[arg(long, default_value_t = 0)]
    seed: u64,
}

/// Drops components that pictures do not show.
pub(super) fn prune(args: &PruneArgs, session: &Context) -> Result<(), Error> {
    args.target.rewrite(session, |mut document, path| {
        let SceneFile { scene, metadata, .. } = &document;
        scene_file::check_memory(path, scene)?;
        let views = probe_views(scene, metadata.views.as_ref(), &metadata.cameras, PROBED.0, JUDGED.1);
        let importance = views.importance(&document.scene, PROBED.1, args.seed);
        let share = pack::prune(&mut document.scene, &importance, args.error);
        session.console.say(&format!("{:.1} % of the components dropped", 100.0 * share));
        Ok(document)
    })
}

/// Arguments of `strivec-pack crop`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  strivec-pack crop lego.strivec -o part.strivec --box=-1,-1,0,1,1,1\n  strivec-pack crop lego.strivec -o coarse.strivec --scales 2"
)]
pub(super) struct CropArgs {
    #[command(flatten)]
    target: EditTarget,
    /// Keep the tensors in this box: smallest and largest corner, in dataset units
    #[arg(long = "box", value_name = "X,Y,Z,X,Y,Z", value_parser = boxed, allow_hyphen_values = true,
        required_unless_present = "scales")]
    corners: Option<Aabb>,
    /// Keep the N coarsest scales, with the file's correction for the missing ones
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    scales: Option<u16>,
}

/// Keeps what is in a box, or coarse enough.
pub(super) fn crop(args: &CropArgs, session: &Context) -> Result<(), Error> {
    args.target.rewrite(session, |mut document, path| {
        if let Some(scales) = args.scales.map(usize::from).filter(|n| *n < document.scene.scales.len()) {
            let prefixes = &document.metadata.prefixes;
            if !matches!(prefixes.get(scales - 1), Some(Some(_))) {
                session.console.say(&format!("the file has no correction for {scales} scales: `pack` fits them"));
            }
            document = pack::keep_scales(document, scales);
        }
        if let Some(corners) = args.corners {
            let map = document.scene.frame.model_from_dataset;
            // The box around the box, where the map turns it.
            let within = Aabb::from_points(corners.corners().map(|corner| map.point(corner)));
            let (bounds, is_contracted) = (document.scene.bounds, document.scene.rules.contraction.is_some());
            if !is_contracted && (within.min.cmpge(bounds.max).any() || within.max.cmple(bounds.min).any()) {
                let dataset_from_model = map.inverse();
                let bounds = Aabb::from_points(bounds.corners().map(|corner| dataset_from_model.point(corner)));
                let corner = |at: glam::DVec3| at.to_array().map(short).join(", ");
                let bounds = format!("({}) to ({})", corner(bounds.min), corner(bounds.max));
                let message = format!("{}: the box holds nothing of the scene (bounds {bounds})", path.display());
                return Err(Error::Usage(message));
            }
            document = pack::crop(document, &within).map_err(|e| Error::container(path, e.into()))?;
        }
        Ok(document)
    })
}

/// Arguments of `strivec-pack transform`.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Example:\n  strivec-pack transform lego.strivec -o turned.strivec --turn z --turn z --scale 0.1\n\nOnly the map from the dataset's space changes, and all other sections stay byte for byte. Views and cameras of the file move with the scene. The up axis stays that of the dataset's space."
)]
pub(super) struct TransformArgs {
    #[command(flatten)]
    files: Files,
    /// Move by this vector, in dataset units, after turning and scaling
    #[arg(long = "move", value_name = "X,Y,Z", value_parser = numbers::<3>, default_value = "0,0,0",
        allow_hyphen_values = true)]
    by: [f64; 3],
    /// Turn by 90 degrees around this axis, counterclockwise seen from its end; -x turns clockwise; can be repeated
    #[arg(long, value_name = "AXIS", allow_hyphen_values = true, value_parser = ["x", "y", "z", "-x", "-y", "-z"])]
    turn: Vec<String>,
    /// Scale by this factor around the origin
    #[arg(long, default_value_t = 1.0)]
    scale: f64,
}

/// Changes where a scene is in its dataset's space: FRAME alone. All else in a file is in the model's space.
pub(super) fn transform(args: &TransformArgs, session: &Context) -> Result<(), Error> {
    if !(args.scale > 0.0 && args.scale.is_finite()) {
        return Err(Error::Usage(format!("--scale {}: must be positive", args.scale)));
    }
    let quarter = |axis: &String| {
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let (sign, axis) = axis.strip_prefix('-').map_or((1.0, axis.as_str()), |axis| (-1.0, axis));
        let turned = |x, y, z| DQuat::from_xyzw(sign * half * x, sign * half * y, sign * half * z, half);
        match axis {
            "x" => turned(1.0, 0.0, 0.0),
            "y" => turned(0.0, 1.0, 0.0),
            _ => turned(0.0, 0.0, 1.0),
        }
    };
    let rotation = args.turn.iter().fold(DQuat::IDENTITY, |all, axis| quarter(axis) * all);
    let moved = Similarity { scale: args.scale, rotation: rotation.normalize(), translation: args.by.into() };
    args.files.rewrite(session, |mut document, bytes, path| {
        let frame = &mut document.scene.frame;
        let before = moved.inverse();
        let map = frame.model_from_dataset;
        frame.model_from_dataset = Similarity {
            scale: map.scale * before.scale,
            rotation: (map.rotation * before.rotation).normalize(),
            translation: map.point(before.translation),
        };
        frame.meters_per_unit = frame.meters_per_unit.map(|meters| meters / args.scale);
        container::with_frame(bytes, frame).map_err(|e| Error::container(path, e))
    })
}
