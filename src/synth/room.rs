//! A room around the still life: a floor, four walls and a ceiling, with paintings and a cupboard, and cameras in it.

use glam::{DMat3, DVec2, DVec3};

use super::portable::{cos_sin, hash, uniform};
use super::solid::Solid;
use super::texture::Texture;
use super::thing::{FOOT, Thing};
use strivec_format::geometry::Camera;

/// Half of the room from wall to wall, and its height.
const HALF: DVec2 = DVec2::new(2.3, 1.9);
const HEIGHT: f64 = 2.0;
/// The thickness of floor, walls and ceiling.
const THICK: f64 = 0.1;
/// Half the edge of a cube around the room, and the radius of a ball around it.
pub(super) const EXTENT: f64 = 2.5;
pub(super) const RADIUS: f64 = 4.34;
/// The cameras' way around the still life, and the share by which they leave it at most.
const WAY: DVec2 = DVec2::new(1.65, 1.35);
const STRAY: f64 = 0.12;
/// The lowest and the highest camera.
const EYES: [f64; 2] = [-0.2, 0.75];
/// Cameras look at points that are at least this far away, in plan.
const NEAREST: f64 = 1.5;
/// Half of the horizontal angle of view, in turns: 30 degrees.
const HALF_ANGLE: f64 = 1.0 / 12.0;

/// Floor, walls, ceiling, cupboard and paintings. They touch each other and the foot of the still life, and do not overlap.
pub(super) fn things(seed: u64) -> Vec<Thing> {
    let mut things = Vec::new();
    let mut add = |solid: Solid, texture: Texture, lets_light_through: bool| {
        let texture_seed = hash(seed, things.len() as u64);
        things.push(Thing { solid, texture, texture_seed, lets_light_through });
    };
    let middle = FOOT + 0.5 * HEIGHT;
    let slab = DVec3::new(HALF.x + THICK, HALF.y + THICK, 0.5 * THICK);
    add(Solid::block(DVec3::Z * (FOOT - 0.5 * THICK), slab), Texture::Planks, true);
    add(Solid::block(DVec3::Z * (FOOT + HEIGHT + 0.5 * THICK), slab), Texture::Plaster, true);
    for side in [-1.0, 1.0] {
        let long = DVec3::new(HALF.x + THICK, 0.5 * THICK, 0.5 * HEIGHT);
        add(Solid::block(DVec3::new(0.0, side * (HALF.y + 0.5 * THICK), middle), long), Texture::Wallpaper, true);
        let short = DVec3::new(0.5 * THICK, HALF.y, 0.5 * HEIGHT);
        add(Solid::block(DVec3::new(side * (HALF.x + 0.5 * THICK), 0.0, middle), short), Texture::Wallpaper, true);
    }
    let cupboard = DVec3::new(0.5, 0.15, 0.6);
    add(Solid::block(DVec3::new(-1.4, HALF.y - cupboard.y, FOOT + cupboard.z), cupboard), Texture::Planks, false);
    // The z axis of a painting points into the room.
    let on_long = |side: f64| DMat3::from_cols(DVec3::X * side, DVec3::Z, DVec3::Y * -side);
    let on_short = |side: f64| DMat3::from_cols(DVec3::Y * -side, DVec3::Z, DVec3::X * -side);
    let painting = DVec3::new(0.45, 0.3, 0.02);
    for (at, turn) in [
        (DVec3::new(0.7, HALF.y - painting.z, 0.35), on_long(1.0)),
        (DVec3::new(-0.6, painting.z - HALF.y, 0.3), on_long(-1.0)),
        (DVec3::new(HALF.x - painting.z, 0.3, 0.35), on_short(1.0)),
        (DVec3::new(painting.z - HALF.x, -0.4, 0.4), on_short(-1.0)),
    ] {
        add(Solid::block(at, painting).turned(turn), Texture::Tiles, false);
    }
    things
}

/// True if a surface at `point` with this outward normal faces the inside of the room, as those do that a scanner sees.
pub(super) fn faces_inside(point: DVec3, normal: DVec3) -> bool {
    normal.dot(DVec3::Z * (FOOT + 0.5 * HEIGHT) - point) > 0.0
}

/// `count` cameras on a way around the still life, each of which looks at a random point of the room.
pub(super) fn cameras(count: u32, size: [u32; 2], seed: u64) -> Vec<Camera> {
    let (cos, sin) = cos_sin(HALF_ANGLE);
    let focal = 0.5 * f64::from(size[0]) * cos / sin;
    (0..count)
        .map(|i| {
            let stream = hash(seed, u64::from(i));
            let (cos, sin) = cos_sin((f64::from(i) + uniform(stream, 0)) / f64::from(count));
            let place = WAY * DVec2::new(cos, sin) * (1.0 + STRAY * (2.0 * uniform(stream, 1) - 1.0));
            let position = place.extend(EYES[0] + (EYES[1] - EYES[0]) * uniform(stream, 2));
            let target = (1_u64..)
                .map(|n| {
                    let random = |axis| uniform(stream, 3 * n + axis);
                    let plan = HALF * (2.0 * DVec2::new(random(0), random(1)) - 1.0);
                    plan.extend(FOOT + HEIGHT * random(2))
                })
                .find(|target| target.truncate().distance(place) > NEAREST)
                .expect("most of the room is far enough");
            Camera::looking_at(size, focal, position, target, DVec3::Z)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Surroundings;
    use crate::scene::SyntheticScene;

    #[test]
    fn cameras_are_inside_and_see_something_in_every_direction() {
        let scene = SyntheticScene::within(Surroundings::Room, 0);
        let cameras = cameras(40, [24, 18], 3);
        let mut walls_seen = [0; 3];
        for camera in &cameras {
            assert!(scene.things.iter().all(|thing| thing.solid.depth(camera.position) < -0.05));
            for ray in camera.rays(0..18).flatten() {
                let hit = scene.hit(&ray, 0.0).expect("a room has no opening");
                assert!(hit.t < 2.0 * RADIUS, "{}", hit.t);
                let wall = [Texture::Planks, Texture::Plaster, Texture::Wallpaper].map(|t| t == hit.thing.texture);
                walls_seen.iter_mut().zip(wall).for_each(|(sum, seen)| *sum += usize::from(seen));
            }
        }
        assert!(walls_seen.iter().all(|&seen| seen > 40 * 24 * 18 / 20), "{walls_seen:?}");
    }
}
