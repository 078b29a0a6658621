//! What a page tells about a scene.

use serde_json::{Value, json};

use crate::container::Document;
use crate::render::gpu::{Gpu, GpuRenderer};

/// Facts of the `document` that was read from `bytes` bytes.
pub(super) fn of_document(document: &Document, bytes: usize) -> Value {
    let scene = &document.scene;
    let scales: Vec<Value> = (scene.scales.iter())
        .map(|scale| {
            json!({
                "tensors": scale.cloud.len(),
                "resolution": scale.cloud.resolution,
                "density_rank": scale.factors.density_rank,
                "appearance_rank": scale.factors.appearance_rank,
                "top_k": scale.top_k,
            })
        })
        .collect();
    let provenance = &scene.provenance;
    json!({
        "bytes": bytes,
        "parameters": scene.parameter_count(),
        "scales": scales,
        "decoder_mode": scene.decoder.mode.name(),
        "bounds": [scene.bounds.min.to_array(), scene.bounds.max.to_array()],
        "near_far": [scene.frame.near, scene.frame.far],
        "step": scene.rules.step,
        "background": scene.frame.background,
        "dataset": provenance.dataset,
        "preset": provenance.preset,
        "tool": provenance.tool,
        "licence": document.extras.licence,
        "test_psnr": document.extras.quality.as_ref().and_then(|quality| quality.test),
    })
}

/// Facts of what renders it.
pub(super) fn of_device(gpu: &Gpu, renderer: &GpuRenderer) -> Value {
    let info = gpu.info();
    let [scene, work] = renderer.memory_bytes();
    json!({
        "name": info.name,
        "driver": info.driver,
        "kind": format!("{:?}", info.device_type),
        "scene_bytes": scene,
        "work_bytes": work,
    })
}
