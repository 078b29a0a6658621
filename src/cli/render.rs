//! `strivec render`: render pictures of a scene.

use std::path::PathBuf;
use std::time::Instant;

use serde::Serialize;

use super::approximations::Approximations;
use super::backend::{BackendOptions, Drawn};
use super::camera_path::OTHERS;
use super::output::{check_outputs, make_folder};
use super::progress::Progress;
use super::table::plural;
use super::video::Video;
use super::viewpoints::Viewpoints;
use super::{Context, Error, scene_file, write_atomically};
use strivec_field::render::{Picture, RenderSettings, Turntable, upsample_bilinear};
use strivec_format::escape::escaped_path;
use strivec_format::model::Scene;
use strivec_measure::{DepthCode, color_png, depth_png, opacity_png};

const EXAMPLES: &str = "\
Examples:
  strivec render lego.strivec --orbit 60 --size 400x400 --out orbit
  strivec render lego.strivec --cameras lego/transforms_test.json --out frames --depth
  strivec render lego.strivec --orbit 60 --step-scale 2 --decoder per-ray --out quick
  strivec render lego.strivec --pose 1,0,0,0,0,1,0,0,0,0,1,4,0,0,0,1 --out one
  strivec render lego.strivec --path turntable --frames 240 --backend gpu --out frames --video lego.mp4
  strivec render lego.strivec --path flight.json --fps 60 --size 1280x720 --out frames

Depth is the distance along the ray in dataset units, as 16-bit PNG; depth.json in the folder holds the distance per gray \
value or, of an unbounded scene, the scale s of the distance s * (65535 / value - 1). 0 is empty space. Frames of a path are frame_0000.png, frame_0001.png, …, with or without --video.";

/// The arguments.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Args {
    /// Scene file
    file: PathBuf,
    #[command(flatten)]
    viewpoints: Viewpoints,
    /// Render --cameras without their distortion or projection: as pinholes of the same focal lengths
    #[arg(long, requires = "cameras")]
    undistort: bool,
    /// Folder for the pictures; created if absent
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Also encode the frames of --path as .mp4 (needs the program ffmpeg) or animated .webp (img2webp or ffmpeg)
    #[arg(long, value_name = "FILE", conflicts_with_all = OTHERS)]
    video: Option<PathBuf>,
    #[command(flatten)]
    backend: BackendOptions,
    /// Also write the expected depth, NAME_depth.png
    #[arg(long)]
    depth: bool,
    /// Also write the opacity, NAME_opacity.png
    #[arg(long)]
    opacity: bool,
    #[command(flatten)]
    approximations: Approximations,
}

/// The result, as `--json` prints it.
#[derive(Serialize)]
struct Report {
    #[serde(flatten)]
    drawn: Drawn,
    #[serde(flatten)]
    settings: RenderSettings,
    /// Preparation of the renderer.
    seconds_preparing: f64,
    seconds: f64,
    /// Depth of a gray value of 1, in dataset units; absent for an unbounded scene.
    depth_unit: Option<f64>,
    /// Depth of half the largest gray value in pictures of an unbounded scene, in dataset units.
    #[serde(skip_serializing_if = "Option::is_none")]
    depth_scale: Option<f64>,
    /// Pictures in the order of the cameras.
    files: Vec<PathBuf>,
    video: Option<PathBuf>,
}

/// Edge of the inner cube of an unbounded scene, in model units.
const INNER_EDGE: f64 = 2.0;

/// The content of `depth.json`.
#[derive(Serialize)]
struct DepthScale {
    depth: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    unit: Option<f64>,
    #[serde(skip_serializing_if = "Option::is_none")]
    scale: Option<f64>,
}

impl DepthScale {
    fn new(code: DepthCode) -> Self {
        match code {
            DepthCode::Linear { unit } => Self {
                depth: "distance along the ray in the dataset's units is gray value times unit; 0 where there is nothing",
                unit: Some(unit),
                scale: None,
            },
            DepthCode::Reciprocal { scale } => Self {
                depth: "distance along the ray in the dataset's units is scale * (65535 / gray value - 1); 0 where there is \
                        nothing",
                unit: None,
                scale: Some(scale),
            },
        }
    }
}

/// The gray values of depths of `scene`, in dataset units: to far or, if far is at the horizon of an unbounded scene,
/// with half of them in the first edge of the inner cube.
fn depth_code(scene: &Scene) -> DepthCode {
    let model_units = scene.frame.model_from_dataset.scale;
    match scene.rules.contraction {
        None => DepthCode::Linear { unit: unit_reaching(scene.frame.far / model_units) },
        Some(_) => DepthCode::Reciprocal { scale: INNER_EDGE / model_units },
    }
}

