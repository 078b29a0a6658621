//! COLMAP, as its program or as Python's pycolmap: the search for it and the command of each stage.
//!
//! All commands run in the folder of the capture, so that no argument depends on how its path is written.

use std::io;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use clap::ValueEnum;
use serde::Deserialize;

use super::super::Error;
use super::folder::{DATABASE, IMAGES, PICTURES, UNSORTED};
use super::options::{Mapper, Matching, Options, name_of};

/// The stages by pycolmap, one per call.
const SCRIPT: &str = include_str!("pycolmap_stage.py");
/// Pictures per block of exhaustive matching; an interrupted matching resumes at a block.
const BLOCK: &str = "10";
/// COLMAP's command for global mapping.
const COLMAP_GLOBAL: &str = "global_mapper";
/// The first version whose matching was measured to be fast on a CPU.
const FAST_MATCHING: (u32, u32) = (4, 0);
const INSTALL: &str = "install one of them: apt install colmap, or pip install pycolmap";

/// Where to look for COLMAP.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Programs")]
pub(super) struct Search {
    /// Program that computes the poses
    #[arg(long, value_enum, default_value_t)]
    program: Choice,
    /// Program of COLMAP, 3.8 or later
    #[arg(long, value_name = "PROGRAM", default_value = "colmap")]
    colmap: PathBuf,
    /// Python with pycolmap, 4 or later [default: $PYTHON, else python3]
    #[arg(long, value_name = "PROGRAM")]
    python: Option<PathBuf>,
}

/// Programs that compute poses.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
enum Choice {
    /// The newer of those that are installed
    #[default]
    Auto,
    /// COLMAP's program
    Colmap,
    /// COLMAP in Python
    Pycolmap,
}

/// An installed COLMAP.
pub(super) struct Colmap {
    kind: Kind,
    program: PathBuf,
    version: String,
    /// Major and minor.
    order: (u32, u32),
}

enum Kind {
    Program {
        /// Names of the groups of options: `SiftExtraction` and `SiftMatching` before COLMAP 3.12.
        extraction: &'static str,
        matching: &'static str,
        /// The program and its command for global mapping.
        global: Option<(PathBuf, &'static str)>,
    },
    Python {
        has_global: bool,
    },
}

/// The output of the script's `version`.
#[derive(Deserialize)]
struct PythonVersion {
    version: String,
    global: bool,
}

impl Search {
    /// The COLMAP to use.
    ///
    /// # Errors
    ///
    /// If it is not installed or too old, with how to install it; if it does not have the mapper of `options`.
    pub(super) fn find(&self, options: &Options) -> Result<Colmap, Error> {
        let python = self.python.clone().or_else(|| std::env::var_os("PYTHON").map(PathBuf::from));
        let (colmap, python) = (&self.colmap, &python.unwrap_or_else(|| "python3".into()));
        let found = match self.program {
            Choice::Colmap => colmap_program(colmap).map_err(|why| {
                let name = colmap.display();
                format!("COLMAP 3.8 or later is needed, but {name} {why}; install it: apt install colmap")
            }),
            Choice::Pycolmap => pycolmap(python).map_err(|why| {
                let name = python.display();
                format!("pycolmap 4 or later is needed, but {name} {why}; install it: pip install pycolmap")
            }),
            Choice::Auto => match (colmap_program(colmap), pycolmap(python)) {
                (Ok(program), Ok(module)) => Ok(if module.order > program.order { module } else { program }),
                (Ok(found), Err(_)) | (Err(_), Ok(found)) => Ok(found),
                (Err(program), Err(module)) => Err(format!(
                    "COLMAP 3.8 or later, or pycolmap 4 or later, is needed, but {} {program} and {} {module}; {INSTALL}",
                    colmap.display(),
                    python.display()
                )),
            },
        };
        let found = found.map_err(Error::Runtime)?;
        if options.mapper == Mapper::Global && !found.has_global_mapper() {
            let message = format!(
                "--mapper global needs pycolmap 4, COLMAP 4 or the program glomap beside COLMAP; {} has no global mapper",
                found.describe()
            );
            return Err(Error::Runtime(message));
        }
        Ok(found)
    }
}

/// COLMAP's program, else what is wrong with it.
fn colmap_program(program: &Path) -> Result<Colmap, String> {
    let program = resolved(program);
    let text = printed(&run(&program, &["help"]).map_err(|error| absent(&error))?);
    let version = text.split_once("COLMAP ").and_then(|(_, rest)| rest.split_whitespace().next());
    let Some(version) = version else { return Err("prints no version of COLMAP".into()) };
    let Some(order) = order_of(version).filter(|order| *order >= (3, 8)) else {
        return Err(format!("is version {version}"));
    };
    let help = |command: &str| run(&program, &[command, "-h"]).map(|output| printed(&output)).unwrap_or_default();
    let feature = |command: &str, group: &str| help(command).contains(&format!("--{group}.use_gpu"));
    let extraction =
        if feature("feature_extractor", "FeatureExtraction") { "FeatureExtraction" } else { "SiftExtraction" };
    let matching = if feature("exhaustive_matcher", "FeatureMatching") { "FeatureMatching" } else { "SiftMatching" };
    let global = if text.contains(COLMAP_GLOBAL) {
        Some((program.clone(), COLMAP_GLOBAL))
    } else {
        run(Path::new("glomap"), &["-h"]).is_ok().then(|| (PathBuf::from("glomap"), "mapper"))
    };
    Ok(Colmap { kind: Kind::Program { extraction, matching, global }, version: version.to_owned(), program, order })
}

/// Python with pycolmap, else what is wrong with it.
fn pycolmap(python: &Path) -> Result<Colmap, String> {
    let program = resolved(python);
    let output = run(&program, &["-c", SCRIPT, "version"]).map_err(|error| absent(&error))?;
    if !output.status.success() {
        let problem = String::from_utf8_lossy(&output.stderr);
        let last = problem.lines().rfind(|line| !line.trim().is_empty()).unwrap_or("no message");
        return Err(format!("cannot import pycolmap ({})", last.trim()));
    }
    let found: Option<PythonVersion> = serde_json::from_slice(&output.stdout).ok();
    let Some(PythonVersion { version, global }) = found else { return Err("prints no version of pycolmap".into()) };
    let Some(order) = order_of(&version).filter(|order| *order >= (4, 0)) else {
        return Err(format!("has pycolmap {version}"));
    };
    Ok(Colmap { kind: Kind::Python { has_global: global }, program, version, order })
}

impl Colmap {
    /// Name, version and program.
    pub(super) fn describe(&self) -> String {
        let name = match self.kind {
            Kind::Program { .. } => "COLMAP",
            Kind::Python { .. } => "pycolmap",
        };
        format!("{name} {} ({})", self.version, self.program.display())
    }

