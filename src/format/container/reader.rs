//! From bytes to a scene, whole or in part (spec 2.4).

use super::encode::{EncodeOptions, FactorOptions};
use super::encoding::{ArrayOptions, Encoding};
use super::error::Error;
use super::factors::BlockShape;
use super::fetch::{Fetched, fetch};
use super::limits::{Budget, Limits};
use super::metadata::{Metadata, SkippedSection, UnknownSection};
use super::order::{ScaleSections, SectionOrder};
use super::part::Part;
use super::prefix::Prefix;
use super::section::{Section, SectionKind, name_of};
use super::source::Source;
use super::table::Contents;
use super::{
    decoder, factors, frame, matrix, occupancy, parallel, placement, prefix, probes, provenance, rules, scale, table,
};
use crate::geometry::Aabb;
use crate::model::{
    Decoder, Factors, Form, Frame, MemoryLimit, Occupancy, Provenance, Rules, Scale, Scene, TensorCloud,
};

/// Bytes of the first request: header and table of most files.
const FIRST_READ: u64 = 16 << 10;
/// Chunks that are decoded at once.
const PARALLEL_CHUNKS: usize = 16;

/// A scene and the ancillary parts of its file.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneFile {
    /// The scene.
    pub scene: Scene,
    /// The ancillary parts.
    pub metadata: Metadata,
    /// How the file stores the scene's numbers: writing with these options gives the same numbers again.
    /// `chunk_tensors` and `zstd_level` are the defaults.
    pub encoding: EncodeOptions,
}

/// Decodes the scene of a whole `.strivec` file (spec 2.4). The scene passes [`Scene::check`].
///
/// Ancillary sections never prevent that: those that cannot be used are skipped.
///
/// # Errors
///
/// If the bytes are not a whole, undamaged file of this major version whose scene is valid, or if decoding takes more
/// memory than [`Limits::of_file`] allows.
///
/// # Examples
///
/// ```
/// use strivec_format::container::{Error, decode};
///
/// assert!(matches!(decode(b"ply\nformat ascii 1.0\n"), Err(Error::NotStrivec { .. })));
///
/// let bytes = include_bytes!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/v1/smallest.strivec"));
/// let scene = decode(bytes)?;
/// assert_eq!(scene.check(), Ok(()));
/// println!("{} scales, {} parameters", scene.scales.len(), scene.parameter_count());
/// # Ok::<(), Error>(())
/// ```
pub fn decode(bytes: &[u8]) -> Result<Scene, Error> {
    Ok(decode_scene_file(bytes, Limits::of_file(bytes.len() as u64))?.scene)
}

/// [`decode`], with the ancillary sections of the file.
///
/// # Errors
///
/// As for [`decode`], but with the memory of `limits`.
pub fn decode_scene_file(bytes: &[u8], limits: Limits) -> Result<SceneFile, Error> {
    let reader = Reader::open(bytes, limits)?;
    reader.contents.check_whole(bytes)?;
    reader.read(&Part::WHOLE)
}

/// An open file: its section table is read, its sections are read on demand.
#[derive(Debug)]
pub struct Reader<S> {
    source: S,
    contents: Contents,
    limits: Limits,
}

impl<S: Source> Reader<S> {
    /// Reads header and section table.
    ///
    /// # Errors
    ///
    /// As for [`super::sections`]; and if the source fails, or if a critical section has an unknown kind.
    pub fn open(source: S, limits: Limits) -> Result<Self, Error> {
        let head = source.read(0..FIRST_READ)?;
        let length = table::length(&head)?;
        let contents =
            if length <= FIRST_READ { table::sections(&head)? } else { table::sections(&source.read(0..length)?)? };
        let unknown = |s: &&Section| s.critical && matches!(s.kind, SectionKind::Other(_));
        if let Some(section) = contents.sections.iter().find(unknown) {
            return Err(Error::UnknownCritical { name: section.to_string() });
        }
        Ok(Self { source, contents, limits })
    }

