//! Writing an edited file again: what the edit does not change stays as it is.

use std::path::Path;

use super::encoding::{LayoutArgs, Plain, options_for};
use crate::table::plural;
use crate::{Context, Error};
use strivec_field::render::TRADE_NOTE;
use strivec_format::container;
use strivec_format::container::{Codec, EncodeOptions, Limits, Metadata, Original, SceneFile};
use strivec_format::model::{MemoryLimit, ReferenceField, Scene};
use strivec_train::pack;

/// How edited files are written.
pub(super) struct Edit<'a> {
    /// Encoding of the factors.
    pub(super) encoding: Plain,
    pub(super) layout: &'a LayoutArgs,
    pub(super) session: &'a Context,
}

/// The file of `after`, which an edit has made of `before`, the content of the file `bytes` at `path`.
///
/// Unchanged sections are copied, unless the level requires to compress them anew. If the scene changes, probes that no
/// longer hold and measurements are dropped.
pub(super) fn rewritten(
    before: &SceneFile,
    bytes: &[u8],
    mut after: SceneFile,
    edit: &Edit<'_>,
    path: &Path,
) -> Result<Vec<u8>, Error> {
    let container_error = |e| Error::container(path, e);
    let sections = container::sections(bytes).map_err(container_error)?.sections;
    let was_compressed = sections.iter().any(|section| section.codec != Codec::Stored);
    let options = options_for(edit.encoding, &mut after, was_compressed).map_err(container_error)?;
    let options = edit.layout.layout().apply(options, was_compressed);
    let SceneFile { scene, mut metadata, .. } = after;
    let decoded = match edit.encoding {
        Plain::Keep => None,
        _ => Some(decoded(&scene, &options).map_err(container_error)?),
    };
    let seen = decoded.as_ref().unwrap_or(&scene);
    if *seen != before.scene {
        forget_measurements(&mut metadata, seen, before.scene.memory, path, edit.session)?;
    }
    let written = if edit.layout.layout().recompresses() {
        container::encode_scene_file(&scene, &metadata, &options)
    } else {
        let original = Original { bytes, scene: &before.scene, metadata: &before.metadata, encoding: &before.encoding };
        container::rewrite_scene_file(&scene, &metadata, &options, original)
    };
    written.map_err(container_error)
}

/// The scene that a reader decodes.
fn decoded(scene: &Scene, options: &EncodeOptions) -> Result<Scene, container::Error> {
    let stored = EncodeOptions { zstd_level: None, ..options.clone() };
    let bytes = container::encode_scene_file(scene, &Metadata::default(), &stored)?;
    Ok(container::decode_scene_file(&bytes, Limits { memory: u64::MAX })?.scene)
}

/// Drops what was measured of the scene before it became `scene`, and the probes that are no longer true. To check them may
/// take `memory`.
fn forget_measurements(
    metadata: &mut Metadata,
    scene: &Scene,
    memory: MemoryLimit,
    path: &Path,
    session: &Context,
) -> Result<(), Error> {
    metadata.quality = None;
    metadata.notes.remove(TRADE_NOTE);
    let Some(mut probes) = metadata.probes.take() else { return Ok(()) };
    memory.unless_over("the reference field", ReferenceField::memory(scene)).map_err(Error::memory(path))?;
    let all = probes.probes.len();
    probes.probes = pack::true_probes(scene, &probes);
    let kept = probes.probes.len();
    if kept < all {
        let of = plural(all, "probe");
        let message = format!("{kept} of {of} kept: the others no longer hold");
        session.console.say(&format!("{}: {message}", path.display()));
    }
    metadata.probes = (kept > 0).then_some(probes);
    Ok(())
}
