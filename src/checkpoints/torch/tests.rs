use std::io::{Cursor, Write};

use glam::DVec3;
use zip::CompressionMethod;
use zip::write::{SimpleFileOptions, ZipWriter};

use super::pickle::Pickle;
use super::read;
use strivec_format::geometry::Aabb;
use strivec_import::testing::{Seen, seen_with};
use strivec_import::{Fault, Input, ReadOptions};

#[path = "../../../tests/data/mod.rs"]
mod data;

const FINE: &[u8] = include_bytes!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/import/dvgo-fine.tar"));
const OLDEST: &[u8] = include_bytes!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/import/dvgo-oldest.tar"));
const STRIDED: &[u8] = include_bytes!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/import/dvgo-strided.tar"));
const TENSORF: &[u8] = include_bytes!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/import/tensorf.th"));
const COMMAND: &[u8] = include_bytes!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/import/command.tar"));
const BEFORE_1_6: &[u8] = include_bytes!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../fixtures/import/before-1.6.tar"));

fn seen(bytes: &[u8]) -> Result<Seen, Fault> {
    seen_with(bytes, &ReadOptions::default(), read)
}

fn message(bytes: &[u8]) -> String {
    seen(bytes).unwrap_err().to_string()
}

fn centers(bytes: &[u8]) -> Vec<[f64; 3]> {
    seen(bytes).unwrap().cells.iter().map(|cell| cell.center().to_array()).collect()
}

#[test]
fn dvgos_voxels_are_those_of_density_and_mask() {
    // Density fills [0][0][0], [1][0][0], [1][0][1] and [2][1][1]; each mask takes one away.
    let cells = seen(FINE).unwrap().cells;
    assert_eq!(cells[0], Aabb { min: DVec3::splat(-0.5), max: DVec3::splat(0.5) });
    assert_eq!(centers(FINE), [[0.0, 0.0, 0.0], [1.0, 0.0, 1.0], [2.0, 1.0, 1.0]]);
    assert_eq!(centers(OLDEST), [[1.0, 0.0, 0.0], [1.0, 0.0, 1.0], [2.0, 1.0, 1.0]]);
    assert_eq!(centers(STRIDED), [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 0.0, 1.0], [2.0, 1.0, 1.0]]);
    let opaque = ReadOptions { min_alpha: 0.03, ..ReadOptions::default() };
    assert_eq!(seen_with(FINE, &opaque, read).unwrap().cells, []);
    let all = ReadOptions { min_alpha: 1e-7, ..ReadOptions::default() };
    assert_eq!(seen_with(FINE, &all, read).unwrap().cells.len(), 11, "all but the masked");
}

#[test]
fn tensorfs_mask_is_packed_from_the_most_significant_bit() {
    let expected = [
        Aabb { min: DVec3::new(2.5, 0.5, -0.5), max: DVec3::new(3.5, 1.5, 0.5) },
        Aabb { min: DVec3::new(-0.5, 1.5, 0.5), max: DVec3::new(0.5, 2.5, 1.5) },
    ];
    assert_eq!(seen(TENSORF).unwrap().cells, expected);
}

#[test]
fn real_tensorf_checkpoints_are_read() {
    let Some(folder) = data::folder("tensorf-lego") else { return };
    // Counted by NumPy; the sides are `alphaMask.aabb` and half a voxel, over so many vertices.
    for (name, count, min, vertices) in [
        ("lego200_vm192_iter1581.th", 976563, DVec3::new(-0.67322832, -1.16929126, -1.12204719), [108.0, 189.0, 173.0]),
        ("lego200_cp384_iter346.th", 191647, DVec3::splat(-1.5), [128.0; 3]),
    ] {
        let mut seen = Seen::default();
        read(&mut Input::open(&folder.join(name)).unwrap(), &ReadOptions::default(), &mut seen).unwrap();
        assert_eq!(seen.cells.len(), count, "{name}");
        let bounds = seen.cells.iter().fold(Aabb::EMPTY, |bounds, cell| bounds.union(cell));
        let pitch = seen.cells[0].size();
        let widest = Aabb { min: min - 0.51 * pitch, max: min + (DVec3::from_array(vertices) - 0.49) * pitch };
        assert!(widest.contains(bounds.min) && widest.contains(bounds.max), "{name}: {bounds:?} in {widest:?}");
    }
}

