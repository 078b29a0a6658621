//! `strivec pose`: camera poses of photographs or of a video, by COLMAP.
//!
//! Four stages: the pictures are placed in the folder of the capture, COLMAP finds features in them, matches pairs, and
//! computes poses and points. Each finished stage is recorded, so that the same command resumes.

mod folder;
mod frames;
mod model;
mod options;
mod pairs;
mod photographs;
mod process;
mod programs;
mod report;

use std::fs;
use std::path::PathBuf;
use std::process::Command;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use super::numbers::in_range;
use super::output::make_folder;
use super::progress::Progress;
use super::table::plural;
use super::{Context, Error, write_atomically};
use folder::{CaptureFolder, FinishedStage, IMAGES, Inputs, PICTURES, PoseStage, UNSORTED};
use frames::SourceVideo;
use options::{Mapper, Matching, Options, name_of};
use pairs::PairsTried;
use photographs::Photographs;
use programs::{Colmap, Search};
use report::Report;
use strivec_format::digits::grouped;

const EXAMPLES: &str = "\
Examples:
  strivec pose photos -o capture
  strivec pose walk.mp4 -o capture --frames 200
  strivec pose photos -o capture --camera-each --camera-model SIMPLE_RADIAL
  strivec pose photos -o capture --program pycolmap --python venv/bin/python --mapper global

Needs COLMAP (apt install colmap) or pycolmap (pip install pycolmap), and for videos ffmpeg (apt install ffmpeg). DIR \
receives the pictures (images), COLMAP's models (sparse/0 is the largest), logs, and pose.json, which records finished \
stages. Ctrl-C stops with exit code 4; the same command resumes after the last finished stage. --force begins anew: it \
removes what a run with the same DIR has written. Photographs are JPEG, PNG, TIFF or, with COLMAP's \
program, WebP files; they are never changed.";

/// Pictures below which no model can be computed.
const MIN_PICTURES: usize = 3;
/// Pairs from which faster ways to match are named.
const MANY_PAIRS: u64 = 1000;
/// Skipped files that messages list.
const LISTED: usize = 5;

/// The arguments.
#[derive(Debug, clap::Args)]
#[command(after_help = EXAMPLES)]
pub(super) struct Args {
    /// Folder of photographs, or a video
    #[arg(value_name = "PHOTOS|VIDEO")]
    source: PathBuf,
    /// Folder for the pictures and COLMAP's model; created if absent
    #[arg(long, short, value_name = "DIR")]
    output: PathBuf,
    /// Hard-link photographs if the file system can [default: copy]
    #[arg(long)]
    link: bool,
    /// Frames of a video, at most; the sharpest of each interval is used
    #[arg(long, value_name = "N", default_value_t = 150, value_parser = clap::value_parser!(u32).range(3..=100_000))]
    frames: u32,
    /// Time between two frames of a video, in seconds, at least
    #[arg(long, value_name = "S", default_value_t = 0.2, value_parser = in_range(0.0..=f64::MAX, "a time in seconds"))]
    min_gap: f64,
    #[command(flatten)]
    options: Options,
    #[command(flatten)]
    search: Search,
}

/// Computes the poses.
pub(super) fn run(args: &Args, session: &Context) -> Result<(), Error> {
    let interrupted = session.interrupts()?;
    let metadata = fs::metadata(&args.source).map_err(Error::io("read", &args.source))?;
    if let Some(file) = &args.options.vocab_tree {
        fs::File::open(file).map_err(Error::io("read", file))?;
    }
    let colmap = args.search.find(&args.options)?;
    let source = if metadata.is_dir() {
        PoseSource::Photographs(photographs(args, &colmap)?)
    } else {
        PoseSource::Video(SourceVideo::open(&args.source)?)
    };
    let inputs = inputs(args, &source, &colmap)?;
    let mut capture = CaptureFolder::open(&args.output, &args.source, inputs, session.force)?;
    session.console.say(&format!("pose: {} with {}", capture.folder().display(), colmap.describe()));
    source.skipped().iter().take(LISTED).for_each(|file| session.console.say(&format!("skipped: {file}")));
    if source.skipped().len() > LISTED {
        session.console.say(&format!("skipped: {} more", source.skipped().len() - LISTED));
    }
    let names = PoseRun { args, session, interrupted: &interrupted, capture: &mut capture }.all(&source, &colmap)?;
    let report = Report::read(&capture, colmap.describe(), &names, source.skipped().to_vec())?;
    session.console.result(&report, Report::text)
}

/// The photographs or the video.
enum PoseSource {
    Photographs(Photographs),
    Video(SourceVideo),
}

impl PoseSource {
    fn skipped(&self) -> &[String] {
        match self {
            Self::Photographs(photographs) => &photographs.skipped,
            Self::Video(_) => &[],
        }
    }
}

