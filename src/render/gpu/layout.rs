//! The structs of `shaders/layout.wgsl`, byte for byte: a test compares them with what naga makes of the shaders.

use bytemuck::{Pod, Zeroable};

/// One scale of the scene.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Scale {
    pub(super) min: [f32; 3],
    pub(super) top_k: u32,
    pub(super) cells_per_unit: [f32; 3],
    pub(super) lists: u32,
    pub(super) cells: [u32; 3],
    pub(super) starts: u32,
    pub(super) half: [f32; 3],
    pub(super) candidates: u32,
    pub(super) factor_cells_per_unit: [f32; 3],
    pub(super) rows: u32,
    pub(super) last_cell: [u32; 3],
    pub(super) density: u32,
    pub(super) first_row: [u32; 3],
    pub(super) appearance: u32,
    pub(super) density_quads: u32,
    pub(super) appearance_quads: u32,
    pub(super) first_quad: u32,
    pub(super) padding: u32,
}

/// A fully connected layer.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Layer {
    pub(super) inputs: u32,
    pub(super) outputs: u32,
    pub(super) weights: u32,
    pub(super) bias: u32,
}

/// The shaders' `Scene` without its layers and scales, which follow.
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
    pub(super) grid_words: u32,
    pub(super) grid_blocks: u32,
    pub(super) grid_min: [f32; 3],
    pub(super) padding0: u32,
    pub(super) grid_cells_per_unit: [f32; 3],
    pub(super) padding1: u32,
    pub(super) grid_cells: [i32; 3],
    pub(super) padding2: u32,
    pub(super) grid_block_counts: [i32; 3],
    pub(super) padding3: u32,
}

/// What changes from one batch of rays to the next.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Frame {
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
    pub(super) padding0: u32,
    pub(super) padding1: u32,
}

/// A ray and what became of it.
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
    pub(super) colored_weights: f32,
    pub(super) first_block: u32,
    pub(super) first_row: u32,
    pub(super) colored: u32,
    pub(super) listed: u32,
}

/// How far the batch's lists have grown.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub(super) struct Counters {
    pub(super) blocks: u32,
    pub(super) rows: u32,
    pub(super) listed: u32,
    pub(super) padding: u32,
}

/// One pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
#[repr(C)]
pub(super) struct PixelPair {
    pub(super) color: [f32; 3],
    pub(super) opacity: f32,
    pub(super) depth: f32,
    /// Samples whose density was evaluated.
    pub(super) evaluated: f32,
    /// Samples that added colour.
    pub(super) colored: f32,
    pub(super) padding: f32,
}

#[cfg(test)]
mod tests {
    use std::mem::{offset_of, size_of};

    use super::*;
    use crate::render::gpu::shader::{Shape, Stage};

    /// Offsets of a struct's members and its size, as WGSL has them.
    fn of_wgsl(name: &str) -> (Vec<(String, u32)>, u32) {
        let module = wgpu::naga::front::wgsl::parse_str(&Stage::March.source(&Shape::default())).unwrap();
        let (_, found) = module.types.iter().find(|(_, t)| t.name.as_deref() == Some(name)).expect(name);
        let wgpu::naga::TypeInner::Struct { members, span } = &found.inner else { panic!("{name} is no struct") };
        (members.iter().map(|m| (m.name.clone().unwrap(), m.offset)).collect(), *span)
    }

    macro_rules! assert_same {
        ($wgsl:literal, $rust:ty, $($member:ident),+) => {{
            let (members, size) = of_wgsl($wgsl);
            let own = [$((stringify!($member).to_owned(), offset_of!($rust, $member) as u32)),+];
            let padding_apart = |m: &(String, u32)| !m.0.starts_with("padding");
            let members: Vec<_> = members.into_iter().filter(padding_apart).collect();
            assert_eq!(members[..own.len().min(members.len())], own, $wgsl);
            (members.len() - own.len(), size, size_of::<$rust>() as u32)
        }};
    }

    #[test]
    fn structs_lie_as_the_shaders_have_them() {
        let whole = [
            assert_same!(
                "Scale",
                Scale,
                min,
                top_k,
                cells_per_unit,
                lists,
                cells,
                starts,
                half,
                candidates,
                factor_cells_per_unit,
                rows,
                last_cell,
                density,
                first_row,
                appearance,
                density_quads,
                appearance_quads,
                first_quad
            ),
            assert_same!("Layer", Layer, inputs, outputs, weights, bias),
            assert_same!(
                "Frame",
                Frame,
                position,
                width,
                right,
                height,
                up,
                first_ray,
                back,
                ray_count,
                focal,
                principal,
                rays_are_given,
                blocks
            ),
            assert_same!(
                "Ray",
                Ray,
                start,
                entry,
                direction,
                length,
                transmittance,
                weights,
                distances,
                evaluated,
                outputs,
                colored_weights,
                first_block,
                first_row,
                colored,
                listed
            ),
            assert_same!("Counters", Counters, blocks, rows, listed),
        ];
        for (missing, wgsl, rust) in whole {
            assert_eq!((missing, wgsl), (0, rust));
        }
        let (missing, wgsl, rust) = assert_same!(
            "Scene",
            SceneHead,
            bounds_min,
            near,
            bounds_max,
            far,
            background,
            position_error,
            step,
            density_shift,
            depth_scale,
            min_weight,
            min_transmittance,
            appearance,
            grid_words,
            grid_blocks,
            grid_min,
            grid_cells_per_unit,
            grid_cells,
            grid_block_counts
        );
        assert_eq!(missing, 2, "layers and scales");
        let shape = Shape::default();
        assert_eq!(wgsl, rust + 16 * shape.layers + 128 * shape.scales);
        assert_eq!((size_of::<Layer>(), size_of::<Scale>()), (16, 128));
    }
}
