//! Scans: from entropy-coded data to coefficients, and to the samples of each component.

use super::JpegError;
use super::bits::Bits;
use super::frame::{BLOCK, Component, Frame};
use super::idct;
use super::tables::{Huffman, Tables, ZIGZAG};

/// The place of a coefficient's lowest bit of which nothing is known yet.
const UNKNOWN: u8 = u8::MAX;
/// The lowest bit at which a progressive picture may begin.
const MAX_LOW: u8 = 13;

/// A picture whose scans are being decoded.
#[derive(Debug)]
pub(super) struct Decoding {
    frame: Frame,
    planes: Vec<Plane>,
}

/// A component's data.
#[derive(Debug)]
struct Plane {
    /// \[row\]\[column\] samples in whole minimum coded units. Empty for a progressive picture that is not complete.
    samples: Vec<u8>,
    /// \[block row\]\[block column\] coefficients in natural order of a progressive picture, else empty.
    coefficients: Vec<[i16; 64]>,
    /// The quantization table at the first scan of the component.
    quantization: Option<[u16; 64]>,
    /// \[coefficient in the order of the file\] the place of the lowest known bit.
    lows: [u8; 64],
}

impl Plane {
    fn new(component: &Component, is_progressive: bool) -> Self {
        let samples = component.padded_samples() as usize;
        let (samples, blocks) = if is_progressive { (0, samples / (BLOCK * BLOCK)) } else { (samples, 0) };
        Self { samples: vec![0; samples], coefficients: vec![[0; 64]; blocks], quantization: None, lows: [UNKNOWN; 64] }
    }
}

/// The coefficients that a scan has, and their bits.
#[derive(Clone, Copy)]
struct Selection {
    /// The first and the last coefficient in the order of the file.
    range: [usize; 2],
    /// The place of the lowest bit known before; 0: nothing is known.
    high: u8,
    /// The place of the lowest bit known afterwards.
    low: u8,
}

/// What a scan of one component needs.
struct ScanComponent<'a> {
    /// The number of the component in the frame.
    number: usize,
    dc: Option<&'a Huffman>,
    ac: Option<&'a Huffman>,
    /// The last block's mean.
    predictor: i32,
}

impl Decoding {
    pub(super) fn new(frame: Frame) -> Self {
        let planes = frame.components.iter().map(|component| Plane::new(component, frame.is_progressive)).collect();
        Self { frame, planes }
    }

    pub(super) fn frame(&self) -> &Frame {
        &self.frame
    }

    /// True if all bits of all coefficients are known.
    pub(super) fn is_complete(&self) -> bool {
        self.planes.iter().all(|plane| plane.lows == [0; 64])
    }

    /// True if something is known of the mean of each block.
    pub(super) fn has_all_means(&self) -> bool {
        self.planes.iter().all(|plane| plane.lows[0] != UNKNOWN)
    }

    /// Decodes the scan of the segment `header`, whose data begin at the first of `bytes`. Returns the length of the data.
    pub(super) fn scan(&mut self, header: &[u8], tables: &Tables, bytes: &[u8]) -> Result<usize, JpegError> {
        let (mut components, selection) = self.parse(header, tables)?;
        for component in &components {
            let plane = &mut self.planes[component.number];
            plane.quantization = plane.quantization.or_else(|| {
                tables.quantization.get(self.frame.components[component.number].quantization).copied().flatten()
            });
            if plane.quantization.is_none() {
                return Err(JpegError::Damaged("a quantization table is missing"));
            }
        }
        let mut bits = Bits::new(bytes);
        let mut end_run = 0;
        let is_single = components.len() == 1;
        let first = &self.frame.components[components[0].number];
        let [columns, rows] = if is_single { first.blocks } else { self.frame.units };
        let mut until_restart = tables.restart_interval;
        let mut restarts = 0;
        for row in 0..rows {
            for column in 0..columns {
                if tables.restart_interval > 0 {
                    if until_restart == 0 {
                        bits.restart(restarts)?;
                        restarts += 1;
                        until_restart = tables.restart_interval;
                        end_run = 0;
                        components.iter_mut().for_each(|component| component.predictor = 0);
                    }
                    until_restart -= 1;
                }
                for component in &mut components {
                    let of_frame = &self.frame.components[component.number];
                    let [across, down] = if is_single { [1; 2] } else { of_frame.sampling };
                    for block_row in row * down..(row + 1) * down {
                        for block_column in column * across..(column + 1) * across {
                            let plane = &mut self.planes[component.number];
                            let place = [block_column, block_row].map(|n| n as usize);
                            if self.frame.is_progressive {
                                let block = place[1] * of_frame.padded_blocks[0] as usize + place[0];
                                let block = &mut plane.coefficients[block];
                                progressive(&mut bits, component, selection, &mut end_run, block)?;
                            } else {
                                sequential(&mut bits, component, plane, place, of_frame.stride())?;
                            }
                        }
                    }
                }
            }
        }
        for component in &components {
            self.planes[component.number].lows[selection.range[0]..=selection.range[1]].fill(selection.low);
        }
        Ok(bits.position())
    }

