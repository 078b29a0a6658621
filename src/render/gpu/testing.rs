//! What tests ask naga about shaders.

use wgpu::naga;

/// What the validator says of `source`: the module and what it found out, or why it is none.
pub(crate) fn validated(source: &str) -> Result<(naga::Module, naga::valid::ModuleInfo), String> {
    let module = naga::front::wgsl::parse_str(source).map_err(|e| e.emit_to_string(source))?;
    // Every backend can unpack halves; the other two are for what asks for them.
    use naga::valid::Capabilities;
    let capabilities = Capabilities::SHADER_FLOAT16_IN_FLOAT32 | Capabilities::SHADER_FLOAT16 | Capabilities::SUBGROUP;
    let mut validator = naga::valid::Validator::new(naga::valid::ValidationFlags::all(), capabilities);
    validator.subgroup_operations(naga::valid::SubgroupOperationSet::all());
    validator.subgroup_stages(naga::valid::ShaderStages::COMPUTE);
    let info = validator.validate(&module).map_err(|e| e.emit_to_string(source))?;
    Ok((module, info))
}

/// Names and offsets of the members of `source`'s struct `name`, padding apart, and its size.
pub(crate) fn members_of(source: &str, name: &str) -> (Vec<(String, u32)>, u32) {
    let (module, _) = validated(source).unwrap();
    let (_, found) = module.types.iter().find(|(_, t)| t.name.as_deref() == Some(name)).expect(name);
    let naga::TypeInner::Struct { members, span } = &found.inner else { panic!("{name} is no struct") };
    let members = members.iter().map(|m| (m.name.clone().unwrap(), m.offset));
    (members.filter(|m| !m.0.starts_with("padding")).collect(), *span)
}

/// Compares a struct of `source` with its Rust twin, of which all members but padding are named; returns how many more the
/// shader's has.
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
pub(crate) use assert_same_layout;
