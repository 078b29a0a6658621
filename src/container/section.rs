//! Sections: what the parts of a file are called and how its table describes them.

use std::fmt;

use super::{Codec, Error, records};

/// The bit of an entry's flags that marks a critical section.
const CRITICAL: u16 = 1;
/// The scale of a section that belongs to none.
const NO_SCALE: u16 = u16::MAX;
/// The chunk of a section that belongs to none.
const NO_CHUNK: u32 = u32::MAX;

/// What a section holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum SectionKind {
    /// How the model lies in the dataset's space.
    Frame,
    /// The field's and the march's rules and bounds.
    Rules,
    /// What made the file.
    Provenance,
    /// The terms of its use.
    License,
    /// What was measured of it.
    Quality,
    /// Where to look from.
    Views,
    /// A small picture.
    Thumbnail,
    /// The MLP.
    Decoder,
    /// Where samples count; a scene may have none.
    Occupancy,
    /// A scale's shape and chunks.
    Scale,
    /// A scale's appearance matrix.
    Matrix,
    /// A chunk's tensors.
    Placement,
    /// Their density factors.
    Density,
    /// Their appearance factors.
    Appearance,
    /// How a scene that ends with this scale is corrected.
    Prefix,
    /// Rays with what they see.
    Probes,
    /// The cameras that it was trained from.
    Cameras,
    /// Keys and values.
    Notes,
    /// A kind that this version does not define: its name, padded with zeros.
    Other([u8; 12]),
}

impl SectionKind {
    const KNOWN: [(Self, &str); 18] = [
        (Self::Frame, "FRAME"),
        (Self::Rules, "RULES"),
        (Self::Provenance, "PROVENANCE"),
        (Self::License, "LICENCE"),
        (Self::Quality, "QUALITY"),
        (Self::Views, "VIEWS"),
        (Self::Thumbnail, "THUMBNAIL"),
        (Self::Decoder, "DECODER"),
        (Self::Occupancy, "OCCUPANCY"),
        (Self::Scale, "SCALE"),
        (Self::Matrix, "MATRIX"),
        (Self::Placement, "PLACEMENT"),
        (Self::Density, "DENSITY"),
        (Self::Appearance, "APPEARANCE"),
        (Self::Prefix, "PREFIX"),
        (Self::Probes, "PROBES"),
        (Self::Cameras, "CAMERAS"),
        (Self::Notes, "NOTES"),
    ];

    /// Whether a reader that does not know a section of this (known) kind must refuse the file.
    pub(super) fn is_critical(self) -> bool {
        use SectionKind as K;
        !matches!(
            self,
            K::Provenance
                | K::License
                | K::Quality
                | K::Views
                | K::Thumbnail
                | K::Prefix
                | K::Probes
                | K::Cameras
                | K::Notes
        )
    }

    /// The kind of this name; `None` where it is not capital letters, digits and hyphens padded with zeros.
    fn of_name(name: [u8; 12]) -> Option<Self> {
        let length = name.iter().position(|&b| b == 0).unwrap_or(name.len());
        let (letters, padding) = name.split_at(length);
        let valid = letters.iter().all(|b| b.is_ascii_uppercase() || b.is_ascii_digit() || *b == b'-');
        if letters.is_empty() || !valid || padding.iter().any(|&b| b != 0) {
            return None;
        }
        let known = Self::KNOWN.iter().find(|(_, known)| known.as_bytes() == letters);
        Some(known.map_or(Self::Other(name), |(kind, _)| *kind))
    }

    fn name(self) -> [u8; 12] {
        if let Self::Other(name) = self {
            return name;
        }
        let mut padded = [0; 12];
        if let Some((_, name)) = Self::KNOWN.iter().find(|(kind, _)| *kind == self) {
            padded[..name.len()].copy_from_slice(name.as_bytes());
        }
        padded
    }
}

impl fmt::Display for SectionKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let name = self.name();
        f.write_str(String::from_utf8_lossy(&name).trim_end_matches('\0'))
    }
}

/// An entry of the section table.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Section {
    /// What it holds.
    pub kind: SectionKind,
    /// Whether a reader that does not know its kind must refuse the file.
    pub critical: bool,
    /// The scale it belongs to, if to one.
    pub scale: Option<u16>,
    /// The chunk of that scale, if to one.
    pub chunk: Option<u32>,
    /// How its body is stored.
    pub codec: Codec,
    /// Where its payload begins in the file.
    pub offset: u64,
    /// Bytes of its payload.
    pub length: u64,
    /// Bytes of its payload once its body is decoded.
    pub decoded_length: u64,
    /// CRC-32 of its payload as stored.
    pub checksum: u32,
}

impl fmt::Display for Section {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&name_of(self.kind, self.scale, self.chunk))
    }
}

/// What messages call a section.
pub(super) fn name_of(kind: SectionKind, scale: Option<u16>, chunk: Option<u32>) -> String {
    let chunk = chunk.map_or_else(String::new, |chunk| format!(" of chunk {chunk}"));
    let scale = scale.map_or_else(String::new, |scale| format!(" of scale {scale}"));
    format!("{kind}{chunk}{scale}")
}

impl Section {
    /// Whether it is this section.
    pub(super) fn is_at(&self, kind: SectionKind, scale: Option<u16>, chunk: Option<u32>) -> bool {
        (self.kind, self.scale, self.chunk) == (kind, scale, chunk)
    }

    /// Reads what an entry says; `index` is its place in the table.
    pub(super) fn of_entry(entry: &records::Entry, index: usize) -> Result<Self, Error> {
        let kind = SectionKind::of_name(entry.kind).ok_or_else(|| {
            let expected = "capital letters, digits and hyphens, then zeros";
            Error::malformed(format!("name of section {index}"), expected, format!("{:02x?}", entry.kind))
        })?;
        let section = Self {
            kind,
            critical: entry.flags & CRITICAL != 0,
            scale: (entry.scale != NO_SCALE).then_some(entry.scale),
            chunk: (entry.chunk != NO_CHUNK).then_some(entry.chunk),
            codec: Codec::of_code(entry.codec),
            offset: entry.offset,
            length: entry.length,
            decoded_length: entry.decoded_length,
            checksum: entry.checksum,
        };
        Error::unless_equal(format!("{section} flags besides the critical bit"), 0, entry.flags & !CRITICAL)?;
        let reserved = u64::from(entry.reserved) | u64::from(entry.reserved_too) | entry.reserved_last;
        Error::unless_equal(format!("{section} reserved fields"), 0, reserved)?;
        if section.codec == Codec::Stored {
            Error::unless_equal(format!("{section} decoded length"), section.length, section.decoded_length)?;
        }
        if !matches!(kind, SectionKind::Other(_)) && section.critical != kind.is_critical() {
            let name = |critical| if critical { "critical" } else { "ancillary" };
            let place = format!("{section} flags");
            return Err(Error::malformed(place, name(kind.is_critical()), name(section.critical)));
        }
        Ok(section)
    }

    pub(super) fn entry(&self) -> records::Entry {
        records::Entry {
            kind: self.kind.name(),
            flags: if self.critical { CRITICAL } else { 0 },
            scale: self.scale.unwrap_or(NO_SCALE),
            chunk: self.chunk.unwrap_or(NO_CHUNK),
            codec: self.codec.code(),
            reserved: 0,
            checksum: self.checksum,
            reserved_too: 0,
            offset: self.offset,
            length: self.length,
            decoded_length: self.decoded_length,
            reserved_last: 0,
        }
    }
}
