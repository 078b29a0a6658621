//! `strivec-pack extract` and `assemble`: a scene as a folder of arrays and a description that other tools can read and
//! change, and back.

use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use super::convert::Written;
use super::encoding::{LayoutArgs, Plain, options_for};
use super::input::{self, LimitArgs, Outputs};
use crate::table::plural;
use crate::{Context, Error};
use strivec_export::{ArrayReader, ArrayWriter, SceneDescription, write_arrays};
use strivec_format::container;
use strivec_format::container::SceneFile;
use strivec_format::escape::escaped_path;
use strivec_import::npy;
use strivec_import::npy::{Element, Header, NpyError};

/// The description's file name.
const DESCRIPTION: &str = "scene.json";

/// Arguments of `strivec-pack extract`.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
Example:
  strivec-pack extract lego.strivec -o lego

The folder holds scene.json and arrays for numpy.load: scaleS_density and scaleS_appearance f32[tensor][vertex of x, then \
y, then z][component], scaleS_matrix f32[feature][component], scaleS_cells u32[tensor][3] or scaleS_centers \
f64[tensor][3], decoderL_weights f32[output][input], decoderL_bias, occupancy bool[z][y][x]. Probes, prefix \
corrections, quality figures, the thumbnail and unknown sections are dropped.")]
pub(super) struct ExtractArgs {
    /// Scene file, or - for standard input
    input: PathBuf,
    /// Folder to create
    #[arg(long, short)]
    output: PathBuf,
    #[command(flatten)]
    limits: LimitArgs,
}

/// Arguments of `strivec-pack assemble`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  strivec-pack assemble lego -o lego.strivec")]
pub(super) struct AssembleArgs {
    /// Folder made by `extract`
    input: PathBuf,
    /// File to write, or - for standard output
    #[arg(long, short)]
    output: PathBuf,
    /// Encoding of the factors; keep: f16 if it is lossless, else f32
    #[arg(long, value_enum, default_value_t = Plain::Keep)]
    encoding: Plain,
    #[command(flatten)]
    layout: LayoutArgs,
}

/// Writes a file's scene as a folder.
pub(super) fn extract(args: &ExtractArgs, session: &Context) -> Result<(), Error> {
    if args.output.exists() {
        let message = format!("{}: exists; name a new folder", args.output.display());
        return Err(Error::Usage(message));
    }
    let (document, _) = input::read(&args.input, args.limits, &session.console)?;
    // The folder is written under another name and then renamed, so that it is complete.
    let parent = args.output.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let partial = tempfile::tempdir_in(parent).map_err(Error::io("make a folder in", parent))?;
    let files = files_of(&document)?;
    for (name, bytes) in &files {
        let path = partial.path().join(name);
        fs::write(&path, bytes).map_err(Error::io("write", &path))?;
    }
    let partial = partial.keep();
    fs::rename(&partial, &args.output).map_err(|error| {
        // Remove the folder if it cannot get its name.
        let _ = fs::remove_dir_all(&partial);
        Error::io("make", &args.output)(error)
    })?;
    let names: Vec<&String> = files.keys().collect();
    session.console.result(&names, |names| format!("{}: {}\n", escaped_path(&args.output), plural(names.len(), "file")))
}

/// Writes a folder's scene as a file.
pub(super) fn assemble(args: &AssembleArgs, session: &Context) -> Result<(), Error> {
    let outputs = Outputs::new(std::slice::from_ref(&args.input), false, &args.output, false, session)?;
    let mut document = Folder(&args.input).document()?;
    let options = options_for(args.encoding, &mut document, true).map_err(|e| Error::container(&args.input, e))?;
    args.layout.check()?;
    let options = args.layout.layout().for_new(options);
    let bytes = container::encode_scene_file(&document.scene, &document.metadata, &options)
        .map_err(|e| Error::container(&args.input, e))?;
    let output = outputs.write(&args.input, &bytes)?;
    if outputs.takes_standard_output() {
        return Ok(());
    }
    let bytes = bytes.len() as u64;
    let rows = [Written { input: args.input.clone(), output, bytes_before: bytes, bytes }];
    session.console.result(&rows, |rows| Written::text(rows))
}

