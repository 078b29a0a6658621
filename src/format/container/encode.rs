//! From a scene to bytes.

use std::collections::BTreeMap;

use super::codec::Codec;
use super::encoding::{ArrayOptions, Encoding, Filter};
use super::error::Error;
use super::metadata::Metadata;
use super::section::{Section, SectionKind};
use super::writer::{FinishedSection, Rewriter, SectionPlace};
use super::{
    chunks, decoder, factors, frame, limits, matrix, occupancy, parallel, placement, prefix, probes, provenance, rules,
    scale, table,
};
use crate::binary16;
use crate::model::{Block, Factors, Form, Placement, Scale, Scene};

/// Choices of the writer; the same scene with the same choices gives the same bytes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct EncodeOptions {
    /// How density factors are written, a scale; the last one holds for all further scales.
    pub density: Vec<FactorOptions>,
    /// How appearance factors are written, a scale; the last one holds for all further scales.
    pub appearance: Vec<FactorOptions>,
    /// How matrices and decoder are written.
    pub networks: ArrayOptions,
    /// Step codes of matrices and decoder, for grids.
    pub network_steps: NetworkSteps,
    /// \[scale\]\[tensor\] the number of the tensor's chunk; a scale without any is cut by `chunk_tensors`.
    pub chunks: Vec<Vec<u32>>,
    /// Tensors of a chunk, at most.
    pub chunk_tensors: usize,
    /// zstd's compression level, 1 to 22, or `None` to compress nothing; reading is equally fast for all.
    pub zstd_level: Option<i32>,
}

/// Step codes of the rows of matrices and decoder; where there are none, the finest steps that reach every number.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct NetworkSteps {
    /// DECODER.
    pub decoder: Vec<u8>,
    /// \[scale\] MATRIX.
    pub matrices: Vec<Vec<u8>>,
    /// \[scale\] PREFIX.
    pub prefixes: Vec<Vec<u8>>,
}

/// A file that an edit began with: its bytes, and what was decoded from them.
#[derive(Clone, Copy, Debug)]
pub struct Original<'a> {
    /// The whole file.
    pub bytes: &'a [u8],
    /// The scene that was decoded from the file.
    pub scene: &'a Scene,
    /// The ancillary parts of the file.
    pub metadata: &'a Metadata,
    /// How it stores the scene's numbers.
    pub encoding: &'a EncodeOptions,
}

/// How some of a scale's factors are written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FactorOptions {
    /// As floats or integers, and in which arrangement.
    pub array: ArrayOptions,
    /// \[block\]\[tensor\]\[component\] step codes for grids ([`super::step`]); `None` for the finest steps that reach every
    /// number. A reader returns them with floats if a scale's chunks differ in their encodings.
    pub steps: Option<Vec<Vec<u8>>>,
}

impl FactorOptions {
    /// True if both name the same encoding and filter, and both or none name steps.
    fn is_like(&self, other: &Self) -> bool {
        (self.array, self.steps.is_some()) == (other.array, other.steps.is_some())
    }

    /// `encoding`, with nothing else chosen.
    pub fn new(encoding: Encoding) -> Self {
        Self { array: ArrayOptions::best(encoding), steps: None }
    }

    /// Drops the step codes of all but the `kept` of a scale's `tensors`.
    fn keep_tensors(&mut self, kept: &[usize], tensors: usize) {
        for steps in self.steps.iter_mut().flatten() {
            let of_tensor = steps.len() / tensors.max(1);
            *steps = kept.iter().flat_map(|n| &steps[n * of_tensor..][..of_tensor]).copied().collect();
        }
    }
}

impl EncodeOptions {
    /// All factors in `encoding`.
    pub fn uniform(encoding: Encoding) -> Self {
        let factors = vec![FactorOptions::new(encoding)];
        Self { density: factors.clone(), appearance: factors, ..Self::default() }
    }

    /// Drops what belongs to all but the `kept` of the `tensors` of `scale`.
    pub fn keep_tensors(&mut self, scale: usize, kept: &[usize], tensors: usize) {
        for factors in [&mut self.density, &mut self.appearance] {
            if let Some(factors) = factors.get_mut(scale) {
                factors.keep_tensors(kept, tensors);
            }
        }
        if let Some(chunks) = self.chunks.get_mut(scale).filter(|chunks| chunks.len() == tensors) {
            *chunks = kept.iter().map(|&n| chunks[n]).collect();
        }
    }

