//! Validation and layout of shaders by naga, for tests.

use wgpu::naga;

/// The module of `source` and naga's information about it, or the error.
pub fn validated(source: &str) -> Result<(naga::Module, naga::valid::ModuleInfo), String> {
    let module = naga::front::wgsl::parse_str(source).map_err(|e| e.emit_to_string(source))?;
    // Every backend can unpack halves. The other two capabilities are for shapes with extensions.
    use naga::valid::Capabilities;
    let capabilities = Capabilities::SHADER_FLOAT16_IN_FLOAT32 | Capabilities::SHADER_FLOAT16 | Capabilities::SUBGROUP;
    let mut validator = naga::valid::Validator::new(naga::valid::ValidationFlags::all(), capabilities);
    validator.subgroup_operations(naga::valid::SubgroupOperationSet::all());
    validator.subgroup_stages(naga::valid::ShaderStages::COMPUTE);
    let info = validator.validate(&module).map_err(|e| e.emit_to_string(source))?;
    Ok((module, info))
}

/// Names and offsets of the members of `source`'s struct `name`, without padding, and its size.
pub fn members_of(source: &str, name: &str) -> (Vec<(String, u32)>, u32) {
    let (module, _) = validated(source).unwrap();
    let (_, found) = module.types.iter().find(|(_, t)| t.name.as_deref() == Some(name)).expect(name);
    let naga::TypeInner::Struct { members, span } = &found.inner else { panic!("{name} is no struct") };
    let members = members.iter().map(|m| (m.name.clone().unwrap(), m.offset));
    (members.filter(|m| !m.0.starts_with("padding")).collect(), *span)
}

/// Compares a struct of `source` with its Rust twin, all of whose members but padding are listed. Returns the number of
/// further members of the shader's struct, and its size.
#[doc(hidden)]
#[macro_export]
macro_rules! assert_same_layout {
    ($source:expr, $wgsl:literal, $rust:ty, $($member:ident),+) => {{
        let (members, size) = $crate::render::gpu::testing::members_of($source, $wgsl);
        let own = [$((stringify!($member).to_owned(), std::mem::offset_of!($rust, $member) as u32)),+];
        assert_eq!(members[..own.len().min(members.len())], own, $wgsl);
        let more = members.len() - own.len();
        if more == 0 {
            assert_eq!(size, size_of::<$rust>() as u32, $wgsl);
        }
        (more, size)
    }};
}
pub use crate::assert_same_layout;
