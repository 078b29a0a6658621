//! `KHR_gaussian_splatting`: primitives whose vertices are Gaussian splats, as attributes or, by
//! `KHR_gaussian_splatting_compression_spz_2`, as an SPZ stream.
//!
//! Scales are standard deviations or, if any of a primitive is negative, their logarithms, which splat-transform wrote until
//! June 2026. Opacities are in \[0, 1\], rotations are x, y, z, w, colors are coefficients of degree 0, of
//! sRGB or linear colors by `colorSpace`. Kernels other than the ellipse are read as one, as the extension advises. SPZ has
//! axes right, up, back, glTF left, up, front, so streams are turned by half a turn about y. Indices are ignored.

use std::collections::HashMap;

use glam::{DMat4, DVec3};
use gltf::json::accessor::{ComponentType, Type};
use gltf::json::buffer::View;
use gltf::json::mesh::{Mode, Primitive as Json};
use gltf::json::validation::Checked;
use gltf::json::{Accessor, Index};
use gltf::mesh::Semantic;
use serde::Deserialize;
use serde_json::{Map, Value};

use super::super::splats::{Splat, SpzSplats, channels_of, report};
use super::super::{Fault, ReadOptions, Transformed, Visitor};
use super::accessor::Values;
use super::buffers::Buffers;
use super::document::{CornerBudget, get};
use super::draco::Draco;
use super::primitive::{PRIMITIVE_COST, srgb, types};
use strivec_format::color::byte;

pub(super) const NAME: &str = "KHR_gaussian_splatting";
/// The extension of SPZ streams, and its name in an earlier draft.
pub(super) const SPZ_NAMES: [&str; 2] =
    ["KHR_gaussian_splatting_compression_spz_2", "KHR_gaussian_splatting_compression_spz"];
/// The prefix of the names of the extension's attributes.
const PREFIX: &str = "KHR_gaussian_splatting:";
/// The color space whose values are not sRGB.
const LINEAR: &str = "lin_rec709_display";

/// The extension of a primitive.
#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Splatting {
    #[serde(default)]
    color_space: String,
    /// By their names without the prefix: see [`move_attributes`].
    #[serde(default)]
    attributes: HashMap<String, Index<Accessor>>,
    #[serde(default)]
    extensions: Compressions,
}

#[derive(Default, Deserialize)]
struct Compressions {
    #[serde(rename = "KHR_gaussian_splatting_compression_spz_2", alias = "KHR_gaussian_splatting_compression_spz")]
    spz: Option<Spz>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Spz {
    buffer_view: Index<View>,
}

/// Moves the attributes of splats of the JSON `primitive` into the extension, which a primitive with such attributes gets if
/// it has none: it is no cloud of bare points.
pub(super) fn move_attributes(primitive: &mut Value) {
    let Some(attributes) = primitive.get_mut("attributes").and_then(Value::as_object_mut) else { return };
    let own: Map<String, Value> = attributes
        .iter()
        .filter_map(|(name, index)| Some((name.strip_prefix(PREFIX)?.to_owned(), index.clone())))
        .collect();
    if own.is_empty() {
        return;
    }
    attributes.retain(|name, _| !name.starts_with(PREFIX));
    let mut place = Some(primitive);
    for key in ["extensions", NAME] {
        let object = place.and_then(Value::as_object_mut);
        place = object.map(|object| object.entry(key).or_insert_with(|| Value::Object(Map::new())));
    }
    if let Some(extension) = place.and_then(Value::as_object_mut) {
        extension.insert("attributes".into(), own.into());
    }
}

/// A primitive of splats.
pub(super) struct SplatPrimitive<'b> {
    source: SplatSource<'b>,
    /// True if colors are linear.
    is_linear: bool,
}

enum SplatSource<'b> {
    Attributes(Box<SplatAttributes<'b>>),
    Spz(&'b SpzSplats),
}

struct SplatAttributes<'b> {
    positions: Values<'b>,
    rotations: Values<'b>,
    scales: Values<'b>,
    opacities: Values<'b>,
    colors: Option<Values<'b>>,
}

impl<'b> SplatPrimitive<'b> {
    /// The primitive `json` at `place`; `None` if it has no splats.
    ///
    /// # Errors
    ///
    /// If an attribute is missing or of another type than the extension allows.
    pub(super) fn of(
        json: &Json,
        place: &dyn Fn() -> String,
        buffers: &'b Buffers<'_>,
        budget: &mut CornerBudget,
    ) -> Result<Option<Self>, Fault> {
        let Some(extension) = json.extensions.as_ref().and_then(|all| all.others.get(NAME)) else { return Ok(None) };
        let extension = Splatting::deserialize(extension)
            .map_err(|error| Fault::broken(place(), format!("invalid extension {NAME}: {error}")))?;
        budget.spend(PRIMITIVE_COST + extension.attributes.len() as u64)?;
        if json.mode != Checked::Valid(Mode::Points) {
            return Err(Fault::malformed(place(), "the mode 0 of splats, points", "another one"));
        }
        if Draco::of(json, place)?.is_some() {
            let what = format!("{}: Draco compression of splats", place());
            return Err(Fault::unsupported(what, "export them as SPZ, or without compression"));
        }
        let source = match &extension.extensions.spz {
            Some(spz) => SplatSource::Spz(buffers.spz(spz.buffer_view)?),
            None => SplatSource::Attributes(Box::new(SplatAttributes::of(json, &extension, place, buffers, budget)?)),
        };
        Ok(Some(Self { source, is_linear: extension.color_space == LINEAR }))
    }