    /// True if it decodes WebP; the packages of pycolmap do not.
    pub(super) fn reads_webp(&self) -> bool {
        matches!(self.kind, Kind::Program { .. })
    }

    /// True if sequential matching also tries the next nine pictures.
    pub(super) fn matches_the_next_nine(&self) -> bool {
        matches!(self.kind, Kind::Program { .. }) && self.order < (3, 12)
    }

    /// True if a later version matches much faster on a CPU.
    pub(super) fn matches_slowly(&self) -> bool {
        self.order < FAST_MATCHING
    }

    fn has_global_mapper(&self) -> bool {
        match &self.kind {
            Kind::Program { global, .. } => global.is_some(),
            Kind::Python { has_global } => *has_global,
        }
    }

    /// Finds features in the listed pictures.
    pub(super) fn features(&self, options: &Options, threads: usize) -> Command {
        let max_features = options.max_features.to_string();
        let mut command;
        match self.kind {
            Kind::Program { extraction, .. } => {
                command = self.stage("feature_extractor");
                command.args(["--image_path", IMAGES, "--image_list_path", PICTURES]);
                command.args(["--ImageReader.camera_model", &options.camera_model]);
                let single = if options.camera_each { "0" } else { "1" };
                command.args(["--ImageReader.single_camera", single]);
                let each = if options.camera_each { "1" } else { "0" };
                command.args(["--ImageReader.single_camera_per_image", each]);
                command.args(["--SiftExtraction.max_num_features", &max_features]);
                on_device(&mut command, extraction, options, threads);
            }
            Kind::Python { .. } => {
                command = self.script("features", options, threads);
                command.args(["--images", IMAGES, "--pictures", PICTURES, "--max-features", &max_features]);
                command.args(["--camera-model", &options.camera_model]);
                if options.camera_each {
                    command.arg("--camera-each");
                }
            }
        }
        command
    }

