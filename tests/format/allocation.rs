//! Files that declare more than they hold: refused before anything is allocated.
//!
//! Unsafe because a test that measures allocations has to be the allocator.
#![expect(unsafe_code, reason = "a global allocator is unsafe to implement")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use glam::{IVec3, UVec3};
use strivec_format::container::{Error, Limits, decode_scene_file, encode};
use strivec_format::model::{Form, Placement};

use super::roundtrip::f32;
use super::scenes::two_scales;
use super::surgery::{File, Part, name};

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

/// Result of reading a file with `memory`, and the largest block that was requested.
fn decode_measured(bytes: &[u8], memory: u64) -> (Result<(), Error>, usize) {
    LARGEST.set(0);
    let result = decode_scene_file(bytes, Limits { memory }).map(drop);
    (result, LARGEST.get())
}

/// A file whose scale 0 has as many tensors, in one chunk, as its SCALE claims, all of which have no components.
fn bomb(tensors: u32) -> Vec<u8> {
    let mut scene = two_scales();
    let coarse = &mut scene.scales[0];
    let Placement::Lattice { cells, .. } = &mut coarse.cloud.placement else { unreachable!() };
    *cells = vec![UVec3::ZERO, UVec3::X];
    let rows = 2 * Form::Cp.rows(coarse.cloud.resolution);
    coarse.factors.density[0].values = vec![0.0; rows * 2];
    coarse.factors.appearance[0].values = vec![0.0; rows * 3];
    let mut file = File::of(&encode(&scene, &f32()).unwrap());
    let Placement::Lattice { lattice, .. } = &scene.scales[0].cloud.placement else { unreachable!() };
    let last = lattice.center(IVec3::new(tensors as i32 - 1, 0, 0)) + scene.scales[0].cloud.half_edge;
    let scale = file.part("SCALE");
    scale.patch(0, &tensors.to_le_bytes());
    scale.patch(112, &tensors.to_le_bytes());
    scale.patch(128, &tensors.to_le_bytes());
    scale.patch(128 + 28, &last.x.to_le_bytes());
    let set = |part: &mut Part, record: usize, body: u64| {
        part.payload.truncate(record);
        part.payload.extend(zeros(body));
        (part.codec, part.decoded_length) = (1, record as u64 + body);
    };
    set(file.part("PLACEMENT"), 0, tensors.into());
    // A byte of components a tensor.
    set(file.part("DENSITY"), 64, tensors.into());
    set(file.part("APPEARANCE"), 64, tensors.into());
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

/// Bytes of a tensor of scale 0: 9 rows of 5 components.
const TENSOR: u64 = 9 * 5 * 4;

#[test]
fn a_bomb_that_fits_the_budget_opens() {
    let (result, largest) = decode_measured(&bomb(1000), 1 << 20);
    assert_eq!(result, Ok(()));
    // Density and appearance are two blocks.
    assert_eq!(largest as u64, 1000 * TENSOR * 3 / 5);
}

#[test]
fn a_bomb_is_refused_before_it_is_allocated() {
    let file = bomb(1 << 20);
    assert!(file.len() < 10_000, "{} bytes", file.len());
    for memory in [1 << 20, 100 << 20] {
        let (result, largest) = decode_measured(&file, memory);
        assert!(matches!(result, Err(Error::Budget { .. })), "{result:?}");
        assert!((largest as u64) < memory.min(1 << 20), "{largest} bytes");
    }
}

#[test]
fn a_declared_size_is_believed_only_where_the_record_implies_it() {
    for length in [30 << 20, u64::MAX - 64] {
        let mut file = File::of(&bomb(1000));
        let density = file.part("DENSITY");
        density.payload.truncate(64);
        density.payload.extend(zeros(length.min(30 << 20)));
        density.decoded_length = 64 + length;
        let (result, largest) = decode_measured(&file.bytes(), u64::MAX);
        assert!(matches!(result, Err(Error::Malformed { .. })), "{result:?}");
        assert!((largest as u64) <= 1000 * TENSOR, "{largest} bytes");
    }
}

#[test]
fn counts_allocate_nothing_by_themselves() {
    let mut file = File::of(&encode(&two_scales(), &f32()).unwrap());
    for (kind, at, value) in [
        ("SCALE", 56, 16_384u32.to_le_bytes().as_slice()),
        ("OCCUPANCY", 48, [1024u32, 512, 512].map(u32::to_le_bytes).concat().as_slice()),
        ("DECODER", 17, [1024u32.to_le_bytes(); 2].concat().as_slice()),
        ("PROVENANCE", 16, (1u64 << 40).to_le_bytes().as_slice()),
    ] {
        let part = file.sections.iter().position(|p| p.kind == name(kind)).unwrap();
        let before = file.sections[part].clone();
        file.sections[part].patch(at, value);
        let (result, largest) = decode_measured(&file.bytes(), u64::MAX);
        // An ancillary section is skipped.
        assert_eq!(result.is_ok(), kind == "PROVENANCE", "{kind}: {result:?}");
        assert!(largest < 20 << 10, "{kind}: {largest} bytes");
        file.sections[part] = before;
    }
}
