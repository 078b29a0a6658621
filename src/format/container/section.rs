//! Sections: the parts of a file, their kinds, and their entries in the section table (spec 2.2 and 2.3).

use std::fmt;
use std::ops::Range;

use super::codec::Codec;
use super::error::{Error, hex};
use super::record::{BorrowDecode, Encode, Record};

/// The bit of an entry's flags that marks a critical section.
const CRITICAL: u16 = 1;
/// The scale of a section that belongs to none.
const NO_SCALE: u16 = u16::MAX;
/// The chunk of a section that belongs to none.
const NO_CHUNK: u32 = u32::MAX;

/// Kinds of sections.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum SectionKind {
    /// The map from dataset space to model space, and how pictures are meant.
    Frame,
    /// The rules and bounds of the field and the march.
    Rules,
    /// Where the scene came from.
    Provenance,
    /// The terms of use of the scene.
    License,
    /// Measurements.
    Quality,
    /// The initial pose of a viewer, and a camera path.
    Views,
    /// The MLP.
    Decoder,
    /// The occupancy grid; a scene may have none.
    Occupancy,
    /// A scale's shape and chunks.
    Scale,
    /// A scale's appearance matrix.
    Matrix,
    /// A chunk's tensors.
    Placement,
    /// A chunk's density factors.
    Density,
    /// A chunk's appearance factors.
    Appearance,
    /// The correction of the scene that ends with this scale.
    Prefix,
    /// Rays and their pixels.
    Probes,
    /// The cameras of the training photographs.
    Cameras,
    /// A small picture.
    Thumbnail,
    /// Keys and values.
    Notes,
    /// A kind that this version does not define, by its name padded with zeros.
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
        (Self::Thumbnail, "THUMBNAIL"),
        (Self::Notes, "NOTES"),
    ];

    /// True if a file without a section of this (known) kind is not a scene.
    pub(super) fn is_critical(self) -> bool {
        use SectionKind as K;
        !matches!(
            self,
            K::Provenance
                | K::License
                | K::Quality
                | K::Views
                | K::Prefix
                | K::Probes
                | K::Cameras
                | K::Thumbnail
                | K::Notes
        )
    }

    /// Whether a section of this kind belongs to a scale, and to a chunk of it; `None` if the kind is unknown.
    fn place(self) -> Option<(bool, bool)> {
        use SectionKind as K;
        match self {
            K::Other(_) => None,
            K::Scale | K::Matrix | K::Prefix => Some((true, false)),
            K::Placement | K::Density | K::Appearance => Some((true, true)),
            _ => Some((false, false)),
        }
    }

    /// True if the body of a section of this (known) kind may have the codec *adaptive*.
    fn is_adaptive(self) -> bool {
        use SectionKind as K;
        matches!(self, K::Decoder | K::Occupancy | K::Matrix | K::Density | K::Appearance | K::Prefix)
    }

    /// True if the body of a section of this (known) kind may be compressed.
    fn is_compressible(self) -> bool {
        use SectionKind as K;
        matches!(
            self,
            K::Decoder
                | K::Occupancy
                | K::Scale
                | K::Matrix
                | K::Placement
                | K::Density
                | K::Appearance
                | K::Prefix
                | K::Cameras
                | K::Notes
        )
    }

    /// The kind of this name; `None` if it is not capital letters, digits and hyphens padded with zeros.
    fn from_name(name: [u8; 12]) -> Option<Self> {
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
    /// Kind of the section.
    pub kind: SectionKind,
    /// True if a reader that does not support the kind must refuse the file.
    pub critical: bool,
    /// The scale it belongs to, if any.
    pub scale: Option<u16>,
    /// The chunk of that scale, if any.
    pub chunk: Option<u32>,
    /// The encoding of its body.
    pub codec: Codec,
    /// Offset of the payload in the file, in bytes.
    pub offset: u64,
    /// Bytes of its payload.
    pub length: u64,
    /// Bytes of its payload once its body is decoded.
    pub decoded_length: u64,
    /// CRC-32 of its payload as stored.
    pub checksum: u32,
    /// A bit or byte of its entry that version 1.0 reserves is set: a later version's (spec 1).
    pub uses_reserved: bool,
}

impl fmt::Display for Section {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&name_of(self.kind, self.scale, self.chunk))
    }
}