#[test]
fn what_would_be_executed_is_refused_by_name() {
    let global = if cfg!(windows) { "nt.system" } else { "posix.system" };
    let message = message(COMMAND);
    assert!(
        message.starts_with("byte ") && message.contains(&format!("of command/data.pkl: the global {global:?}")),
        "{message}"
    );
    assert!(message.contains("parsed, never executed"), "{message}");
    for (pickle, name) in [
        (&b"\x80\x02cbuiltins\neval\n."[..], "byte 2 of x: the global \"builtins.eval\""),
        (b"\x80\x04\x8c\x02os\x8c\x06system\x93.", "byte 14 of x: the global \"os.system\""),
    ] {
        let error = Pickle::parse(pickle.to_vec(), "x").err().unwrap().to_string();
        assert!(error.starts_with(name), "{error}");
    }
}

#[test]
fn other_files_are_told_what_to_do() {
    assert!(message(BEFORE_1_6).contains("save it again with torch.save of PyTorch 1.6 or later"));
    let mut tar = vec![0; 512];
    tar[257..262].copy_from_slice(b"ustar");
    assert!(message(&tar).contains("before 1.6"));
    assert_eq!(
        message(b"other"),
        "byte 0: expected a checkpoint of PyTorch 1.6 or later, a zip archive, found [6f, 74, 68, 65, 72]"
    );
    assert_eq!(message(&zip(&[])), "the archive: expected one entry data.pkl, found 0");
    let other = zip(&[("x/data.pkl", b"\x80\x02}X\x01\0\0\0aK\x01s.")]);
    assert_eq!(
        message(&other),
        "the keys of the checkpoint: expected DVGO's model_state_dict and model_kwargs, or TensoRF's alphaMask.mask, found a"
    );
    let tensorf = zip(&[("x/data.pkl", b"\x80\x02}(X\x06\0\0\0kwargs}X\x0a\0\0\0state_dict}u.")]);
    assert!(message(&tensorf).starts_with("a TensoRF checkpoint without alphaMask is not supported"));
    let big = zip(&[("x/data.pkl", b"N."), ("x/byteorder", b"big")]);
    assert!(message(&big).starts_with("a checkpoint of big-endian numbers"));
}

/// An archive of stored files, as PyTorch makes them.
fn zip(files: &[(&str, &[u8])]) -> Vec<u8> {
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    for (name, bytes) in files {
        zip.start_file(*name, SimpleFileOptions::default().compression_method(CompressionMethod::Stored)).unwrap();
        zip.write_all(bytes).unwrap();
    }
    zip.finish().unwrap().into_inner()
}

#[test]
fn checkpoints_that_contradict_themselves_are_refused() {
    // The storage is shorter than in the pickle: its file is called "0" and lies before the others.
    let replaced = |from: &[u8], to: &[u8]| {
        let mut bytes = FINE.to_vec();
        let at = bytes.windows(from.len()).position(|w| w == from).unwrap();
        bytes[at..at + to.len()].copy_from_slice(to);
        bytes
    };
    let wrong = message(&replaced(b"num_voxels", b"mpi_depth\0"));
    assert!(wrong.contains("its bytes are damaged: Invalid checksum"), "{wrong}");
    assert!(message(&FINE[..FINE.len() / 2]).contains("zip directory"));
}

fn parse_error(pickle: &[u8]) -> String {
    Pickle::parse(pickle.to_vec(), "x").err().unwrap().to_string()
}

