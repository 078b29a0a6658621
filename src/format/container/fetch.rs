//! Reading the payloads of sections from a source with few requests.

use std::borrow::Cow;
use std::ops::Range;

use super::error::Error;
use super::payload::Payload;
use super::section::Section;
use super::source::Source;

/// Payloads that are no farther apart, in bytes, are read in one request.
const MAX_GAP: u64 = 64 << 10;

/// Payloads that were read.
pub(super) struct Fetched<'a> {
    parts: Vec<(Range<u64>, Cow<'a, [u8]>)>,
}

impl Fetched<'_> {
    /// The payload of a section that was read.
    pub(super) fn payload<'s>(&'s self, section: &'s Section) -> Result<Payload<'s>, Error> {
        let range = section.offset..section.offset + section.length;
        let holds = |part: &&(Range<u64>, Cow<'_, [u8]>)| part.0.start <= range.start && range.end <= part.0.end;
        let Some((from, bytes)) = self.parts.iter().find(holds) else {
            return Err(Error::Truncated { part: section.to_string(), missing: range });
        };
        let [start, end] = [range.start, range.end].map(|at| (at - from.start) as usize);
        Payload::new(section, &bytes[start..end])
    }
}

/// Reads the payloads of `sections`, which are in the order of the file; nearby ones in one request.
pub(super) fn fetch<'s>(source: &'s impl Source, sections: &[&Section]) -> Result<Fetched<'s>, Error> {
    let mut ranges: Vec<Range<u64>> = Vec::new();
    for section in sections {
        let end = section.offset + section.length;
        match ranges.last_mut() {
            Some(last) if section.offset >= last.start && section.offset <= last.end.saturating_add(MAX_GAP) => {
                last.end = last.end.max(end);
            }
            _ => ranges.push(section.offset..end),
        }
    }
    let mut parts = Vec::with_capacity(ranges.len());
    for range in ranges {
        let bytes = source.read(range.clone())?;
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