/// An entry of the section table as it is in the file; 64 bytes.
#[derive(Encode, BorrowDecode)]
pub(super) struct Entry {
    pub(super) kind: [u8; 12],
    pub(super) flags: u16,
    pub(super) scale: u16,
    pub(super) chunk: u32,
    pub(super) codec: u16,
    pub(super) reserved: u16,
    pub(super) checksum: u32,
    pub(super) reserved_too: u32,
    pub(super) offset: u64,
    pub(super) length: u64,
    pub(super) decoded_length: u64,
    pub(super) reserved_last: u64,
}

impl Record for Entry {}

/// What messages call a section.
pub(super) fn name_of(kind: SectionKind, scale: Option<u16>, chunk: Option<u32>) -> String {
    let chunk = chunk.map_or_else(String::new, |chunk| format!(" of chunk {chunk}"));
    let scale = scale.map_or_else(String::new, |scale| format!(" of scale {scale}"));
    format!("{kind}{chunk}{scale}")
}

impl Section {
    /// True if it is the section of this kind, scale and chunk.
    pub(super) fn is_at(&self, kind: SectionKind, scale: Option<u16>, chunk: Option<u32>) -> bool {
        (self.kind, self.scale, self.chunk) == (kind, scale, chunk)
    }

    /// Reads `entry`, number `index` of the table.
    pub(super) fn from_entry(entry: &Entry, index: usize) -> Result<Self, Error> {
        let kind = SectionKind::from_name(entry.kind).ok_or_else(|| {
            let expected = "capital letters, digits and hyphens, then zeros";
            Error::malformed(format!("name of section {index}"), expected, hex(&entry.kind))
        })?;
        let section = Self {
            kind,
            critical: entry.flags & CRITICAL != 0,
            scale: (entry.scale != NO_SCALE).then_some(entry.scale),
            chunk: (entry.chunk != NO_CHUNK).then_some(entry.chunk),
            codec: Codec::from_code(entry.codec),
            offset: entry.offset,
            length: entry.length,
            decoded_length: entry.decoded_length,
            checksum: entry.checksum,
            uses_reserved: entry.flags & !CRITICAL != 0
                || entry.reserved != 0
                || entry.reserved_too != 0
                || entry.reserved_last != 0,
        };
        if section.codec == Codec::Stored {
            Error::unless_equal(format!("{section} decoded length"), section.length, section.decoded_length)?;
        }
        let Some((has_scale, has_chunk)) = kind.place() else { return Ok(section) };
        if section.critical != kind.is_critical() {
            let name = |critical| if critical { "critical" } else { "ancillary" };
            let place = format!("{section} flags");
            return Err(Error::malformed(place, name(kind.is_critical()), name(section.critical)));
        }
        if (section.scale.is_some(), section.chunk.is_some()) != (has_scale, has_chunk) {
            let expected = match (has_scale, has_chunk) {
                (false, _) => "neither of a scale nor of a chunk",
                (true, false) => "of a scale and of no chunk",
                (true, true) => "of a chunk of a scale",
            };
            return Err(Error::malformed(format!("section {kind}"), expected, section));
        }
        Ok(section)
    }

    /// Checks that the entry has no reserved bit, and that its codec is one that spec 2.3 lists for the kind.
    pub(super) fn check_entry(&self) -> Result<(), Error> {
        self.check_reserved()?;
        match self.codec {
            Codec::Stored => Ok(()),
            Codec::Zstd if self.kind.is_compressible() => Ok(()),
            Codec::Adaptive if self.kind.is_adaptive() => Ok(()),
            Codec::Zstd | Codec::Adaptive => {
                let expected = if self.kind.is_compressible() { "stored or zstd" } else { "stored" };
                Err(Error::malformed(format!("{self} codec"), expected, self.codec))
            }
            Codec::Other(_) => Err(Error::unsupported(self, self.codec)),
        }
    }

    /// The section's bytes in a file whose table was checked and whose length is that of the table.
    pub(super) fn range(&self) -> Range<usize> {
        self.offset as usize..(self.offset + self.length) as usize
    }

    /// [`Error::Unsupported`] if the entry has a reserved bit.
    pub(super) fn check_reserved(&self) -> Result<(), Error> {
        if !self.uses_reserved {
            return Ok(());
        }
        Err(Error::unsupported(format!("{self} flags or reserved bytes"), "a value that version 1.0 does not define"))
    }

    pub(super) fn entry(&self) -> Entry {
        Entry {
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
