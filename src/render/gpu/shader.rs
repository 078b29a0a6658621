//! The WGSL of each stage: a prelude of constants made from the scene's shape, and files of `shaders/`.

use std::fmt::Write as _;

/// Pixels along the edge of a tile, whose rays share a workgroup: they meet mostly the same tensors.
pub(super) const TILE: u32 = 8;
/// Rays of a workgroup.
pub(super) const RAY_LANES: u32 = TILE * TILE;
/// Rays of a workgroup where samples are compacted.
pub(super) const COMPACT_LANES: u32 = 256;
/// Invocations of a workgroup of the decoder.
const LANES: u32 = 128;
/// Slots of a block, the first of which leads to the next block.
pub(super) const SLOTS: u32 = 8;
/// Workgroups along a dimension, at most: what every device has.
const MAX_ACROSS: u32 = 65535;
/// Quads of one binding of the scene's numbers, as a shift: 128 MiB, which every device allows.
pub(super) const CHUNK_SHIFT: u32 = 23;
/// The first binding of the scene's numbers.
pub(super) const FIRST_CHUNK: u32 = 8;
/// Bytes of a pair of the decoder's workgroup memory.
const PAIR_BYTES: u32 = 32;

/// How factors are stored on the device.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Precision {
    /// As the file has them.
    #[default]
    F32,
    /// Rounded to 16 bits: half the memory and bandwidth; and what goes from one layer of the decoder to the next, where the
    /// device has such numbers. Sums stay in 32 bits.
    F16,
}

/// What a device may have of WGSL's extensions, which the shaders use where it has them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Extensions {
    /// Numbers of 16 bits.
    pub(super) f16: bool,
    /// Sums over the lanes that run together.
    pub(super) subgroups: bool,
}

/// What the shaders are made for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Shape {
    pub(super) precision: Precision,
    pub(super) extensions: Extensions,
    /// Bindings that the scene's numbers are split over.
    pub(super) chunks: u32,
    /// Quads of one, as a shift.
    pub(super) chunk_shift: u32,
    pub(super) scales: u32,
    /// The largest of all scales.
    pub(super) top_k: u32,
    pub(super) layers: u32,
    /// The most inputs of a layer.
    pub(super) inputs: u32,
    /// The most outputs of a layer, or features, in quads.
    pub(super) output_quads: u32,
    /// Components of appearance of all scales, each scale's padded to quads.
    pub(super) component_quads: u32,
    pub(super) features: u32,
    pub(super) feature_frequencies: u32,
    pub(super) direction_frequencies: u32,
    /// Cells along a block's edge, as a shift; absent where there is no grid.
    pub(super) block_shift: Option<u32>,
    pub(super) coverage_is_all: bool,
    pub(super) density_is_mean: bool,
    pub(super) appearance_is_mean: bool,
    pub(super) aggregation_is_clamped: bool,
    /// Every sample is decoded; else every ray.
    pub(super) decodes_samples: bool,
    /// Where rays are decoded: samples add colors of their own.
    pub(super) samples_have_colors: bool,
    /// Workgroup memory, in bytes.
    pub(super) workgroup_bytes: u32,
}

impl Shape {
    /// Rows of the decoder's tile: as many as fit, in fours; `None` where not even four do.
    pub(super) fn rows(&self) -> Option<u32> {
        [32, 16, 8, 4].into_iter().find(|&rows| self.bytes_for(rows) <= self.workgroup_bytes)
    }

    /// Workgroup memory of the decoder with `rows` rows.
    fn bytes_for(&self, rows: u32) -> u32 {
        let own_color = if self.samples_have_colors { 12 } else { 0 };
        let of_row = PAIR_BYTES * self.scales * self.top_k + 4 * self.scales + 8 + 4 + own_color;
        let of_number = if self.keeps_halves() { 2 } else { 4 };
        let per_row = of_number * self.tile_columns() + of_row;
        rows * per_row + 48
    }

    /// Whether the decoder's tile holds numbers of 16 bits.
    fn keeps_halves(&self) -> bool {
        self.precision == Precision::F16 && self.extensions.f16
    }