    /// The header and section table.
    pub fn contents(&self) -> &Contents {
        &self.contents
    }

    /// Reads `part`. No byte of other scales or chunks is read or checked.
    ///
    /// # Errors
    ///
    /// If a section of the part does not follow the format, if its scene is not valid, or if no tensor of a scale is in
    /// the part.
    pub fn read(&self, part: &Part) -> Result<SceneFile, Error> {
        let mut budget = Budget::new(self.limits);
        let (known, unknown): (Vec<&Section>, Vec<&Section>) =
            self.contents.sections.iter().partition(|s| !matches!(s.kind, SectionKind::Other(_)));
        let mut order = SectionOrder::new(&known);
        let head_sections = HeadSections::take(&mut order)?;
        let mut metadata = Metadata::default();
        let head = self.read_head(&head_sections, &mut metadata.skipped, &mut budget)?;

        let region = part.within.map(|within| head.rules.contracted_box(&within));
        let count = part.scales.map_or(head.scales, |s| s.clamp(1, head.scales));
        let mut scales: Vec<Scale> = Vec::with_capacity(count);
        let mut encoding = EncodeOptions {
            density: Vec::new(),
            appearance: Vec::new(),
            networks: head.networks,
            ..EncodeOptions::default()
        };
        encoding.network_steps.decoder = head.decoder_steps;
        for index in 0..head.scales {
            let sections = ScaleSections::take(&mut order, index as u16, index + 1 < head.scales)?;
            if index < count {
                scales.push(self.read_scale(&sections, region, head.features, &mut encoding, &mut budget)?);
                let prefix = self.read_prefix(&sections, &scales, &mut metadata.skipped, &mut budget)?;
                let (prefix, steps) = prefix.unzip();
                metadata.prefixes.push(prefix);
                encoding.network_steps.prefixes.push(steps.unwrap_or_default());
            }
        }
        let tail = [SectionKind::Probes, SectionKind::Cameras, SectionKind::Thumbnail, SectionKind::Notes];
        let mut ancillary = head_sections.ancillary;
        ancillary.extend(tail.into_iter().filter_map(|kind| order.take_whole_if(kind)));
        order.finish()?;
        if part.metadata {
            self.read_metadata(&ancillary, &unknown, head.scales, &mut metadata, &mut budget)?;
            if let Some(error) =
                metadata.probes.as_ref().and_then(|p| probes::check_steps(p, &head.rules, &head.bounds).err())
            {
                metadata.probes = None;
                metadata.skipped.push(SkippedSection { name: SectionKind::Probes.to_string(), error });
            }
        }

        let Head { frame, rules, bounds, scales: all_scales, decoder, occupancy, provenance, .. } = head;
        let is_prefix = count < all_scales;
        if is_prefix && let Some(quality) = &mut metadata.quality {
            quality.prefixes.clear();
        }
        let memory = MemoryLimit(self.limits.memory);
        let mut scene = Scene { frame, bounds, rules, scales, decoder, occupancy, provenance, memory };
        if is_prefix && let Some(correction) = &metadata.prefixes[count - 1] {
            correction.apply(&mut scene);
        }
        if let Some(within) = part.within {
            scene.bounds = scene.rules.cropped_bounds(&scene.bounds, &within);
        }
        // Integers times steps are finite.
        let is_integers = |options: &FactorOptions| options.array.encoding.is_by_group();
        scene.check_given(encoding.density.iter().chain(&encoding.appearance).all(is_integers))?;
        Ok(SceneFile { scene, metadata, encoding })
    }