    /// Passes the splats to `visitor`, transformed by `world`. `bytes` is the length of the file, for progress.
    pub(super) fn read(
        &self,
        world: &DMat4,
        options: &ReadOptions,
        place: &dyn Fn() -> String,
        budget: &mut CornerBudget,
        bytes: u64,
        visitor: &mut dyn Visitor,
    ) -> Result<(), Fault> {
        let of_splat = || format!("a splat of {}", place());
        let mut placed = Transformed { visitor, transform: *world, place: &of_splat };
        match &self.source {
            SplatSource::Spz(splats) => {
                budget.spend(splats.count())?;
                placed.transform *= DMat4::from_scale(DVec3::new(-1.0, 1.0, -1.0));
                splats.pass(options, bytes, &mut placed)
            }
            SplatSource::Attributes(attributes) => {
                let SplatAttributes { positions, rotations, scales, opacities, colors } = &**attributes;
                budget.spend(positions.count)?;
                let splats = 0..positions.count as usize;
                let are_logarithms = splats.clone().any(|n| scales.vector::<3>(n).iter().any(|scale| *scale < 0.0));
                for n in splats {
                    report(n as u64, positions.count, bytes, &mut placed)?;
                    let place = || format!("splat {n} of {}", place());
                    let deviations: [f64; 3] = scales.vector(n);
                    let [x, y, z, w] = rotations.vector(n);
                    let [opacity] = opacities.vector(n);
                    let splat = Splat {
                        center: DVec3::from_array(positions.vector(n)),
                        deviations: if are_logarithms { deviations.map(f64::exp) } else { deviations },
                        rotation: [w, x, y, z],
                        opacity,
                        color: colors.as_ref().map(|colors| self.color(colors.vector(n))),
                    };
                    splat.pass(options, &mut placed, place)?;
                }
                Ok(())
            }
        }
    }

    /// The sRGB color of coefficients of degree 0.
    fn color(&self, coefficients: [f64; 3]) -> [u8; 3] {
        channels_of(coefficients).map(if self.is_linear { srgb } else { byte })
    }
}

impl<'b> SplatAttributes<'b> {
    fn of(
        json: &Json,
        extension: &Splatting,
        place: &dyn Fn() -> String,
        buffers: &'b Buffers<'_>,
        budget: &mut CornerBudget,
    ) -> Result<Self, Fault> {
        let position = json.attributes.get(&Checked::Valid(Semantic::Positions)).copied();
        let mut count = None;
        let mut attribute = |name: &str, index: Option<Index<Accessor>>, shape: Type, expected: &str| {
            let Some(index) = index else { return Ok(None) };
            let accessor = get(&buffers.document.accessors, index, "accessor")?;
            if accessor.buffer_view.is_none() && accessor.sparse.is_none() {
                let problem =
                    format!("{name} has no buffer view; the splats are compressed in a way that is not supported");
                return Err(Fault::broken(place(), problem));
            }
            let values = Values::of(buffers, index, None, budget)?;
            if values.shape != shape || values.component == ComponentType::U32 {
                return Err(Fault::malformed(place(), format!("{name} of {expected}"), types(&values)));
            }
            if *count.get_or_insert(values.count) != values.count {
                let expected = format!("{} elements of {name}", count.unwrap_or_default());
                return Err(Fault::malformed(place(), expected, values.count));
            }
            Ok(Some(values))
        };
        let own = |name: &str| extension.attributes.get(name).copied();
        let missing = |name: &str| Fault::broken(place(), format!("the attribute {name} of splats is missing"));
        let of_three = "three floats or small integers";
        let positions = attribute("POSITION", position, Type::Vec3, of_three)?;
        let mut required = |name: &str, shape, expected| {
            attribute(name, own(name), shape, expected)?.ok_or_else(|| missing(&format!("{PREFIX}{name}")))
        };
        let rotations = required("ROTATION", Type::Vec4, "four floats or small integers")?;
        let scales = required("SCALE", Type::Vec3, of_three)?;
        let opacities = required("OPACITY", Type::Scalar, "floats or small integers")?;
        let color = "SH_DEGREE_0_COEF_0";
        Ok(Self {
            positions: positions.ok_or_else(|| missing("POSITION"))?,
            rotations,
            scales,
            opacities,
            colors: attribute(color, own(color), Type::Vec3, of_three)?,
        })
    }
}