    /// Columns of the decoder's tile.
    pub(super) fn tile_columns(&self) -> u32 {
        self.inputs.max(4 * self.component_quads.max(self.output_quads))
    }

    /// Constants, and how numbers are read.
    fn prelude(&self) -> String {
        let rows = self.rows().unwrap_or(4);
        let mut text = String::from("// Made from the scene's shape: see src/render/gpu/shader.rs.\n");
        // naga takes subgroups without a word, and would not take the word.
        if self.keeps_halves() {
            text += "enable f16;\n";
        }
        for (name, value) in [
            ("SCALES", self.scales),
            ("TOP_K", self.top_k),
            ("LAYERS", self.layers),
            ("OUTPUT_QUADS", self.output_quads),
            ("COMPONENT_QUADS", self.component_quads),
            ("COMPONENTS", 4 * self.component_quads),
            ("FEATURES", self.features),
            ("FEATURE_QUADS", self.features.div_ceil(4)),
            ("FEATURE_FREQUENCIES", self.feature_frequencies),
            ("DIRECTION_FREQUENCIES", self.direction_frequencies),
            ("BLOCK_SHIFT", self.block_shift.unwrap_or(0)),
            ("TILE", TILE),
            ("RAY_LANES", RAY_LANES),
            ("COMPACT_LANES", COMPACT_LANES),
            ("LANES", LANES),
            ("SLOTS", SLOTS),
            ("MAX_ACROSS", MAX_ACROSS),
            ("ROWS", rows),
            ("TILE_QUADS", self.tile_columns() * rows / 4),
            ("PAIRS", rows * self.scales * self.top_k),
            ("OWN_COLOR_QUADS", if self.samples_have_colors { 3 * rows / 4 } else { 1 }),
        ] {
            let _ = writeln!(text, "const {name}: u32 = {value}u;");
        }
        for (name, value) in [
            ("HAS_GRID", self.block_shift.is_some()),
            ("COVERAGE_IS_ALL", self.coverage_is_all),
            ("DENSITY_IS_MEAN", self.density_is_mean),
            ("APPEARANCE_IS_MEAN", self.appearance_is_mean),
            ("IS_CLAMPED", self.aggregation_is_clamped),
            ("DECODES_SAMPLES", self.decodes_samples),
            ("SAMPLES_HAVE_COLORS", self.samples_have_colors),
        ] {
            let _ = writeln!(text, "const {name}: bool = {value};");
        }
        for chunk in 0..self.chunks {
            let binding = FIRST_CHUNK + chunk;
            let _ = writeln!(text, "@group(0) @binding({binding}) var<storage, read> quads{chunk}: array<vec4<u32>>;");
        }
        text += "fn quad(i: u32) -> vec4<u32> {\n";
        if self.chunks > 1 {
            let (shift, mask) = (self.chunk_shift, (1_u32 << self.chunk_shift) - 1);
            let _ = writeln!(text, "    let within = i & {mask}u;\n    switch i >> {shift}u {{");
            for chunk in 1..self.chunks {
                let _ = writeln!(text, "        case {chunk}u: {{ return quads{chunk}[within]; }}");
            }
            text += "        default: { return quads0[within]; }\n    }\n}\n";
        } else {
            text += "    return quads0[i];\n}\n";
        }
        text += match self.precision {
            Precision::F32 => "fn factor(i: u32) -> vec4<f32> {\n    return bitcast<vec4<f32>>(quad(i));\n}\n",
            Precision::F16 => {
                "fn factor(i: u32) -> vec4<f32> {\n    let both = quad(i >> 1u);\n    let halves = select(both.xy, both.zw, (i & 1u) == 1u);\n    \
                 return vec4(unpack2x16float(halves.x), unpack2x16float(halves.y));\n}\n"
            }
        };
        text += if self.keeps_halves() {
            "alias Kept = vec4<f16>;\nfn kept(x: vec4<f32>) -> Kept {\n    return Kept(clamp(x, vec4(-65504.0), vec4(65504.0)));\n}\n"
        } else {
            "alias Kept = vec4<f32>;\nfn kept(x: vec4<f32>) -> Kept {\n    return x;\n}\n"
        };
        text
    }
}

