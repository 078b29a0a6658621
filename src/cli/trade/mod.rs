//! `strivec trade`: speed against quality of a scene on this machine.

mod candidate;
mod encodings;
mod knobs;
mod measured;
mod pareto;
mod plot;
mod report;
mod sweep;
mod views;

use std::fs;
use std::path::PathBuf;

use candidate::{Candidate, Engine};
use knobs::{SearchSpace, combinations, knobs};
use measured::{Belongs, Log, Measured};
use report::{Report, Row, stored_front};
use sweep::{Sweep, SweepScene};
use views::SweepCameras;

use super::backend::Backend;
use super::dataset::DatasetOptions;
use super::output::make_folder;
use super::table::plural;
use super::{Context, Error, check_output, scene_file, write_atomically};
use strivec_field::render::{ParetoFront, RenderSettings, TRADE_NOTE};
use strivec_format::container;
use strivec_format::container::{Metadata, SceneFile};

const EXAMPLES: &str = "\
Examples:
  strivec trade lego.strivec --data lego
  strivec trade lego.strivec --data lego --also per-ray.strivec --encodings --store
  strivec trade lego.strivec --size 400 --backend cpu,gpu --out trade-lego
  strivec render lego.strivec --quality fast --path turntable --out frames

All points render the same views in turn, so that a temporary slowdown of the machine affects all of them. A stopped sweep \
resumes if started again. --store writes the Pareto front into the file; render, eval, the players and strivec-pack convert \
then accept --quality fast, balanced or best, and render and eval accept --min-fps 30 or --min-psnr 35.";

/// The arguments.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Args {
    /// Scene file
    file: PathBuf,
    /// Dataset folder: compare with its photographs [default: compare with the scene's exact pictures]
    #[arg(long, value_name = "DATASET")]
    data: Option<PathBuf>,
    /// Split of the dataset: train, val, test or all; for Blender's layout S of transforms_S.json
    #[arg(long, value_name = "S", default_value = "test", requires = "data")]
    split: String,
    /// Downscale photographs N times
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..), requires = "data")]
    downscale: u32,
    #[command(flatten)]
    dataset: DatasetOptions,
    /// Width of the pictures in pixels without --data, 16 to 4096
    #[arg(long, value_name = "PIXELS", default_value_t = 400, value_parser = clap::value_parser!(u32).range(16..=4096), conflicts_with = "data")]
    size: u32,
    /// Number of views, evenly spaced over all views
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u16).range(1..=1000))]
    views: u16,
    /// Rounds; each renders one view with every setting
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u16).range(1..=1000))]
    rounds: u16,
    /// Other files of the same scene, such as one trained for another decoder mode
    #[arg(long, value_name = "FILE", num_args = 1..)]
    also: Vec<PathBuf>,
    /// Also measure other encodings of the scene
    #[arg(long)]
    encodings: bool,
    /// Renderers; the results of the first are stored
    #[arg(long, value_enum, value_delimiter = ',', default_values_t = [Backend::Cpu])]
    backend: Vec<Backend>,
    /// Numbers of threads to measure [default: all, half of them, …, 1]
    #[arg(long, value_name = "LIST", value_delimiter = ',', value_parser = clap::value_parser!(u16).range(1..=4096))]
    threads_list: Vec<u16>,
    /// Number of combined settings to try; a quarter is measured fully; 0 tries none
    #[arg(long, value_name = "N", default_value_t = 32, value_parser = clap::value_parser!(u16).range(0..=256))]
    combinations: u16,
    /// Folder for trade.json, trade.csv, plots, pictures and the log of an unfinished sweep
    #[arg(long, value_name = "DIR", default_value = "trade")]
    out: PathBuf,
    /// Write the Pareto front into FILE
    #[arg(long)]
    store: bool,
}

/// Measures render settings of the scene in the file, reports, and stores the front if asked to.
pub(super) fn run(args: &Args, session: &Context) -> Result<(), Error> {
    let file = &args.file;
    let console = &session.console;
    let _reserved = args.store.then(|| check_output(file, true)).transpose()?;
    let (SceneFile { scene, metadata, .. }, bytes) = scene_file::read(file, console)?;
    scene_file::check_memory(file, &scene)?;
    let views = match &args.data {
        Some(folder) => {
            let options = args.dataset.load_options(args.downscale);
            SweepCameras::of_dataset(folder, &args.split, &options, args.views.into(), &scene, console)?
        }
        None => SweepCameras::own(&scene, &metadata, args.views.into(), args.size, console)?,
    };
    // The difference to photographs includes the scene's error already.
    let scene_error = if args.data.is_some() { 0.0 } else { scene_file::scene_error(&metadata) };
    let name = file.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    let own = SweepScene { name: name.clone(), scene: scene.clone(), bytes: bytes.len() as u64 };
    let (sources, checksums) = sources(own, &metadata, crc32fast::hash(&bytes), args, session)?;

    make_folder(&args.out)?;
    let belongs = Belongs { version: 2, files: checksums, views: format!("{}, {:?}", views.what, views.size()) };
    let log = Log::open(&args.out.join("visits.jsonl"), &belongs, session.force)?;
    let threads = rayon::current_num_threads();
    let backend = *args.backend.first().unwrap_or(&Backend::Cpu);
    let engine = Engine { backend, half: false };
    let base = Candidate { source: 0, settings: RenderSettings::default(), engine, threads };
    let mut sweep = Sweep { sources: &sources, views: &views, base: base.clone(), log, session };
    let rows = Row::all(measure(&mut sweep, args, scene_error)?, &base, &sources);

    let machine = machine(threads);
    let front = ParetoFront::new(
        machine.clone(),
        base.engine.name().to_owned(),
        views.size(),
        views.what.clone(),
        stored_front(&rows, &base),
        scene_error,
    );
    let report = Report { file: name, against: views.what.clone(), size: views.size(), machine, rows, front };
    report.write(&args.out)?;
    report.write_pictures(&args.out, &sources[0], &base, &views, session)?;
    if args.store {
        let mut notes = metadata.notes;
        notes.insert(TRADE_NOTE.to_owned(), report.front.to_note());
        let with_notes = container::with_notes(&bytes, &notes).map_err(|e| Error::container(file, e))?;
        write_atomically(file, &with_notes, true)?;
        console.say(&format!("{}: {} stored", file.display(), plural(report.front.points.len(), "point")));
    }
    console.result(&report, Report::text)
}

