//! The bytes of a document's buffers, loaded on first use.

use std::cell::{Cell, OnceCell};
use std::fs::File;
use std::io::Read;
use std::path::Path;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use gltf::json::{Buffer, Index};

use super::super::Fault;
use super::super::error::excerpt;
use super::document::{Document, get};

/// Bytes of the separate files of a glTF file, of one and of all together.
const MAX_BESIDE: u64 = 8 << 30;

pub(super) struct Buffers<'a> {
    pub(super) document: &'a Document,
    blob: Option<Vec<u8>>,
    beside: &'a dyn Fn(&str) -> Result<Vec<u8>, Fault>,
    /// \[buffer\]
    loaded: Vec<OnceCell<Vec<u8>>>,
    bytes_beside: Cell<u64>,
}

impl<'a> Buffers<'a> {
    pub(super) fn new(
        document: &'a Document,
        blob: Option<Vec<u8>>,
        beside: &'a dyn Fn(&str) -> Result<Vec<u8>, Fault>,
    ) -> Self {
        let loaded = document.buffers.iter().map(|_| OnceCell::new()).collect();
        Self { document, blob, beside, loaded, bytes_beside: Cell::new(0) }
    }

    /// The bytes of buffer `index`, of the declared length.
    pub(super) fn bytes(&self, index: Index<Buffer>) -> Result<&[u8], Fault> {
        let buffer = get(&self.document.buffers, index, "buffer")?;
        let bytes: &[u8] = match (&buffer.uri, &self.blob) {
            (None, Some(blob)) if index.value() == 0 => blob,
            (None, _) => {
                self.document.unless_compressed()?;
                return Err(Fault::invalid(
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
        Fault::unless_within("bytes of separate buffers", MAX_BESIDE, self.bytes_beside.get())?;
        Ok(bytes)
    }
}

/// The bytes of the file `name` in the folder of the glTF file `path`.
///
/// # Errors
///
/// If the file cannot be read or lies outside the folder.
pub fn beside(path: &Path, name: &str) -> Result<Vec<u8>, Fault> {
    check_name(name)?;
    let wrong = |problem: &str| Fault::invalid(format!("the buffer \"{name}\""), problem);
    let unreadable = |error: std::io::Error| wrong(&format!("cannot read the file: {error}"));
    let path = path.parent().unwrap_or(Path::new("")).join(name);
    // Check that it is a file before opening it: opening a pipe would block.
    let metadata = path.metadata().map_err(unreadable)?;
    if !metadata.is_file() {
        return Err(wrong("it is not a regular file"));
    }
    Fault::unless_within("bytes of a separate buffer", MAX_BESIDE, metadata.len())?;
    let mut bytes = Vec::with_capacity(metadata.len() as usize);
    File::open(path).map_err(unreadable)?.take(MAX_BESIDE).read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// Checks that `name` is relative and stays in its folder on every system.
fn check_name(name: &str) -> Result<(), Fault> {
    let leaves = name.starts_with('/') || name.contains(['\\', ':', '\0']) || name.split('/').any(|part| part == "..");
    if name.is_empty() || leaves {
        let what = format!("a buffer at {}", excerpt(name.as_bytes()));
        return Err(Fault::unsupported(
            what,
            "move it into the folder of the glTF file and name it by a relative path",
        ));
    }
    Ok(())
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