/// The stages of a batch, in order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stage {
    Rays,
    March,
    ShadedSamples,
    Workgroups,
    Decoder,
    Resolve,
    /// Only where normals are wanted.
    Normals,
}

impl Stage {
    pub(super) const ALL: [Self; 7] =
        [Self::Rays, Self::March, Self::ShadedSamples, Self::Workgroups, Self::Decoder, Self::Resolve, Self::Normals];

    /// As the shader's file is called.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Rays => "rays",
            Self::March => "march",
            Self::ShadedSamples => "compact",
            Self::Workgroups => "workgroups",
            Self::Decoder => "decoder",
            Self::Resolve => "resolve",
            Self::Normals => "normals",
        }
    }

    /// The files that it is made of, besides the prelude.
    fn files(self, extensions: Extensions) -> &'static [&'static str] {
        macro_rules! shader {
            ($name:literal) => {
                include_str!(concat!("../../../shaders/", $name, ".wgsl"))
            };
        }
        const LAYOUT: &str = shader!("layout");
        const SCENE_BUFFER: &str = shader!("scene_buffer");
        const REAL: &str = shader!("real");
        const NEIGHBORS: &str = shader!("neighbors");
        const GATHER: &str = shader!("gather");
        const DENSITY: &str = shader!("density");
        match self {
            Self::Rays => &[LAYOUT, shader!("rays")],
            Self::March => &[
                LAYOUT,
                SCENE_BUFFER,
                REAL,
                shader!("cells"),
                shader!("ray_marcher"),
                NEIGHBORS,
                GATHER,
                DENSITY,
                shader!("march"),
            ],
            Self::ShadedSamples if extensions.subgroups => {
                &[LAYOUT, shader!("compact_alloc_subgroup"), shader!("compact")]
            }
            Self::ShadedSamples => &[LAYOUT, shader!("compact_alloc"), shader!("compact")],
            Self::Workgroups => &[LAYOUT, shader!("workgroups")],
            Self::Decoder => &[LAYOUT, SCENE_BUFFER, REAL, NEIGHBORS, GATHER, shader!("decoder")],
            Self::Resolve => &[LAYOUT, REAL, shader!("resolve")],
            Self::Normals => &[LAYOUT, SCENE_BUFFER, REAL, NEIGHBORS, GATHER, DENSITY, shader!("normals")],
        }
    }

    /// The bindings of `shaders/layout.wgsl` that it uses, and whether it reads the scene's numbers.
    pub(super) fn bindings(self) -> (&'static [u32], bool) {
        match self {
            Self::Rays => (&[0, 1, 2], false),
            Self::March => (&[0, 1, 2, 3, 5], true),
            Self::ShadedSamples => (&[1, 2, 3, 4, 5], false),
            Self::Workgroups => (&[5, 6], false),
            Self::Decoder => (&[0, 2, 4, 5], true),
            Self::Resolve => (&[0, 1, 2, 4, 7], false),
            Self::Normals => (&[0, 1, 2, 7], true),
        }
    }

    /// The whole shader for scenes of `shape`.
    pub(super) fn source(self, shape: &Shape) -> String {
        shape.prelude() + &self.files(shape.extensions).join("\n")
    }
}

#[cfg(test)]
impl Default for Shape {
    /// The paper's.
    fn default() -> Self {
        Self {
            precision: Precision::F32,
            extensions: Extensions::default(),
            chunks: 1,
            chunk_shift: CHUNK_SHIFT,
            scales: 3,
            top_k: 4,
            layers: 3,
            inputs: 150,
            output_quads: 32,
            component_quads: 36,
            features: 27,
            feature_frequencies: 2,
            direction_frequencies: 2,
            block_shift: Some(3),
            coverage_is_all: true,
            density_is_mean: false,
            appearance_is_mean: false,
            aggregation_is_clamped: false,
            decodes_samples: true,
            samples_have_colors: false,
            workgroup_bytes: 16352,
        }
    }
}