    /// Reads FRAME, RULES, PROVENANCE, DECODER and OCCUPANCY.
    fn read_head(
        &self,
        sections: &HeadSections<'_>,
        skipped: &mut Vec<SkippedSection>,
        budget: &mut Budget,
    ) -> Result<Head, Error> {
        let &HeadSections { frame, rules, provenance, decoder, occupancy, .. } = sections;
        let wanted: Vec<&Section> =
            [Some(frame), Some(rules), provenance, Some(decoder), occupancy].into_iter().flatten().collect();
        let bytes = fetch(&self.source, &wanted)?;
        let frame = frame::read(&bytes.payload(frame)?)?;
        let (rules, bounds, scales) = rules::read(&bytes.payload(rules)?)?;
        let provenance = match provenance {
            Some(section) => {
                let read = bytes.payload(section).and_then(|payload| provenance::read(&payload));
                unless_skipped(section, read, skipped)?.unwrap_or_default()
            }
            None => Provenance::default(),
        };
        let (decoder, networks, decoder_steps, features) = decoder::read(&bytes.payload(decoder)?, budget)?;
        let occupancy = match occupancy {
            Some(section) => Some(occupancy::read(&bytes.payload(section)?, budget)?),
            None => None,
        };
        let scales = usize::from(scales);
        Ok(Head { frame, rules, bounds, scales, provenance, decoder, networks, decoder_steps, features, occupancy })
    }

    /// The correction of the scene of `scales`, if the last of them has one, and the step codes of its rows.
    fn read_prefix(
        &self,
        sections: &ScaleSections<'_>,
        scales: &[Scale],
        skipped: &mut Vec<SkippedSection>,
        budget: &mut Budget,
    ) -> Result<Option<(Prefix, Vec<u8>)>, Error> {
        let Some(section) = sections.prefix else { return Ok(None) };
        let ranks: Vec<u32> = scales.iter().map(|s| s.factors.appearance_rank()).collect();
        let features = scales[0].appearance_matrix.features;
        let bytes = fetch(&self.source, &[section])?;
        let read = bytes.payload(section).and_then(|payload| prefix::read(&payload, features, &ranks, budget));
        unless_skipped(section, read, skipped)
    }

    /// Reads the `ancillary` sections of known kinds and keeps the `unknown` ones.
    fn read_metadata(
        &self,
        ancillary: &[&Section],
        unknown: &[&Section],
        scales: usize,
        metadata: &mut Metadata,
        budget: &mut Budget,
    ) -> Result<(), Error> {
        let bytes = fetch(&self.source, ancillary)?;
        for section in ancillary {
            let read = bytes.payload(section).and_then(|payload| metadata.read(&payload, scales, budget));
            unless_skipped(section, read, &mut metadata.skipped)?;
        }
        let bytes = fetch(&self.source, unknown)?;
        for &section in unknown {
            let read = bytes.payload(section).and_then(|payload| {
                section.check_reserved()?;
                budget.spend(section, section.length)?;
                Ok(payload.bytes().to_vec())
            });
            if let Some(payload) = unless_skipped(section, read, &mut metadata.skipped)? {
                metadata.unknown.push(UnknownSection { section: Section { offset: 0, ..section.clone() }, payload });
            }
        }
        Ok(())
    }

    /// Checks that the table has the sections of as many chunks as `scale`, which is SCALE, declares.
    fn check_chunks(&self, scale: &Section, found: usize, expected: usize) -> Result<(), Error> {
        let chunk = Some(found as u32);
        let is_there = |s: &Section| s.is_at(SectionKind::Placement, scale.scale, chunk);
        if found < expected && !self.contents.sections.iter().any(is_there) {
            return Err(Error::MissingSection { name: name_of(SectionKind::Placement, scale.scale, chunk) });
        }
        Error::unless_equal(format!("{scale} chunks"), expected, found)
    }

