//! Opening a file in steps, the coarse scale first: a file at hand by [`each_step`], a file that arrives by [`Stream`].
//!
//! A [`Stream`] loads nothing itself: load the ranges of [`Stream::wanted`], pass their bytes to [`Stream::add`], and
//! take scenes from [`Stream::step`].

use std::borrow::Cow;
use std::ops::Range;

use strivec_format::container::{Contents, Error, Limits, Part, Reader, SceneFile, Section, SectionKind, Source};

/// Ranges with gaps of at most this many bytes are loaded as one, as the reader does.
const NEAR: u64 = 64 << 10;
/// Files of fewer bytes are shown in one step.
const SMALL: u64 = 1 << 20;

/// A scene of the scales that have arrived.
#[derive(Clone, Debug)]
pub struct Step {
    /// The scene; a prefix of it is corrected to look like the whole.
    pub file: SceneFile,
    /// Header and table of the file.
    pub contents: Contents,
    /// Number of scales that have arrived.
    pub scales: usize,
    /// True if these are all scales of the file.
    pub is_whole: bool,
}

/// A file that arrives in pieces.
#[derive(Debug, Default)]
pub struct Stream {
    known: ArrivedBytes,
    contents: Option<Contents>,
    /// Number of scales of the last step.
    shown: usize,
    is_done: bool,
}

impl Stream {
    /// Adds the bytes of `range`; if these are fewer, the file ends with them.
    pub fn add(&mut self, range: Range<u64>, bytes: Vec<u8>) {
        let end = range.start + bytes.len() as u64;
        if end < range.end {
            self.known.end = self.known.end.min(end);
        }
        self.known.add(range.start, bytes);
    }

    /// Header and table of the file, once they have arrived.
    pub fn contents(&self) -> Option<&Contents> {
        self.contents.as_ref()
    }

    /// Number of bytes that have arrived.
    pub fn bytes(&self) -> u64 {
        self.known.parts.iter().map(|(_, part)| part.len() as u64).sum()
    }

    /// The missing bytes of the next step; empty if [`Stream::step`] can be called.
    ///
    /// # Errors
    ///
    /// If the bytes are not those of a `.strivec` file.
    pub fn wanted(&mut self) -> Result<Vec<Range<u64>>, Error> {
        if self.is_done {
            return Ok(Vec::new());
        }
        if self.contents.is_none() {
            match Reader::open(&self.known, self.limits()) {
                Ok(reader) => {
                    reader.contents().check_length()?;
                    self.contents = Some(reader.contents().clone());
                }
                Err(Error::Source { range, .. }) => return Ok(vec![range]),
                Err(error) => return Err(error),
            }
        }
        let Some(contents) = &self.contents else { return Ok(Vec::new()) };
        let scales = self.next_scales(contents);
        if scales == scale_count(contents) {
            return Ok(self.known.missing(0..contents.file_length));
        }
        let is_needed = |section: &&Section| {
            let is_known = !matches!(section.kind, SectionKind::Other(_));
            !is_known || section.scale.is_none_or(|scale| usize::from(scale) < scales)
        };
        let sections = contents.sections.iter().filter(is_needed);
        let needed = joined(sections.map(|s| s.offset..s.offset + s.length));
        Ok(needed.into_iter().flat_map(|range| self.known.missing(range)).collect())
    }

    /// The next scene, once nothing is [`Stream::wanted`] for it; `None` if this step cannot be shown, or if there are
    /// no more steps.
    ///
    /// # Errors
    ///
    /// If the file is malformed, or if bytes are missing.
    pub fn step(&mut self) -> Result<Option<Step>, Error> {
        let Some(contents) = self.contents.clone().filter(|_| !self.is_done) else { return Ok(None) };
        let scales = self.next_scales(&contents);
        let is_whole = scales == scale_count(&contents);
        (self.shown, self.is_done) = (scales, is_whole);
        let reader = Reader::open(&self.known, self.limits())?;
        read_step(&reader, scales)
    }

    /// True if there are no more steps.
    pub fn is_done(&self) -> bool {
        self.is_done
    }

    /// By the bytes that have arrived, not by the length that the file declares, which is untrusted.
    fn limits(&self) -> Limits {
        Limits::of_file(self.bytes())
    }

