//! Tables of a file: quantization, Huffman codes, and the restart interval.

use super::JpegError;

/// The natural order of coefficients, by their place in a file.
pub(super) const ZIGZAG: [usize; 64] = [
    0, 1, 8, 16, 9, 2, 3, 10, 17, 24, 32, 25, 18, 11, 4, 5, 12, 19, 26, 33, 40, 48, 41, 34, 27, 20, 13, 6, 7, 14, 21,
    28, 35, 42, 49, 56, 57, 50, 43, 36, 29, 22, 15, 23, 30, 37, 44, 51, 58, 59, 52, 45, 38, 31, 39, 46, 53, 60, 61, 54,
    47, 55, 62, 63,
];

/// Bits by which codes are looked up.
pub(super) const LOOKUP_BITS: usize = 9;

/// The tables that the segments read so far define.
#[derive(Debug, Default)]
pub(super) struct Tables {
    /// \[table\]\[coefficient in natural order\].
    pub(super) quantization: [Option<[u16; 64]>; 4],
    pub(super) dc: [Option<Box<Huffman>>; 4],
    pub(super) ac: [Option<Box<Huffman>>; 4],
    /// Minimum coded units between restarts; 0: none.
    pub(super) restart_interval: u32,
}

/// A Huffman code.
#[derive(Debug)]
pub(super) struct Huffman {
    /// \[next bits\] length and symbol of the code with which they begin; the length is 0 if the code is longer.
    pub(super) lookup: [(u8, u8); 1 << LOOKUP_BITS],
    /// \[length\] one more than the largest code, aligned to 16 bits.
    pub(super) ends: [u32; 17],
    /// \[length\] what leads from a code to the place of its symbol.
    pub(super) offsets: [i32; 17],
    pub(super) symbols: Vec<u8>,
}

impl Huffman {
    /// The code with `counts`\[length − 1\] symbols of each length.
    fn new(counts: &[u8; 16], symbols: &[u8]) -> Result<Self, JpegError> {
        let mut table =
            Self { lookup: [(0, 0); 1 << LOOKUP_BITS], ends: [0; 17], offsets: [0; 17], symbols: symbols.to_vec() };
        let (mut code, mut place) = (0_u32, 0_usize);
        for length in 1..=16_usize {
            let count = u32::from(counts[length - 1]);
            if code + count > 1 << length {
                return Err(JpegError::Damaged("a Huffman table has too many codes"));
            }
            table.offsets[length] = place as i32 - code as i32;
            if length <= LOOKUP_BITS {
                for &symbol in &symbols[place..place + count as usize] {
                    let spare = LOOKUP_BITS - length;
                    table.lookup[(code as usize) << spare..][..1 << spare].fill((length as u8, symbol));
                    code += 1;
                }
            } else {
                code += count;
            }
            place += count as usize;
            table.ends[length] = code << (16 - length);
            code <<= 1;
        }
        Ok(table)
    }
}

/// A segment of tables.
pub(super) struct Segment<'a, 'b> {
    bytes: &'a [u8],
    tables: &'b mut Tables,
}

impl<'a, 'b> Segment<'a, 'b> {
    pub(super) fn new(bytes: &'a [u8], tables: &'b mut Tables) -> Self {
        Self { bytes, tables }
    }

    /// Reads Huffman tables.
    pub(super) fn huffman(self) -> Result<(), JpegError> {
        const WRONG: JpegError = JpegError::Damaged("a segment of Huffman tables is malformed");
        let mut rest = self.bytes;
        while let Some((&header, after)) = rest.split_first() {
            let (counts, after) = after.split_first_chunk::<16>().ok_or(WRONG)?;
            let count = counts.iter().map(|&count| usize::from(count)).sum::<usize>();
            let symbols = after.get(..count).filter(|symbols| symbols.len() <= 256).ok_or(WRONG)?;
            let of_class = match header >> 4 {
                0 => &mut self.tables.dc,
                1 => &mut self.tables.ac,
                _ => return Err(WRONG),
            };
            let table = of_class.get_mut(usize::from(header & 15)).ok_or(WRONG)?;
            *table = Some(Box::new(Huffman::new(counts, symbols)?));
            rest = &after[count..];
        }
        Ok(())
    }

    /// Reads quantization tables.
    pub(super) fn quantization(self) -> Result<(), JpegError> {
        const WRONG: JpegError = JpegError::Damaged("a segment of quantization tables is malformed");
        let mut rest = self.bytes;
        while let Some((&header, after)) = rest.split_first() {
            let bytes_each = match header >> 4 {
                0 => 1,
                1 => 2,
                _ => return Err(WRONG),
            };
            let values = after.get(..64 * bytes_each).ok_or(WRONG)?;
            let mut table = [0; 64];
            for (&place, value) in ZIGZAG.iter().zip(values.chunks(bytes_each)) {
                table[place] = value.iter().fold(0, |sum, &byte| (sum << 8) | u16::from(byte));
            }
            *self.tables.quantization.get_mut(usize::from(header & 15)).ok_or(WRONG)? = Some(table);
            rest = &after[64 * bytes_each..];
        }
        Ok(())
    }

    /// Reads the restart interval.
    pub(super) fn restart_interval(self) -> Result<(), JpegError> {
        let bytes = self.bytes.try_into().map_err(|_| JpegError::Damaged("the restart interval is malformed"))?;
        self.tables.restart_interval = u32::from(u16::from_be_bytes(bytes));
        Ok(())
    }
}
