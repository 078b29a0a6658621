//! The scene: a still life on a mosaic plinth. The geometry is always the same; a seed changes only the textures.
//!
//! Solids touch where they rest on each other but do not overlap, so each is a closed surface of its own.

use glam::{DMat3, DVec3};

use super::outdoor::Ground;
use super::portable::{cos_sin, hash};
use super::room;
use super::solid::{Face, Solid};
use super::surroundings::Surroundings;
use super::texture::Texture;
use super::thing::{FLOOR, Thing};
use strivec_format::geometry::{Aabb, Ray};

/// The solids and their surroundings; z is up. The still life is within \[−1, 1\]³.
pub(super) struct SyntheticScene {
    pub(super) things: Vec<Thing>,
    pub(super) surroundings: Surroundings,
    /// The ground under the solids; `None` indoors and without surroundings.
    pub(super) ground: Option<Ground>,
}

/// The intersection of a ray with the scene.
pub(super) struct Hit<'a> {
    pub(super) thing: &'a Thing,
    pub(super) t: f64,
    pub(super) face: Face,
}

impl SyntheticScene {
    /// The still life with textures of `seed`.
    pub(super) fn new(seed: u64) -> Self {
        let mut scene = Self { things: Vec::new(), surroundings: Surroundings::None, ground: None };
        let mut add = |solid, texture| {
            let texture_seed = hash(seed, scene.things.len() as u64);
            scene.things.push(Thing { solid, texture, texture_seed, lets_light_through: false });
        };
        add(Solid::rod(DVec3::new(0.0, 0.0, FLOOR - 0.06), 0.95, 0.06), Texture::Mosaic);
        add_wall(&mut add);
        add_bowl(&mut add);
        add_books(&mut add);
        add_pins(&mut add);
        add_brushes(&mut add);
        scene
    }

    /// The still life and its surroundings, with textures of `seed`, a dataset's.
    pub(super) fn within(surroundings: Surroundings, seed: u64) -> Self {
        let ground = match surroundings {
            Surroundings::Meadow => Some(Ground::Meadow(hash(seed, 6))),
            Surroundings::Floor => Some(Ground::Floor),
            Surroundings::None | Surroundings::Room => None,
        };
        let mut scene = Self { surroundings, ground, ..Self::new(hash(seed, 0)) };
        if surroundings == Surroundings::Room {
            scene.things.extend(room::things(hash(seed, 7)));
        }
        scene
    }

    /// Half the edge of a cube around the origin that contains all solids.
    pub(super) fn extent(&self) -> f64 {
        if self.surroundings == Surroundings::Room { room::EXTENT } else { 1.0 }
    }

    /// The radius of a ball around the origin that contains all solids.
    pub(super) fn radius(&self) -> f64 {
        if self.surroundings == Surroundings::Room { room::RADIUS } else { 1.35 }
    }

    /// The first surface that `ray` enters after distance `nearest`.
    pub(super) fn hit(&self, ray: &Ray, nearest: f64) -> Option<Hit<'_>> {
        let mut best: Option<Hit<'_>> = None;
        for thing in self.things.iter().filter(|thing| thing.solid.may_meet(ray)) {
            for [enter, _] in thing.solid.spans(ray).into_iter().flatten() {
                if enter.t > nearest && best.as_ref().is_none_or(|hit| enter.t < hit.t) {
                    best = Some(Hit { thing, t: enter.t, face: enter.face });
                }
            }
        }
        best
    }

    /// True if any point of `ray` after its origin is inside a solid that throws a shadow.
    pub(super) fn blocks(&self, ray: &Ray) -> bool {
        let meets = |solid: &Solid| solid.spans(ray).into_iter().flatten().any(|[_, leave]| leave.t > 0.0);
        self.things.iter().any(|thing| !thing.lets_light_through && thing.solid.may_meet(ray) && meets(&thing.solid))
    }
}

/// A standing tiled wall with a round hole, and a pole that rests in it.
fn add_wall(add: &mut impl FnMut(Solid, Texture)) {
    let (cos, sin) = cos_sin(1.0 / 30.0);
    // Columns: along the wall, up, and through the hole.
    let turn = DMat3::from_cols(DVec3::new(cos, sin, 0.0), DVec3::Z, DVec3::new(sin, -cos, 0.0));
    let center = DVec3::new(0.0, 0.36, FLOOR + 0.85);
    let bounds = Aabb { min: DVec3::new(-0.45, -0.85, -0.09), max: DVec3::new(0.45, 0.5, 0.09) };
    add(Solid::pierced_block(center, bounds, 0.26).turned(turn), Texture::Tiles);
    let rest = center - DVec3::Z * (0.26 - 0.03);
    add(Solid::rod(rest, 0.03, 0.48).turned(turn), Texture::Helix([0xf4eee0, 0xb3261e]));
}

