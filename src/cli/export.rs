//! `strivec export`: write a scene as a mesh, points, splats or a grid for other programs.

use std::fs::File;
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use std::time::Instant;

use glam::DVec3;
use serde::Serialize;

use super::output::write_atomically_with;
use super::progress::Progress;
use super::state_file::beside;
use super::table::{plural, short};
use super::{Context, Error, check_output, scene_file, write_atomically};
use strivec_checkpoints::authors::{AuthorsFiles, authors_files};
use strivec_checkpoints::tensorf_checkpoint;
use strivec_export as interop;
use strivec_export::{
    CoarseCoordinates, DvgoOptions, OccupancyOptions, Space, Splats, SurfaceOptions, dvgo_checkpoint, surface,
};
use strivec_format::digits::grouped;
use strivec_format::escape::escaped_path;
use strivec_format::geometry::Aabb;
use strivec_format::model::Scene;

const EXAMPLES: &str = "\
Examples:
  strivec export lego.strivec -o lego.ply
  strivec export lego.strivec -o lego.glb --resolution 512 --min-triangles 100
  strivec export lego.strivec -o cloud.ply --as points
  strivec export lego.strivec -o start.ply --as splats
  strivec export lego.strivec -o lego.sog --harmonics 2
  strivec export lego.strivec -o occupancy.npz
  strivec export lego.strivec -o coarse_last.tar
  strivec export tensorf.strivec -o tensorf.th
  strivec export lego.strivec -o lego.th --as authors
  strivec export lego.strivec -o factors.npz --as factors

The kind is that of --as; without it, .ply, .obj and .glb are meshes, .spz and .sog are splats, .npz is an occupancy, .tar is a DVGO checkpoint, and .th is one of TensoRF.

mesh: the closed surface at which a step of a ray has the opacity --alpha, with normals, and with the colors that it shows \
against them (.glb: without lighting). points: the same without triangles. splats: a flat Gaussian at each point; .ply in the \
layout of the first implementation, for trainers to start from, .spz and .sog for viewers. With --harmonics, colors depend on the direction. \
SPZ points up where PLY and SOG point down: its y and z have the opposite signs. occupancy: the cells outside of which the scene is empty, \
occupancy [z][y][x] and bounds. dvgo: densities and colors without direction on a grid, which DVGO loads as a coarse model. tensorf: the parameters of a scene of one tensor, as `strivec import` reads them. authors: the same of tensor clouds, \
for the Strivec authors' program: beside NAME.th are NAME.txt, the configuration, and NAME_centers_S.txt, the centers of scale \
S, or NAME_meta.pkl. That program derives centers from points; pass these ones as its `geo` instead. factors: all arrays of the scene, \
scaleS_density and scaleS_appearance [tensor][vertex of x, then y, then z][component] (with matrices, the same with _x, _y and _z: \
the vector, then the matrix), scaleS_matrix [feature][component], scaleS_centers, scaleS_half_edge, scaleS_resolution, \
scaleS_top_k, decoderL_weights, decoderL_bias, occupancy [z][y][x] with occupancy_bounds, bounds, and the rules' numbers.

Coordinates are those of the photographs' cameras; the node of a .glb turns the scene upright. Far from the origin, as in UTM \
coordinates, 32 bits are too few: then a .ply of triangles or points has doubles, a .obj more digits, and the node of a .glb \
moves the scene to its place. Splats and checkpoints have 32 bits alone; a warning states how far apart their coordinates are. \
Of an unbounded scene the inner cube alone is exported; meshes, points and splats also have its surroundings with --surroundings.";