/// Names and contents.
fn files_of(document: &SceneFile) -> Result<BTreeMap<String, Vec<u8>>, Error> {
    let mut arrays = ArrayFiles(BTreeMap::new());
    write_arrays(&document.scene, &mut arrays).map_err(|e| Error::Runtime(e.to_string()))?;
    let ArrayFiles(mut files) = arrays;
    let description = SceneDescription::of(&document.scene, &document.metadata);
    let json = serde_json::to_vec_pretty(&description).map_err(|e| Error::Runtime(e.to_string()))?;
    files.insert(DESCRIPTION.into(), json);
    Ok(files)
}

/// Names and contents of `.npy` files.
struct ArrayFiles(BTreeMap<String, Vec<u8>>);

impl ArrayWriter for ArrayFiles {
    fn add<T: Element>(&mut self, name: &str, shape: &[usize], values: impl IntoIterator<Item = T>) -> io::Result<()> {
        let mut bytes = Vec::new();
        npy::write(&mut bytes, shape, values)?;
        self.0.insert(format!("{name}.npy"), bytes);
        Ok(())
    }
}

/// A folder made by `extract`.
struct Folder<'a>(&'a Path);

impl Folder<'_> {
    fn document(&self) -> Result<SceneFile, Error> {
        let path = self.0.join(DESCRIPTION);
        let bytes = fs::read(&path).map_err(Error::io("read", &path))?;
        let description: SceneDescription = serde_json::from_slice(&bytes).map_err(|e| self.refusal(e.to_string()))?;
        description.scene(self)
    }
}

impl ArrayReader for Folder<'_> {
    type Error = Error;

    fn has(&self, name: &str) -> bool {
        self.0.join(format!("{name}.npy")).exists()
    }

    fn refusal(&self, message: String) -> Error {
        Error::Malformed(format!("{}: {message}", self.0.join(DESCRIPTION).display()))
    }

    fn read<T: Element, const N: usize>(
        &self,
        name: &str,
        expected: [Option<usize>; N],
    ) -> Result<([usize; N], Vec<T>), Error> {
        let path = self.0.join(format!("{name}.npy"));
        let bytes = fs::read(&path).map_err(Error::io("read", &path))?;
        let malformed = |message: String| Error::Malformed(format!("{}: {message}", path.display()));
        let mut rest = bytes.as_slice();
        let header = Header::read(&mut rest).map_err(|e| malformed(e.to_string()))?;
        if header.number != T::NUMBER {
            return Err(malformed(format!("expected numbers of type {:?}, found {:?}", T::NUMBER, header.number)));
        }
        let shape: Vec<usize> = header.shape.iter().map(|&n| n as usize).collect();
        let fits = shape.len() == N && expected.iter().zip(&shape).all(|(e, &n)| e.is_none_or(|e| e == n));
        if !fits {
            let lengths = expected.map(|e| e.map_or("any".into(), |n| n.to_string())).join(", ");
            return Err(malformed(format!("expected an array of lengths {lengths}, found {shape:?}")));
        }
        if header.fortran_order && N > 1 {
            return Err(malformed("the array is in Fortran order; expected C order".into()));
        }
        if header.bytes() != rest.len() as u64 {
            let (expected, found) = (header.bytes(), rest.len());
            return Err(malformed(format!("expected the {expected} bytes of {shape:?}, found {found}")));
        }
        let mut values = Vec::with_capacity(header.count as usize);
        header
            .for_each(&mut rest, |_, value| {
                values.push(T::from_f64(value));
                Ok::<_, NpyError>(())
            })
            .map_err(|e| malformed(e.to_string()))?;
        Ok((shape.try_into().expect("of this many dimensions"), values))
    }
}