/// The photographs in the source's folder that `colmap` reads.
fn photographs(args: &Args, colmap: &Colmap) -> Result<Photographs, Error> {
    let mut photographs = Photographs::list(&args.source)?;
    if !colmap.reads_webp() {
        photographs.skip_webp(&colmap.describe());
    }
    let count = photographs.pictures.len();
    if count < MIN_PICTURES {
        let skipped = photographs.skipped.first().map_or_else(String::new, |file| format!(" (skipped: {file})"));
        return Err(Error::Malformed(format!(
            "{}: {} in the folder{skipped}; at least {MIN_PICTURES} JPEG, PNG, TIFF, WebP or BMP files are needed",
            args.source.display(),
            plural(count, "photograph")
        )));
    }
    if !args.options.camera_each {
        photographs.check_one_size()?;
    }
    Ok(photographs)
}

/// The inputs that decide the result, for comparison with the run that a command resumes.
fn inputs(args: &Args, source: &PoseSource, colmap: &Colmap) -> Result<Inputs, Error> {
    let Options { camera_model, camera_each, max_features, matching, vocab_tree, mapper, gpu } = &args.options;
    let path = fs::canonicalize(&args.source).map_err(Error::io("read", &args.source))?;
    let mut inputs: Vec<(&str, String)> = vec![
        ("source", path.display().to_string()),
        ("COLMAP", colmap.describe()),
        ("--camera-model", camera_model.clone()),
        ("--camera-each", camera_each.to_string()),
        ("--max-features", max_features.to_string()),
        ("--matching", name_of(*matching)),
        ("--vocab-tree", vocab_tree.as_ref().map_or_else(|| "none".into(), |file| file.display().to_string())),
        ("--mapper", name_of(*mapper)),
        ("--gpu", gpu.to_string()),
    ];
    match source {
        PoseSource::Photographs(photographs) => inputs.push(("photographs", photographs.fingerprint())),
        PoseSource::Video(video) => {
            inputs.push(("video", video.fingerprint()?));
            inputs.push(("--frames", args.frames.to_string()));
            inputs.push(("--min-gap", args.min_gap.to_string()));
        }
    }
    Ok(inputs.into_iter().map(|(name, value)| (name.to_owned(), value)).collect())
}

/// Faster ways than `colmap` and `matching` to match `pictures`, a sentence each.
fn faster_ways(colmap: &Colmap, matching: Matching, pictures: usize) -> Vec<String> {
    let mut ways = Vec::new();
    if colmap.matches_slowly() {
        ways.push(
            "pycolmap 4 (pip install pycolmap) matched 292 photographs in a twentieth of the time of COLMAP 3.8".into(),
        );
    }
    if matching == Matching::Exhaustive {
        let pairs = |matching| grouped(PairsTried::new(matching, pictures, false, false).total());
        let [all, some] = [Matching::Exhaustive, Matching::Sequential].map(pairs);
        ways.push(format!(
            "all {all} pairs; --matching sequential tries {some}, which is enough if the order of names is that of the way"
        ));
    }
    ways
}

/// A run.
struct PoseRun<'a> {
    args: &'a Args,
    session: &'a Context,
    interrupted: &'a AtomicBool,
    capture: &'a mut CaptureFolder,
}