/// The arguments.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Args {
    /// Scene file
    file: PathBuf,
    /// File to write
    #[arg(long, short, value_name = "FILE")]
    output: PathBuf,
    /// Kind of the file [default: by its extension]
    #[arg(long = "as", value_name = "KIND")]
    kind: Option<Kind>,
    /// Cells along the longest edge of the box around the scene [default: 256; dvgo: 160; occupancy: the scene's own cells]
    #[arg(long, value_name = "N")]
    resolution: Option<u32>,
    /// Opacity of a step of a ray at the surface
    #[arg(long, value_name = "A", default_value_t = SurfaceOptions::default().alpha)]
    alpha: f64,
    /// Space of the coordinates
    #[arg(long, value_enum, default_value_t = SpaceName::Dataset)]
    space: SpaceName,
    /// Remove connected parts of the surface of fewer triangles [default: 0, keep all]
    #[arg(long, value_name = "N", default_value_t = 0, hide_default_value = true)]
    min_triangles: u32,
    /// Splats: degree of the spherical harmonics, 0 to 3; 0 gives a splat the color that it shows against the normal
    #[arg(long, value_name = "DEGREE", default_value_t = 0, value_parser = clap::value_parser!(u32).range(0..=3))]
    harmonics: u32,
    /// Unbounded scenes: also export the surroundings of the inner cube, up to 64 of its half edges away
    #[arg(long)]
    surroundings: bool,
}

/// Kinds of files.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
enum Kind {
    /// Triangles: .ply, .obj or .glb
    Mesh,
    /// Points of the surface: .ply
    Points,
    /// 3D Gaussian splats on the surface: .ply, .spz or .sog
    Splats,
    /// Occupied cells: .npz
    Occupancy,
    /// DVGO's checkpoint: .tar
    Dvgo,
    /// TensoRF's checkpoint: .th
    Tensorf,
    /// A checkpoint of the Strivec authors' program, with files beside it: .th
    Authors,
    /// All arrays of the scene: .npz
    Factors,
}

impl Kind {
    /// The kinds to choose from by a file's extension: those whose extensions name no other kind before them.
    const BY_EXTENSION: [Self; 5] = [Self::Mesh, Self::Splats, Self::Occupancy, Self::Dvgo, Self::Tensorf];

    /// The extensions of files of this kind.
    fn extensions(self) -> &'static [&'static str] {
        match self {
            Self::Mesh => &["ply", "obj", "glb"],
            Self::Points => &["ply"],
            Self::Splats => &["ply", "spz", "sog"],
            Self::Occupancy | Self::Factors => &["npz"],
            Self::Dvgo => &["tar"],
            Self::Tensorf | Self::Authors => &["th"],
        }
    }
}

/// The names of [`Space`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum SpaceName {
    /// That of the photographs' cameras
    Dataset,
    /// That of the field
    Model,
}

impl From<SpaceName> for Space {
    fn from(name: SpaceName) -> Self {
        match name {
            SpaceName::Dataset => Self::Dataset,
            SpaceName::Model => Self::Model,
        }
    }
}

/// The result, as `--json` prints it.
#[derive(Serialize)]
struct Report<'a> {
    file: &'a Path,
    kind: Kind,
    #[serde(flatten)]
    contents: ExportContents,
    seconds: f64,
}

/// The contents of a file.
#[derive(Serialize)]
#[serde(untagged)]
enum ExportContents {
    /// Contents of an exported surface.
    Surface {
        vertices: usize,
        triangles: usize,
        /// The smallest and the largest corner.
        bounds: [[f64; 3]; 2],
    },
    /// Contents of an exported occupancy.
    Cells {
        cells: [u32; 3],
        occupied: u64,
        /// The smallest and the largest corner.
        bounds: [[f64; 3]; 2],
    },
    /// Contents of an exported checkpoint.
    Voxels { resolution: u32 },
    /// Contents of an exported scene.
    Parameters { parameters: u64 },
}

/// Writes the file.
pub(super) fn run(args: &Args, session: &Context) -> Result<(), Error> {
    let (kind, extension) = kind_and_extension(args)?;
    if args.harmonics > 0 && kind != Kind::Splats {
        return Err(Error::Usage("--harmonics is for splats".into()));
    }
    let _reserved = check_output(&args.output, session.force)?;
    let (scene_file, _) = scene_file::read(&args.file, &session.console)?;
    let start = Instant::now();
    let exported = export(kind, &extension, &scene_file.scene, args, session);
    let contents = exported.map_err(Error::of_scene(&args.file))?;
    if let Some(warning) = rounding(kind, &contents, &scene_file.scene, args) {
        session.console.say(&warning);
    }
    let report = Report { file: &args.output, kind, contents, seconds: start.elapsed().as_secs_f64() };
    session.console.result(&report, text)
}

