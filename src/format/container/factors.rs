//! DENSITY and APPEARANCE: the factors of a chunk's tensors (spec 3.10).

use std::fmt::Display;

use super::array::{self, ArrayHead};
use super::codec::adaptive::{ArrayShape, Groups};
use super::encoding::ArrayOptions;
use super::error::Error;
use super::limits::Budget;
use super::payload::{Body, Payload};
use super::record::{self, BorrowDecode, Encode, Record};
use super::writer::{Compression, FinishedSection, SectionPlace};
use crate::model::{Block, Form};

/// Bytes that a number takes while it is read: itself, and its integer in another arrangement.
const NUMBER_BYTES: u64 = 8;

#[derive(Encode, BorrowDecode)]
struct FactorsRecord {
    /// 0 if all components are stored, 1 if the body lists those of each tensor.
    is_ragged: u8,
    reserved: [u8; 7],
    head: ArrayHead,
}

impl Record for FactorsRecord {
    fn check(&self, place: &dyn Display) -> Result<(), Error> {
        if self.is_ragged > 1 {
            return Err(Error::unknown_code(place, "components", self.is_ragged));
        }
        Error::unless_reserved(place, &self.reserved)?;
        self.head.check(place)
    }
}

/// One part, density or appearance, of a scale's factors.
pub(super) struct ScalePart<'a> {
    pub(super) blocks: &'a [Block],
    pub(super) resolution: [u32; 3],
}

/// A block without its numbers: its form and its rank.
pub(super) type BlockShape = (Form, usize);

/// How a chunk's numbers are laid out in a scene's and in a file's order.
struct ChunkLayout {
    blocks: Vec<BlockLayout>,
}

/// [`ChunkLayout`] of a block.
struct BlockLayout {
    rank: usize,
    /// Rows of a tensor.
    rows: usize,
    /// \[tensor of the chunk\] the components that it has.
    components: Vec<Vec<usize>>,
}

impl ChunkLayout {
    /// For tensors that have these `components` of all blocks together.
    fn new(shapes: &[BlockShape], resolution: [u32; 3], components: &[Vec<usize>]) -> Self {
        let mut first = 0;
        let block = |&(form, rank): &BlockShape| {
            let range = first..first + rank;
            first = range.end;
            let of_block =
                |all: &Vec<usize>| all.iter().filter(|c| range.contains(c)).map(|c| c - range.start).collect();
            BlockLayout { rank, rows: form.rows(resolution), components: components.iter().map(of_block).collect() }
        };
        Self { blocks: shapes.iter().map(block).collect() }
    }

    /// The lengths of the array's groups.
    fn group_lengths(&self) -> impl Iterator<Item = usize> + Clone {
        self.blocks.iter().flat_map(BlockLayout::group_lengths)
    }
}

impl BlockLayout {
    /// Entries of a tensor in a scene.
    fn tensor_len(&self) -> usize {
        self.rows * self.rank
    }

    fn group_lengths(&self) -> impl Iterator<Item = usize> + Clone {
        std::iter::repeat_n(self.rows, self.components.iter().map(Vec::len).sum())
    }

    /// Calls `visit` with each number's place within its tensor, tensor by tensor, in the file's order.
    fn for_each(&self, by_group: bool, mut visit: impl FnMut(usize, usize)) {
        for (tensor, components) in self.components.iter().enumerate() {
            if by_group {
                for &c in components {
                    for row in 0..self.rows {
                        visit(tensor, row * self.rank + c);
                    }
                }
            } else {
                for row in 0..self.rows {
                    for &c in components {
                        visit(tensor, row * self.rank + c);
                    }
                }
            }
        }
    }
}

/// The components of all blocks together.
fn rank_of(shapes: &[BlockShape]) -> usize {
    shapes.iter().map(|(_, rank)| rank).sum()
}

/// The shape of the factors of so many `tensors`. Masks come first if the section `is_ragged`.
fn shape(tensors: usize, shapes: &[BlockShape], resolution: [u32; 3], is_ragged: bool, bits: u8) -> ArrayShape {
    let blocks = shapes.iter().map(|&(form, rank)| (rank, form.vectors(resolution))).collect();
    ArrayShape {
        bits,
        masks: is_ragged.then_some([tensors, rank_of(shapes)]),
        groups: Groups::Components { tensors, blocks },
    }
}

