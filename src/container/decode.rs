//! From bytes to a scene.

use super::cursor::Cursor;
use super::section::SectionKind;
use super::{Error, appearance, decoder, factors, frame, occupancy, placement, provenance, rules, sections};
use crate::model::{Provenance, Scale, Scene, TensorCloud};

/// The scene in a `.strivec` file, which passes [`Scene::check`].
///
/// Sections that this version does not know are skipped where the file says that the scene is whole without them.
///
/// # Errors
///
/// Where the bytes are anything but a whole, undamaged file of this major version whose scene is valid; the error
/// says what and where. Memory stays within a small multiple of the file's size plus a constant
/// (`format-spec/v1.md`, section "Limits").
pub fn decode(bytes: &[u8]) -> Result<Scene, Error> {
    let contents = sections(bytes)?;
    let mut cursor = Cursor::new(bytes, &contents)?;
    let frame = frame::read(cursor.take(SectionKind::Frame, None)?)?;
    let (rules, bounds, scale_count) = rules::read(cursor.take(SectionKind::Rules, None)?)?;
    let provenance = match cursor.take_if(SectionKind::Provenance, None) {
        Some(payload) => provenance::read(payload)?,
        None => Provenance::default(),
    };
    let decoder = decoder::read(cursor.take(SectionKind::Decoder, None)?)?;
    let occupancy = cursor.take_if(SectionKind::Occupancy, None).map(occupancy::read).transpose()?;
    let mut scales = Vec::new();
    for index in 0..scale_count {
        let tensors = placement::read(cursor.take(SectionKind::Placement, Some(index))?)?;
        let appearance_matrix = appearance::read(cursor.take(SectionKind::Appearance, Some(index))?)?;
        let (resolution, factors) =
            factors::read(cursor.take(SectionKind::Factors, Some(index))?, tensors.placement_len())?;
        let cloud = TensorCloud { placement: tensors.placement, half: tensors.half, resolution };
        scales.push(Scale { cloud, top_k: tensors.top_k, factors, appearance_matrix });
    }
    cursor.finish()?;
    let scene = Scene { frame, bounds, rules, scales, decoder, occupancy, provenance };
    scene.check()?;
    Ok(scene)
}
