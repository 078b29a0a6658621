//! `EXT_meshopt_compression` and `KHR_meshopt_compression`: the compressed bytes of a buffer view. The second adds a
//! version of the vertex codec and a filter for colors; both are read under either name.

use gltf::json::buffer::View;
use gltf::json::{Buffer, Index};
use meshoptimizer_rs::codec::{
    decode_filter_color, decode_filter_exp, decode_filter_oct, decode_filter_quat, decode_index_buffer,
    decode_index_sequence, decode_vertex_buffer,
};
use meshoptimizer_rs::{Limits, Workspace};
use serde::Deserialize;

use super::super::Fault;

pub(super) const NAMES: [&str; 2] = ["EXT_meshopt_compression", "KHR_meshopt_compression"];

/// The extension of a buffer view.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Meshopt {
    pub(super) buffer: Index<Buffer>,
    #[serde(default)]
    pub(super) byte_offset: u64,
    pub(super) byte_length: u64,
    byte_stride: u64,
    count: u64,
    mode: Mode,
    #[serde(default)]
    filter: MeshoptFilter,
}

#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "UPPERCASE")]
enum Mode {
    Attributes,
    Triangles,
    Indices,
}

#[derive(Clone, Copy, Default, Deserialize)]
#[serde(rename_all = "UPPERCASE")]
enum MeshoptFilter {
    #[default]
    None,
    Octahedral,
    Quaternion,
    Exponential,
    Color,
}

impl Meshopt {
    /// The extension of `view` at `place`, if it is compressed.
    ///
    /// # Errors
    ///
    /// If the extension lacks a field, or contradicts the view.
    pub(super) fn of(view: &View, place: &dyn Fn() -> String) -> Result<Option<Self>, Fault> {
        let extensions = view.extensions.as_ref();
        let Some((name, json)) =
            extensions.and_then(|all| NAMES.iter().find_map(|name| Some((name, all.others.get(*name)?))))
        else {
            return Ok(None);
        };
        let meshopt = Self::deserialize(json)
            .map_err(|error| Fault::broken(place(), format!("invalid extension {name}: {error}")))?;
        if meshopt.count.checked_mul(meshopt.byte_stride) != Some(view.byte_length.0) {
            let found = format!("{} elements of {} bytes", meshopt.count, meshopt.byte_stride);
            return Err(Fault::malformed(place(), format!("{} bytes in {name}", view.byte_length.0), found));
        }
        Ok(Some(meshopt))
    }

    /// The view's bytes, decoded from `source`.
    ///
    /// # Errors
    ///
    /// If `source` breaks the format.
    pub(super) fn decode(&self, source: &[u8], place: &dyn Fn() -> String) -> Result<Vec<u8>, Fault> {
        let wrong = |error| Fault::broken(place(), format!("the meshopt compression is invalid: {error}"));
        let (count, stride) = (self.count as usize, self.byte_stride as usize);
        // The caller has limited the size, and the work is proportional to it.
        let mut workspace = Workspace::new(Limits { max_bytes: count * stride, max_work: u64::MAX });
        let decode = match self.mode {
            Mode::Attributes => decode_vertex_buffer,
            Mode::Triangles => decode_index_buffer,
            Mode::Indices => decode_index_sequence,
        };
        let mut bytes = decode(count, stride, source, &mut workspace).map_err(wrong)?;
        let filter = match self.filter {
            MeshoptFilter::None => return Ok(bytes),
            MeshoptFilter::Octahedral => decode_filter_oct,
            MeshoptFilter::Quaternion => decode_filter_quat,
            MeshoptFilter::Exponential => decode_filter_exp,
            MeshoptFilter::Color => decode_filter_color,
        };
        filter(&mut bytes, count, stride, &mut workspace).map_err(wrong)?;
        Ok(bytes)
    }
}
