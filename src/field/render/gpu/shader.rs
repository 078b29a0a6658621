//! The WGSL of each stage: a prelude of constants generated from the scene's shape, and files of `shaders/`.

use std::fmt::Write as _;

use strivec_format::model::{Aggregation, Coverage, DecoderMode, Reduction, Sky};

/// Pixels along the edge of a tile. Its rays share a workgroup because they meet mostly the same tensors.
pub(super) const TILE: u32 = 8;
/// Rays of a workgroup.
pub(super) const RAY_LANES: u32 = TILE * TILE;
/// Rays of a workgroup of the compaction.
pub(super) const COMPACT_LANES: u32 = 256;
/// Invocations of a workgroup of the decoder.
const LANES: u32 = 128;
/// Slots of a block. The first one holds the number of the next block.
pub(super) const SLOTS: u32 = 8;
/// The most workgroups along a dimension on every device.
const MAX_ACROSS: u32 = 65535;
/// Log₂ of the quads of one binding of the scene buffer: 128 MiB, which every device allows.
pub(super) const CHUNK_SHIFT: u32 = 23;
/// The first binding of the scene buffer.
pub(super) const FIRST_CHUNK: u32 = 8;
/// Log₂ of the quads of a row, if the scene buffer is a texture.
pub(super) const TEXTURE_SHIFT: u32 = 13;
/// Bytes of an interpolation site in the decoder's workgroup memory.
const SITE_BYTES: u32 = 32;

/// The precision of factors on the device.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Precision {
    /// 32 bits.
    #[default]
    F32,
    /// Factors are rounded to 16 bits, which halves memory and bandwidth. If the device supports 16-bit floats, so are
    /// the activations between the decoder's layers. Sums are in 32 bits.
    F16,
}

/// The WGSL extensions that shaders use if the device supports them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Extensions {
    /// 16-bit floats.
    pub(super) f16: bool,
    /// Subgroup operations.
    pub(super) subgroups: bool,
}

/// The parameters that shaders are generated for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct ShaderShape {
    pub(super) precision: Precision,
    pub(super) extensions: Extensions,
    /// True for a software device: the scene buffer is a texture, which such devices read several times as fast, and each
    /// lane of the decoder gathers the components of a row of its own.
    pub(super) is_software: bool,
    /// Number of bindings of the scene buffer.
    pub(super) chunks: u32,
    /// Log₂ of the quads of one binding.
    pub(super) chunk_shift: u32,
    pub(super) scales: u32,
    /// The largest `top_k` of all scales.
    pub(super) top_k: u32,
    pub(super) layers: u32,
    /// The most inputs of a layer.
    pub(super) inputs: u32,
    /// The largest number of outputs of a layer, or of features, in quads.
    pub(super) output_quads: u32,
    /// Appearance components of all scales in quads, each block's padded.
    pub(super) component_quads: u32,
    /// Blocks of a scale on the device: 3 if a scale has components with a matrix, else 1.
    pub(super) blocks: u32,
    pub(super) features: u32,
    pub(super) feature_frequencies: u32,
    pub(super) direction_frequencies: u32,
    /// True if the scene has a grid of cells in which samples can count.
    pub(super) has_grid: bool,
    pub(super) contracted: bool,
    /// The degree of the sky; 0 if there is none.
    pub(super) sky_degree: u32,
    pub(super) coverage: Coverage,
    pub(super) density_reduction: Reduction,
    pub(super) appearance_reduction: Reduction,
    pub(super) aggregation: Aggregation,
    pub(super) decoder_mode: DecoderMode,
    /// Bytes of workgroup memory.
    pub(super) workgroup_bytes: u32,
}

impl ShaderShape {
    /// Quads of the sky's coefficients.
    pub(super) fn sky_terms(&self) -> u32 {
        Sky::terms(self.sky_degree) as u32
    }

    /// Rows of the decoder's tile: as many as fit, a multiple of four; `None` if four do not fit.
    pub(super) fn rows(&self) -> Option<u32> {
        [32, 16, 8, 4].into_iter().find(|&rows| self.bytes_for(rows) <= self.workgroup_bytes)
    }

    /// Bytes of the decoder's workgroup memory with `rows` rows.
    fn bytes_for(&self, rows: u32) -> u32 {
        let own_color = if self.decoder_mode == DecoderMode::Residual { 12 } else { 0 };
        let row_bytes = SITE_BYTES * self.scales * self.top_k * self.blocks + 4 * self.scales + 16 + own_color;
        let number_bytes = if self.has_f16_tile() { 2 } else { 4 };
        let per_row = number_bytes * self.tile_columns() + row_bytes;
        rows * per_row + 48
    }

    /// True if the decoder's tile holds 16-bit floats.
    fn has_f16_tile(&self) -> bool {
        self.precision == Precision::F16 && self.extensions.f16
    }

