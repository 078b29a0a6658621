//! The bytes of a document's buffers and buffer views, loaded and decompressed on first use.

use std::cell::{Cell, OnceCell};

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use gltf::json::buffer::View;
use gltf::json::{Buffer, Index};

use super::super::Fault;
use super::super::Input;
use super::super::beside::{MAX_BESIDE, check_name};
use super::super::error::excerpt;
use super::super::splats::SpzSplats;
use super::document::{Document, get};
use super::draco;
use super::meshopt::Meshopt;

/// Decompressed bytes of a document, whatever its size, and beyond that per byte of its buffers. A byte of meshoptimizer
/// can stand for 1024; Draco has no bound, and shrinks a flat grid of a million vertices by 124.
const MIN_ROOM: u64 = 16 << 20;
const MAX_RATIO: u64 = 1024;
/// Decompressed bytes of a document in all.
const MAX_DECOMPRESSED: u64 = 8 << 30;

pub(super) struct Buffers<'a> {
    pub(super) document: &'a Document,
    blob: Option<Vec<u8>>,
    beside: &'a dyn Fn(&str) -> Result<Vec<u8>, Fault>,
    /// \[buffer\]
    loaded: Vec<OnceCell<Vec<u8>>>,
    bytes_beside: Cell<u64>,
    /// \[buffer view\], of compressed ones.
    decompressed: Vec<OnceCell<Vec<u8>>>,
    /// \[buffer view\], of those with Draco streams.
    meshes: Vec<OnceCell<draco::DracoMesh>>,
    /// \[buffer view\], of those with SPZ streams.
    splats: Vec<OnceCell<SpzSplats>>,
    bytes_loaded: Cell<u64>,
    bytes_decompressed: Cell<u64>,
}

impl<'a> Buffers<'a> {
    pub(super) fn new(
        document: &'a Document,
        blob: Option<Vec<u8>>,
        beside: &'a dyn Fn(&str) -> Result<Vec<u8>, Fault>,
    ) -> Self {
        let views = document.buffer_views.len();
        Self {
            document,
            beside,
            loaded: document.buffers.iter().map(|_| OnceCell::new()).collect(),
            bytes_beside: Cell::new(0),
            decompressed: (0..views).map(|_| OnceCell::new()).collect(),
            meshes: (0..views).map(|_| OnceCell::new()).collect(),
            splats: (0..views).map(|_| OnceCell::new()).collect(),
            bytes_loaded: Cell::new(blob.as_ref().map_or(0, |blob| blob.len() as u64)),
            bytes_decompressed: Cell::new(0),
            blob,
        }
    }

    /// The bytes of buffer `index`, of the declared length.
    fn bytes(&self, index: Index<Buffer>) -> Result<&[u8], Fault> {
        let buffer = get(&self.document.buffers, index, "buffer")?;
        let bytes: &[u8] = match (&buffer.uri, &self.blob) {
            (None, Some(blob)) if index.value() == 0 => blob,
            (None, _) => {
                return Err(Fault::broken(
                    format!("buffer {index}"),
                    "it has no URI, and there is no chunk BIN for it",
                ));
            }
            (Some(uri), _) => {
                let cell = &self.loaded[index.value()];
                match cell.get() {
                    Some(bytes) => bytes,
                    None => {
                        let bytes = self.load(index, uri)?;
                        self.bytes_loaded.set(self.bytes_loaded.get() + bytes.len() as u64);
                        cell.get_or_init(|| bytes)
                    }
                }
            }
        };
        let declared = usize::try_from(buffer.byte_length.0).ok();
        declared.and_then(|length| bytes.get(..length)).ok_or_else(|| {
            let expected = format!("the declared {} bytes", buffer.byte_length.0);
            Fault::malformed(format!("buffer {index}"), expected, format!("{} bytes", bytes.len()))
        })
    }

    /// The bytes of buffer view `index`, decompressed.
    pub(super) fn view(&self, index: Index<View>) -> Result<&[u8], Fault> {
        let view = get(&self.document.buffer_views, index, "buffer view")?;
        let place = || format!("buffer view {index}");
        let Some(meshopt) = Meshopt::of(view, &place)? else {
            return self.part(view.buffer, view.byte_offset.unwrap_or_default().0, view.byte_length.0, &place);
        };
        let cell = &self.decompressed[index.value()];
        if let Some(bytes) = cell.get() {
            return Ok(bytes);
        }
        let source = self.part(meshopt.buffer, meshopt.byte_offset, meshopt.byte_length, &place)?;
        self.charge(view.byte_length.0)?;
        let bytes = meshopt.decode(source, &place)?;
        Ok(cell.get_or_init(|| bytes))
    }