/// The section of the factors of `tensors`. `steps` has a step code for each component of each tensor of the scale:
/// \[block\]\[tensor\]\[component\].
pub(super) fn write(
    compression: Compression,
    place: SectionPlace,
    part: &ScalePart<'_>,
    tensors: &[u32],
    options: ArrayOptions,
    steps: Option<&[Vec<u8>]>,
) -> Result<FinishedSection, Error> {
    let name = place.kind.to_string();
    let resolution = part.resolution;
    let shapes: Vec<BlockShape> = part.blocks.iter().map(|block| (block.form, block.rank as usize)).collect();
    let rank = rank_of(&shapes);
    let of_tensor = |block: &'_ Block, n: u32| {
        let len = block.tensor_len(resolution);
        n as usize * len..(n as usize + 1) * len
    };
    // −0 counts as stored.
    let components_of = |&n: &u32| {
        let of_block = |block: &Block| {
            let (values, rank) = (&block.values[of_tensor(block, n)], block.rank as usize);
            (0..rank).map(|c| values[c..].iter().step_by(rank).any(|v| v.to_bits() != 0)).collect::<Vec<_>>()
        };
        let has: Vec<bool> = part.blocks.iter().flat_map(of_block).collect();
        (0..rank).filter(|&c| has[c]).collect()
    };
    let components: Vec<Vec<usize>> = tensors.iter().map(components_of).collect();
    let is_ragged = components.iter().any(|c| c.len() < rank);
    let mut body = Vec::new();
    if is_ragged {
        for components in &components {
            let mut mask = vec![0u8; rank.div_ceil(8)];
            components.iter().for_each(|&c| mask[c / 8] |= 1 << (c % 8));
            body.extend(mask);
        }
    }
    let layout = ChunkLayout::new(&shapes, resolution, &components);
    let chosen: Option<Vec<u8>> = steps.map(|steps| {
        let of_block = |(block, steps): (&'_ BlockLayout, &'_ Vec<u8>)| {
            let of_tensor = |(&t, components): (&u32, &Vec<usize>)| {
                let first = t as usize * block.rank;
                components.iter().map(|c| steps[first + c]).collect::<Vec<_>>()
            };
            tensors.iter().zip(&block.components).flat_map(of_tensor).collect::<Vec<_>>()
        };
        layout.blocks.iter().zip(steps).flat_map(of_block).collect()
    });
    let mut values = Vec::new();
    for (block, layout) in part.blocks.iter().zip(&layout.blocks) {
        layout.for_each(options.encoding.is_by_group(), |t, at| {
            values.push(block.values[of_tensor(block, tensors[t])][at]);
        });
    }
    let written = array::write(&name, &values, layout.group_lengths(), options, chosen.as_deref())?;
    body.extend(written.body);
    let record = FactorsRecord { is_ragged: u8::from(is_ragged), reserved: [0; 7], head: written.head };
    let shape = |bits| shape(tensors.len(), &shapes, resolution, is_ragged, bits);
    array::finished(compression, place, record::write(&name, &record)?, &body, options.encoding, shape)
}

/// The factors of a chunk.
pub(super) struct FactorChunk {
    layout: ChunkLayout,
    options: ArrayOptions,
    /// \[group\] step codes, in the file's order; empty for floats.
    steps: Vec<u8>,
    /// Decoded numbers, in the file's order.
    numbers: Vec<f32>,
}

impl FactorChunk {
    /// Copies the numbers into `blocks`, the factors of the scale, and the step codes into `steps`,
    /// \[block\]\[tensor\]\[component\]; `places` are the numbers of the chunk's tensors in the scale.
    pub(super) fn put(self, places: &[u32], blocks: &mut [Block], steps: &mut [Vec<u8>]) {
        let Self { layout, options, steps: codes, numbers } = self;
        let (mut next, mut codes) = (numbers.into_iter(), codes.into_iter());
        for ((layout, block), steps) in layout.blocks.iter().zip(blocks).zip(steps) {
            let tensor_len = layout.tensor_len();
            layout.for_each(options.encoding.is_by_group(), |t, at| {
                if let Some(value) = next.next() {
                    block.values[places[t] as usize * tensor_len + at] = value;
                }
            });
            let components = layout.components.iter().enumerate().flat_map(|(t, cs)| cs.iter().map(move |&c| (t, c)));
            for ((t, c), code) in components.zip(&mut codes) {
                steps[places[t] as usize * layout.rank + c] = code;
            }
        }
    }