    /// Reads the scale of these sections, or only its chunks that reach into `within`, in a scene of so many `features`. Adds
    /// how it is stored to `encoding`.
    fn read_scale(
        &self,
        sections: &ScaleSections<'_>,
        within: Option<Aabb>,
        features: u32,
        encoding: &mut EncodeOptions,
        budget: &mut Budget,
    ) -> Result<Scale, Error> {
        let name = sections.scale;
        let mut wanted = vec![sections.scale, sections.matrix];
        if within.is_none() {
            wanted.extend(sections.chunks.iter().flatten());
        }
        let bytes = fetch(&self.source, &wanted)?;
        let shape = scale::read(&bytes.payload(sections.scale)?, budget)?;
        let (appearance_matrix, matrix_steps) =
            matrix::read(&bytes.payload(sections.matrix)?, features, shape.record.appearance_rank, budget)?;
        self.check_chunks(name, sections.chunks.len(), shape.chunks.len())?;
        let reaches = |n: &usize| within.is_none_or(|box_| shape.covered(*n).intersection(&box_).is_solid());
        let chunks: Vec<usize> = (0..shape.chunks.len()).filter(reaches).collect();
        let more = match within {
            None => None,
            Some(_) => Some(fetch(&self.source, &chunks.iter().flat_map(|&n| sections.chunks[n]).collect::<Vec<_>>())?),
        };
        let bytes = more.as_ref().unwrap_or(&bytes);

        let record = &shape.record;
        let tensors: u64 = chunks.iter().map(|&n| u64::from(shape.chunks[n].tensors)).sum();
        let forms = shape.forms();
        // Within the limits: 2^22 tensors, 2^21 rows, 2^9 components.
        let numbers_of = |(form, rank): &(Form, u32)| tensors * form.rows(record.resolution) as u64 * u64::from(*rank);
        let numbers: u64 = forms.iter().flatten().map(numbers_of).sum();
        // Step codes, and the chunk of each tensor.
        let step_codes = tensors * (4 + u64::from(record.density_rank) + u64::from(record.appearance_rank));
        budget.spend(name, 4 * numbers + step_codes + 64 * tensors)?;
        let mut centers = Vec::with_capacity(chunks.len());
        for &n in &chunks {
            centers.push(placement::read(&bytes.payload(sections.chunks[n][0])?, &shape, n, budget)?);
        }
        let (placement, numbers) = placement::merge(&name.to_string(), &shape, centers)?;
        if within.is_none() {
            scale::check_extent(&name.to_string(), &shape, &placement)?;
        }
        let mut factors = Factors::zeros(tensors as usize, record.resolution, forms.each_ref().map(Vec::as_slice));
        let [of_density, of_appearance] =
            read_factors(bytes, sections, &chunks, &numbers, &mut factors, record.resolution, budget)?;
        encoding.density.push(of_density);
        encoding.appearance.push(of_appearance);
        encoding.network_steps.matrices.push(matrix_steps);
        let mut chunk_of = vec![0; tensors as usize];
        for (&chunk, numbers) in chunks.iter().zip(&numbers) {
            numbers.iter().for_each(|&n| chunk_of[n as usize] = chunk as u32);
        }
        encoding.chunks.push(chunk_of);
        let cloud = TensorCloud { placement, half_edge: shape.half_edge(), resolution: record.resolution };
        Ok(Scale { cloud, top_k: record.top_k, factors, appearance_matrix })
    }
}

/// `None` if the ancillary `section` cannot be used (spec 1); `skipped` then lists it.
fn unless_skipped<T>(
    section: &Section,
    read: Result<T, Error>,
    skipped: &mut Vec<SkippedSection>,
) -> Result<Option<T>, Error> {
    match read {
        // Of the whole file.
        Err(error @ (Error::Truncated { .. } | Error::Source { .. })) => Err(error),
        Err(error) => {
            skipped.push(SkippedSection { name: section.to_string(), error });
            Ok(None)
        }
        Ok(read) => Ok(Some(read)),
    }
}

