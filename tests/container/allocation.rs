//! Files that declare more than they hold: refused before anything is allocated.
//!
//! Unsafe because a test that asks what was allocated has to be the allocator.
#![allow(unsafe_code)]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use strivec::container::{Error, decode, encode};

use super::roundtrip::F32;
use super::scenes::two_scales;
use super::surgery::{File, name};

/// The system's allocator, which remembers the largest request of each thread.
struct Remembering;

thread_local! {
    static LARGEST: Cell<usize> = const { Cell::new(0) };
}

fn remember(layout: Layout) {
    LARGEST.set(LARGEST.get().max(layout.size()));
}

// SAFETY: every method passes its arguments on to the system's allocator, which keeps the contract.
unsafe impl GlobalAlloc for Remembering {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        remember(layout);
        // SAFETY: as above.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        remember(layout);
        // SAFETY: as above.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: as above.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Remembering = Remembering;

/// What `decode` makes of a file, and the largest block it asked for.
fn decode_measured(bytes: &[u8]) -> (Result<(), Error>, usize) {
    LARGEST.set(0);
    let result = decode(bytes).map(drop);
    (result, LARGEST.get())
}

/// A file whose scale 0 has as many tensors as its PLACEMENT claims, all told in `frames` of zeros.
fn bomb(tensors: u32, factor_bytes: u64, factor_frame: &[u8]) -> Vec<u8> {
    let mut file = File::of(&encode(&two_scales(), &F32).unwrap());
    let placement = file.part("PLACEMENT");
    let mut payload = placement.payload[..93].to_vec();
    payload[1..5].copy_from_slice(&tensors.to_le_bytes());
    payload[81..93].copy_from_slice(&[tensors.to_le_bytes(), 1u32.to_le_bytes(), 1u32.to_le_bytes()].concat());
    payload.resize(93 + tensors as usize, 0);
    placement.set(payload);
    placement.compress(93);
    let factors = file.part("FACTORS");
    factors.codec = 1;
    factors.decoded_length = 22 + factor_bytes;
    factors.payload.truncate(22);
    factors.payload.extend(factor_frame);
    file.bytes()
}

/// An RLE zstd frame of zeros, made by hand: 4 bytes for each 128 KiB.
fn zeros(length: u64) -> Vec<u8> {
    let mut frame = vec![0x28, 0xB5, 0x2F, 0xFD, 0xE0];
    frame.extend(length.to_le_bytes());
    let mut left = length;
    while left > 0 {
        let block = left.min(128 << 10);
        left -= block;
        let header = (block as u32) << 3 | 1 << 1 | u32::from(left == 0);
        frame.extend(&header.to_le_bytes()[..3]);
        frame.push(0);
    }
    frame
}

#[test]
fn the_allocator_remembers() {
    LARGEST.set(0);
    drop(std::hint::black_box(vec![1u8; 12_345]));
    assert_eq!(LARGEST.get(), 12_345);
}

#[test]
fn hand_made_frames_are_valid() {
    assert_eq!(zstd::bulk::decompress(&zeros(300_000), 300_000).unwrap(), vec![0; 300_000]);
}

#[test]
fn a_bomb_that_fits_the_allowance_opens() {
    // 1000 tensors of 9 rows of 5 components.
    let length = 1000 * 9 * 5 * 4;
    let (result, largest) = decode_measured(&bomb(1000, length, &zeros(length)));
    assert_eq!(result, Ok(()));
    assert_eq!(largest as u64, length);
}

#[test]
fn a_bomb_is_refused_before_it_is_allocated() {
    // 2^20 tensors: 180 MiB from some 6 KB, which allow for 32 MiB and a bit.
    let length = (1 << 20) * 9 * 5 * 4;
    let file = bomb(1 << 20, length, &zeros(length));
    assert!(file.len() < 10_000);
    let (result, largest) = decode_measured(&file);
    assert!(matches!(result, Err(Error::Expansion { .. })), "{result:?}");
    assert!(largest < 16 << 10, "{largest} bytes");
}

#[test]
fn a_declared_size_is_believed_only_where_the_record_implies_it() {
    let (result, largest) = decode_measured(&bomb(1000, 30 << 20, &zeros(30 << 20)));
    assert!(matches!(result, Err(Error::Malformed { .. })), "{result:?}");
    assert!(largest < 64 << 10, "{largest} bytes");
}

#[test]
fn sizes_beyond_all_files_are_refused() {
    for length in [1 << 33, u64::MAX - 22] {
        let (result, largest) = decode_measured(&bomb(1000, length, &zeros(100)));
        assert!(matches!(result, Err(Error::Limit { .. })), "{result:?}");
        assert!(largest < 16 << 10, "{largest} bytes");
    }
}

#[test]
fn counts_allocate_nothing_by_themselves() {
    let mut file = File::of(&encode(&two_scales(), &F32).unwrap());
    for (kind, at, value) in [
        ("PLACEMENT", 1, (1u32 << 24).to_le_bytes().as_slice()),
        ("FACTORS", 2, [1024u32.to_le_bytes(); 3].concat().as_slice()),
        ("OCCUPANCY", 48, [1024u32.to_le_bytes(); 3].concat().as_slice()),
        ("DECODER", 17, [16_384u32.to_le_bytes(); 2].concat().as_slice()),
        ("PROVENANCE", 16, (1u64 << 40).to_le_bytes().as_slice()),
    ] {
        let part = file.sections.iter().position(|p| p.kind == name(kind)).unwrap();
        let before = file.sections[part].clone();
        file.sections[part].patch(at, value);
        let (result, largest) = decode_measured(&file.bytes());
        assert!(matches!(result, Err(Error::Malformed { .. })), "{kind}: {result:?}");
        assert!(largest < 16 << 10, "{kind}: {largest} bytes");
        file.sections[part] = before;
    }
}
