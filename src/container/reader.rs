//! From bytes to a scene, whole or in part.

use std::borrow::Cow;
use std::ops::Range;

use super::limits::{Budget, Limits};
use super::metadata::{Metadata, UnknownSection};
use super::payload::Payload;
use super::section::{Section, SectionKind};
use super::source::Source;
use super::{
    Contents, Error, decoder, factors, frame, matrix, occupancy, parallel, placement, prefix, provenance, rules,
    section, table,
};
use crate::geometry::Aabb;
use crate::model::{FactorKind, Factors, Provenance, Scale, Scene, TensorCloud};

/// Bytes that are asked for first: header and table of most files.
const FIRST_READ: u64 = 16 << 10;
/// Chunks that are decoded at once.
const AT_ONCE: usize = 16;
/// Sections that are no farther apart are asked for at once.
const NEAR: u64 = 64 << 10;

/// A scene and what its file holds besides.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneFile {
    /// The scene.
    pub scene: Scene,
    /// The rest.
    pub metadata: Metadata,
}

/// What to read of a file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Part {
    /// How many scales, coarsest first; `None` for all.
    pub scales: Option<usize>,
    /// The chunks that reach into this box of model space; `None` for all. The scene's bounds become what both share.
    pub within: Option<Aabb>,
    /// Whether thumbnail, probes, cameras, notes and unknown sections are wanted, too.
    pub metadata: bool,
}

impl Part {
    /// All of a file.
    pub const WHOLE: Self = Self { scales: None, within: None, metadata: true };
}

/// The scene in a whole `.strivec` file, which passes [`Scene::check`].
///
/// Sections that this version does not know are skipped where the file says that the scene is whole without them.
///
/// # Errors
///
/// Where the bytes are anything but a whole, undamaged file of this major version whose scene is valid; the error
/// says what and where. Memory stays within that of [`Limits::default`].
pub fn decode(bytes: &[u8]) -> Result<Scene, Error> {
    Ok(decode_scene_file(bytes, Limits::default())?.scene)
}

/// [`decode`], with everything that the file holds besides.
///
/// # Errors
///
/// As for [`decode`], and where decoding would take more than `limits`.
pub fn decode_scene_file(bytes: &[u8], limits: Limits) -> Result<SceneFile, Error> {
    let reader = Reader::open(bytes, limits)?;
    reader.contents.check_whole(bytes)?;
    reader.read(&Part::WHOLE)
}