    fn next_scales(&self, contents: &Contents) -> usize {
        let is_all_there = self.known.missing(0..contents.file_length).is_empty();
        if is_all_there { scale_count(contents) } else { next_scales(contents, self.shown) }
    }
}

/// Number of scales to show after `shown` scales: one more, and all of a small file.
fn next_scales(contents: &Contents, shown: usize) -> usize {
    let all = scale_count(contents);
    if contents.file_length < SMALL { all } else { (shown + 1).min(all) }
}

/// Reads the first `scales` scales. Returns `None` if the file has no correction for leaving out the others, as such a
/// prefix is almost transparent.
fn read_step<S: Source>(reader: &Reader<S>, scales: usize) -> Result<Option<Step>, Error> {
    let contents = reader.contents().clone();
    let is_whole = scales == scale_count(&contents);
    let part = if is_whole { Part::WHOLE } else { Part { scales: Some(scales), within: None, metadata: true } };
    let file = reader.read(&part)?;
    let is_shown = is_whole || file.metadata.prefixes.get(scales - 1).is_some_and(Option::is_some);
    Ok(is_shown.then_some(Step { file, contents, scales, is_whole }))
}

/// Calls `show` with each step of a file at hand, the coarse scale first, until it returns false.
///
/// # Errors
///
/// If the file cannot be read or is malformed.
pub fn each_step<S: Source>(reader: &Reader<S>, mut show: impl FnMut(Step) -> bool) -> Result<(), Error> {
    let (mut scales, all) = (0, scale_count(reader.contents()));
    loop {
        scales = next_scales(reader.contents(), scales);
        let is_wanted = read_step(reader, scales)?.is_none_or(&mut show);
        if scales >= all || !is_wanted {
            return Ok(());
        }
    }
}

/// Number of scales in the file.
pub fn scale_count(contents: &Contents) -> usize {
    contents.sections.iter().filter_map(|s| s.scale).max().map_or(0, |last| usize::from(last) + 1)
}

/// Joins ranges with small gaps; `ranges` are in file order.
fn joined(ranges: impl Iterator<Item = Range<u64>>) -> Vec<Range<u64>> {
    let mut joined: Vec<Range<u64>> = Vec::new();
    for range in ranges {
        match joined.last_mut() {
            Some(last) if range.start <= last.end.saturating_add(NEAR) => last.end = last.end.max(range.end),
            _ => joined.push(range),
        }
    }
    joined
}

/// The bytes of a file that have arrived.
#[derive(Debug)]
struct ArrivedBytes {
    /// Offset and bytes, ascending; none overlap.
    parts: Vec<(u64, Vec<u8>)>,
    /// End of the file; `u64::MAX` while unknown.
    end: u64,
}

impl Default for ArrivedBytes {
    fn default() -> Self {
        Self { parts: Vec::new(), end: u64::MAX }
    }
}

impl ArrivedBytes {
    fn add(&mut self, offset: u64, bytes: Vec<u8>) {
        let end = offset + bytes.len() as u64;
        for gap in self.missing(offset..end) {
            let at = self.parts.partition_point(|(start, _)| *start < gap.start);
            let [first, last] = [gap.start, gap.end].map(|v| (v - offset) as usize);
            // Usually all bytes are new and none are copied.
            if (first, last) == (0, bytes.len()) {
                self.parts.insert(at, (offset, bytes));
                return;
            }
            self.parts.insert(at, (gap.start, bytes[first..last].to_vec()));
        }
    }

    /// The parts of `range` that have not arrived.
    fn missing(&self, range: Range<u64>) -> Vec<Range<u64>> {
        let mut gaps = Vec::new();
        let mut at = range.start;
        for (start, part) in &self.parts {
            let end = start + part.len() as u64;
            if end <= at {
                continue;
            }
            if *start >= range.end {
                break;
            }
            if *start > at {
                gaps.push(at..*start);
            }
            at = end;
        }
        let end = range.end.min(self.end);
        if at < end {
            gaps.push(at..end);
        }
        gaps
    }
}