/// Writes the file of this kind and extension.
fn export(kind: Kind, extension: &str, scene: &Scene, args: &Args, session: &Context) -> Result<ExportContents, Error> {
    let space = Space::from(args.space);
    // In percent.
    let progress = Progress::start(&session.console, "sample", 100);
    let sampled = |done, all| progress.set(100 * done / all, String::new);
    let failed = || Error::interop(&args.output);
    let write = |write: &mut dyn FnMut(&mut BufWriter<&mut File>) -> Result<(), interop::Error>| {
        write_atomically_with(&args.output, session.force, |file| write(file).map_err(failed()))
    };
    match kind {
        Kind::Mesh | Kind::Points | Kind::Splats => {
            let options = SurfaceOptions {
                resolution: args.resolution.unwrap_or(SurfaceOptions::default().resolution),
                alpha: args.alpha,
                space,
                min_triangles: args.min_triangles,
                surroundings: args.surroundings,
            };
            let mut mesh = surface(scene, &options, &sampled).map_err(failed())?;
            if kind == Kind::Points {
                mesh.triangles = Vec::new();
            }
            let splats = if kind == Kind::Splats {
                let progress = Progress::start(&session.console, "color", 100);
                let fitted = |done, all| progress.set(100 * done / all, String::new);
                Some(Splats::with_harmonics(&mesh, scene, space, args.harmonics, &fitted).map_err(failed())?)
            } else {
                None
            };
            write(&mut |file| match (&splats, extension) {
                (Some(splats), "spz") => interop::write_spz(splats, file),
                (Some(splats), "sog") => interop::write_sog(splats, file),
                (Some(splats), _) => Ok(interop::write_splats(splats, file)?),
                (_, "obj") => Ok(interop::write_obj(&mesh, file)?),
                (_, "glb") => interop::write_glb(&mesh, space.up(&scene.frame), file),
                _ => Ok(interop::write_ply(&mesh, file)?),
            })?;
            let bounds = corners(&mesh.bounds());
            Ok(ExportContents::Surface { vertices: mesh.positions.len(), triangles: mesh.triangles.len(), bounds })
        }
        Kind::Occupancy => {
            let options = OccupancyOptions { resolution: args.resolution, space };
            let mut written = None;
            write(&mut |file| {
                written = Some(interop::write_occupancy(scene, &options, file)?);
                Ok(())
            })?;
            let grid = written.expect("a grid was written");
            Ok(ExportContents::Cells {
                cells: grid.cells.into(),
                occupied: grid.occupied,
                bounds: corners(&grid.bounds),
            })
        }
        Kind::Dvgo => {
            let resolution = args.resolution.unwrap_or(DvgoOptions::default().resolution);
            let checkpoint = dvgo_checkpoint(scene, &DvgoOptions { resolution, space }, &sampled).map_err(failed())?;
            write(&mut |file| Ok(strivec_checkpoints::write_checkpoint(file, &checkpoint).map(drop)?))?;
            Ok(ExportContents::Voxels { resolution })
        }
        Kind::Tensorf => {
            let checkpoint = tensorf_checkpoint(scene).map_err(Error::checkpoint(&args.output))?;
            write(&mut |file| Ok(strivec_checkpoints::write_checkpoint(file, &checkpoint).map(drop)?))?;
            Ok(ExportContents::Parameters { parameters: scene.parameter_count() })
        }
        Kind::Authors => {
            let AuthorsFiles { checkpoint, beside: files } =
                authors_files(scene).map_err(Error::checkpoint(&args.output))?;
            let stem = args.output.with_extension("");
            let files: Vec<_> = files.into_iter().map(|(end, bytes)| (beside(&stem, &end), bytes)).collect();
            files.iter().try_for_each(|(path, _)| check_output(path, session.force).map(drop))?;
            write(&mut |file| Ok(strivec_checkpoints::write_checkpoint(file, &checkpoint).map(drop)?))?;
            for (path, bytes) in &files {
                write_atomically(path, bytes, session.force)?;
            }
            Ok(ExportContents::Parameters { parameters: scene.parameter_count() })
        }
        Kind::Factors => {
            write(&mut |file| interop::write_factors(scene, file))?;
            Ok(ExportContents::Parameters { parameters: scene.parameter_count() })
        }
    }
}

