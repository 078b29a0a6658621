//! Takes files apart and puts them together again, changed, with checksums that are right: from the specification,
//! with nothing of the crate's reader or writer.

/// A file in parts.
#[derive(Clone)]
pub(crate) struct File {
    pub(crate) major: u16,
    pub(crate) minor: u16,
    pub(crate) sections: Vec<Part>,
}

/// A section.
#[derive(Clone)]
pub(crate) struct Part {
    pub(crate) kind: [u8; 12],
    pub(crate) flags: u16,
    pub(crate) scale: u16,
    pub(crate) codec: u16,
    pub(crate) reserved: u16,
    pub(crate) decoded_length: u64,
    pub(crate) payload: Vec<u8>,
}

fn number(bytes: &[u8], at: usize, size: usize) -> u64 {
    (0..size).map(|i| u64::from(bytes[at + i]) << (8 * i)).sum()
}

/// The name of a section, padded.
pub(crate) fn name(name: &str) -> [u8; 12] {
    let mut padded = [0; 12];
    padded[..name.len()].copy_from_slice(name.as_bytes());
    padded
}

impl File {
    /// The parts of a valid file.
    pub(crate) fn of(bytes: &[u8]) -> Self {
        let sections = (0..number(bytes, 12, 4) as usize).map(|index| {
            let entry = &bytes[32 + 48 * index..];
            let (offset, length) = (number(entry, 24, 8) as usize, number(entry, 32, 8) as usize);
            Part {
                kind: entry[..12].try_into().unwrap(),
                flags: number(entry, 12, 2) as u16,
                scale: number(entry, 14, 2) as u16,
                codec: number(entry, 16, 2) as u16,
                reserved: number(entry, 18, 2) as u16,
                decoded_length: number(entry, 40, 8),
                payload: bytes[offset..offset + length].to_vec(),
            }
        });
        Self { major: number(bytes, 8, 2) as u16, minor: number(bytes, 10, 2) as u16, sections: sections.collect() }
    }

    /// The first section of this name.
    pub(crate) fn part(&mut self, kind: &str) -> &mut Part {
        self.sections.iter_mut().find(|p| p.kind == name(kind)).unwrap()
    }

    /// Its index.
    pub(crate) fn index(&self, kind: &str) -> usize {
        self.sections.iter().position(|p| p.kind == name(kind)).unwrap()
    }

    /// The file, its layout and checksums right.
    pub(crate) fn bytes(&self) -> Vec<u8> {
        let mut end = 32 + 48 * self.sections.len();
        let (mut table, mut payloads) = (Vec::new(), Vec::new());
        for part in &self.sections {
            let offset = end.next_multiple_of(64);
            payloads.resize(payloads.len() + offset - end, 0);
            payloads.extend(&part.payload);
            end = offset + part.payload.len();
            table.extend(part.kind);
            for field in [part.flags, part.scale, part.codec, part.reserved] {
                table.extend(field.to_le_bytes());
            }
            table.extend(crc32fast::hash(&part.payload).to_le_bytes());
            for field in [offset as u64, part.payload.len() as u64, part.decoded_length] {
                table.extend(field.to_le_bytes());
            }
        }
        let mut file = b"\xB3STV\r\n\x1A\n".to_vec();
        file.extend(self.major.to_le_bytes());
        file.extend(self.minor.to_le_bytes());
        file.extend((self.sections.len() as u32).to_le_bytes());
        file.extend((end as u64).to_le_bytes());
        file.extend([0; 8]);
        file.extend(table);
        file.extend(payloads);
        seal(&mut file);
        file
    }
}

impl Part {
    /// A section of this name without a scale that a reader may skip.
    pub(crate) fn ancillary(kind: &str, payload: &[u8]) -> Self {
        Self {
            kind: name(kind),
            flags: 0,
            scale: 0xFFFF,
            codec: 0,
            reserved: 0,
            decoded_length: payload.len() as u64,
            payload: payload.to_vec(),
        }
    }

    /// Sets a payload that is stored as it is.
    pub(crate) fn set(&mut self, payload: Vec<u8>) {
        self.codec = 0;
        self.decoded_length = payload.len() as u64;
        self.payload = payload;
    }

    /// Overwrites bytes of the payload.
    pub(crate) fn patch(&mut self, at: usize, bytes: &[u8]) {
        self.payload[at..at + bytes.len()].copy_from_slice(bytes);
    }

    /// Compresses what follows the first `record` bytes of a payload that is stored as it is.
    pub(crate) fn compress(&mut self, record: usize) {
        assert_eq!(self.codec, 0);
        let body = zstd::bulk::compress(&self.payload[record..], 3).unwrap();
        self.payload.truncate(record);
        self.payload.extend(body);
        self.codec = 1;
    }
}

/// Makes the checksums of header and table right, whatever they hold.
pub(crate) fn seal(file: &mut [u8]) {
    let table_end = file.len().min(32 + 48 * number(file, 12, 4) as usize);
    let table = crc32fast::hash(&file[32..table_end]);
    file[24..28].copy_from_slice(&table.to_le_bytes());
    let header = crc32fast::hash(&file[..28]);
    file[28..32].copy_from_slice(&header.to_le_bytes());
}