/// All scenes of the sweep, beginning with the file's `own`, which has `metadata`, and the CRC-32 of each file.
fn sources(
    own: SweepScene,
    metadata: &Metadata,
    checksum: u32,
    args: &Args,
    session: &Context,
) -> Result<(Vec<SweepScene>, Vec<u32>), Error> {
    let (mut sources, mut checksums) = (vec![own], vec![checksum]);
    for path in &args.also {
        let (SceneFile { scene, .. }, bytes) = scene_file::read(path, &session.console)?;
        checksums.push(crc32fast::hash(&bytes));
        let name = path.file_stem().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
        sources.push(SweepScene { name, scene, bytes: bytes.len() as u64 });
    }
    if args.encodings {
        sources.extend(encodings::encoded(&sources[0].scene, metadata, session)?);
    }
    Ok((sources, checksums))
}

/// Measures each knob alone, then the combinations that could lie on the Pareto front. Returns knobs, candidates and
/// measurements, the base first.
fn measure(
    sweep: &mut Sweep<'_>,
    args: &Args,
    scene_error: f64,
) -> Result<Vec<(&'static str, Candidate, Measured)>, Error> {
    let base = sweep.base.clone();
    let space = SearchSpace {
        base: base.clone(),
        scene: &sweep.sources[0].scene,
        sources: sweep.sources.len(),
        engines: engines(&args.backend, base.engine),
        threads: threads(&args.threads_list, base.threads, base.engine.backend),
    };
    let knobs = knobs(&space);
    let rounds = usize::from(args.rounds);
    let singles: Vec<Candidate> = knobs.iter().flat_map(|knob| knob.candidates.iter().cloned()).collect();
    sweep.measure("single settings", &singles, 1, rounds)?;
    let alone = sweep.known(&singles, 1);
    let of_base = sweep.known(std::slice::from_ref(&base), 1).pop().map(|(_, m)| m);
    let of_base = of_base.ok_or_else(|| Error::Runtime("nothing was measured".into()))?;
    let likely = combinations(&knobs, &of_base, &alone, args.combinations.into(), scene_error);
    let finalists = sweep.halve(likely, usize::from(args.combinations).div_ceil(4), rounds)?;
    sweep.measure("finalists", &finalists, 1, rounds)?;

    let mut measured = vec![("exact", base, of_base)];
    for knob in &knobs {
        measured.extend(sweep.known(&knob.candidates, 1).into_iter().map(|(c, m)| (knob.name, c, m)));
    }
    measured.extend(sweep.known(&finalists, 1).into_iter().map(|(c, m)| ("several", c, m)));
    Ok(measured)
}

/// The engines of `backends`, except `base`.
fn engines(backends: &[Backend], base: Engine) -> Vec<Engine> {
    let mut engines = Vec::new();
    for &backend in backends {
        let half = (backend == Backend::Gpu).then_some(true);
        for engine in [Some(false), half].into_iter().flatten().map(|half| Engine { backend, half }) {
            if engine != base && !engines.contains(&engine) {
                engines.push(engine);
            }
        }
    }
    engines
}

/// Numbers of threads to measure besides `all`; none for a GPU.
fn threads(wanted: &[u16], all: usize, backend: Backend) -> Vec<usize> {
    if backend == Backend::Gpu {
        return Vec::new();
    }
    let halves = || std::iter::successors(Some(all / 2), |n| Some(n / 2)).take_while(|n| *n > 0).collect();
    let mut threads: Vec<usize> =
        if wanted.is_empty() { halves() } else { wanted.iter().map(|n| usize::from(*n)).collect() };
    threads.retain(|n| *n != all);
    threads
}

/// The processor's name, or its architecture if the name is unknown, and the number of threads.
fn machine(threads: usize) -> String {
    let text = fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let name =
        text.lines().find_map(|line| line.strip_prefix("model name")?.split_once(':')).map(|(_, name)| name.trim());
    format!("{}, {}", name.unwrap_or(std::env::consts::ARCH), plural(threads, "thread"))
}