/// A warning if the format of this kind rounds the coordinates of `contents` too much.
fn rounding(kind: Kind, contents: &ExportContents, scene: &Scene, args: &Args) -> Option<String> {
    let space = match kind {
        Kind::Tensorf | Kind::Authors => Space::Dataset,
        _ => args.space.into(),
    };
    let coarse = match (kind, contents) {
        (Kind::Splats, &ExportContents::Surface { bounds: [min, max], .. }) => {
            CoarseCoordinates::of(&Aabb { min: min.into(), max: max.into() })
        }
        (Kind::Dvgo | Kind::Tensorf | Kind::Authors, _) => CoarseCoordinates::of_scene(scene, space),
        _ => None,
    }?;
    let CoarseCoordinates { bounds, spacing } = coarse;
    let [spacing, farthest, edge] =
        [spacing, bounds.min.abs().max(bounds.max.abs()).max_element(), bounds.size().max_element()].map(short);
    let mut text = format!(
        "warning: {}: numbers of this format have 32 bits and are {spacing} apart near {farthest}, in a scene of length {edge}",
        args.output.display()
    );
    if space == Space::Dataset {
        let [x, y, z] = (DVec3::ZERO - coarse.middle()).to_array();
        text += &format!("; `strivec-pack transform --move {x},{y},{z}` brings a copy to the origin");
    }
    Some(text)
}

/// The smallest and the largest corner of `bounds`.
fn corners(bounds: &Aabb) -> [[f64; 3]; 2] {
    [bounds.min, bounds.max].map(Into::into)
}

/// One line.
fn text(report: &Report) -> String {
    let between = |bounds: &[[f64; 3]; 2]| {
        let [min, max] = bounds.map(|corner| corner.map(short).join(", "));
        format!("from {min} to {max}")
    };
    let contents = match &report.contents {
        ExportContents::Surface { vertices, triangles, bounds } => {
            let count = match report.kind {
                Kind::Points => plural(*vertices, "point"),
                Kind::Splats => plural(*vertices, "splat"),
                _ => format!("{} vertices, {}", grouped(*vertices as u64), plural(*triangles, "triangle")),
            };
            format!("{count}, {}", between(bounds))
        }
        ExportContents::Cells { cells: [x, y, z], occupied, bounds } => {
            format!("{} of {x} x {y} x {z} cells, {}", grouped(*occupied), between(bounds))
        }
        ExportContents::Voxels { resolution } => format!("{resolution} voxels along the longest edge"),
        ExportContents::Parameters { parameters } => format!("{} parameters", grouped(*parameters)),
    };
    format!("{}: {contents}, in {:.1} s", escaped_path(report.file), report.seconds)
}

/// The kind of the output, and its extension in lower case.
fn kind_and_extension(args: &Args) -> Result<(Kind, String), Error> {
    let path = args.output.display();
    let extension = args.output.extension().unwrap_or_default().to_string_lossy().to_lowercase();
    let is_of = |kind: &Kind| kind.extensions().contains(&extension.as_str());
    match args.kind.or(Kind::BY_EXTENSION.into_iter().find(is_of)) {
        None => {
            let known = "name it .ply, .obj, .glb, .spz, .sog, .npz, .tar or .th";
            Err(Error::Usage(format!("{path}: no kind of file has the extension {extension:?}; {known}")))
        }
        Some(kind) if !is_of(&kind) => {
            let known = kind.extensions().iter().map(|e| format!(".{e}")).collect::<Vec<_>>().join(" or ");
            Err(Error::Usage(format!("{path}: a file of this kind has the extension {known}, not {extension:?}")))
        }
        Some(kind) => Ok((kind, extension)),
    }
}