    /// Matches `pairs`, which is not [`Matching::Auto`], and verifies their geometry.
    pub(super) fn matching(&self, options: &Options, pairs: Matching, threads: usize) -> Command {
        let vocab_tree = options.vocab_tree.as_ref().map(|file| std::path::absolute(file).unwrap_or(file.clone()));
        let mut command;
        match self.kind {
            Kind::Program { matching, .. } if pairs == Matching::Sequential => {
                command = self.stage("sequential_matcher");
                command.args(["--SequentialMatching.quadratic_overlap", "1"]);
                if let Some(file) = vocab_tree {
                    command.args(["--SequentialMatching.loop_detection", "1"]);
                    command.arg("--SequentialMatching.vocab_tree_path").arg(file);
                }
                on_device(&mut command, matching, options, threads);
            }
            Kind::Program { matching, .. } => {
                command = self.stage("exhaustive_matcher");
                command.args(["--ExhaustiveMatching.block_size", BLOCK]);
                on_device(&mut command, matching, options, threads);
            }
            Kind::Python { .. } => {
                command = self.script("matching", options, threads);
                command.args(["--pairs", &name_of(pairs), "--block-size", BLOCK]);
                if let Some(file) = vocab_tree {
                    command.arg("--vocab-tree").arg(file);
                }
            }
        }
        command
    }

    /// Computes poses and points: commands to run in order, with the names of their logs.
    pub(super) fn mapping(&self, options: &Options, threads: usize) -> Vec<(&'static str, Command)> {
        let mut commands = Vec::new();
        let threads_text = threads.to_string();
        let mut command = match (&self.kind, options.mapper) {
            (Kind::Python { .. }, mapper) => {
                let mut command = self.script("mapping", options, threads);
                command.args(["--images", IMAGES, "--output", UNSORTED, "--mapper", &name_of(mapper)]);
                return vec![("mapping", command)];
            }
            (Kind::Program { global: Some((program, mapper)), .. }, Mapper::Global) => {
                if *mapper == COLMAP_GLOBAL {
                    // The global mapper depends on focal lengths, which pictures without EXIF data lack. The program
                    // glomap calibrates by itself.
                    commands.push(("calibration", self.stage("view_graph_calibrator")));
                }
                let mut command = Command::new(program);
                command.args([mapper, "--database_path", DATABASE]);
                command
            }
            (Kind::Program { .. }, _) => {
                let mut command = self.stage("mapper");
                command.args(["--Mapper.num_threads", &threads_text]);
                command
            }
        };
        command.args(["--image_path", IMAGES, "--output_path", UNSORTED]);
        commands.push(("mapping", command));
        commands
    }

    fn stage(&self, name: &str) -> Command {
        let mut command = Command::new(&self.program);
        command.args([name, "--database_path", DATABASE]);
        command
    }

    fn script(&self, stage: &str, options: &Options, threads: usize) -> Command {
        let mut command = Command::new(&self.program);
        command.args(["-c", SCRIPT, stage, "--database", DATABASE, "--threads", &threads.to_string()]);
        if options.gpu {
            command.arg("--gpu");
        }
        command
    }
}

/// The options of `group` that choose the device.
fn on_device(command: &mut Command, group: &str, options: &Options, threads: usize) {
    command.args([format!("--{group}.use_gpu").as_str(), if options.gpu { "1" } else { "0" }]);
    command.args([format!("--{group}.num_threads"), threads.to_string()]);
}

/// `program` so that it does not depend on the folder that it runs in; a name alone is looked up on PATH.
fn resolved(program: &Path) -> PathBuf {
    if program.components().count() > 1 {
        std::path::absolute(program).unwrap_or_else(|_| program.to_path_buf())
    } else {
        program.to_path_buf()
    }
}

fn run(program: &Path, arguments: &[&str]) -> io::Result<Output> {
    Command::new(program).args(arguments).stdin(Stdio::null()).output()
}

/// A program's output on both streams; versions of COLMAP differ in the stream that they use.
fn printed(output: &Output) -> String {
    [&output.stdout, &output.stderr].map(|bytes| String::from_utf8_lossy(bytes).into_owned()).concat()
}

fn absent(error: &io::Error) -> String {
    if error.kind() == io::ErrorKind::NotFound { "is not installed".into() } else { format!("cannot be run: {error}") }
}

/// Major and minor of a version such as 3.8, 3.12.1 or 4.0-dev.
fn order_of(version: &str) -> Option<(u32, u32)> {
    let mut parts = version.split(|c: char| !c.is_ascii_digit());
    Some((parts.next()?.parse().ok()?, parts.next().and_then(|minor| minor.parse().ok()).unwrap_or(0)))
}

#[cfg(test)]
mod tests {
    use super::order_of;

    #[test]
    fn versions_are_ordered_by_number() {
        assert_eq!(["3.8", "3.12.1", "4", "4.0-dev"].map(order_of), [(3, 8), (3, 12), (4, 0), (4, 0)].map(Some));
        assert_eq!(["", "dev", "-1"].map(order_of), [None; 3]);
    }
}