impl PoseRun<'_> {
    /// All stages that are not finished; returns the names of the pictures.
    fn all(&mut self, source: &PoseSource, colmap: &Colmap) -> Result<Vec<String>, Error> {
        let threads = rayon::current_num_threads();
        let options = &self.args.options;
        match source {
            PoseSource::Photographs(photographs) => {
                let total = photographs.pictures.len() as u64;
                self.stage(PoseStage::Pictures, total, |work, progress| work.photographs(photographs, progress))?;
            }
            PoseSource::Video(video) => {
                self.stage(PoseStage::Pictures, video.frames(), |work, progress| work.frames(video, progress))?;
            }
        }
        let listed = self.capture.path(PICTURES);
        let names = fs::read_to_string(&listed).map_err(Error::io("read", &listed))?;
        let names: Vec<String> = names.lines().map(str::to_owned).collect();
        let count = names.len();

        self.stage(PoseStage::Features, count as u64, |work, progress| {
            let scaled = |line: &str| process::counter(line).map(|[done, _]| done);
            work.program("features", colmap.features(options, threads), progress, &scaled)?;
            Ok(plural(count, "picture"))
        })?;

        let pairs = options.matching.of(count);
        let tried = PairsTried::new(pairs, count, colmap.matches_the_next_nine(), options.vocab_tree.is_some());
        let total = tried.total();
        self.stage(PoseStage::Matching, total, |work, progress| {
            if total >= MANY_PAIRS {
                faster_ways(colmap, pairs, count).iter().for_each(|way| progress.say(&format!("matching: {way}")));
            }
            if pairs == Matching::Sequential && options.vocab_tree.is_none() {
                progress.say("matching: sequential without loop detection; --vocab-tree FILE adds it");
            }
            let scaled = |line: &str| process::counter(line).map(|counter| tried.done(counter));
            work.program("matching", colmap.matching(options, pairs, threads), progress, &scaled)?;
            Ok(name_of(pairs))
        })?;

        self.stage(PoseStage::Mapping, count as u64, |work, progress| {
            let unsorted = work.capture.path(UNSORTED);
            folder::remove(&unsorted, |path| fs::remove_dir_all(path))?;
            make_folder(&unsorted)?;
            if options.mapper == Mapper::Global {
                progress.say("mapping: global: poses may be wrong although the reprojection error is small");
            }
            for (task, command) in colmap.mapping(options, threads) {
                work.program(task, command, progress, &process::registered)?;
            }
            if !model::sort(work.capture.folder())? {
                let problem =
                    "mapping: COLMAP found no model; if the pictures overlap too little, take more between them";
                return Err(process::with_end_of(&work.capture.log("mapping")?, problem));
            }
            report::mapping_found(work.capture.folder(), count)
        })?;
        Ok(names)
    }

    /// Runs `work`, which returns what it found, as `stage` of `total` steps, unless it is finished.
    fn stage(
        &mut self,
        stage: PoseStage,
        total: u64,
        work: impl FnOnce(&mut Self, &Progress<'_>) -> Result<String, Error>,
    ) -> Result<(), Error> {
        let task = name_of(stage);
        let console = &self.session.console;
        if let Some(finished) = self.capture.finished(stage) {
            console.say(&format!("{task}: {} (finished before)", finished.found));
            return Ok(());
        }
        let progress = Progress::start(console, &task, total);
        let start = Instant::now();
        let found = work(self, &progress)?;
        let seconds = start.elapsed().as_secs_f64();
        progress.finish(&format!("{task}: {found} in {seconds:.1} s"));
        self.capture.finish(FinishedStage { stage, seconds, found })
    }

    /// Runs `command` in the folder of the capture; `done` reads the number of steps from a line of its output.
    fn program(
        &mut self,
        task: &str,
        mut command: Command,
        progress: &Progress<'_>,
        done: &dyn Fn(&str) -> Option<u64>,
    ) -> Result<(), Error> {
        command.current_dir(self.capture.folder());
        let log = self.capture.log(task)?;
        let mut line = |line: &str| {
            if let Some(done) = done(line) {
                progress.set(done, String::new);
            }
        };
        process::run(task, command, &log, self.interrupted, &mut line)
    }

    /// Places photographs.
    fn photographs(&mut self, photographs: &Photographs, progress: &Progress<'_>) -> Result<String, Error> {
        let images = self.capture.path(IMAGES);
        let names = || photographs.pictures.iter().map(|picture| picture.name.clone());
        let count = plural(photographs.pictures.len(), "photograph");
        self.list(names())?;
        if photographs.are_in(&images) {
            self.capture.place([])?;
            return Ok(format!("{count} in place"));
        }
        self.capture.place(names())?;
        make_folder(&images)?;
        photographs.place(&images, self.args.link, progress, self.interrupted)?;
        Ok(format!("{count} {}", if self.args.link { "linked or copied" } else { "copied" }))
    }

    /// Extracts the frames of a video.
    fn frames(&mut self, video: &SourceVideo, progress: &Progress<'_>) -> Result<String, Error> {
        let images = self.capture.path(IMAGES);
        make_folder(&images)?;
        let (count, gap) = (self.args.frames as usize, self.args.min_gap);
        let log = self.capture.log("frames")?;
        let chosen = video.sharpest(count, gap, &log, progress, self.interrupted)?;
        if chosen.len() < MIN_PICTURES {
            let message = format!("{}: too short for {MIN_PICTURES} frames", self.args.source.display());
            return Err(Error::Malformed(message));
        }
        self.list(frames::frame_names(chosen.len()))?;
        self.capture.place(frames::frame_names(chosen.len()))?;
        let extraction = Progress::start(&self.session.console, "writing frames", chosen.len() as u64);
        video.extract(&chosen, &images, &log, &extraction, self.interrupted)?;
        drop(extraction);
        Ok(format!("the {} sharpest frames", chosen.len()))
    }

    /// Writes the list of pictures for COLMAP.
    fn list(&self, names: impl Iterator<Item = String>) -> Result<(), Error> {
        let text: String = names.map(|name| name + "\n").collect();
        write_atomically(&self.capture.path(PICTURES), text.as_bytes(), true)
    }
}