#[test]
fn pickles_that_torch_does_not_write_are_refused() {
    for (pickle, error) in [
        (&b""[..], "byte 0 of x: expected 1 bytes, found 0"),
        (b"\x80\x06.", "byte 0 of x: expected a protocol of 2 to 5, found 6"),
        (b".", "byte 0 of x: expected 1 values on the stack, found 0"),
        (b"(.", "byte 1 of x: expected 1 values on the stack, found 0"),
        (b"(N\x86.", "byte 2 of x: expected 2 values on the stack, found 1"),
        (b"N(\x85.", "byte 2 of x: expected 1 values on the stack, found 0"),
        (b"Nt.", "byte 1 of x: expected a mark on the stack, found none"),
        (b"Nq", "byte 1 of x: expected 1 bytes, found 0"),
        (b"q\0", "byte 0 of x: expected a value on the stack, found none"),
        (b"h\x05.", "byte 0 of x: expected a memoized value, found number 5"),
        (b"X\xff\xff\xff\xff.", "byte 0 of x: expected 4294967295 bytes, found 1"),
        (b"\x8d\xff\xff\xff\xff\xff\xff\xff\xff.", "byte 0 of x: expected 18446744073709551615 bytes, found 1"),
        (b"X\x01\0\0\0\xff.", "byte 0 of x: expected UTF-8, found other bytes"),
        (b"}Na.", "byte 2 of x: expected a list to append to, found something else"),
        (b"]NNs.", "byte 3 of x: expected a dictionary to set items of, found something else"),
        (b"}(Nu.", "byte 3 of x: expected pairs of a key and a value, found 1 items"),
        (b"NNR.", "byte 2 of x: expected a function to call, found something else"),
        (b"I1\n.", "byte 0 of x: expected an instruction of torch's pickles, found 0x49"),
        (b"N.N", "byte 1 of x: expected the end of the pickle, found 1 more bytes"),
        (b"NQ.", "byte 1 of x: expected a tuple, found something else"),
        (b"ctorch\nSize\n)R.", "byte 13 of x: expected the arguments that torch passes, found 0 arguments of Same"),
    ] {
        assert_eq!(parse_error(pickle), error);
    }
    let endless = [b"c".as_slice(), &[b'a'; 1000]].concat();
    assert_eq!(
        parse_error(&endless),
        "byte 0 of x: expected a name of at most 256 bytes and its line's end, found none"
    );
}

#[test]
fn pickles_without_end_are_limited() {
    let many = |instruction: &[u8], times: usize| instruction.repeat(times);
    assert_eq!(parse_error(&many(b"N", (1 << 20) + 1)), "values of a pickle: at most 1048576 are read, found 1048577");
    let popped = [b"Nq\0".as_slice(), &many(b"0h\0", 1 << 22)].concat();
    assert_eq!(parse_error(&popped), "instructions of a pickle: at most 4194304 are read, found 4194305");
    // A list a million lists deep, and one that is its own only item: no matter.
    let deep = [many(b"]", 1 << 19), many(b"a", (1 << 19) - 1), b".".to_vec()].concat();
    assert!(Pickle::parse(deep, "x").is_ok());
    assert!(Pickle::parse(b"]q\0h\0a.".to_vec(), "x").is_ok());
}

#[test]
fn work_grows_with_the_pickle_alone() {
    // A list of a million items whose state is set a million times: 2⁴⁰ items, if each time copied them.
    let list = [b"Nq\0]q\x01(".as_slice(), &b"h\0".repeat(1 << 20), b"e"].concat();
    let built = [list, b"h\0b".repeat(1 << 20), b".".to_vec()].concat();
    assert!(Pickle::parse(built, "x").is_ok());
    // A million keys that share a text of 16 MiB, each of which is compared.
    let text = [b"X\0\0\0\x01".as_slice(), &vec![b'a'; 1 << 24], b"q\0"].concat();
    let keys = [text, b"}(".to_vec(), b"h\0h\0".repeat(1 << 20), b"u.".to_vec()].concat();
    let pickle = Pickle::parse(keys, "x").unwrap();
    assert_eq!(pickle.get(pickle.root, "model_kwargs"), None);
}

#[test]
fn tensors_lie_inside_their_storages() {
    let tensor = |offset: u8, shape: [u8; 2], strides: [u8; 2]| {
        let mut pickle =
            b"\x80\x02ctorch._utils\n_rebuild_tensor_v2\n((X\x07\0\0\0storagectorch\nFloatStorage\n".to_vec();
        pickle.extend(b"X\x01\0\0\x000X\x03\0\0\0cpuK\x06tQ");
        pickle.extend([b'K', offset, b'K', shape[0], b'K', shape[1], 0x86, b'K', strides[0], b'K', strides[1], 0x86]);
        pickle.extend(b"\x89NtR.");
        Pickle::parse(pickle, "x").map(drop).map_err(|e| e.to_string())
    };
    assert_eq!(tensor(0, [2, 3], [3, 1]), Ok(()));
    assert_eq!(tensor(200, [0, 3], [3, 1]), Ok(()), "no numbers are anywhere");
    for (offset, shape, strides) in [(1, [2, 3], [3, 1]), (0, [2, 4], [3, 1]), (0, [2, 3], [4, 1])] {
        let error = tensor(offset, shape, strides).unwrap_err();
        let found = format!("found offset {offset}, shape {shape:?}, strides {strides:?}");
        assert!(
            error.contains("expected a tensor inside its storage of 6 numbers") && error.ends_with(&found),
            "{error}"
        );
    }
}
