//! Encoding without loss.

use strivec_format::container::{
    ArrayOptions, EncodeOptions, Encoding, Error, FactorOptions, Limits, NetworkSteps, SceneFile, decode_scene_file,
    encode_scene_file,
};
use strivec_format::model::Block;

/// Options that encode `file` without loss: its own, and floats for arrays that its own would round, as after an edit.
///
/// # Errors
///
/// If the scene cannot be encoded.
pub fn lossless(file: &SceneFile) -> Result<EncodeOptions, Error> {
    let trial = EncodeOptions { zstd_level: None, ..file.encoding.clone() };
    let read = match encode_scene_file(&file.scene, &file.metadata, &trial) {
        Ok(bytes) => Some(decode_scene_file(&bytes, Limits { memory: u64::MAX })?),
        // The encoding cannot hold a number of the scene.
        Err(Error::Overflow { .. }) => None,
        Err(error) => return Err(error),
    };
    let mut options = EncodeOptions { density: Vec::new(), appearance: Vec::new(), ..file.encoding.clone() };
    let floats = EncodeOptions::lossless(&file.scene);
    for (s, scale) in file.scene.scales.iter().enumerate() {
        let read = read.as_ref().map(|read| &read.scene.scales[s].factors);
        let fits = |read: Option<&[Block]>, own: &[Block]| {
            let same = |(read, own): (&Block, &Block)| same_bits(&read.values, &own.values);
            read.is_some_and(|read| read.iter().zip(own).all(same))
        };
        let choose = |fits: bool, own: &[FactorOptions], floats: &[FactorOptions]| {
            let options = if fits { own.get(s).or(own.last()) } else { floats.last() };
            options.cloned().unwrap_or_else(|| FactorOptions::new(Encoding::F32))
        };
        let factors = &scale.factors;
        let [density, appearance] =
            [(read.map(|r| &r.density[..]), &factors.density), (read.map(|r| &r.appearance[..]), &factors.appearance)]
                .map(|(read, own)| fits(read, own));
        options.density.push(choose(density, &file.encoding.density, &floats.density));
        options.appearance.push(choose(appearance, &file.encoding.appearance, &floats.appearance));
    }
    let same = |read: &SceneFile| {
        let mut scales = read.scene.scales.iter().zip(&file.scene.scales);
        // A reader returns `None` for each scale without a correction; an edit leaves out the whole list.
        let prefixes = [&read.metadata.prefixes, &file.metadata.prefixes].map(|prefixes| prefixes.iter().flatten());
        let [read_prefixes, own_prefixes] = prefixes;
        read.scene.decoder == file.scene.decoder
            && scales.all(|(read, own)| read.appearance_matrix == own.appearance_matrix)
            && read_prefixes.eq(own_prefixes)
    };
    if !read.as_ref().is_some_and(same) {
        options.networks = ArrayOptions::best(Encoding::F32);
        options.network_steps = NetworkSteps::default();
    }
    Ok(options)
}

fn same_bits(a: &[f32], b: &[f32]) -> bool {
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| a.to_bits() == b.to_bits())
}
