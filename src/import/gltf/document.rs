//! The JSON of a glTF file: the parts about geometry, in lists of bounded length.

use gltf::json::buffer::View;
use gltf::json::{Accessor, Buffer, Index, Mesh};
use serde::Deserialize;

use super::super::Fault;
use super::super::error::excerpt;
use super::normalize::{DECODED, few, meshes, one};

/// Corners of all instances of all meshes.
const MAX_CORNERS: u64 = 1 << 32;

/// Prefixes of extensions that change neither the vertices nor their encoding, and the extension that allows smaller
/// types, all of which are supported.
const HARMLESS: [&str; 15] = [
    "KHR_materials_",
    "KHR_texture_",
    "EXT_texture_",
    "MSFT_texture_",
    "KHR_lights_punctual",
    "EXT_lights_",
    "KHR_mesh_quantization",
    "KHR_technique",
    "KHR_animation_pointer",
    "KHR_node_",
    "KHR_interactivity",
    "KHR_xmp",
    "EXT_mesh_features",
    "EXT_instance_features",
    "EXT_structural_metadata",
];
const INSTANCING: &str = "EXT_mesh_gpu_instancing";
/// The beginning of the names of the extensions of splats.
const SPLATTING: &str = "KHR_gaussian_splatting";
/// The remedy for a file with another extension.
const WITHOUT: &str = "export the file without it";

/// The part that is parsed first: in other versions, the rest has other types.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Preamble {
    asset: Option<Asset>,
    #[serde(default, deserialize_with = "few")]
    extensions_used: Vec<String>,
    #[serde(default, deserialize_with = "few")]
    extensions_required: Vec<String>,
}

#[derive(Deserialize)]
struct Asset {
    version: String,
}

/// The parts of a document that hold geometry.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub(super) struct Document {
    #[serde(default, deserialize_with = "few")]
    pub(super) accessors: Vec<Accessor>,
    #[serde(default, deserialize_with = "few")]
    pub(super) buffers: Vec<Buffer>,
    #[serde(default, deserialize_with = "few")]
    pub(super) buffer_views: Vec<View>,
    #[serde(default, deserialize_with = "meshes")]
    pub(super) meshes: Vec<Mesh>,
    #[serde(default, deserialize_with = "few")]
    pub(super) nodes: Vec<Node>,
    #[serde(default, deserialize_with = "few")]
    pub(super) scenes: Vec<Scene>,
    #[serde(default, deserialize_with = "one")]
    pub(super) scene: Option<Index<Scene>>,
}

/// The root nodes of a scene.
#[derive(Deserialize)]
pub(super) struct Scene {
    #[serde(default)]
    pub(super) nodes: Vec<Index<Node>>,
}

/// A node: its mesh, its children, and its transform, which the type of `gltf` would round to 32 bits.
#[derive(Deserialize)]
pub(super) struct Node {
    pub(super) mesh: Option<Index<Mesh>>,
    pub(super) children: Option<Vec<Index<Node>>>,
    /// Column by column.
    pub(super) matrix: Option<[f64; 16]>,
    /// A quaternion x, y, z, w.
    pub(super) rotation: Option<[f64; 4]>,
    pub(super) scale: Option<[f64; 3]>,
    pub(super) translation: Option<[f64; 3]>,
}

impl Document {
    /// Parses `json`.
    ///
    /// # Errors
    ///
    /// If it is not glTF 2, or uses unsupported extensions.
    pub(super) fn parse(json: &[u8]) -> Result<Self, Fault> {
        let json = json.strip_prefix(b"\xef\xbb\xbf").unwrap_or(json);
        let wrong = |error| Fault::broken("the JSON", format!("not a glTF document: {error}"));
        let preamble: Preamble = serde_json::from_slice(json).map_err(wrong)?;
        let version = preamble.asset.map(|asset| asset.version).unwrap_or_else(|| "unknown".into());
        if version != "2" && !version.starts_with("2.") {
            let what = format!("glTF of version {}", excerpt(version.as_bytes()));
            return Err(Fault::unsupported(what, "convert it to glTF 2"));
        }
        for name in &preamble.extensions_required {
            if !HARMLESS.iter().any(|known| name.starts_with(known)) && !DECODED.contains(&name.as_str()) {
                return Err(unsupported(name, WITHOUT));
            }
        }
        if preamble.extensions_used.iter().any(|name| name == INSTANCING) {
            return Err(unsupported(INSTANCING, WITHOUT));
        }
        // Without it, splats are bare points, transparent ones, too.
        let is_unknown = |name: &&String| name.starts_with(SPLATTING) && !DECODED.contains(&name.as_str());
        if let Some(name) = preamble.extensions_used.iter().find(is_unknown) {
            return Err(unsupported(name, "export the splats as PLY or SPZ"));
        }
        serde_json::from_slice(json).map_err(wrong)
    }
}

/// The error for the extension `name`.
fn unsupported(name: &str, remedy: &'static str) -> Fault {
    Fault::unsupported(format!("the extension {}", excerpt(name.as_bytes())), remedy)
}

/// Entry `index` of `list`; `what` names an entry in errors.
pub(super) fn get<'a, T>(list: &'a [T], index: Index<T>, what: &str) -> Result<&'a T, Fault> {
    let missing = || Fault::broken("the JSON", format!("{what} {index} is missing: there are {}", list.len()));
    list.get(index.value()).ok_or_else(missing)
}

/// The spent part of [`MAX_CORNERS`]: a few bytes of JSON can instantiate one large mesh a million times.
#[derive(Default)]
pub(super) struct CornerBudget {
    spent: u64,
}

impl CornerBudget {
    /// Adds `corners` and checks the limit.
    pub(super) fn spend(&mut self, corners: u64) -> Result<(), Fault> {
        self.spent = self.spent.saturating_add(corners);
        Fault::unless_within("corners of all instances", MAX_CORNERS, self.spent)
    }
}
