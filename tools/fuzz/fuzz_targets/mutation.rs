//! Valid files with changes and correct checksums, so that fuzzing reaches the code behind the checksums.

#[path = "../../../tests/format/surgery.rs"]
#[allow(dead_code, reason = "a part is used")]
mod surgery;

use arbitrary::Arbitrary;
use surgery::{File, seal};

/// Files that together use every feature of the format.
const FILES: [&[u8]; 14] = [
    include_bytes!("../../../fixtures/v1/smallest.strivec"),
    include_bytes!("../../../fixtures/v1/everything.strivec"),
    include_bytes!("../../../fixtures/v1/f16-planes.strivec"),
    include_bytes!("../../../fixtures/v1/integers-adaptive-3.strivec"),
    include_bytes!("../../../fixtures/v1/grid-3.strivec"),
    include_bytes!("../../../fixtures/v1/integers-adaptive-ragged.strivec"),
    include_bytes!("../../../fixtures/v1/ragged-grid.strivec"),
    include_bytes!("../../../fixtures/v1/ragged-f32.strivec"),
    include_bytes!("../../../fixtures/v1/explicit.strivec"),
    include_bytes!("../../../fixtures/v1/occupancy.strivec"),
    include_bytes!("../../../fixtures/v1/zstd.strivec"),
    include_bytes!("../../../fixtures/v1/networks-grid.strivec"),
    include_bytes!("../../../fixtures/v1/vm.strivec"),
    include_bytes!("../../../fixtures/v1/vm-integers-adaptive.strivec"),
];

#[derive(Debug, Arbitrary)]
pub struct Input {
    file: u8,
    changes: Vec<Change>,
}

/// A change of section `section`, modulo the number of sections.
#[derive(Debug, Arbitrary)]
pub struct Change {
    section: u8,
    what: What,
}

#[derive(Debug, Arbitrary)]
pub enum What {
    Set { at: u16, value: u8 },
    Number { at: u16, value: u64 },
    Insert { at: u16, value: u8 },
    Cut { length: u16 },
    Kind { of: u8 },
    Flags(u16),
    Scale(u16),
    Chunk(u32),
    Codec(u16),
    DecodedLength(u64),
    Repeat,
    Remove,
    Compress { record: u8 },
    /// A byte of header or table.
    Table { at: u16, value: u8 },
}

impl Input {
    /// The changed file.
    pub fn bytes(self) -> Vec<u8> {
        let mut file = File::of(FILES[self.file as usize % FILES.len()]);
        let mut in_table = Vec::new();
        for Change { section, what } in self.changes.into_iter().take(16) {
            let count = file.sections.len();
            if count == 0 {
                break;
            }
            let index = section as usize % count;
            let part = &mut file.sections[index];
            let length = part.payload.len();
            match what {
                What::Set { at, value } if length > 0 => part.payload[at as usize % length] = value,
                What::Number { at, value } if length >= 8 => part.patch(at as usize % (length - 7), &value.to_le_bytes()),
                What::Insert { at, value } => part.payload.insert(at as usize % (length + 1), value),
                What::Cut { length: to } => part.payload.truncate(to as usize),
                What::Kind { of } => file.sections[index].kind = file.sections[of as usize % count].kind,
                What::Flags(value) => part.flags = value,
                What::Scale(value) => part.scale = value,
                What::Chunk(value) => part.chunk = value,
                What::Codec(value) => part.codec = value,
                What::DecodedLength(value) => part.decoded_length = value,
                What::Repeat => {
                    let copy = part.clone();
                    file.sections.insert(index, copy);
                }
                What::Remove => drop(file.sections.remove(index)),
                What::Compress { record } if part.codec == 0 && record as usize <= length => part.compress(record as usize),
                What::Table { at, value } => in_table.push((at, value)),
                _ => (),
            }
        }
        let mut bytes = file.bytes();
        let table_end = 64 + 64 * file.sections.len();
        for (at, value) in in_table {
            bytes[at as usize % table_end] = value;
        }
        seal(&mut bytes);
        bytes
    }
}