    /// Columns of the decoder's tile.
    pub(super) fn tile_columns(&self) -> u32 {
        self.inputs.max(4 * self.component_quads.max(self.output_quads))
    }

    /// The prelude: constants, and access to the scene buffer and to factors.
    fn prelude(&self) -> String {
        let rows = self.rows().unwrap_or(4);
        let mut text = String::from("// Made from the scene's shape: see src/render/gpu/shader.rs.\n");
        // naga accepts subgroup operations without `enable subgroups;` and rejects the directive.
        if self.has_f16_tile() {
            text += "enable f16;\n";
        }
        for (name, value) in [
            ("SCALES", self.scales),
            ("TOP_K", self.top_k),
            ("BLOCKS", self.blocks),
            ("LAYERS", self.layers),
            ("OUTPUT_QUADS", self.output_quads),
            ("COMPONENT_QUADS", self.component_quads),
            ("COMPONENTS", 4 * self.component_quads),
            ("FEATURES", self.features),
            ("FEATURE_QUADS", self.features.div_ceil(4)),
            ("FEATURE_FREQUENCIES", self.feature_frequencies),
            ("DIRECTION_FREQUENCIES", self.direction_frequencies),
            ("SKY_TERMS", self.sky_terms()),
            ("TILE", TILE),
            ("RAY_LANES", RAY_LANES),
            ("COMPACT_LANES", COMPACT_LANES),
            ("LANES", LANES),
            ("SLOTS", SLOTS),
            ("MAX_ACROSS", MAX_ACROSS),
            ("ROWS", rows),
            ("TILE_QUADS", self.tile_columns() * rows / 4),
            ("SITES", rows * self.scales * self.top_k * self.blocks),
            ("OWN_COLOR_QUADS", if self.decoder_mode == DecoderMode::Residual { 3 * rows / 4 } else { 1 }),
        ] {
            let _ = writeln!(text, "const {name}: u32 = {value}u;");
        }
        for (name, value) in [
            ("HAS_GRID", self.has_grid),
            ("CONTRACTED", self.contracted),
            ("HAS_SKY", self.sky_degree > 0),
            ("COVERAGE_IS_ALL", self.coverage == Coverage::All),
            ("DENSITY_IS_MEAN", self.density_reduction == Reduction::Mean),
            ("APPEARANCE_IS_MEAN", self.appearance_reduction == Reduction::Mean),
            ("IS_CLAMPED", self.aggregation == Aggregation::Clamped),
            ("DECODES_SAMPLES", self.decoder_mode == DecoderMode::PerSample),
            ("SAMPLES_HAVE_COLORS", self.decoder_mode == DecoderMode::Residual),
        ] {
            let _ = writeln!(text, "const {name}: bool = {value};");
        }
        self.write_scene_access(&mut text);
        text += match self.precision {
            Precision::F32 => "fn factor(i: u32) -> vec4<f32> {\n    return bitcast<vec4<f32>>(quad(i));\n}\n",
            Precision::F16 => {
                "fn factor(i: u32) -> vec4<f32> {\n    let both = quad(i >> 1u);\n    let halves = select(both.xy, both.zw, (i & 1u) == 1u);\n    \
                 return vec4(unpack2x16float(halves.x), unpack2x16float(halves.y));\n}\n"
            }
        };
        text += if self.has_f16_tile() {
            "alias Kept = vec4<f16>;\nfn kept(x: vec4<f32>) -> Kept {\n    return Kept(clamp(x, vec4(-65504.0), vec4(65504.0)));\n}\n"
        } else {
            "alias Kept = vec4<f32>;\nfn kept(x: vec4<f32>) -> Kept {\n    return x;\n}\n"
        };
        text
    }

    /// The declaration of the scene buffer, and `quad`, which reads it.
    fn write_scene_access(&self, text: &mut String) {
        const QUAD: &str = "fn quad(i: u32) -> vec4<u32>";
        // llvmpipe reads a buffer number by number and a texture by vectors, several times as fast
        // (docs/experiments/2026-11-28-software-device.md).
        if self.is_software {
            let mask = (1_u32 << TEXTURE_SHIFT) - 1;
            let _ = writeln!(text, "@group(0) @binding({FIRST_CHUNK}) var quads: texture_2d<u32>;");
            let load = format!("textureLoad(quads, vec2(i & {mask}u, i >> {TEXTURE_SHIFT}u), 0)");
            let _ = writeln!(text, "{QUAD} {{\n    return {load};\n}}");
            return;
        }
        for chunk in 0..self.chunks {
            let binding = FIRST_CHUNK + chunk;
            let _ = writeln!(text, "@group(0) @binding({binding}) var<storage, read> quads{chunk}: array<vec4<u32>>;");
        }
        let _ = writeln!(text, "{QUAD} {{");
        if self.chunks > 1 {
            // Every device allows 128 MiB to a binding. A scene of one binding is read without the switch.
            let (shift, mask) = (self.chunk_shift, (1_u32 << self.chunk_shift) - 1);
            let _ = writeln!(text, "    let within = i & {mask}u;\n    switch i >> {shift}u {{");
            for chunk in 1..self.chunks {
                let _ = writeln!(text, "        case {chunk}u: {{ return quads{chunk}[within]; }}");
            }
            *text += "        default: { return quads0[within]; }\n    }\n}\n";
        } else {
            *text += "    return quads0[i];\n}\n";
        }
    }
}