    /// Floats: 16 bits where that loses nothing of `scene`, else 32 bits.
    pub fn lossless(scene: &Scene) -> Self {
        let factors = scene.scales.iter().flat_map(|scale| scale.factors.blocks().map(|block| &block.values));
        let is_half = |value: &f32| binary16::value_of(binary16::bits_of(*value)).to_bits() == value.to_bits();
        Self::uniform(if factors.flatten().all(is_half) { Encoding::F16 } else { Encoding::F32 })
    }
}

impl Default for EncodeOptions {
    /// Half-precision factors at level 9, which writes quickly enough not to be noticed after training.
    fn default() -> Self {
        let factors = vec![FactorOptions::new(Encoding::F16)];
        Self {
            density: factors.clone(),
            appearance: factors,
            networks: ArrayOptions { encoding: Encoding::F32, filter: Filter::None },
            network_steps: NetworkSteps::default(),
            chunks: Vec::new(),
            chunk_tensors: 1024,
            zstd_level: Some(9),
        }
    }
}

/// The `.strivec` file of `scene` and nothing else.
///
/// # Errors
///
/// As for [`encode_scene_file`].
pub fn encode(scene: &Scene, options: &EncodeOptions) -> Result<Vec<u8>, Error> {
    encode_scene_file(scene, &Metadata::default(), options)
}

/// The `.strivec` file of `scene` and `metadata`.
///
/// # Errors
///
/// Where the scene breaks an invariant ([`Scene::check`]) or exceeds a limit of the format ([`limits`]), where a
/// number does not fit the encoding, or where the options are not valid.
pub fn encode_scene_file(scene: &Scene, metadata: &Metadata, options: &EncodeOptions) -> Result<Vec<u8>, Error> {
    write(scene, metadata, options, None)
}

/// The `.strivec` file of `scene` and `metadata`, which an edit has made of `original`. Every section whose content is as
/// before is a copy of the original's payload. The others are written with `options`, and in the original's codec where
/// their encoding is as before.
///
/// # Errors
///
/// As for [`encode_scene_file`]; and if the original's bytes are not a whole file.
pub fn rewrite_scene_file(
    scene: &Scene,
    metadata: &Metadata,
    options: &EncodeOptions,
    original: Original<'_>,
) -> Result<Vec<u8>, Error> {
    let contents = table::sections(original.bytes)?;
    contents.check_whole(original.bytes)?;
    write(scene, metadata, options, Some((original, &contents.sections)))
}

