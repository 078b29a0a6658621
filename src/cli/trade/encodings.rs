//! The scene as decoded from other encodings.

use super::sweep::SweepScene;
use crate::{Context, Error};
use strivec_format::container::{EncodeOptions, Encoding, Limits, Metadata, decode_scene_file, encode_scene_file};
use strivec_format::model::Scene;
use strivec_recipe::{JUDGED, PROBED};
use strivec_train::pack::{Goal, ReferencePictures, balance, probe_views, search};

/// Encodings that treat all factors alike, and their names.
const PLAIN: [(&str, Encoding); 3] =
    [("f16", Encoding::F16), ("grid8", Encoding::Grid(8)), ("grid6", Encoding::Grid(6))];
/// PSNR in dB between the pictures before and after lossy encoding, the goals of the search.
const LOSSY: [f64; 3] = [60.0, 52.0, 45.0];

/// `scene` after encoding and decoding, once per encoding.
pub(super) fn encoded(scene: &Scene, metadata: &Metadata, session: &Context) -> Result<Vec<SweepScene>, Error> {
    let failed = |e: strivec_format::container::Error| Error::Runtime(e.to_string());
    let source = |name: String, scene: &Scene, options: &EncodeOptions| -> Result<SweepScene, Error> {
        let bytes = encode_scene_file(scene, &Metadata::default(), options).map_err(failed)?;
        let scene = decode_scene_file(&bytes, Limits { memory: u64::MAX }).map_err(failed)?.scene;
        Ok(SweepScene { name, scene, bytes: bytes.len() as u64 })
    };
    let mut sources = Vec::new();
    let mut balanced = scene.clone();
    balance(&mut balanced);
    for (name, encoding) in PLAIN {
        session.console.say(&format!("encoding {name}"));
        let scene = if matches!(encoding, Encoding::Grid(_)) { &balanced } else { scene };
        sources.push(source(name.to_owned(), scene, &EncodeOptions::uniform(encoding))?);
    }
    session.console.say("estimating importance");
    let probed = |count| probe_views(scene, metadata.views.as_ref(), &metadata.cameras, count, JUDGED.1);
    let importance = probed(PROBED.0).importance(scene, PROBED.1, 0);
    let distortion = ReferencePictures::from_own_pictures(scene, probed(JUDGED.0));
    for psnr in LOSSY {
        session.console.say(&format!("encoding at {psnr} dB"));
        let goal = Goal::Error { before: 0.0, more: 10f64.powf(-psnr / 10.0) };
        if let Some(found) = search(scene, &importance, &distortion, goal, 0, &mut |_| {}).map_err(failed)? {
            let options = EncodeOptions { zstd_level: Some(19), ..found.options };
            sources.push(source(format!("lossy {psnr} dB"), &found.scene, &options)?);
        }
    }
    Ok(sources)
}