strivec_format::named! {
    /// The stages of a batch, in order.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub(super) enum ShaderStage {
        Rays = "rays",
        March = "march",
        Compact = "compact",
        Workgroups = "workgroups",
        Decoder = "decoder",
        Resolve = "resolve",
        /// Only if normals are on.
        Normals = "normals",
    }
}

impl ShaderStage {
    /// The shader's files after the prelude.
    fn files(self, shape: &ShaderShape) -> &'static [&'static str] {
        use strivec_shaders::{
            CELLS, COMPACT, COMPACT_ALLOC, COMPACT_ALLOC_SUBGROUP, COMPONENTS_BY_LANE, COMPONENTS_BY_TILE, DECODER,
            DENSITY, GATHER, LAYOUT, MARCH, NEIGHBORS, NORMALS, PATH, RAY_MARCHER, RAYS, REAL, RESOLVE, SCENE_BUFFER,
            SKY, WORKGROUPS,
        };
        match self {
            Self::Rays => &[LAYOUT, PATH, RAYS],
            Self::March => &[LAYOUT, SCENE_BUFFER, REAL, PATH, CELLS, RAY_MARCHER, NEIGHBORS, GATHER, DENSITY, MARCH],
            // Subgroups allocate without barriers.
            Self::Compact if shape.extensions.subgroups => &[LAYOUT, COMPACT_ALLOC_SUBGROUP, COMPACT],
            Self::Compact => &[LAYOUT, COMPACT_ALLOC, COMPACT],
            Self::Workgroups => &[LAYOUT, WORKGROUPS],
            // A lane per row needs about 50 loops for a sample. By tiles, rays of many samples exceeded the 65 535 at
            // which llvmpipe ends loops, and their colors were wrong
            // (docs/experiments/2026-11-28-software-device.md).
            Self::Decoder if shape.is_software => {
                &[LAYOUT, SCENE_BUFFER, REAL, PATH, NEIGHBORS, GATHER, COMPONENTS_BY_LANE, DECODER]
            }
            Self::Decoder => &[LAYOUT, SCENE_BUFFER, REAL, PATH, NEIGHBORS, GATHER, COMPONENTS_BY_TILE, DECODER],
            Self::Resolve => &[LAYOUT, REAL, SKY, RESOLVE],
            Self::Normals => &[LAYOUT, SCENE_BUFFER, REAL, PATH, NEIGHBORS, GATHER, DENSITY, NORMALS],
        }
    }

    /// The bindings of `shaders/layout.wgsl` that the stage uses, and whether it reads the scene buffer.
    pub(super) fn bindings(self) -> (&'static [u32], bool) {
        match self {
            Self::Rays => (&[0, 1, 2], false),
            Self::March => (&[0, 1, 2, 3, 5], true),
            Self::Compact => (&[1, 2, 3, 4, 5], false),
            Self::Workgroups => (&[5, 6], false),
            Self::Decoder => (&[0, 2, 4, 5], true),
            Self::Resolve => (&[0, 1, 2, 4, 7], false),
            Self::Normals => (&[0, 1, 2, 7], true),
        }
    }

    /// The complete shader for scenes of `shape`.
    pub(super) fn source(self, shape: &ShaderShape) -> String {
        shape.prelude() + &self.files(shape).join("\n")
    }
}

#[cfg(test)]
impl Default for ShaderShape {
    /// The paper's configuration.
    fn default() -> Self {
        Self {
            precision: Precision::F32,
            extensions: Extensions::default(),
            is_software: false,
            chunks: 1,
            chunk_shift: CHUNK_SHIFT,
            scales: 3,
            top_k: 4,
            layers: 3,
            inputs: 150,
            output_quads: 32,
            component_quads: 36,
            blocks: 1,
            features: 27,
            feature_frequencies: 2,
            direction_frequencies: 2,
            has_grid: true,
            contracted: false,
            sky_degree: 0,
            coverage: Coverage::All,
            density_reduction: Reduction::Sum,
            appearance_reduction: Reduction::Sum,
            aggregation: Aggregation::Normalized,
            decoder_mode: DecoderMode::PerSample,
            workgroup_bytes: 16352,
        }
    }
}

