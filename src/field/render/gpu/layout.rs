//! The structs of `shaders/layout.wgsl`, byte for byte. A test compares them with naga's layout of the shaders.

use bytemuck::{Pod, Zeroable};

/// One scale of the scene.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(super) struct PackedScale {
    pub(super) min: [f32; 3],
    pub(super) top_k: u32,
    pub(super) cells_per_unit: [f32; 3],
    pub(super) lists: u32,
    pub(super) cells: [u32; 3],
    pub(super) starts: u32,
    pub(super) half_edge: [f32; 3],
    pub(super) candidates: u32,
    pub(super) factor_cells_per_unit: [f32; 3],
    pub(super) tensors: u32,
    pub(super) last_cell: [u32; 3],
    pub(super) has_matrices: u32,
    pub(super) first_row: [u32; 3],
    pub(super) padding1: u32,
    pub(super) first_quads: [u32; 3],
    pub(super) padding2: u32,
}

/// A fully connected layer.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(super) struct PackedLayer {
    pub(super) inputs: u32,
    pub(super) output_quads: u32,
    pub(super) weights: u32,
    pub(super) bias: u32,
}

/// The shaders' `Scene` without its layers, scales and sky, which follow.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(super) struct SceneHead {
    pub(super) bounds_min: [f32; 3],
    pub(super) near: f32,
    pub(super) bounds_max: [f32; 3],
    pub(super) far: f32,
    pub(super) background: [f32; 3],
    pub(super) position_error: f32,
    pub(super) step: f32,
    pub(super) density_shift: f32,
    pub(super) depth_scale: f32,
    pub(super) min_weight: f32,
    pub(super) min_transmittance: f32,
    pub(super) appearance: u32,
    pub(super) grid_masks: u32,
    pub(super) grid_distances: u32,
    pub(super) grid_min: [f32; 3],
    pub(super) shell: f32,
    pub(super) grid_cells_per_unit: [f32; 3],
    pub(super) padding1: u32,
    pub(super) grid_cells: [i32; 3],
    pub(super) own_min_weight: f32,
    pub(super) grid_bricks: [i32; 3],
    pub(super) own_min_transmittance: f32,
}

/// The uniforms of a batch of rays.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(super) struct FrameUniforms {
    pub(super) position: [f32; 3],
    pub(super) width: u32,
    pub(super) right: [f32; 3],
    pub(super) height: u32,
    pub(super) up: [f32; 3],
    pub(super) first_ray: u32,
    pub(super) back: [f32; 3],
    pub(super) ray_count: u32,
    pub(super) focal: [f32; 2],
    pub(super) principal: [f32; 2],
    pub(super) rays_are_given: u32,
    pub(super) blocks: u32,
    pub(super) strides: u32,
    pub(super) opaque_zero: u32,
}

/// A ray: its span, and the results and the state of its march.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Ray {
    pub(super) start: [f32; 3],
    pub(super) entry: f32,
    pub(super) direction: [f32; 3],
    pub(super) length: f32,
    pub(super) transmittance: f32,
    pub(super) weights: f32,
    pub(super) distances: f32,
    pub(super) evaluated: u32,
    pub(super) outputs: [f32; 3],
    pub(super) shaded_weights: f32,
    pub(super) first_block: u32,
    pub(super) first_row: u32,
    pub(super) shaded: u32,
    pub(super) compacted_ray: u32,
    pub(super) lost: [f32; 3],
    pub(super) next: u32,
    pub(super) block: u32,
    pub(super) used: u32,
    pub(super) scale: f32,
    pub(super) first: f32,
    pub(super) skipped_weights: f32,
    pub(super) padding1: u32,
    pub(super) padding2: u32,
    pub(super) padding3: u32,
}

/// Lengths of the batch's lists.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Counters {
    pub(super) blocks: u32,
    pub(super) rows: u32,
    pub(super) shaded_rays: u32,
    pub(super) unfinished: u32,
}

/// One pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(super) struct PixelPair {
    pub(super) color: [f32; 3],
    pub(super) opacity: f32,
    pub(super) depth: f32,
    /// Number of samples evaluated.
    pub(super) evaluated: f32,
    /// Number of samples shaded.
    pub(super) shaded: f32,
    pub(super) padding: f32,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::render::gpu::shader::{ShaderShape, ShaderStage};
    use crate::render::gpu::testing::assert_same_layout;

    #[test]
    fn scene_structs_have_the_shaders_layout() {
        let shape = ShaderShape { sky_degree: 3, ..ShaderShape::default() };
        let source = &ShaderStage::March.source(&shape);
        #[rustfmt::skip]
        assert_same_layout!(
            source, "Scale", PackedScale,
            min, top_k, cells_per_unit, lists, cells, starts, half_edge, candidates, factor_cells_per_unit,
            tensors, last_cell, has_matrices, first_row, first_quads
        );
        assert_same_layout!(source, "Layer", PackedLayer, inputs, output_quads, weights, bias);
        #[rustfmt::skip]
        let (more, size) = assert_same_layout!(
            source, "Scene", SceneHead,
            bounds_min, near, bounds_max, far, background, position_error, step, density_shift, depth_scale, min_weight,
            min_transmittance, appearance, grid_masks, grid_distances, grid_min, shell, grid_cells_per_unit,
            grid_cells, own_min_weight, grid_bricks, own_min_transmittance
        );
        let [head, layer, scale] =
            [size_of::<SceneHead>(), size_of::<PackedLayer>(), size_of::<PackedScale>()].map(|b| b as u32);
        let expected = head + layer * shape.layers + scale * shape.scales + 16 * shape.sky_terms();
        assert_eq!((more, size), (3, expected), "layers, scales and the sky follow");
    }

    #[test]
    fn batch_structs_have_the_shaders_layout() {
        let source = &ShaderStage::March.source(&ShaderShape::default());
        #[rustfmt::skip]
        assert_same_layout!(
            source, "Frame", FrameUniforms,
            position, width, right, height, up, first_ray, back, ray_count, focal, principal, rays_are_given, blocks, strides,
            opaque_zero
        );
        #[rustfmt::skip]
        assert_same_layout!(
            source, "Ray", Ray,
            start, entry, direction, length, transmittance, weights, distances, evaluated, outputs, shaded_weights,
            first_block, first_row, shaded, compacted_ray, lost, next, block, used, scale, first, skipped_weights
        );
        assert_same_layout!(source, "Counters", Counters, blocks, rows, shaded_rays, unfinished);
    }

    #[test]
    #[should_panic(expected = "Layer")]
    fn a_member_in_another_place_is_found() {
        #[repr(C)]
        struct Swapped {
            output_quads: u32,
            inputs: u32,
            weights: u32,
            bias: u32,
        }
        let source = &ShaderStage::March.source(&ShaderShape::default());
        assert_same_layout!(source, "Layer", Swapped, inputs, output_quads, weights, bias);
    }
}
