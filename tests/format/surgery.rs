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
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Part {
    pub(crate) kind: [u8; 12],
    pub(crate) flags: u16,
    pub(crate) scale: u16,
    pub(crate) chunk: u32,
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
            let entry = &bytes[64 + 64 * index..];
            let (offset, length) = (number(entry, 32, 8) as usize, number(entry, 40, 8) as usize);
            Part {
                kind: entry[..12].try_into().unwrap(),
                flags: number(entry, 12, 2) as u16,
                scale: number(entry, 14, 2) as u16,
                chunk: number(entry, 16, 4) as u32,
                codec: number(entry, 20, 2) as u16,
                reserved: number(entry, 22, 2) as u16,
                decoded_length: number(entry, 48, 8),
                payload: bytes[offset..offset + length].to_vec(),
            }
        });
        Self { major: number(bytes, 8, 2) as u16, minor: number(bytes, 10, 2) as u16, sections: sections.collect() }
    }

    /// The first section of this name.
    pub(crate) fn part(&mut self, kind: &str) -> &mut Part {
        self.sections.iter_mut().find(|p| p.kind == name(kind)).unwrap()
    }

    /// Index of the first section of this name.
    pub(crate) fn index(&self, kind: &str) -> usize {
        self.sections.iter().position(|p| p.kind == name(kind)).unwrap()
    }

    /// The file, its layout and checksums right.
    pub(crate) fn bytes(&self) -> Vec<u8> {
        let mut end = 64 + 64 * self.sections.len();
        let (mut table, mut payloads) = (Vec::new(), Vec::new());
        for part in &self.sections {
            let offset = end.next_multiple_of(64);
            payloads.resize(payloads.len() + offset - end, 0);
            payloads.extend(&part.payload);
            end = offset + part.payload.len();
            table.extend(part.kind);
            table.extend([part.flags, part.scale].map(u16::to_le_bytes).concat());
            table.extend(part.chunk.to_le_bytes());
            table.extend([part.codec, part.reserved].map(u16::to_le_bytes).concat());
            table.extend([crc32fast::hash(&part.payload), 0].map(u32::to_le_bytes).concat());
            let numbers = [offset as u64, part.payload.len() as u64, part.decoded_length, 0];
            table.extend(numbers.map(u64::to_le_bytes).concat());
        }
        let mut file = b"\xB3STV\r\n\x1A\n".to_vec();
        file.extend(self.major.to_le_bytes());
        file.extend(self.minor.to_le_bytes());
        file.extend((self.sections.len() as u32).to_le_bytes());
        file.extend((end as u64).to_le_bytes());
        file.resize(64, 0);
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
            chunk: 0xFFFF_FFFF,
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
        assert_eq!(self.codec, 0, "stored as it is");
        let body = zstd::bulk::compress(&self.payload[record..], 3).unwrap();
        self.payload.truncate(record);
        self.payload.extend(body);
        self.codec = 1;
    }
}

impl Part {
    /// Stores as it is what follows the first `record` bytes of the payload.
    pub(crate) fn inflate(&mut self, record: usize) {
        if self.codec == 1 {
            let body = zstd::bulk::decompress(&self.payload[record..], 1 << 20).unwrap();
            let payload = [&self.payload[..record], &body].concat();
            self.set(payload);
        }
    }
}

/// Makes the checksums of header, table and file right, whatever they hold.
pub(crate) fn seal(file: &mut [u8]) {
    let table_end = file.len().min(64 + 64 * number(file, 12, 4) as usize);
    let checksums =
        [crc32fast::hash(&file[64.min(table_end)..table_end]), crc32fast::hash(&file[64.min(file.len())..])];
    file[24..32].copy_from_slice(&checksums.map(u32::to_le_bytes).concat());
    seal_header(file);
}

/// Makes the checksum of the header right.
pub(crate) fn seal_header(file: &mut [u8]) {
    let header = crc32fast::hash(&file[..60]);
    file[60..64].copy_from_slice(&header.to_le_bytes());
}