#[cfg(test)]
mod tests {
    use wgpu::naga;

    use super::*;
    use crate::render::gpu::testing::validated;

    fn shapes() -> Vec<ShaderShape> {
        let paper = ShaderShape::default();
        let both = Extensions { f16: true, subgroups: true };
        vec![
            ShaderShape { precision: Precision::F16, chunks: 3, ..paper.clone() },
            ShaderShape { precision: Precision::F16, extensions: both, ..paper.clone() },
            ShaderShape { extensions: both, decoder_mode: DecoderMode::Residual, ..paper.clone() },
            ShaderShape { decoder_mode: DecoderMode::PerRay, ..paper.clone() },
            ShaderShape { is_software: true, ..paper.clone() },
            ShaderShape { is_software: true, decoder_mode: DecoderMode::Residual, blocks: 3, ..paper.clone() },
            ShaderShape {
                is_software: true,
                precision: Precision::F16,
                extensions: both,
                decoder_mode: DecoderMode::PerRay,
                appearance_reduction: Reduction::Mean,
                ..paper.clone()
            },
            ShaderShape { contracted: true, ..paper.clone() },
            ShaderShape { blocks: 3, ..paper.clone() },
            ShaderShape { sky_degree: 1, ..paper.clone() },
            ShaderShape { sky_degree: 4, decoder_mode: DecoderMode::PerRay, ..paper.clone() },
            ShaderShape { decoder_mode: DecoderMode::Residual, density_reduction: Reduction::Mean, ..paper.clone() },
            ShaderShape {
                scales: 1,
                top_k: 16,
                layers: 1,
                inputs: 300,
                output_quads: 7,
                component_quads: 1,
                has_grid: false,
                ..paper.clone()
            },
            ShaderShape {
                coverage: Coverage::Any,
                appearance_reduction: Reduction::Mean,
                aggregation: Aggregation::Clamped,
                ..paper.clone()
            },
            ShaderShape {
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
            for stage in ShaderStage::ALL {
                let source = stage.source(&shape);
                validated(&source).unwrap_or_else(|e| panic!("{}: {e}\n{shape:?}", stage.name()));
            }
        }
        let broken = ShaderStage::March.source(&ShaderShape::default()).replace("fn advance", "fn advanced");
        assert!(validated(&broken).is_err());
    }

    #[test]
    fn stages_use_their_bindings_and_at_most_four_storage_buffers() {
        let both = [false, true].map(|is_software| ShaderShape { is_software, ..ShaderShape::default() });
        for (shape, stage) in both.iter().flat_map(|shape| ShaderStage::ALL.map(|stage| (shape, stage))) {
            let (module, info) = validated(&stage.source(shape)).unwrap();
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
    fn every_shader_names_its_twin_in_its_head() {
        let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
        for entry in std::fs::read_dir(root.join("shaders")).unwrap() {
            let path = entry.unwrap().path();
            if path.extension().is_none_or(|ending| ending != "wgsl") {
                continue;
            }
            let source = std::fs::read_to_string(&path).unwrap();
            let head: Vec<&str> = source.lines().map_while(|line| line.strip_prefix("// ")).collect();
            let head = head.join(" ");
            let words = head.split([' ', ',', ';']).map(|word| word.trim_end_matches('.'));
            let twins: Vec<&str> = words.filter(|word| word.starts_with("src/") && word.ends_with(".rs")).collect();
            assert!(!twins.is_empty() || head.contains("No twin."), "{}: {head}", path.display());
            assert!(twins.iter().all(|twin| root.join(twin).exists()), "{}: {twins:?}", path.display());
        }
    }

    #[test]
    fn the_decoder_fits_in_workgroup_memory() {
        for shape in shapes() {
            let (module, _) = validated(&ShaderStage::Decoder.source(&shape)).unwrap();
            let mut layouter = naga::proc::Layouter::default();
            layouter.update(module.to_ctx()).unwrap();
            let bytes: u32 = (module.global_variables.iter())
                .filter(|(_, g)| g.space == naga::AddressSpace::WorkGroup)
                .map(|(_, g)| layouter[g.ty].size.next_multiple_of(16))
                .sum();
            let rows = shape.rows().unwrap();
            assert!(bytes <= shape.bytes_for(rows) + 64 && bytes <= shape.workgroup_bytes, "{bytes} for {rows} rows");
        }
        assert_eq!(ShaderShape::default().rows(), Some(16));
        let halves = Extensions { f16: true, subgroups: false };
        let half = ShaderShape { precision: Precision::F16, extensions: halves, ..ShaderShape::default() };
        assert_eq!(half.rows(), Some(16));
        assert_eq!(ShaderShape { component_quads: 10_000, ..ShaderShape::default() }.rows(), None);
    }
}
