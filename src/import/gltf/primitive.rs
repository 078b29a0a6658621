//! A mesh's primitive: its vertices, their topology and their colors.

use std::sync::LazyLock;

use glam::{DMat4, DVec3};
use gltf::json::accessor::{ComponentType, Type};
use gltf::json::mesh::{Mode, Primitive as Json};
use gltf::json::validation::Checked;
use gltf::mesh::Semantic;

use super::super::{Fault, Point, Visitor};
use super::accessor::Values;
use super::buffers::Buffers;
use super::document::CornerBudget;
use super::draco::Draco;

/// Corners charged for a primitive itself, so that empty ones are limited too.
pub(super) const PRIMITIVE_COST: u64 = 64;
/// Corners between two reports of progress.
const REPORT_EVERY: u64 = 1 << 17;

pub(super) struct Primitive<'b> {
    mode: Mode,
    positions: Values<'b>,
    colors: Option<Values<'b>>,
    indices: Option<Values<'b>>,
}

impl<'b> Primitive<'b> {
    /// The primitive `json` at `place`; `None` if it has no positions or consists of lines.
    ///
    /// # Errors
    ///
    /// If an accessor has another type than the format allows.
    pub(super) fn of(
        json: &Json,
        place: &dyn Fn() -> String,
        buffers: &'b Buffers<'_>,
        budget: &mut CornerBudget,
    ) -> Result<Option<Self>, Fault> {
        budget.spend(PRIMITIVE_COST)?;
        let wrong = |expected: &str, found: String| Err(Fault::malformed(place(), expected, found));
        let mode = match json.mode {
            Checked::Valid(Mode::Lines | Mode::LineLoop | Mode::LineStrip) => return Ok(None),
            Checked::Valid(mode) => mode,
            Checked::Invalid => return wrong("a mode from 0 to 6", "another one".into()),
        };
        let draco = Draco::of(json, place)?;
        let mesh = draco.as_ref().map(|draco| buffers.draco(draco.buffer_view)).transpose()?;
        if mesh.is_some() && mode != Mode::Triangles {
            return Err(Fault::unsupported(format!("{}: Draco compression of {mode:?}", place()), "export triangles"));
        }
        let mut attribute = |semantic, name| {
            let id = draco.as_ref().and_then(|draco| draco.attributes.get(name).copied());
            let accessor = json.attributes.get(&Checked::Valid(semantic));
            accessor.map(|&accessor| Values::of(buffers, accessor, mesh.zip(id), budget)).transpose()
        };
        let Some(positions) = attribute(Semantic::Positions, "POSITION")? else { return Ok(None) };
        let colors = attribute(Semantic::Colors(0), "COLOR_0")?;
        let indices = match mesh {
            Some(mesh) => Some(Values::indices(buffers, json.indices, mesh)?),
            None => json.indices.map(|accessor| Values::of(buffers, accessor, None, budget)).transpose()?,
        };

        // KHR_mesh_quantization allows the small integers.
        if positions.shape != Type::Vec3 || positions.component == ComponentType::U32 {
            return wrong("positions of three floats or small integers", types(&positions));
        }
        if let Some(colors) = &colors {
            let is_known = match colors.component {
                ComponentType::F32 => true,
                ComponentType::U8 | ComponentType::U16 => colors.normalized,
                _ => false,
            };
            if !is_known || !matches!(colors.shape, Type::Vec3 | Type::Vec4) {
                return wrong("colors of floats or normalized small integers", types(colors));
            }
            if colors.count != positions.count {
                return wrong(&format!("{} colors", positions.count), colors.count.to_string());
            }
        }
        if let Some(indices) = &indices {
            let is_unsigned = matches!(indices.component, ComponentType::U8 | ComponentType::U16 | ComponentType::U32);
            if indices.shape != Type::Scalar || !is_unsigned || indices.normalized {
                return wrong("indices of unsigned integers", types(indices));
            }
        }
        Ok(Some(Self { mode, positions, colors, indices }))
    }

    /// Passes the triangles or points, or only the vertices, to `visitor`, transformed by `world`. `bytes` is the
    /// length of the file, for progress.
    pub(super) fn read(
        &self,
        world: &DMat4,
        only_vertices: bool,
        place: &dyn Fn() -> String,
        budget: &mut CornerBudget,
        bytes: u64,
        visitor: &mut dyn Visitor,
    ) -> Result<(), Fault> {
        let indices = self.indices.as_ref().filter(|_| !only_vertices);
        let count = indices.map_or(self.positions.count, |indices| indices.count);
        budget.spend(count)?;
        let corner = |n: u64| {
            let vertex = match indices {
                Some(indices) => indices.vector::<1>(n as usize)[0] as u64,
                None => n,
            };
            if vertex >= self.positions.count {
                return Err(Fault::malformed(place(), format!("an index below {}", self.positions.count), vertex));
            }
            self.point(vertex as usize, world, place)
        };
        if only_vertices || self.mode == Mode::Points {
            for n in 0..count {
                Point::pass(corner(n), visitor)?;
                if n % REPORT_EVERY == REPORT_EVERY - 1 {
                    visitor.progress(bytes, bytes)?;
                }
            }
            return Ok(());
        }
        let triangles = if self.mode == Mode::Triangles { count / 3 } else { count.saturating_sub(2) };
        for n in 0..triangles {
            let [a, b, c] = match self.mode {
                Mode::TriangleStrip => [n, n + 1 + n % 2, n + 2 - n % 2],
                Mode::TriangleFan => [n + 1, n + 2, 0],
                _ => [3 * n, 3 * n + 1, 3 * n + 2],
            };
            match (corner(a), corner(b), corner(c)) {
                (Ok(a), Ok(b), Ok(c)) => visitor.triangle([a, b, c])?,
                (Err(fault), ..) | (_, Err(fault), _) | (.., Err(fault)) => fault.pass(visitor)?,
            }
            if n % REPORT_EVERY == REPORT_EVERY - 1 {
                visitor.progress(bytes, bytes)?;
            }
        }
        Ok(())
    }

    fn point(&self, vertex: usize, world: &DMat4, place: &dyn Fn() -> String) -> Result<Point, Fault> {
        let position = world.transform_point3(DVec3::from_array(self.positions.vector(vertex)));
        let color = self.colors.as_ref().map(|colors| colors.vector(vertex).map(srgb));
        Point::new(position, color, || format!("vertex {vertex} of {}", place()))
    }
}

/// The type of an accessor, for errors.
pub(super) fn types(values: &Values<'_>) -> String {
    format!("{}{:?} of {:?}", if values.normalized { "normalized " } else { "" }, values.shape, values.component)
}

/// The sRGB byte of a linear value in \[0, 1\]. The table is finer than the steps of a byte everywhere.
pub(super) fn srgb(linear: f64) -> u8 {
    static BYTES: LazyLock<Vec<u8>> = LazyLock::new(|| {
        let encoded = |x: f64| if x <= 0.0031308 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 };
        (0..=u16::MAX).map(|n| (encoded(f64::from(n) / 65535.0) * 255.0).round() as u8).collect()
    });
    BYTES[(linear.clamp(0.0, 1.0) * 65535.0).round() as usize]
}