    /// The mesh of the Draco stream in buffer view `index`.
    pub(super) fn draco(&self, index: Index<View>) -> Result<&draco::DracoMesh, Fault> {
        let source = self.view(index)?;
        let cell = &self.meshes[index.value()];
        if let Some(mesh) = cell.get() {
            return Ok(mesh);
        }
        let room = self.room().saturating_sub(self.bytes_decompressed.get());
        let mesh = draco::DracoMesh::decode(source, room, &|| format!("buffer view {index}"))?;
        self.charge(mesh.len())?;
        Ok(cell.get_or_init(|| mesh))
    }

    /// The splats of the SPZ stream in buffer view `index`.
    pub(super) fn spz(&self, index: Index<View>) -> Result<&SpzSplats, Fault> {
        let source = self.view(index)?;
        let cell = &self.splats[index.value()];
        if let Some(splats) = cell.get() {
            return Ok(splats);
        }
        let of_stream =
            |fault: Fault| Fault::broken(format!("the SPZ stream in buffer view {index}"), fault.to_string());
        let splats = SpzSplats::read(&mut Input::from_bytes(source)).map_err(of_stream)?;
        self.charge(splats.len())?;
        Ok(cell.get_or_init(|| splats))
    }

    /// `length` bytes of `buffer` from byte `start` on; `place` names what refers to them.
    fn part(&self, buffer: Index<Buffer>, start: u64, length: u64, place: &dyn Fn() -> String) -> Result<&[u8], Fault> {
        let bytes = self.bytes(buffer)?;
        let part = start.checked_add(length).and_then(|end| bytes.get(start as usize..end as usize));
        part.ok_or_else(|| {
            let expected = format!("a range within the {} bytes of its buffer", bytes.len());
            Fault::malformed(place(), expected, format!("{length} bytes from byte {start} on"))
        })
    }

    /// The limit of decompressed bytes for the buffers loaded so far.
    fn room(&self) -> u64 {
        let by_size = self.bytes_loaded.get().saturating_mul(MAX_RATIO).saturating_add(MIN_ROOM);
        by_size.min(MAX_DECOMPRESSED)
    }

    /// Adds `bytes` to the decompressed ones and checks the limit.
    fn charge(&self, bytes: u64) -> Result<(), Fault> {
        self.bytes_decompressed.set(self.bytes_decompressed.get().saturating_add(bytes));
        Fault::unless_within("decompressed bytes", self.room(), self.bytes_decompressed.get())
    }

    fn load(&self, index: Index<Buffer>, uri: &str) -> Result<Vec<u8>, Fault> {
        let wrong = |expected: &str, found: String| Fault::malformed(format!("buffer {index}"), expected, found);
        if let Some(data) = uri.strip_prefix("data:") {
            let Some((_, data)) = data.split_once(";base64,") else {
                return Err(wrong("a data URI in base64", excerpt(uri.as_bytes())));
            };
            return STANDARD
                .decode(data)
                .map_err(|error| wrong("a data URI in base64", format!("another one: {error}")));
        }
        let name = percent_decoded(uri).ok_or_else(|| wrong("a URI", excerpt(uri.as_bytes())))?;
        check_name(&name)?;
        let bytes = (self.beside)(&name)?;
        self.bytes_beside.set(self.bytes_beside.get().saturating_add(bytes.len() as u64));
        Fault::unless_within("bytes of separate files", MAX_BESIDE, self.bytes_beside.get())?;
        Ok(bytes)
    }
}

/// `uri` with its %XX decoded; `None` if the result is not UTF-8.
fn percent_decoded(uri: &str) -> Option<String> {
    let mut bytes = Vec::with_capacity(uri.len());
    let mut rest = uri.as_bytes();
    while let Some((&first, after)) = rest.split_first() {
        rest = after;
        if first != b'%' {
            bytes.push(first);
            continue;
        }
        let digit = |n: usize| after.get(n).and_then(|&digit| char::from(digit).to_digit(16));
        bytes.push((16 * digit(0)? + digit(1)?) as u8);
        rest = &after[2..];
    }
    String::from_utf8(bytes).ok()
}