/// A file that is opened: its table is known, its sections are read when they are wanted.
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
    /// As for [`super::sections`], where the source fails, and where a critical section is unknown.
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

    /// What the file says it holds.
    pub fn contents(&self) -> &Contents {
        &self.contents
    }

    /// Reads `part`: no byte of other scales or chunks is asked for, and none of theirs is checked.
    ///
    /// # Errors
    ///
    /// Where what is read is not what the format demands, and where no tensor of a scale is in the part.
    pub fn read(&self, part: &Part) -> Result<SceneFile, Error> {
        let mut budget = Budget::new(self.limits);
        let mut metadata = Metadata::default();
        let (known, unknown): (Vec<&Section>, Vec<&Section>) =
            self.contents.sections.iter().partition(|s| !matches!(s.kind, SectionKind::Other(_)));

        let mut order = Order { sections: &known, next: 0 };
        let frame = order.take(SectionKind::Frame, None, None)?;
        let rules = order.take(SectionKind::Rules, None, None)?;
        let provenance = order.take_if(SectionKind::Provenance, None, None);
        let mut beside: Vec<&Section> =
            [SectionKind::License, SectionKind::Quality, SectionKind::Views, SectionKind::Thumbnail]
                .into_iter()
                .filter_map(|kind| order.take_if(kind, None, None))
                .collect();
        let decoder = order.take(SectionKind::Decoder, None, None)?;
        let occupancy = order.take_if(SectionKind::Occupancy, None, None);

        let head: Vec<&Section> =
            [Some(frame), Some(rules), provenance, Some(decoder), occupancy].into_iter().flatten().collect();
        let bytes = self.fetch(&head)?;
        let frame = frame::read(&bytes.payload(frame)?)?;
        let (rules, bounds, scale_count) = rules::read(&bytes.payload(rules)?)?;
        let provenance = match provenance {
            Some(section) => provenance::read(&bytes.payload(section)?)?,
            None => Provenance::default(),
        };
        let decoder = decoder::read(&bytes.payload(decoder)?, &mut budget)?;
        let occupancy = match occupancy {
            Some(section) => Some(occupancy::read(&bytes.payload(section)?, &mut budget)?),
            None => None,
        };

        let scale_count = usize::from(scale_count);
        let count = part.scales.map_or(scale_count, |s| s.clamp(1, scale_count));
        let mut scales: Vec<Scale> = Vec::with_capacity(count);
        for index in 0..scale_count as u16 {
            let of_scale = ScaleSections::take(&mut order, index, usize::from(index) + 1 < scale_count)?;
            if usize::from(index) < count {
                scales.push(self.read_scale(&of_scale, part.within, &mut budget)?);
                let ranks: Vec<u32> = scales.iter().map(|s| s.factors.appearance_rank).collect();
                let features = scales[0].appearance_matrix.features;
                let prefix = match of_scale.prefix {
                    Some(section) => {
                        let bytes = self.fetch(&[section])?;
                        Some(prefix::read(&bytes.payload(section)?, features, &ranks, &mut budget)?)
                    }
                    None => None,
                };
                metadata.prefixes.push(prefix);
            }
        }
        beside.extend(
            [SectionKind::Probes, SectionKind::Cameras, SectionKind::Notes]
                .into_iter()
                .filter_map(|kind| order.take_if(kind, None, None)),
        );
        order.finish()?;
        if part.metadata {
            let bytes = self.fetch(&beside)?;
            for section in beside {
                metadata.read(&bytes.payload(section)?, &mut budget)?;
            }
            let bytes = self.fetch(&unknown)?;
            for section in unknown {
                budget.spend(section, section.length)?;
                let payload = bytes.payload(section)?.bytes().to_vec();
                metadata.unknown.push(UnknownSection { section: Section { offset: 0, ..section.clone() }, payload });
            }
        }

        let mut scene = Scene { frame, bounds, rules, scales, decoder, occupancy, provenance };
        if count < scale_count
            && let Some(correction) = &metadata.prefixes[count - 1]
        {
            correction.apply(&mut scene);
        }
        if let Some(within) = part.within {
            scene.bounds = scene.bounds.intersection(&within);
        }
        scene.check()?;
        Ok(SceneFile { scene, metadata })
    }

    /// The scale of these sections, or those of its chunks that reach into `within`.
    fn read_scale(
        &self,
        sections: &ScaleSections<'_>,
        within: Option<Aabb>,
        budget: &mut Budget,
    ) -> Result<Scale, Error> {
        let name = sections.scale;
        let mut wanted = vec![sections.scale, sections.matrix];
        if within.is_none() {
            wanted.extend(sections.chunks.iter().flatten());
        }
        let bytes = self.fetch(&wanted)?;
        let shape = placement::read_scale(&bytes.payload(sections.scale)?, budget)?;
        let appearance_matrix = matrix::read(&bytes.payload(sections.matrix)?, budget)?;
        Error::unless_equal(format!("{name} chunks"), shape.chunks.len(), sections.chunks.len())?;
        let reaches = |n: &usize| within.is_none_or(|box_| shape.covered(*n).intersection(&box_).is_solid());
        let chunks: Vec<usize> = (0..shape.chunks.len()).filter(reaches).collect();
        let more = match within {
            None => None,
            Some(_) => Some(self.fetch(&chunks.iter().flat_map(|&n| sections.chunks[n]).collect::<Vec<_>>())?),
        };
        let bytes = more.as_ref().unwrap_or(&bytes);

        let record = &shape.record;
        let tensors: u64 = chunks.iter().map(|&n| u64::from(shape.chunks[n].tensors)).sum();
        let rows = Factors::rows(record.resolution) as u64;
        // Within the limits: 2^24 tensors, 2^12 rows, 2^9 components.
        let [density, appearance] =
            [record.density_rank, record.appearance_rank].map(|rank| tensors * rows * u64::from(rank));
        budget.spend(name, 4 * (density + appearance) + 64 * tensors)?;
        let mut centers = Vec::with_capacity(chunks.len());
        for &n in &chunks {
            centers.push(placement::read(&bytes.payload(sections.chunks[n][0])?, &shape, n, budget)?);
        }
        let (placement, places) = placement::merge(&name.to_string(), &shape, centers)?;
        if within.is_none() {
            placement::check_extent(&name.to_string(), &shape, &placement)?;
        }
        let mut factors = Factors {
            kind: FactorKind::Cp,
            density_rank: record.density_rank,
            appearance_rank: record.appearance_rank,
            density: vec![0.0; density as usize],
            appearance: vec![0.0; appearance as usize],
        };
        let ranks = [record.density_rank, record.appearance_rank].map(|rank| rank as usize);
        let of_chunks: Vec<_> = chunks.iter().zip(&places).collect();
        for some in of_chunks.chunks(AT_ONCE) {
            // In the order of the file, so that what is wrong with it does not depend on threads.
            let mut parts = Vec::with_capacity(2 * some.len());
            for &(&n, places) in some {
                for (section, rank) in sections.chunks[n][1..].iter().zip(ranks) {
                    let part = factors::open(&bytes.payload(section)?, rank, record.resolution, places.len())?;
                    let budget = budget.set_aside(section, part.most())?;
                    parts.push((part, budget));
                }
            }
            let read = parallel::map(parts, |(part, mut budget)| part.read(&mut budget));
            let mut read = read.into_iter();
            for (_, places) in some {
                for values in [&mut factors.density, &mut factors.appearance] {
                    if let Some(chunk) = read.next() {
                        chunk?.put(places, values);
                    }
                }
            }
        }
        let cloud = TensorCloud { placement, half: shape.half(), resolution: record.resolution };
        Ok(Scale { cloud, top_k: record.top_k, factors, appearance_matrix })
    }

    /// The payloads of `sections`, which are in the order of the file; near ones are asked for at once.
    fn fetch(&self, sections: &[&Section]) -> Result<Fetched<'_>, Error> {
        let mut ranges: Vec<Range<u64>> = Vec::new();
        for section in sections {
            let end = section.offset + section.length;
            match ranges.last_mut() {
                Some(last) if section.offset >= last.start && section.offset <= last.end.saturating_add(NEAR) => {
                    last.end = last.end.max(end);
                }
                _ => ranges.push(section.offset..end),
            }
        }
        let mut parts = Vec::with_capacity(ranges.len());
        for range in ranges {
            let bytes = self.source.read(range.clone())?;
            let found = range.start + bytes.len() as u64;
            if found < range.end {
                let cut = sections.iter().find(|s| s.offset + s.length > found && s.offset >= range.start);
                let part = cut.map_or_else(|| "file".into(), ToString::to_string);
                return Err(Error::Truncated { part, missing: found..range.end });
            }
            parts.push((range, bytes));
        }
        Ok(Fetched { parts })
    }
}

