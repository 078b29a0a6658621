//! `strivec-pack extract` and `assemble`: a scene as a folder of arrays and a description that other tools can read and
//! change, and back.

use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use glam::{DVec3, UVec3};
use serde::{Deserialize, Serialize};

use super::convert::Written;
use super::encoding::{LayoutArgs, Plain, options_for};
use super::input::{self, LimitArgs, Outputs};
use crate::cli::table::plural;
use crate::cli::{Error, Session};
use crate::container::{self, EncodeOptions, Metadata, SceneFile, TrainingCamera, Views};
use crate::escape::escaped_path;
use crate::geometry::{Aabb, Lattice};
use crate::interop::{ArrayWriter, block_name, write_arrays};
use crate::model::{
    AppearanceMatrix, Block, Decoder, DecoderMode, FactorKind, Factors, Form, Frame, Linear, Occupancy, Placement,
    Provenance, Rules, Scale, Scene, TensorCloud,
};
use crate::npy::{self, Element, Header, NpyError};

/// The description's file name.
const DESCRIPTION: &str = "scene.json";
/// The description's layout: raised when a reader of the last one would misread it.
const LAYOUT: u32 = 1;

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

/// Everything but long arrays.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Description {
    /// [`LAYOUT`].
    layout: u32,
    frame: Frame,
    bounds: Aabb,
    rules: Rules,
    scales: Vec<ScaleDescription>,
    decoder: DecoderDescription,
    /// Bounds of the grid.
    occupancy: Option<Aabb>,
    provenance: Provenance,
    license: Option<String>,
    views: Option<Views>,
    cameras: Vec<TrainingCamera>,
    notes: BTreeMap<String, String>,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ScaleDescription {
    /// Half edges of the tensors.
    half: DVec3,
    resolution: [u32; 3],
    top_k: u32,
    factor_kind: FactorKind,
    /// The lattice; absent if centers are explicit.
    lattice: Option<Lattice>,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct DecoderDescription {
    mode: DecoderMode,
    feature_frequencies: u32,
    direction_frequencies: u32,
    layers: usize,
}

/// Writes a file's scene as a folder.
pub(super) fn extract(args: &ExtractArgs, session: &Session) -> Result<(), Error> {
    if args.output.exists() {
        let message = format!("{}: exists; name a new folder", args.output.display());
        return Err(Error::Usage(message));
    }
    let (document, _) = input::read(&args.input, args.limits, &session.console)?;
    // The folder is written under another name and then renamed, so that it is complete.
    let parent = args.output.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let partial = tempfile::tempdir_in(parent).map_err(Error::io("make a folder in", parent))?;
    let files = files_of(document)?;
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
pub(super) fn assemble(args: &AssembleArgs, session: &Session) -> Result<(), Error> {
    let outputs = Outputs::new(std::slice::from_ref(&args.input), false, &args.output, false, session)?;
    let mut document = Folder(&args.input).document()?;
    let options = options_for(args.encoding, &mut document, true).map_err(|e| Error::container(&args.input, e))?;
    let options = args.layout.for_new(options)?;
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
fn files_of(document: SceneFile) -> Result<BTreeMap<String, Vec<u8>>, Error> {
    let SceneFile { scene, metadata, .. } = document;
    let mut arrays = ArrayFiles(BTreeMap::new());
    write_arrays(&scene, &mut arrays).map_err(|e| Error::Runtime(e.to_string()))?;
    let ArrayFiles(mut files) = arrays;
    let scale = |scale: &Scale| ScaleDescription {
        half: scale.cloud.half_edge,
        resolution: scale.cloud.resolution,
        top_k: scale.top_k,
        factor_kind: scale.factors.kind(),
        lattice: match &scale.cloud.placement {
            Placement::Lattice { lattice, .. } => Some(*lattice),
            Placement::Explicit { .. } => None,
        },
    };
    let decoder = &scene.decoder;
    let description = Description {
        layout: LAYOUT,
        frame: scene.frame.clone(),
        bounds: scene.bounds,
        rules: scene.rules.clone(),
        scales: scene.scales.iter().map(scale).collect(),
        decoder: DecoderDescription {
            mode: decoder.mode,
            feature_frequencies: decoder.feature_frequencies,
            direction_frequencies: decoder.direction_frequencies,
            layers: decoder.layers.len(),
        },
        occupancy: scene.occupancy.as_ref().map(|o| o.bounds),
        provenance: scene.provenance.clone(),
        license: metadata.license,
        views: metadata.views,
        cameras: metadata.cameras,
        notes: metadata.notes,
    };
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
        let malformed = |message: String| Error::Malformed(format!("{}: {message}", path.display()));
        let d: Description = serde_json::from_slice(&bytes).map_err(|e| malformed(e.to_string()))?;
        if d.layout != LAYOUT {
            return Err(malformed(format!("layout {} is not supported; expected {LAYOUT}", d.layout)));
        }
        let scales = d.scales.into_iter().enumerate().map(|(s, scale)| self.scale(s, scale));
        let scales = scales.collect::<Result<_, _>>()?;
        let layers = (0..d.decoder.layers).map(|l| self.layer(l)).collect::<Result<_, _>>()?;
        let decoder = Decoder {
            mode: d.decoder.mode,
            feature_frequencies: d.decoder.feature_frequencies,
            direction_frequencies: d.decoder.direction_frequencies,
            layers,
        };
        let occupancy = d.occupancy.map(|bounds| self.occupancy(bounds)).transpose()?;
        let Description { frame, bounds, rules, provenance, license, views, cameras, notes, .. } = d;
        let scene = Scene { frame, bounds, rules, scales, decoder, occupancy, provenance };
        scene.check().map_err(|e| Error::Malformed(format!("{}: {e}", self.0.display())))?;
        let encoding = EncodeOptions::lossless(&scene);
        Ok(SceneFile { scene, metadata: Metadata { license, views, cameras, notes, ..Metadata::default() }, encoding })
    }

    fn scale(&self, s: usize, scale: ScaleDescription) -> Result<Scale, Error> {
        let (placement, tensors) = match scale.lattice {
            Some(lattice) => {
                let ([tensors, _], cells) = self.array::<u32, 2>(&format!("scale{s}_cells"), [None, Some(3)])?;
                let cells = cells.as_chunks::<3>().0.iter().map(|&cell| UVec3::from_array(cell)).collect();
                (Placement::Lattice { lattice, cells }, tensors)
            }
            None => {
                let ([tensors, _], centers) = self.array::<f64, 2>(&format!("scale{s}_centers"), [None, Some(3)])?;
                let centers = centers.as_chunks::<3>().0.iter().map(|&center| DVec3::from_array(center)).collect();
                (Placement::Explicit { centers }, tensors)
            }
        };
        let limit = container::limits::RESOLUTION;
        if let Some(cells) = scale.resolution.into_iter().find(|&cells| !limit.contains(&u64::from(cells))) {
            let (file, most) = (self.0.join(DESCRIPTION), limit.end());
            let message = format!("{}: scale {s} has {cells} cells; expected 1 to {most}", file.display());
            return Err(Error::Malformed(message));
        }
        let blocks = |part: &str| -> Result<Vec<Block>, Error> {
            let forms = match scale.factor_kind {
                FactorKind::Cp => vec![Form::Cp],
                FactorKind::Vm => (0..3).map(Form::Vm).collect(),
            };
            let is_there =
                |form: &Form| *form == Form::Cp || self.0.join(format!("{}.npy", block_name(s, part, *form))).exists();
            let block = |form: Form| {
                let rows = form.rows(scale.resolution);
                let name = block_name(s, part, form);
                let ([.., rank], values) = self.array::<f32, 3>(&name, [Some(tensors), Some(rows), None])?;
                Ok(Block { form, rank: count(rank)?, values })
            };
            forms.into_iter().filter(is_there).map(block).collect()
        };
        let factors = Factors { density: blocks("density")?, appearance: blocks("appearance")? };
        let columns = Some(factors.appearance_rank() as usize);
        let ([features, rank], weights) = self.array::<f32, 2>(&format!("scale{s}_matrix"), [None, columns])?;
        Ok(Scale {
            cloud: TensorCloud { placement, half_edge: scale.half, resolution: scale.resolution },
            top_k: scale.top_k,
            factors,
            appearance_matrix: AppearanceMatrix { features: count(features)?, rank: count(rank)?, weights },
        })
    }

    fn layer(&self, l: usize) -> Result<Linear, Error> {
        let ([outputs, inputs], weights) = self.array::<f32, 2>(&format!("decoder{l}_weights"), [None, None])?;
        let (_, bias) = self.array::<f32, 1>(&format!("decoder{l}_bias"), [Some(outputs)])?;
        Ok(Linear { inputs: count(inputs)?, outputs: count(outputs)?, weights, bias })
    }

    fn occupancy(&self, bounds: Aabb) -> Result<Occupancy, Error> {
        let ([z, y, x], set) = self.array::<bool, 3>("occupancy", [None; 3])?;
        let mut occupancy = Occupancy::empty(bounds, UVec3::new(count(x)?, count(y)?, count(z)?));
        for bit in (0..set.len()).filter(|&bit| set[bit]) {
            occupancy.words[bit / 64] |= 1 << (bit % 64);
        }
        Ok(occupancy)
    }

    /// The shape and numbers of an array with the `expected` lengths.
    fn array<T: Element, const N: usize>(
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

/// `n` as the model's type of counts.
fn count(n: usize) -> Result<u32, Error> {
    u32::try_from(n).map_err(|_| Error::Malformed(format!("{n} is too large; expected fewer than 2^32")))
}
