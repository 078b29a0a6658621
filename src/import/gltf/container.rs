//! The two forms of a glTF file: JSON, or a GLB of chunks.

use super::super::input::bytes_at;
use super::super::{Fault, Input};
use strivec_format::Place;

/// Bytes of JSON. Only data URIs make it large.
const MAX_JSON: u64 = 256 << 20;

pub(super) struct Container {
    pub(super) json: Vec<u8>,
    /// Chunk BIN of a GLB.
    pub(super) blob: Option<Vec<u8>>,
}

/// Reads either form.
///
/// # Errors
///
/// If the lengths of a GLB contradict the file, or the JSON is too long.
pub(super) fn read(input: &mut Input<'_>) -> Result<Container, Fault> {
    if input.peek(4)? == b"glTF" {
        return glb(input);
    }
    Ok(Container { json: part(input, input.len(), MAX_JSON, "JSON")?, blob: None })
}

fn glb(input: &mut Input<'_>) -> Result<Container, Fault> {
    let header: [u8; 12] = input.array("a GLB header")?;
    let [_, version, length] = [0, 4, 8].map(|at| u32::from_le_bytes(bytes_at(&header, at)));
    if version != 2 {
        return Err(Fault::unsupported(format!("GLB of version {version}"), "convert it to glTF 2"));
    }
    if u64::from(length) > input.len() || length < 20 {
        return Err(Fault::malformed(Place::Offset(8), format!("a length from 20 to {}", input.len()), length));
    }
    let (mut json, mut blob) = (None, None);
    while u64::from(length).saturating_sub(input.offset()) >= 8 {
        let place = input.place();
        let header: [u8; 8] = input.array("a chunk's header")?;
        let (size, kind) = (u64::from(u32::from_le_bytes(bytes_at(&header, 0))), &header[4..]);
        let room = u64::from(length) - input.offset();
        if size > room {
            return Err(Fault::malformed(place, format!("a chunk of at most {room} bytes"), size));
        }
        match kind {
            b"JSON" if json.is_none() => json = Some(part(input, size, MAX_JSON, "JSON")?),
            _ if json.is_none() => return Err(Fault::malformed(place, "a chunk JSON", "another chunk")),
            b"BIN\0" if blob.is_none() => blob = Some(part(input, size, u64::MAX, "BIN")?),
            // Chunks of extensions.
            _ => input.go_to(input.offset() + size)?,
        }
    }
    let json = json.ok_or_else(|| Fault::broken("byte 12", "there is no chunk JSON"))?;
    Ok(Container { json, blob })
}

fn part(input: &mut Input<'_>, size: u64, most: u64, what: &str) -> Result<Vec<u8>, Fault> {
    input.expect_left(size, what)?;
    Fault::unless_within(&format!("bytes of {what}"), most, size)?;
    let mut bytes = vec![0; size as usize];
    input.fill(&mut bytes, what)?;
    Ok(bytes)
}