    /// Encoding and filter of the numbers.
    pub(super) fn options(&self) -> ArrayOptions {
        self.options
    }
}

/// The section of a chunk's factors, of which only the record is read.
pub(super) struct Opened<'a> {
    head: ArrayHead,
    body: Body<'a>,
    options: ArrayOptions,
    /// Bytes of a tensor's mask of components.
    mask_bytes: usize,
    shapes: Vec<BlockShape>,
    resolution: [u32; 3],
    tensors: usize,
}

/// Reads the record of the factors of a chunk of `tensors`, and checks how long the body may be.
pub(super) fn open<'a>(
    payload: &Payload<'a>,
    shapes: &[BlockShape],
    resolution: [u32; 3],
    tensors: usize,
) -> Result<Opened<'a>, Error> {
    let name = payload.section;
    let (record, body): (FactorsRecord, _) = payload.record_and_body()?;
    let options = record.head.options(name)?;
    let encoding = options.encoding;
    let rank = rank_of(shapes);
    let mask_bytes = if record.is_ragged == 0 { 0 } else { rank.div_ceil(8) };
    // Only the masks determine the length of the array. All components of all tensors are its maximum.
    let masks = (mask_bytes * tensors) as u64;
    let numbers: u64 = shapes.iter().map(|(form, rank)| (form.rows(resolution) * rank * tensors) as u64).sum();
    let all = encoding.length((rank * tensors) as u64, numbers);
    if !(masks..=masks + all).contains(&body.length) {
        let expected = format!("{masks} to {}", masks + all);
        return Err(Error::malformed(format!("{name} body length"), expected, body.length));
    }
    Ok(Opened { head: record.head, body, options, mask_bytes, shapes: shapes.to_vec(), resolution, tensors })
}

impl Opened<'_> {
    /// The most memory that [`Self::read`] takes.
    pub(super) fn max_memory(&self) -> u64 {
        let numbers = self.body.length / self.options.encoding.width() as u64;
        self.body.length + NUMBER_BYTES * numbers
    }

    /// Reads the factors.
    pub(super) fn read(&self, budget: &mut Budget) -> Result<FactorChunk, Error> {
        let &Self { ref head, ref body, options, mask_bytes, ref shapes, resolution, tensors } = self;
        let rank = rank_of(shapes);
        let encoding = options.encoding;
        let name = body.section;
        let shape = |bits| shape(tensors, shapes, resolution, mask_bytes > 0, bits);
        let bytes = array::decode(body, body.length, encoding, budget, shape)?;
        let (masks, array) = bytes.split_at(mask_bytes * tensors);
        let components: Vec<Vec<usize>> = match mask_bytes {
            0 => vec![(0..rank).collect(); tensors],
            _ => {
                masks.chunks_exact(mask_bytes).map(|mask| components_of(name, mask, rank)).collect::<Result<_, _>>()?
            }
        };
        let layout = ChunkLayout::new(shapes, resolution, &components);
        let (groups, numbers) = array::count(layout.group_lengths());
        let length = encoding.length(groups, numbers);
        Error::unless_equal(format!("{name} number of bytes of the array"), length, array.len() as u64)?;
        budget.spend(name, NUMBER_BYTES * numbers)?;
        let numbers = array::read(name, head, array, layout.group_lengths())?;
        let steps = if encoding.is_by_group() { array[..groups as usize].to_vec() } else { Vec::new() };
        Ok(FactorChunk { layout, options, steps, numbers })
    }
}

/// The components whose bits are set.
fn components_of(name: &impl std::fmt::Display, mask: &[u8], rank: usize) -> Result<Vec<usize>, Error> {
    let is_set = |c: usize| mask[c / 8] >> (c % 8) & 1 == 1;
    if (rank..8 * mask.len()).any(is_set) {
        return Err(Error::malformed(format!("{name} components"), "without bits past the rank", "such a bit"));
    }
    Ok((0..rank).filter(|&c| is_set(c)).collect())
}