/// Bytes that were asked for.
struct Fetched<'a> {
    parts: Vec<(Range<u64>, Cow<'a, [u8]>)>,
}

impl Fetched<'_> {
    /// The payload of a section that was asked for.
    fn payload<'s>(&'s self, section: &'s Section) -> Result<Payload<'s>, Error> {
        let range = section.offset..section.offset + section.length;
        let holds = |part: &&(Range<u64>, Cow<'_, [u8]>)| part.0.start <= range.start && range.end <= part.0.end;
        let Some((from, bytes)) = self.parts.iter().find(holds) else {
            return Err(Error::Truncated { part: section.to_string(), missing: range });
        };
        let [start, end] = [range.start, range.end].map(|at| (at - from.start) as usize);
        Payload::new(section, &bytes[start..end])
    }
}

/// The sections of one scale.
struct ScaleSections<'a> {
    scale: &'a Section,
    matrix: &'a Section,
    /// \[chunk\] placement, density, appearance.
    chunks: Vec<[&'a Section; 3]>,
    prefix: Option<&'a Section>,
}

impl<'a> ScaleSections<'a> {
    fn take(order: &mut Order<'a, '_>, index: u16, may_have_prefix: bool) -> Result<Self, Error> {
        let scale = order.take(SectionKind::Scale, Some(index), None)?;
        let matrix = order.take(SectionKind::Matrix, Some(index), None)?;
        let mut chunks = Vec::new();
        // Their number is checked against what SCALE says.
        let mut next = Some(order.take(SectionKind::Placement, Some(index), Some(0))?);
        while let Some(placement) = next {
            let chunk = Some(chunks.len() as u32);
            let density = order.take(SectionKind::Density, Some(index), chunk)?;
            chunks.push([placement, density, order.take(SectionKind::Appearance, Some(index), chunk)?]);
            next = order.take_if(SectionKind::Placement, Some(index), Some(chunks.len() as u32));
        }
        let prefix = if may_have_prefix { order.take_if(SectionKind::Prefix, Some(index), None) } else { None };
        Ok(Self { scale, matrix, chunks, prefix })
    }
}

/// Sections of known kind, in the order that they must have.
struct Order<'a, 'b> {
    sections: &'b [&'a Section],
    next: usize,
}

impl<'a> Order<'a, '_> {
    /// The next section, if it is this one.
    fn take_if(&mut self, kind: SectionKind, scale: Option<u16>, chunk: Option<u32>) -> Option<&'a Section> {
        let section = self.sections.get(self.next).filter(|s| s.is_at(kind, scale, chunk))?;
        self.next += 1;
        Some(section)
    }

    /// The next section, which must be this one.
    fn take(&mut self, kind: SectionKind, scale: Option<u16>, chunk: Option<u32>) -> Result<&'a Section, Error> {
        if let Some(section) = self.take_if(kind, scale, chunk) {
            return Ok(section);
        }
        let name = section::name_of(kind, scale, chunk);
        let elsewhere = self.sections.iter().any(|s| s.is_at(kind, scale, chunk));
        Err(match self.sections.get(self.next) {
            Some(found) if elsewhere => Error::malformed("order of sections", name, found),
            _ => Error::MissingSection { name },
        })
    }

    /// Checks that every section was taken.
    fn finish(&self) -> Result<(), Error> {
        match self.sections.get(self.next) {
            None => Ok(()),
            Some(section) => Err(Error::malformed("order of sections", "no further section", section)),
        }
    }
}