fn write(
    scene: &Scene,
    metadata: &Metadata,
    options: &EncodeOptions,
    original: Option<(Original<'_>, &[Section])>,
) -> Result<Vec<u8>, Error> {
    scene.check()?;
    if let Some(level) = options.zstd_level
        && !(1..=22).contains(&level)
    {
        return Err(Error::Level { found: level });
    }
    limits::check("scales", limits::SCALES, scene.scales.len())?;
    let mut out = Rewriter::new(options.zstd_level, original.map(|(original, sections)| (original.bytes, sections)));
    let before = original.map(|(original, _)| original);
    let is_same = |same: &dyn Fn(&Scene) -> bool| before.is_some_and(|before| same(before.scene));

    let same = is_same(&|b| b.frame == scene.frame);
    out.put(SectionPlace::whole(SectionKind::Frame), same, |writer| {
        writer.record(SectionPlace::whole(SectionKind::Frame), frame::write(&scene.frame)?);
        Ok(())
    })?;
    let same = is_same(&|b| b.rules == scene.rules && b.bounds == scene.bounds && b.scales.len() == scene.scales.len());
    out.put(SectionPlace::whole(SectionKind::Rules), same, |writer| {
        writer.record(SectionPlace::whole(SectionKind::Rules), rules::write(scene)?);
        Ok(())
    })?;
    let same = is_same(&|b| b.provenance == scene.provenance);
    out.put(SectionPlace::whole(SectionKind::Provenance), same, |writer| {
        writer.record(SectionPlace::whole(SectionKind::Provenance), provenance::write(&scene.provenance)?);
        Ok(())
    })?;
    metadata.write_head(&mut out, scene.scales.len(), before.map(|b| b.metadata))?;
    let same = is_same(&|b| b.decoder == scene.decoder);
    out.put(SectionPlace::whole(SectionKind::Decoder), same, |writer| {
        decoder::write(writer, &scene.decoder, (options.networks, &options.network_steps.decoder))
    })?;
    if let Some(occupancy) = &scene.occupancy {
        let same = is_same(&|b| b.occupancy.as_ref() == Some(occupancy));
        out.put(SectionPlace::whole(SectionKind::Occupancy), same, |writer| occupancy::write(writer, occupancy))?;
    }
    for s in 0..scene.scales.len() {
        write_scale(&mut out, scene, s, options, before)?;
        if let Some(Some(correction)) = metadata.prefixes.get(s).filter(|_| s + 1 < scene.scales.len()) {
            let same = before.is_some_and(|b| b.metadata.prefixes.get(s) == metadata.prefixes.get(s));
            let steps = options.network_steps.prefixes.get(s).map_or(&[][..], Vec::as_slice);
            out.put(SectionPlace::in_scale(SectionKind::Prefix, s as u16), same, |writer| {
                prefix::write(writer, s as u16, correction, (options.networks, steps))
            })?;
        }
    }
    if let Some(probes) = &metadata.probes {
        probes::check_steps(probes, &scene.rules, &scene.bounds)?;
    }
    metadata.write_tail(&mut out, before.map(|b| b.metadata))?;
    out.writer.finish()
}

/// Writes the sections of scale `s`, but PREFIX.
fn write_scale(
    out: &mut Rewriter<'_>,
    scene: &Scene,
    s: usize,
    options: &EncodeOptions,
    original: Option<Original<'_>>,
) -> Result<(), Error> {
    let (scale, index) = (&scene.scales[s], s as u16);
    let before = original.and_then(|original| original.scene.scales.get(s));
    let chunk_of = options.chunks.get(s).filter(|chunk_of| !chunk_of.is_empty());
    // The chunks, and their numbers before.
    let (numbers, chunks): (Vec<u32>, Vec<Vec<u32>>) = match chunk_of {
        Some(chunk_of) => {
            let place = format!("length of `EncodeOptions::chunks` of scale {s}");
            Error::unless_equal(place, scale.cloud.len(), chunk_of.len())?;
            chunks::chunks_from(chunk_of).into_iter().unzip()
        }
        None => (0..).zip(chunks::chunks_of(&scale.cloud, options.chunk_tensors)).unzip(),
    };
    let kept = original.filter(|_| chunk_of.is_some()).and_then(|original| KeptChunks::new(original, s, scale));

    let is_same = kept.as_ref().is_some_and(|kept| kept.is_whole(&chunks));
    out.put(SectionPlace::in_scale(SectionKind::Scale, index), is_same, |writer| {
        scale::write(writer, index, scale, &chunks)
    })?;
    let is_same = before.is_some_and(|before| before.appearance_matrix == scale.appearance_matrix);
    out.put(SectionPlace::in_scale(SectionKind::Matrix, index), is_same, |writer| {
        let steps = options.network_steps.matrices.get(s).map_or(&[][..], Vec::as_slice);
        matrix::write(writer, index, &scale.appearance_matrix, (options.networks, steps))
    })?;

    let compression = out.writer.compression();
    let of_chunk = |(chunk, (&number, tensors)): (u32, (&u32, &Vec<u32>))| -> Result<[FinishedSection; 3], Error> {
        let place = |kind| SectionPlace::in_chunk(kind, index, chunk);
        let copy = |kind| out.copied(SectionPlace::in_chunk(kind, index, number), place(kind));
        let kept = kept.as_ref().and_then(|kept| Some((kept, kept.tensors(number, tensors)?)));
        let placement = match kept.filter(|(kept, _)| kept.same_numbering).and_then(|_| copy(SectionKind::Placement)) {
            Some(section) => section,
            None => placement::write(compression, index, chunk, &scale.cloud, tensors)?,
        };
        let factors = |kind, part: usize| {
            let blocks = parts(&scale.factors)[part];
            let of_scales = [&options.density, &options.appearance][part];
            let no_options =
                || Error::malformed("`EncodeOptions::density` and `appearance`", "at least one entry each", "none");
            let wanted = of_scales.get(s).or(of_scales.last()).ok_or_else(no_options)?;
            let encoding_before =
                original.and_then(|original| [&original.encoding.density, &original.encoding.appearance][part].get(s));
            let keeps_encoding = encoding_before.is_some_and(|before| before.is_like(wanted));
            let is_same = kept.is_some_and(|(kept, before)| kept.same_numbers(part, before, tensors));
            if keeps_encoding
                && is_same
                && let Some(section) = copy(kind)
            {
                return Ok(section);
            }
            let codec = out.codec(SectionPlace::in_chunk(kind, index, if chunk_of.is_some() { number } else { 0 }));
            let compression =
                if keeps_encoding && codec == Some(Codec::Zstd) { compression.by_zstd() } else { compression };
            let part = factors::ScalePart { blocks, resolution: scale.cloud.resolution };
            factors::write(compression, place(kind), &part, tensors, wanted.array, wanted.steps.as_deref())
        };
        Ok([placement, factors(SectionKind::Density, 0)?, factors(SectionKind::Appearance, 1)?])
    };
    let finished = parallel::map((0..).zip(numbers.iter().zip(&chunks)).collect(), of_chunk);
    for sections in finished {
        sections?.into_iter().for_each(|section| out.writer.add(section));
    }
    Ok(())
}

/// The blocks of density and of appearance.
fn parts(factors: &Factors) -> [&[Block]; 2] {
    [&factors.density, &factors.appearance]
}

/// A scale before and after an edit that keeps its division into chunks.
struct KeptChunks<'a> {
    before: &'a Scale,
    after: &'a Scale,
    /// The tensors of each chunk before.
    chunks: BTreeMap<u32, Vec<u32>>,
    /// Cells have the same numbers in PLACEMENT.
    same_numbering: bool,
}