    /// The components and the selection that the segment `header` of a scan names.
    fn parse<'a>(&self, header: &[u8], tables: &'a Tables) -> Result<(Vec<ScanComponent<'a>>, Selection), JpegError> {
        const WRONG: JpegError = JpegError::Damaged("the header of a scan is malformed");
        let (&count, rest) = header.split_first().ok_or(WRONG)?;
        let (of_components, &[first, last, bits]) = rest.split_last_chunk::<3>().ok_or(WRONG)?;
        let (of_components, left) = of_components.as_chunks::<2>();
        if !(1..=4).contains(&count) || of_components.len() != usize::from(count) || !left.is_empty() {
            return Err(WRONG);
        }
        let selection = if self.frame.is_progressive {
            let [first, last] = [first, last].map(usize::from);
            let (high, low) = (bits >> 4, bits & 15);
            let is_range = if first == 0 { last == 0 } else { count == 1 && (first..64).contains(&last) };
            if !is_range || low > MAX_LOW || (high > 0 && high != low + 1) {
                return Err(WRONG);
            }
            Selection { range: [first, last], high, low }
        } else {
            Selection { range: [0, 63], high: 0, low: 0 }
        };
        let mut components: Vec<ScanComponent<'a>> = Vec::with_capacity(of_components.len());
        for &[identifier, codes] in of_components {
            let number = self.frame.components.iter().position(|component| component.identifier == identifier);
            let number = number.filter(|&number| components.iter().all(|other| other.number != number)).ok_or(WRONG)?;
            let lows = &self.planes[number].lows[selection.range[0]..=selection.range[1]];
            let expected = if selection.high > 0 { selection.high } else { UNKNOWN };
            if lows.iter().any(|&low| low != expected) {
                return Err(JpegError::Damaged("a scan does not continue those before it"));
            }
            let of_number = |tables: &'a [Option<Box<Huffman>>; 4], number: u8| {
                tables.get(usize::from(number)).and_then(Option::as_deref)
            };
            let (dc, ac) = (of_number(&tables.dc, codes >> 4), of_number(&tables.ac, codes & 15));
            let needs_dc = selection.range[0] == 0 && selection.high == 0;
            if (needs_dc && dc.is_none()) || (selection.range[1] > 0 && ac.is_none()) {
                return Err(JpegError::Damaged("a Huffman table is missing"));
            }
            components.push(ScanComponent { number, dc, ac, predictor: 0 });
        }
        Ok((components, selection))
    }

    /// The frame, and \[component\]\[row\]\[column\] its samples in whole minimum coded units.
    pub(super) fn into_planes(self) -> (Frame, Vec<Vec<u8>>) {
        let Self { frame, planes } = self;
        let samples = |(plane, component): (Plane, &Component)| {
            let Plane { mut samples, coefficients, quantization, .. } = plane;
            let quantization = quantization.unwrap_or([1; 64]);
            if frame.is_progressive {
                let stride = component.stride();
                samples = vec![0; component.padded_samples() as usize];
                for (n, block) in coefficients.iter().enumerate() {
                    let (row, column) = (n * BLOCK / stride, n * BLOCK % stride);
                    idct::write_block(block, &quantization, &mut samples[row * BLOCK * stride + column..], stride);
                }
            }
            samples
        };
        let samples = planes.into_iter().zip(&frame.components).map(samples).collect();
        (frame, samples)
    }
}

const LONG_RUN: JpegError = JpegError::Damaged("a block has too many coefficients");
const LARGE: JpegError = JpegError::Damaged("a coefficient is too large");

/// Decodes a difference of means and adds it to the predictor.
fn mean(bits: &mut Bits<'_>, component: &mut ScanComponent<'_>) -> Result<i32, JpegError> {
    let size = component.dc.map_or(Ok(0), |table| bits.symbol(table))?;
    if size > 15 {
        return Err(LARGE);
    }
    component.predictor = component.predictor.wrapping_add(bits.number(size)?);
    Ok(component.predictor)
}

/// Decodes the block at `place`, column and row of blocks, of a sequential picture, and writes its samples (standard, F.2).
fn sequential(
    bits: &mut Bits<'_>,
    component: &mut ScanComponent<'_>,
    plane: &mut Plane,
    place: [usize; 2],
    stride: usize,
) -> Result<(), JpegError> {
    let mut block = [0_i16; 64];
    block[0] = mean(bits, component)? as i16;
    if let Some(table) = component.ac {
        coefficients(bits, table, 1..64, 0, &mut block)?;
    }
    if let Some(quantization) = &plane.quantization {
        let samples = &mut plane.samples[place[1] * BLOCK * stride + place[0] * BLOCK..];
        idct::write_block(&block, quantization, samples, stride);
    }
    Ok(())
}