#[cfg(test)]
mod tests {
    use wgpu::naga;

    use super::*;
    use crate::render::gpu::testing::validated;

    fn shapes() -> Vec<Shape> {
        let paper = Shape::default();
        let both = Extensions { f16: true, subgroups: true };
        vec![
            Shape { precision: Precision::F16, chunks: 3, ..paper.clone() },
            Shape { precision: Precision::F16, extensions: both, ..paper.clone() },
            Shape { extensions: both, decodes_samples: false, samples_have_colors: true, ..paper.clone() },
            Shape { decodes_samples: false, ..paper.clone() },
            Shape { decodes_samples: false, samples_have_colors: true, density_is_mean: true, ..paper.clone() },
            Shape {
                scales: 1,
                top_k: 16,
                layers: 1,
                inputs: 300,
                output_quads: 7,
                component_quads: 1,
                block_shift: None,
                ..paper.clone()
            },
            Shape { coverage_is_all: false, appearance_is_mean: true, aggregation_is_clamped: true, ..paper.clone() },
            Shape {
                feature_frequencies: 0,
                direction_frequencies: 0,
                features: 3,
                inputs: 6,
                output_quads: 1,
                ..paper.clone()
            },
            paper,
        ]
    }

    #[test]
    fn every_shader_is_valid_for_every_shape() {
        for shape in shapes() {
            for stage in Stage::ALL {
                let source = stage.source(&shape);
                validated(&source).unwrap_or_else(|e| panic!("{}: {e}\n{shape:?}", stage.name()));
            }
        }
        let broken = Stage::March.source(&Shape::default()).replace("fn advance", "fn advanced");
        assert!(validated(&broken).is_err());
    }

    #[test]
    fn stages_use_the_bindings_that_they_say_and_no_more_than_four_are_storage() {
        let shape = Shape::default();
        for stage in Stage::ALL {
            let (module, info) = validated(&stage.source(&shape)).unwrap();
            let used = |(handle, global): (naga::Handle<naga::GlobalVariable>, &naga::GlobalVariable)| {
                let used = !info.get_entry_point(0)[handle].is_empty();
                Some((global.binding.as_ref().filter(|_| used)?.binding, global.space))
            };
            let mut found: Vec<_> = module.global_variables.iter().filter_map(used).collect();
            found.sort_by_key(|f| f.0);
            let (bindings, reads_scene) = stage.bindings();
            let expected: Vec<_> = bindings.iter().copied().chain(reads_scene.then_some(FIRST_CHUNK)).collect();
            assert_eq!(found.iter().map(|f| f.0).collect::<Vec<_>>(), expected, "{}", stage.name());
            let storage = found.iter().filter(|f| matches!(f.1, naga::AddressSpace::Storage { .. })).count();
            assert!(storage <= 4, "{}: {storage}", stage.name());
        }
    }

    #[test]
    fn the_decoder_fits_into_workgroup_memory() {
        for shape in shapes() {
            let (module, _) = validated(&Stage::Decoder.source(&shape)).unwrap();
            let mut layouter = naga::proc::Layouter::default();
            layouter.update(module.to_ctx()).unwrap();
            let bytes: u32 = (module.global_variables.iter())
                .filter(|(_, g)| g.space == naga::AddressSpace::WorkGroup)
                .map(|(_, g)| layouter[g.ty].size.next_multiple_of(16))
                .sum();
            let rows = shape.rows().unwrap();
            assert!(bytes <= shape.bytes_for(rows) + 64 && bytes <= shape.workgroup_bytes, "{bytes} for {rows} rows");
        }
        assert_eq!(Shape::default().rows(), Some(16));
        let halves = Extensions { f16: true, subgroups: false };
        let half = Shape { precision: Precision::F16, extensions: halves, ..Shape::default() };
        assert_eq!(half.rows(), Some(16));
        assert_eq!(Shape { component_quads: 10_000, ..Shape::default() }.rows(), None);
    }
}
