//! The header of a frame: size, kind of coding, and the sampling of the components.

use super::JpegError;

/// The side of a block of samples.
pub(super) const BLOCK: usize = 8;

pub(super) const HIERARCHICAL: JpegError = unsupported("hierarchical coding", "magick IN.jpg OUT.png");
pub(super) const JPEG_LS: JpegError = unsupported("JPEG-LS coding", "ffmpeg -i IN.jpg OUT.png");
pub(super) const UNKNOWN_HEIGHT: JpegError = unsupported("a height behind its data", "magick IN.jpg OUT.png");
const ARITHMETIC: JpegError = unsupported("arithmetic coding", "jpegtran -copy all IN.jpg > OUT.jpg");
const LOSSLESS: JpegError = unsupported("lossless coding", "magick IN.jpg OUT.png");
const PRECISION: JpegError = unsupported("samples of other than 8 bits", "magick IN.jpg OUT.png");
const COMPONENTS: JpegError = unsupported("other than 1, 3 or 4 components", "magick IN.jpg OUT.png");
const FRACTIONS: JpegError =
    unsupported("components whose sampling is no whole fraction of the finest", "magick IN.jpg OUT.png");

const fn unsupported(what: &'static str, remedy: &'static str) -> JpegError {
    JpegError::Unsupported { what, remedy }
}

/// The header of a frame.
#[derive(Clone, Debug)]
pub(super) struct Frame {
    /// Columns and rows.
    pub(super) size: [u32; 2],
    pub(super) is_progressive: bool,
    /// The largest sampling of a component, along columns and rows.
    pub(super) finest: [u32; 2],
    /// Columns and rows of minimum coded units of a scan of several components.
    pub(super) units: [u32; 2],
    pub(super) components: Vec<Component>,
}

/// A component of a frame.
#[derive(Clone, Debug)]
pub(super) struct Component {
    pub(super) identifier: u8,
    /// Blocks in a minimum coded unit, along columns and rows.
    pub(super) sampling: [u32; 2],
    /// The number of the quantization table.
    pub(super) quantization: usize,
    /// Columns and rows of samples that belong to the picture.
    pub(super) size: [u32; 2],
    /// Columns and rows of blocks that belong to the picture.
    pub(super) blocks: [u32; 2],
    /// Columns and rows of blocks in whole minimum coded units.
    pub(super) padded_blocks: [u32; 2],
}

impl Component {
    /// Samples in whole minimum coded units.
    pub(super) fn padded_samples(&self) -> u64 {
        self.padded_blocks.map(u64::from).iter().product::<u64>() * (BLOCK * BLOCK) as u64
    }

    /// Samples of a row in whole minimum coded units.
    pub(super) fn stride(&self) -> usize {
        self.padded_blocks[0] as usize * BLOCK
    }
}

impl Frame {
    /// The frame of the segment `bytes` behind `marker`.
    pub(super) fn parse(marker: u8, bytes: &[u8]) -> Result<Self, JpegError> {
        let is_progressive = match marker {
            0xc0 | 0xc1 => false,
            0xc2 => true,
            0xc3 => return Err(LOSSLESS),
            0xc9 | 0xca | 0xcc => return Err(ARITHMETIC),
            _ => return Err(HIERARCHICAL),
        };
        let (header, of_components) = bytes.split_first_chunk::<6>().ok_or(WRONG_LENGTH)?;
        let [precision, height_high, height_low, width_high, width_low, count] = *header;
        if precision != 8 {
            return Err(PRECISION);
        }
        let size =
            [[width_high, width_low], [height_high, height_low]].map(|bytes| u32::from(u16::from_be_bytes(bytes)));
        if size[1] == 0 {
            return Err(UNKNOWN_HEIGHT);
        }
        if size[0] == 0 {
            return Err(JpegError::Damaged("the picture has no columns"));
        }
        if !matches!(count, 1 | 3 | 4) {
            return Err(COMPONENTS);
        }
        let (of_components, rest) = of_components.as_chunks::<3>();
        if of_components.len() != usize::from(count) || !rest.is_empty() {
            return Err(WRONG_LENGTH);
        }
        Self::new(size, is_progressive, of_components)
    }

    fn new(size: [u32; 2], is_progressive: bool, of_components: &[[u8; 3]]) -> Result<Self, JpegError> {
        let samplings = of_components.iter().map(|bytes| [bytes[1] >> 4, bytes[1] & 15].map(u32::from));
        if samplings.clone().flatten().any(|sampling| !(1..=4).contains(&sampling)) {
            return Err(JpegError::Damaged("a sampling factor is not 1 to 4"));
        }
        let finest =
            samplings.clone().fold([1_u32; 2], |finest, sampling| axes(|axis| finest[axis].max(sampling[axis])));
        let units = axes(|axis| size[axis].div_ceil(finest[axis] * BLOCK as u32));
        let mut components: Vec<Component> = Vec::new();
        for (&[identifier, _, quantization], sampling) in of_components.iter().zip(samplings) {
            if components.iter().any(|other| other.identifier == identifier) {
                return Err(JpegError::Damaged("two components have one identifier"));
            }
            if (0..2).any(|axis| finest[axis] % sampling[axis] != 0) {
                return Err(FRACTIONS);
            }
            let own_size = axes(|axis| (size[axis] * sampling[axis]).div_ceil(finest[axis]));
            components.push(Component {
                identifier,
                sampling,
                quantization: usize::from(quantization),
                size: own_size,
                blocks: own_size.map(|extent| extent.div_ceil(BLOCK as u32)),
                padded_blocks: axes(|axis| units[axis] * sampling[axis]),
            });
        }
        Ok(Self { size, is_progressive, finest, units, components })
    }
}

const WRONG_LENGTH: JpegError = JpegError::Damaged("the header of the frame has a wrong length");

/// A number for each axis, columns and rows.
fn axes(of: impl Fn(usize) -> u32) -> [u32; 2] {
    [of(0), of(1)]
}