impl Source for &ArrivedBytes {
    fn read(&self, range: Range<u64>) -> Result<Cow<'_, [u8]>, Error> {
        if let Some(range) = self.missing(range.clone()).into_iter().next() {
            return Err(Error::Source { range, message: "the bytes have not arrived".into() });
        }
        let [start, end] = [range.start, range.end].map(|at| at.min(self.end));
        let holds = |(at, part): &&(u64, Vec<u8>)| *at <= start && end <= at + part.len() as u64;
        if let Some((at, part)) = self.parts.iter().find(holds) {
            return Ok(Cow::Borrowed(&part[(start - at) as usize..(end - at) as usize]));
        }
        let mut bytes = Vec::with_capacity((end - start) as usize);
        for (at, part) in &self.parts {
            let [first, last] = [start, end].map(|v| v.clamp(*at, at + part.len() as u64) - at);
            bytes.extend_from_slice(&part[first as usize..last as usize]);
        }
        Ok(Cow::Owned(bytes))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use strivec_format::container::decode_scene_file;

    fn fixture(name: &str) -> Vec<u8> {
        std::fs::read(format!("{}/../../fixtures/v1/{name}.strivec", env!("CARGO_MANIFEST_DIR"))).unwrap()
    }

    #[test]
    fn a_file_arrives_in_the_wanted_pieces() {
        for name in ["everything", "zstd"] {
            let file = fixture(name);
            let mut stream = Stream::default();
            let (mut loaded, mut found) = (0, None);
            while !stream.is_done() {
                let wanted = stream.wanted().unwrap();
                for range in &wanted {
                    let end = (range.end as usize).min(file.len());
                    loaded += end - range.start as usize;
                    stream.add(range.clone(), file[range.start as usize..end].to_vec());
                }
                if wanted.is_empty() {
                    found = stream.step().unwrap();
                }
            }
            let found = found.unwrap();
            assert!(found.is_whole && loaded == file.len(), "{name}: {loaded} of {}", file.len());
            assert_eq!(found.file, decode_scene_file(&file, Limits::default()).unwrap());
            assert!(stream.wanted().unwrap().is_empty() && stream.step().unwrap().is_none());
        }
    }

    #[test]
    fn malformed_files_are_errors() {
        let mut stream = Stream::default();
        let first = stream.wanted().unwrap().remove(0);
        stream.add(first, b"<!doctype html>".to_vec());
        assert!(matches!(stream.wanted(), Err(Error::NotStrivec { .. })));

        let mut stream = Stream::default();
        stream.add(0..u64::MAX, fixture("zstd")[..20_000].to_vec());
        assert!(stream.wanted().unwrap().is_empty());
        assert!(matches!(stream.step(), Err(Error::Truncated { .. })));
    }

    #[test]
    fn files_that_no_reader_could_hold_are_refused_before_they_are_loaded() {
        let long = |length| Contents { file_length: length, ..container_of("zstd") };
        assert_eq!(long(1 << 20).check_length(), Ok(()));
        assert!(matches!(long(1 << 40).check_length(), Err(Error::Budget { .. })));
    }

    fn container_of(name: &str) -> Contents {
        strivec_format::container::sections(&fixture(name)).unwrap()
    }

    #[test]
    fn a_scene_may_take_memory_by_the_bytes_that_have_arrived() {
        let mut stream = Stream::default();
        stream.add(0..u64::MAX, fixture("zstd"));
        assert!(stream.wanted().unwrap().is_empty());
        let step = stream.step().unwrap().unwrap();
        assert_eq!(step.file.scene.memory.0, Limits::of_file(fixture("zstd").len() as u64).memory);
    }

    #[test]
    fn missing_ranges_are_found() {
        let mut sparse = ArrivedBytes::default();
        sparse.add(10, vec![1; 10]);
        sparse.add(30, vec![3; 10]);
        sparse.add(5, vec![2; 30]);
        assert_eq!(sparse.missing(0..50), [0..5, 40..50]);
        assert_eq!((&sparse).read(8..33).unwrap()[..], [[2; 2].as_slice(), &[1; 10], &[2; 10], &[3; 3]].concat());
        assert!((&sparse).read(30..41).is_err());
        assert_eq!(joined([0..10, 20..30, (1 << 20)..(2 << 20)].into_iter()), [0..30, (1 << 20)..(2 << 20)]);
    }
}