/// Decodes what a scan says of a block of a progressive picture (standard, G.1.2). `end_run` is the number of blocks, from
/// this one on, without more coefficients.
fn progressive(
    bits: &mut Bits<'_>,
    component: &mut ScanComponent<'_>,
    selection: Selection,
    end_run: &mut u32,
    block: &mut [i16; 64],
) -> Result<(), JpegError> {
    let Selection { range: [first, last], high, low } = selection;
    if first == 0 {
        if high == 0 {
            block[0] = (mean(bits, component)? << low) as i16;
        } else if bits.is_set()? {
            block[0] |= 1 << low;
        }
        return Ok(());
    }
    let Some(table) = component.ac else { return Ok(()) };
    if high == 0 {
        first_bits(bits, table, first..last + 1, low, end_run, block)
    } else {
        refined_bits(bits, table, first..last + 1, low, end_run, block)
    }
}

/// The length of a run of blocks without more coefficients, this one included.
fn run_of(bits: &mut Bits<'_>, size: usize) -> Result<u32, JpegError> {
    Ok((1 << size) + bits.take(size as u32)? as u32)
}

/// Decodes the first bits of the coefficients `range` (standard, G.1.2.2).
fn first_bits(
    bits: &mut Bits<'_>,
    table: &Huffman,
    range: std::ops::Range<usize>,
    low: u8,
    end_run: &mut u32,
    block: &mut [i16; 64],
) -> Result<(), JpegError> {
    if *end_run > 0 {
        *end_run -= 1;
        return Ok(());
    }
    if let Some(size) = coefficients(bits, table, range, low, block)? {
        *end_run = run_of(bits, size)? - 1;
    }
    Ok(())
}

/// Decodes the coefficients `range` up to the last that is not zero (standard, F.2.2.2 and G.1.2.2). Returns the size of the number
/// with which those after it end, if the block has such an end.
fn coefficients(
    bits: &mut Bits<'_>,
    table: &Huffman,
    range: std::ops::Range<usize>,
    low: u8,
    block: &mut [i16; 64],
) -> Result<Option<usize>, JpegError> {
    let mut at = range.start;
    while at < range.end {
        let symbol = bits.symbol(table)?;
        let (zeros, size) = (usize::from(symbol >> 4), symbol & 15);
        if size > 0 {
            at += zeros;
            let place = *ZIGZAG[..range.end].get(at).ok_or(LONG_RUN)?;
            block[place] = (bits.number(size)? << low) as i16;
            at += 1;
        } else if zeros == 15 {
            at += 16;
        } else {
            return Ok(Some(zeros));
        }
    }
    Ok(None)
}

/// Decodes one more bit of the coefficients `range` (standard, G.1.2.3).
fn refined_bits(
    bits: &mut Bits<'_>,
    table: &Huffman,
    range: std::ops::Range<usize>,
    low: u8,
    end_run: &mut u32,
    block: &mut [i16; 64],
) -> Result<(), JpegError> {
    let one = 1_i16 << low;
    let mut at = range.start;
    if *end_run == 0 {
        while at < range.end {
            let symbol = bits.symbol(table)?;
            let (mut zeros, size) = (usize::from(symbol >> 4), symbol & 15);
            let mut new = 0;
            match size {
                0 if zeros < 15 => {
                    *end_run = run_of(bits, zeros)?;
                    break;
                }
                0 => {}
                1 => new = if bits.is_set()? { one } else { -one },
                _ => return Err(LARGE),
            }
            // Coefficients that are not zero get a bit each; `zeros` of the others are passed over.
            while at < range.end {
                let coefficient = &mut block[ZIGZAG[at]];
                if *coefficient != 0 {
                    refine(bits, coefficient, one)?;
                } else if zeros == 0 {
                    break;
                } else {
                    zeros -= 1;
                }
                at += 1;
            }
            if new != 0 {
                block[*ZIGZAG[..range.end].get(at).ok_or(LONG_RUN)?] = new;
            }
            at += 1;
        }
    }
    if *end_run > 0 {
        for &place in &ZIGZAG[at.min(range.end)..range.end] {
            if block[place] != 0 {
                refine(bits, &mut block[place], one)?;
            }
        }
        *end_run -= 1;
    }
    Ok(())
}

/// Adds the next bit to a coefficient that is not zero.
fn refine(bits: &mut Bits<'_>, coefficient: &mut i16, one: i16) -> Result<(), JpegError> {
    if bits.is_set()? && *coefficient & one == 0 {
        *coefficient = coefficient.wrapping_add(if *coefficient > 0 { one } else { -one });
    }
    Ok(())
}
