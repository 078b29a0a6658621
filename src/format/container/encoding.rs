//! Encodings and filters of arrays of numbers (spec 3.3).

/// Encodings of an array's numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Encoding {
    /// 32-bit floats, exactly.
    F32,
    /// Rounded to half precision, to nearest, ties to even: a relative error of at most 2^-11 down to 6.1e-5, an
    /// absolute one of at most 3e-8 below. A number that would round to infinity is an error.
    F16,
    /// Integers of these bits (16, 8, 6, 5, 4 or 3) times a step for each group.
    Grid(u8),
}

/// Arrangements of floats before compression; lossless.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Filter {
    /// One after the other.
    #[default]
    None,
    /// All first bytes, then all second bytes, and so on.
    Planes,
}

/// Encoding and filter of an array.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ArrayOptions {
    /// Floats or integers.
    pub encoding: Encoding,
    /// The arrangement before compression.
    pub filter: Filter,
}

impl ArrayOptions {
    /// `encoding` with the filter that compresses best on trained scenes.
    pub fn best(encoding: Encoding) -> Self {
        let filter = match encoding {
            Encoding::F32 | Encoding::F16 => Filter::Planes,
            Encoding::Grid(_) => Filter::None,
        };
        Self { encoding, filter }
    }
}

/// The widths of [`Encoding::Grid`].
pub const GRID_BITS: [u8; 6] = [16, 8, 6, 5, 4, 3];

/// M of the specification: 2^(j/8) in f32.
const MANTISSAS: [u32; 8] =
    [0x3f80_0000, 0x3f8b_95c2, 0x3f98_37f0, 0x3fa5_fed7, 0x3fb5_04f3, 0x3fc5_672a, 0x3fd7_44fd, 0x3fea_c0c7];
/// The exponent of step code 1.
const LOWEST_EXPONENT: i32 = -24;

/// The step of step code `code`.
pub fn step(code: u8) -> f32 {
    let Some(code) = code.checked_sub(1) else { return 0.0 };
    let exponent = LOWEST_EXPONENT + i32::from(code / 8);
    f32::from_bits(MANTISSAS[usize::from(code % 8)]) * f32::from_bits(((127 + exponent) as u32) << 23)
}

/// The code of the smallest step that is at least `step`; the largest code if no step is.
pub fn step_code(step: f32) -> u8 {
    let at_least = |code: u8| self::step(code) >= step;
    let (mut low, mut high) = (0, u8::MAX);
    while low < high {
        let middle = low + (high - low) / 2;
        if at_least(middle) { high = middle } else { low = middle + 1 }
    }
    low
}

/// The largest integer of a grid.
pub(super) fn largest(bits: u8) -> f32 {
    ((1u32 << (bits - 1)) - 1) as f32
}

/// The integers of a grid in `bytes`, of `width` bytes each.
pub(super) fn integers(bytes: &[u8], width: usize) -> impl Iterator<Item = i16> + '_ {
    bytes.chunks_exact(width).map(|bytes| match *bytes {
        [low, high] => i16::from_le_bytes([low, high]),
        _ => i16::from(bytes[0] as i8),
    })
}

/// The inverse of [`integers`], into `bytes` of this many. Integers of one byte are from −128 to 127.
pub(super) fn write_integers(bytes: &mut [u8], integers: &[i16], width: usize) {
    match width {
        1 => bytes.iter_mut().zip(integers).for_each(|(byte, &q)| *byte = q as u8),
        _ => bytes.as_chunks_mut().0.iter_mut().zip(integers).for_each(|(bytes, q)| *bytes = q.to_le_bytes()),
    }
}

impl Encoding {
    /// The codes of encoding and bits in an array head.
    pub(super) fn codes(self) -> (u8, u8) {
        match self {
            Self::F32 => (0, 0),
            Self::F16 => (1, 0),
            Self::Grid(bits) => (2, bits),
        }
    }

    /// True for integers, which have a step for each group; a component is a group.
    pub(super) fn is_by_group(self) -> bool {
        matches!(self, Self::Grid(_))
    }

    /// Bytes of a number.
    pub(super) fn width(self) -> usize {
        match self {
            Self::F32 => 4,
            Self::F16 => 2,
            Self::Grid(bits) => {
                if bits > 8 {
                    2
                } else {
                    1
                }
            }
        }
    }

    /// Bytes of an array of `numbers` numbers in `groups` groups.
    pub(super) fn length(self, groups: u64, numbers: u64) -> u64 {
        let steps = if self.is_by_group() { groups } else { 0 };
        steps + self.width() as u64 * numbers
    }
}