/// A tilted bowl with two fruits in it.
fn add_bowl(add: &mut impl FnMut(Solid, Texture)) {
    let center = DVec3::new(-0.5, -0.3, FLOOR + 0.34);
    let (cos, sin) = cos_sin(0.03);
    let tilt = DMat3::from_cols(DVec3::new(cos, 0.0, -sin), DVec3::Y, DVec3::new(sin, 0.0, cos));
    add(Solid::bowl(center, 0.28, 0.34).turned(tilt), Texture::Glaze);
    for (side, color) in [(1.0, 0xf08a1d), (-1.0, 0x9cc22c)] {
        let (down, aside) = cos_sin(0.115);
        add(
            Solid::sphere(center + 0.17 * DVec3::new(0.28 * side * aside, 0.96 * side * aside, -down), 0.11),
            Texture::Peel(color),
        );
    }
}

/// Three books with a glossy ball on top.
fn add_books(add: &mut impl FnMut(Solid, Texture)) {
    let mut floor = FLOOR;
    for (half, turns, cover) in [
        (DVec3::new(0.27, 0.20, 0.048), 0.06, 0x1f4e79),
        (DVec3::new(0.25, 0.18, 0.034), -0.03, 0x8c2f39),
        (DVec3::new(0.21, 0.16, 0.042), 0.10, 0x2f6b4f),
    ] {
        let (cos, sin) = cos_sin(turns);
        let turn = DMat3::from_cols(DVec3::new(cos, sin, 0.0), DVec3::new(-sin, cos, 0.0), DVec3::Z);
        add(
            Solid::block(DVec3::new(0.45, -0.35, floor + half.z), half).turned(turn),
            Texture::Book { cover, half: half.z },
        );
        floor += 2.0 * half.z;
    }
    add(Solid::sphere(DVec3::new(0.45, -0.35, floor + 0.23), 0.23), Texture::Lacquer);
}

/// A fan of thin banded rods of growing height, each with a bead on top.
fn add_pins(add: &mut impl FnMut(Solid, Texture)) {
    for (i, color) in [0xd7263d, 0xf46036, 0xe8b923, 0x3fa34d, 0x1b98e0, 0x4c3b9b, 0xa23b8f].into_iter().enumerate() {
        let share = i as f64 / 6.0;
        let (cos, sin) = cos_sin(0.505 - 0.195 * share);
        let foot = DVec3::new(0.86 * cos, 0.86 * sin, FLOOR);
        let half = 0.25 + 0.4 * share;
        add(Solid::rod(foot + DVec3::Z * half, 0.014, half), Texture::Bands([color, 0xf7f3e8]));
        add(Solid::sphere(foot + DVec3::Z * (2.0 * half + 0.036), 0.036), Texture::Dots([color, 0xf7f3e8]));
    }
}

/// An open pipe with three brushes that lean past each other in it.
fn add_brushes(add: &mut impl FnMut(Solid, Texture)) {
    let foot = DVec3::new(0.64, 0.12, FLOOR);
    add(Solid::pipe(foot + DVec3::Z * 0.24, 0.105, 0.13, 0.24), Texture::Brass);
    for (i, color) in [0x7a4a21, 0x243b6b, 0x54702f].into_iter().enumerate() {
        let (cos, sin) = cos_sin(0.08 + i as f64 / 3.0);
        let (out, aside) = (DVec3::new(cos, sin, 0.0), DVec3::new(-sin, cos, 0.0));
        let lower = foot + 0.03 * aside - 0.06 * out + DVec3::Z * 0.02;
        let along = (DVec3::Z * 0.46 + 0.12 * out).normalize();
        let across = aside.cross(along);
        let half = 0.44 + 0.04 * i as f64;
        let turn = DMat3::from_cols(aside, -across, along);
        add(Solid::rod(lower + half * along, 0.013, half).turned(turn), Texture::Bands([color, 0xe9c46a]));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::SolidMesh;

    #[test]
    fn axes_are_rotations_and_everything_is_within_reach() {
        for (i, thing) in SyntheticScene::new(1).things.iter().enumerate() {
            let axes = thing.solid.world_from_local;
            assert!((axes.transpose() * axes).abs_diff_eq(DMat3::IDENTITY, 1e-15), "{i}");
            assert!((axes.determinant() - 1.0).abs() < 1e-14, "{i}");
            let bounds = thing.solid.bounds;
            for corner in 0..8 {
                let pick = |axis| if corner >> axis & 1 == 0 { bounds.min[axis] } else { bounds.max[axis] };
                let point = thing.solid.world(DVec3::new(pick(0), pick(1), pick(2)));
                assert!(point.abs().max_element() < 1.0, "{i}: {point}");
            }
        }
    }

    #[test]
    fn solids_rest_on_each_other_but_do_not_overlap() {
        let scene = SyntheticScene::new(0);
        for (i, a) in scene.things.iter().enumerate() {
            let mut mesh = SolidMesh::default();
            mesh.sweep(&a.solid);
            for &point in &mesh.vertices {
                for (j, b) in scene.things.iter().enumerate().filter(|&(j, _)| j != i) {
                    assert!(b.solid.depth(point) < 1e-12, "solid {i} is in solid {j} at {point}");
                }
            }
        }
    }
}