/// Reads the factors of these `chunks` into those of their scale; `numbers` are the numbers of each chunk's tensors
/// in the scale. Returns how density and appearance are stored.
fn read_factors(
    bytes: &Fetched<'_>,
    sections: &ScaleSections<'_>,
    chunks: &[usize],
    numbers: &[Vec<u32>],
    factors: &mut Factors,
    resolution: [u32; 3],
    budget: &mut Budget,
) -> Result<[FactorOptions; 2], Error> {
    let shapes = [&factors.density, &factors.appearance]
        .map(|blocks| blocks.iter().map(|block| (block.form, block.rank as usize)).collect::<Vec<BlockShape>>());
    let all: Vec<_> = chunks.iter().zip(numbers).collect();
    let tensors: usize = numbers.iter().map(Vec::len).sum();
    let mut steps =
        shapes.each_ref().map(|shapes| shapes.iter().map(|(_, rank)| vec![0; tensors * rank]).collect::<Vec<_>>());
    let mut options: [Option<ArrayOptions>; 2] = [None; 2];
    let mut are_mixed = [false; 2];
    for some in all.chunks(PARALLEL_CHUNKS) {
        // In the order of the file, so that the first error does not depend on threads.
        let mut parts = Vec::with_capacity(2 * some.len());
        for &(&n, numbers) in some {
            for (section, shapes) in sections.chunks[n][1..].iter().zip(&shapes) {
                let part = factors::open(&bytes.payload(section)?, shapes, resolution, numbers.len())?;
                let reserved = budget.set_aside(section, part.max_memory())?;
                parts.push((part, reserved));
            }
        }
        let read = parallel::map(parts, |(part, mut budget)| part.read(&mut budget));
        let mut read = read.into_iter();
        for (_, numbers) in some {
            let parts = [&mut factors.density, &mut factors.appearance].into_iter().zip(&mut steps);
            for (part, ((blocks, steps), chunk)) in parts.zip(&mut read).enumerate() {
                let chunk = chunk?;
                are_mixed[part] |= *options[part].get_or_insert(chunk.options()) != chunk.options();
                chunk.put(numbers, blocks, steps);
            }
        }
    }
    let [density, appearance] = steps;
    Ok([(options[0], are_mixed[0], density), (options[1], are_mixed[1], appearance)].map(|(options, mixed, steps)| {
        // The options of a scale hold for all its chunks; 32-bit floats lose nothing of any.
        let array = options.filter(|_| !mixed).unwrap_or(ArrayOptions::best(Encoding::F32));
        FactorOptions { array, steps: (mixed || array.encoding.is_by_group()).then_some(steps) }
    }))
}

/// The sections before the scales.
struct HeadSections<'a> {
    frame: &'a Section,
    rules: &'a Section,
    provenance: Option<&'a Section>,
    decoder: &'a Section,
    occupancy: Option<&'a Section>,
    /// LICENCE, QUALITY and VIEWS, as far as the file has them.
    ancillary: Vec<&'a Section>,
}

impl<'a> HeadSections<'a> {
    fn take(order: &mut SectionOrder<'a, '_>) -> Result<Self, Error> {
        let frame = order.take_whole(SectionKind::Frame)?;
        let rules = order.take_whole(SectionKind::Rules)?;
        let provenance = order.take_whole_if(SectionKind::Provenance);
        let ancillary = [SectionKind::License, SectionKind::Quality, SectionKind::Views];
        let ancillary = ancillary.into_iter().filter_map(|kind| order.take_whole_if(kind)).collect();
        let decoder = order.take_whole(SectionKind::Decoder)?;
        let occupancy = order.take_whole_if(SectionKind::Occupancy);
        Ok(Self { frame, rules, provenance, decoder, occupancy, ancillary })
    }
}

/// The contents of the sections before the scales.
struct Head {
    frame: Frame,
    rules: Rules,
    bounds: Aabb,
    /// Number of scales.
    scales: usize,
    provenance: Provenance,
    decoder: Decoder,
    /// How DECODER stores its numbers.
    networks: ArrayOptions,
    /// The step codes of its rows, none for floats.
    decoder_steps: Vec<u8>,
    /// P.
    features: u32,
    occupancy: Option<Occupancy>,
}