/// Renders every viewpoint.
pub(super) fn run(args: &Args, session: &Context) -> Result<(), Error> {
    args.backend.check()?;
    let (scene_file, _) = scene_file::read(&args.file, &session.console)?;
    let (scene, metadata) = (&scene_file.scene, &scene_file.metadata);
    let turn = Turntable::of(scene, metadata.views.as_ref(), &metadata.cameras);
    let mut cameras = args.viewpoints.cameras(&scene.frame, &scene.bounds, turn.as_ref())?;
    if args.undistort {
        cameras.iter_mut().for_each(|named| named.camera = named.camera.undistorted());
    }
    let size = cameras.first().map_or([0, 0], |named| [named.camera.width, named.camera.height]);
    let settings = args.approximations.settings(&scene_file, &args.file, size)?;
    let scene = scene_file.scene;
    let video = args.video.as_deref().map(|file| Video::plan(file, size)).transpose()?;
    let file = |name: &str, kind: &str| args.out.join(format!("{name}{kind}.png"));

    make_folder(&args.out)?;
    let scale_file = args.out.join("depth.json");
    let mut kinds = vec![""];
    kinds.extend(args.depth.then_some("_depth"));
    kinds.extend(args.opacity.then_some("_opacity"));
    let mut planned: Vec<PathBuf> =
        cameras.iter().flat_map(|camera| kinds.iter().map(|kind| file(&camera.name, kind))).collect();
    planned.extend(args.depth.then(|| scale_file.clone()));
    planned.extend(args.video.clone());
    let _reserved = check_outputs(&planned, session.force)?;
    let depth_code = args.depth.then(|| depth_code(&scene));
    let frame = scene.frame.clone();
    let start = Instant::now();
    let prepared = args.backend.prepare(scene, &settings.approximation, &session.console);
    let mut renderer = prepared.map_err(Error::of_scene(&args.file))?;
    let seconds_preparing = start.elapsed().as_secs_f64();
    let scale = depth_code.map(DepthScale::new);
    if let Some(scale) = &scale {
        let json = serde_json::to_string_pretty(scale).expect("plain data") + "\n";
        write_atomically(&scale_file, json.as_bytes(), session.force)?;
    }
    let progress = Progress::start(&session.console, "render", cameras.len() as u64);
    let start = Instant::now();
    let mut files = Vec::new();
    let mut write = |path: PathBuf, bytes: Vec<u8>| -> Result<(), Error> {
        write_atomically(&path, &bytes, session.force)?;
        files.push(path);
        Ok(())
    };
    for (done, named) in cameras.iter().enumerate() {
        let camera = named.camera.mapped(&frame.model_from_dataset);
        let size = [camera.width, camera.height];
        let picture = upsample_bilinear(&renderer.render(&camera.downscaled(settings.divisor))?, size);
        write(file(&named.name, ""), color_png(size, &colors(&picture))?)?;
        if let Some(code) = depth_code {
            let scale = frame.model_from_dataset.scale;
            let depths: Vec<f64> = picture.pixels.iter().map(|p| f64::from(p.depth) / scale).collect();
            write(file(&named.name, "_depth"), depth_png(size, &depths, code)?)?;
        }
        if args.opacity {
            let opacities: Vec<f32> = picture.pixels.iter().map(|p| p.opacity).collect();
            write(file(&named.name, "_opacity"), opacity_png(size, &opacities)?)?;
        }
        progress
            .set(done as u64 + 1, || format!("{:.2} s per picture", start.elapsed().as_secs_f64() / (done + 1) as f64));
    }
    let seconds = start.elapsed().as_secs_f64();
    progress.finish(&format!("{} in {seconds:.1} s", plural(cameras.len(), "picture")));
    if let Some(video) = &video {
        session.console.say(&format!("making the video with {}", video.program()));
        let frames: Vec<_> = cameras.iter().map(|named| file(&named.name, "")).collect();
        video.encode(&args.out, &frames, args.viewpoints.fps(), session.force)?;
    }
    let report = Report {
        drawn: renderer.drawn(),
        settings,
        seconds_preparing,
        seconds,
        depth_unit: scale.as_ref().and_then(|scale| scale.unit),
        depth_scale: scale.as_ref().and_then(|scale| scale.scale),
        files,
        video: args.video.clone(),
    };
    session.console.result(&report, |report| {
        report.files.iter().chain(&report.video).map(|path| escaped_path(path) + "\n").collect::<String>()
    })
}

/// The colors of a picture's pixels.
pub(super) fn colors(picture: &Picture) -> Vec<[f32; 3]> {
    picture.pixels.iter().map(|p| p.color).collect()
}

/// The smallest of 1, 2 and 5 times a power of ten whose 65535-fold is at least `far`.
fn unit_reaching(far: f64) -> f64 {
    let least = far / f64::from(u16::MAX);
    let exponent = least.log10().floor() as i32;
    let candidate = |digit: u32, exponent: i32| -> f64 {
        // Through decimal text, so that the unit prints as this text.
        format!("{digit}e{exponent}").parse().expect("a number")
    };
    let candidates = [candidate(1, exponent), candidate(2, exponent), candidate(5, exponent)];
    candidates.into_iter().find(|&unit| unit >= least).unwrap_or_else(|| candidate(1, exponent + 1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn depth_units_are_round_and_reach_the_far_end() {
        for (far, unit) in [(6.0, 0.0001), (6.5535, 0.0001), (6.6, 0.0002), (100.0, 0.002), (0.3, 5e-6), (1e9, 20000.0)]
        {
            assert_eq!(unit_reaching(far), unit, "{far}");
        }
    }
}