impl<'a> KeptChunks<'a> {
    /// `None` if the original has no such scale.
    fn new(original: Original<'a>, s: usize, after: &'a Scale) -> Option<Self> {
        let before = original.scene.scales.get(s)?;
        let chunk_of = original.encoding.chunks.get(s).filter(|chunk_of| chunk_of.len() == before.cloud.len())?;
        let chunks = chunks::chunks_from(chunk_of);
        let same_numbering = match (&before.cloud.placement, &after.cloud.placement) {
            (Placement::Explicit { .. }, Placement::Explicit { .. }) => true,
            (Placement::Lattice { lattice, cells }, Placement::Lattice { lattice: other, cells: left }) => {
                lattice == other && scale::extent_of(cells) == scale::extent_of(left)
            }
            _ => false,
        };
        Some(Self { before, after, chunks, same_numbering })
    }

    /// True if nothing of the scale changed that is in SCALE.
    fn is_whole(&self, chunks: &[Vec<u32>]) -> bool {
        let Self { before, after, .. } = self;
        let ranks =
            |scale: &Scale| parts(&scale.factors).map(|blocks| blocks.iter().map(Self::shape).collect::<Vec<_>>());
        before.cloud == after.cloud
            && (before.top_k, ranks(before)) == (after.top_k, ranks(after))
            && self.chunks.values().eq(chunks)
    }

    /// The numbers that the tensors of chunk `number` had before, if they are those that now have the numbers `tensors`.
    fn tensors(&self, number: u32, tensors: &[u32]) -> Option<&[u32]> {
        let (before, after) = (&self.before.cloud, &self.after.cloud);
        let of_chunk = self.chunks.get(&number).filter(|of_chunk| of_chunk.len() == tensors.len())?;
        let mut pairs = of_chunk.iter().zip(tensors);
        let same_shape = (before.half_edge, before.resolution) == (after.half_edge, after.resolution);
        let same = same_shape && pairs.all(|(&b, &a)| before.center(b as usize) == after.center(a as usize));
        same.then_some(of_chunk)
    }

    /// True if the tensors `before` had the same numbers, bit for bit, as the tensors `after` have in this part.
    fn same_numbers(&self, part: usize, before: &[u32], after: &[u32]) -> bool {
        let [old, new] = [self.before, self.after].map(|scale| parts(&scale.factors)[part]);
        old.len() == new.len()
            && old.iter().zip(new).all(|(old, new)| {
                let length = new.tensor_len(self.after.cloud.resolution);
                let of = |block: &'a Block, n: u32| {
                    block.values[n as usize * length..][..length].iter().map(|v| v.to_bits())
                };
                Self::shape(old) == Self::shape(new)
                    && before.iter().zip(after).all(|(&b, &a)| of(old, b).eq(of(new, a)))
            })
    }

    fn shape(block: &Block) -> (Form, u32) {
        (block.form, block.rank)
    }
}
