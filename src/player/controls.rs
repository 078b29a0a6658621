//! Camera controls: orbit, pan, dolly, fly, focus, saved views.

use std::collections::BTreeSet;
use std::f64::consts::TAU;

use glam::{DMat3, DQuat, DVec3};

use super::action::MAX_SAVED_VIEWS;
use super::first_view::{FirstView, Stand, extent, first_view};
use super::{Action, Gesture, Gestures, action_of};
use strivec_format::container::{Pose, TrainingCamera, Views};
use strivec_format::geometry::{Camera, Lens};
use strivec_format::model::Scene;

/// Minimum angle between the line of sight and the vertical, in radians.
const FROM_POLE: f64 = 0.02;
/// Flying speed, in extents of the scene per second. In the surroundings of a contracted scene it grows with the distance.
const FLYING_SPEED: f64 = 0.4;
/// Factor of the flying speed while Shift is held.
const FASTER: f64 = 4.0;
/// Length of the drag that an arrow key replaces, in parts of the window's height.
const KEY_STEP: f64 = 0.05;

/// Effect of dragging the pointer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Drag {
    /// Turns the camera around the pivot.
    Orbit,
    /// Moves the camera sideways.
    Pan,
    /// Turns the camera around its own position.
    Look,
}

/// The camera, the saved views, and the keys and fingers that are held down.
#[derive(Clone, Debug)]
pub struct Controls {
    first: Stand,
    /// Vertical angle of view of the first view, in radians.
    first_angle: f64,
    now: Stand,
    kept: [Option<Stand>; MAX_SAVED_VIEWS],
    /// Vertical angle of view, in radians.
    angle_of_view: f64,
    up: DVec3,
    /// The longest edge of the scene's bounds, or of a contracted scene's inner cube.
    extent: f64,
    /// True if the scene is contracted.
    is_unbounded: bool,
    /// True if dragging turns the camera around its own position first, and around the pivot with Control.
    looks_around: bool,
    held: BTreeSet<String>,
    gestures: Gestures,
}

impl Controls {
    /// Controls for `scene`. The first view is a training camera's if `cameras` do not surround the scene, else that of
    /// `views`, else an overview.
    pub fn new(scene: &Scene, views: Option<&Views>, cameras: &[TrainingCamera]) -> Self {
        let FirstView { stand: first, angle: angle_of_view, up, looks_around } = first_view(scene, views, cameras);
        let extent = extent(scene);
        Self {
            first,
            first_angle: angle_of_view,
            now: first,
            kept: [None; MAX_SAVED_VIEWS],
            angle_of_view,
            up,
            extent,
            is_unbounded: scene.rules.contraction.is_some(),
            looks_around,
            held: BTreeSet::new(),
            gestures: Gestures::default(),
        }
    }

    /// The camera for a picture of `size`, columns and rows.
    pub fn camera(&self, size: [u32; 2]) -> Camera {
        let focal = Camera::focal_of_angle(size[1], self.angle_of_view);
        Camera {
            width: size[0],
            height: size[1],
            focal: [focal; 2],
            principal: size.map(|v| 0.5 * f64::from(v)),
            lens: Lens::PINHOLE,
            world_from_camera: DMat3::from_quat(self.now.pose.rotation),
            position: self.now.pose.position,
        }
    }

    /// The camera's pose, in the model's space.
    pub fn pose(&self) -> Pose {
        self.now.pose
    }

    /// The point that the camera orbits, in the model's space.
    pub fn pivot(&self) -> DVec3 {
        self.now.pivot()
    }

    /// Vertical angle of view, in radians.
    pub fn angle_of_view(&self) -> f64 {
        self.angle_of_view
    }

    /// Moves the camera to `pose`, in the model's space. The distance to the pivot stays.
    pub fn place(&mut self, pose: Pose) {
        self.now.pose = Pose { rotation: pose.rotation.normalize(), ..pose };
    }

    /// Moves the camera to `pose`, with a vertical angle of view of `angle` radians.
    pub fn place_with_angle(&mut self, pose: Pose, angle: f64) {
        self.place(pose);
        self.angle_of_view = angle.clamp(0.02, 3.0);
    }

    /// Orbits around the pivot by a drag of `right` and `down`, in parts of the window's height.
    pub fn orbit(&mut self, right: f64, down: f64) {
        let pivot = self.now.pivot();
        self.turn(right, down);
        self.now.pose.position = pivot + self.now.distance * self.now.axis(DVec3::Z);
    }

    /// Turns the camera around its own position by such a drag.
    pub fn look(&mut self, right: f64, down: f64) {
        self.turn(-0.5 * right, -0.5 * down);
    }

    fn turn(&mut self, right: f64, down: f64) {
        let back = self.now.axis(DVec3::Z);
        // The angle from straight up is clamped, so that the camera never reaches a pole. The roll stays.
        let polar = back.angle_between(self.up);
        let wanted = (polar - TAU / 2.0 * down).clamp(FROM_POLE, TAU / 2.0 - FROM_POLE);
        let yaw = DQuat::from_axis_angle(self.up, -TAU / 2.0 * right);
        let axis = self.up.cross(back).try_normalize().unwrap_or_else(|| self.now.axis(DVec3::X));
        let pitch = DQuat::from_axis_angle(axis, wanted - polar);
        self.now.pose.rotation = (yaw * pitch * self.now.pose.rotation).normalize();
    }

    /// Moves the camera sideways by a drag, so that points at the pivot's distance follow the pointer.
    pub fn pan(&mut self, right: f64, down: f64) {
        let height = 2.0 * self.now.distance * (0.5 * self.angle_of_view).tan();
        let (x, y) = (self.now.axis(DVec3::X), self.now.axis(DVec3::Y));
        self.now.pose.position += height * (down * y - right * x);
    }

    /// Moves the camera to `factor` times its distance from the pivot.
    pub fn dolly(&mut self, factor: f64) {
        let pivot = self.now.pivot();
        self.now.distance = (self.now.distance * factor).clamp(1e-4 * self.extent, 100.0 * self.extent);
        self.now.pose.position = pivot + self.now.distance * self.now.axis(DVec3::Z);
    }

    /// Zooms by `lines` of the wheel; positive is towards the scene.
    pub fn wheel(&mut self, lines: f64) {
        self.dolly(0.9_f64.powf(lines.clamp(-20.0, 20.0)));
    }

    /// Applies a drag of the pointer to the right and down, in parts of the window's height. In a room, where an orbit
    /// would pass through walls, [`Drag::Orbit`] and [`Drag::Look`] are exchanged.
    pub fn dragged(&mut self, [right, down]: [f64; 2], drag: Drag) {
        match (drag, self.looks_around) {
            (Drag::Orbit, false) | (Drag::Look, true) => self.orbit(right, down),
            (Drag::Look, false) | (Drag::Orbit, true) => self.look(right, down),
            (Drag::Pan, _) => self.pan(right, down),
        }
    }

    /// Moves finger `id` to `at`, in parts of the window's height; `None` lifts it. Returns whether the camera moves.
    pub fn touched(&mut self, id: u64, at: Option<[f64; 2]>) -> bool {
        let Some(at) = at else {
            self.gestures.lift(id);
            return false;
        };
        let gesture = self.gestures.touch(id, at);
        match gesture {
            Some(Gesture::Turn(moved)) => self.dragged(moved, Drag::Orbit),
            Some(Gesture::MoveAndPinch(moved, factor)) => {
                self.dragged(moved, Drag::Pan);
                self.dolly(1.0 / factor);
            }
            None => {}
        }
        gesture.is_some()
    }

    /// Sets the pivot to `point`, in the model's space, and turns the camera towards it.
    pub fn focus(&mut self, point: DVec3) {
        let to = point - self.now.pose.position;
        if !(to.is_finite() && to.length() > 1e-4 * self.extent) {
            return;
        }
        let turn = DQuat::from_rotation_arc(-self.now.axis(DVec3::Z), to.normalize());
        self.now.pose.rotation = (turn * self.now.pose.rotation).normalize();
        self.now.distance = to.length();
    }

    /// Handles a key that went down or up. Returns its action, if any besides flying.
    pub fn key(&mut self, code: &str, is_pressed: bool, is_modified: bool) -> Option<Action> {
        if ["KeyW", "KeyA", "KeyS", "KeyD", "KeyQ", "KeyE", "ShiftLeft", "ShiftRight"].contains(&code) {
            if is_pressed {
                self.held.insert(code.to_owned());
            } else {
                self.held.remove(code);
            }
            return None;
        }
        let action = action_of(code, is_modified).filter(|_| is_pressed);
        if let Some(action) = action {
            self.act(action);
        }
        action
    }

    /// Does `action` if it concerns the camera alone.
    pub fn act(&mut self, action: Action) {
        match action {
            Action::Reset => (self.now, self.angle_of_view) = (self.first, self.first_angle),
            Action::Keep(n) => self.kept[n - 1] = Some(self.now),
            Action::Recall(n) => self.now = self.kept[n - 1].unwrap_or(self.now),
            _ => {}
        }
    }

    /// Orbits or, in a room, looks around, or zooms by one step of an arrow key, plus or minus. Returns whether `code` is
    /// such a key.
    pub fn step(&mut self, code: &str) -> bool {
        // Looking left moves the picture to the right.
        let by = if self.looks_around { -KEY_STEP } else { KEY_STEP };
        match code {
            "ArrowLeft" => self.dragged([-by, 0.0], Drag::Orbit),
            "ArrowRight" => self.dragged([by, 0.0], Drag::Orbit),
            "ArrowUp" => self.dragged([0.0, -by], Drag::Orbit),
            "ArrowDown" => self.dragged([0.0, by], Drag::Orbit),
            "Equal" | "NumpadAdd" => self.wheel(1.0),
            "Minus" | "NumpadSubtract" => self.wheel(-1.0),
            _ => return false,
        }
        true
    }

    /// Releases all keys, for a window that has lost the focus.
    pub fn release_keys(&mut self) {
        self.held.clear();
    }

    /// Flies for `seconds` in the direction of the held keys. Returns whether the camera moves.
    pub fn fly(&mut self, seconds: f64) -> bool {
        let held = |code: &str| f64::from(u8::from(self.held.contains(code)));
        let step = DVec3::new(held("KeyD") - held("KeyA"), held("KeyE") - held("KeyQ"), held("KeyS") - held("KeyW"));
        if step == DVec3::ZERO {
            return false;
        }
        let faster = if held("ShiftLeft") + held("ShiftRight") > 0.0 { FASTER } else { 1.0 };
        let away = if self.is_unbounded { self.now.pose.position.abs().max_element().max(1.0) } else { 1.0 };
        let length = FLYING_SPEED * faster * away * self.extent * seconds.clamp(0.0, 0.25);
        self.now.pose.position += length * self.now.axis(step.normalize());
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::first_view::overview;
    use strivec_format::geometry::Aabb;

    fn controls() -> Controls {
        let bounds = Aabb::around(DVec3::new(1.0, 0.0, 0.0), DVec3::ONE);
        let first = overview(&bounds, DVec3::Z, 0.7);
        Controls {
            first,
            first_angle: 0.7,
            now: first,
            kept: [None; MAX_SAVED_VIEWS],
            angle_of_view: 0.7,
            up: DVec3::Z,
            extent: 2.0,
            is_unbounded: false,
            looks_around: false,
            held: BTreeSet::new(),
            gestures: Gestures::default(),
        }
    }

    fn assert_near(a: DVec3, b: DVec3) {
        assert!((a - b).length() < 1e-9, "{a} and {b}");
    }

    #[test]
    fn the_first_picture_shows_all_corners() {
        let controls = controls();
        let camera = controls.camera([300, 200]);
        for corner in Aabb::around(DVec3::new(1.0, 0.0, 0.0), DVec3::ONE).corners() {
            let seen = camera.world_from_camera.transpose() * (corner - camera.position);
            let row = camera.principal[1] + camera.focal[1] * seen.y / seen.z;
            assert!(seen.z < 0.0 && (0.0..=200.0).contains(&row), "{corner}: {row}");
        }
    }

    #[test]
    fn orbiting_keeps_the_pivot_and_stops_at_the_poles() {
        let mut controls = controls();
        let pivot = controls.pivot();
        for (right, down) in [(0.3, 0.1), (-1.2, 3.0), (0.1, -9.0), (7.0, 0.4)] {
            controls.orbit(right, down);
            assert_near(controls.pivot(), pivot);
            let x = controls.now.axis(DVec3::X);
            assert!(x.z.abs() < 1e-9, "the horizon stays level: {x}");
            let up = controls.now.axis(DVec3::Y).z;
            assert!(up > 0.0, "never upside down: {up}");
        }
        let before = controls.pose();
        controls.orbit(1.0, 0.0);
        controls.orbit(1.0, 0.0);
        assert_near(controls.pose().position, before.position);
    }

    #[test]
    fn points_at_the_pivot_follow_the_pointer() {
        let mut controls = controls();
        let (size, grabbed) = ([400, 400], controls.pivot());
        controls.pan(0.25, 0.125);
        let camera = controls.camera(size);
        let seen = camera.world_from_camera.transpose() * (grabbed - camera.position);
        let at = [200.0 - camera.focal[0] * seen.x / seen.z, 200.0 + camera.focal[1] * seen.y / seen.z];
        assert!((at[0] - 300.0).abs() < 1e-6 && (at[1] - 250.0).abs() < 1e-6, "{at:?}");
    }

    #[test]
    fn focus_turns_to_a_point_and_orbits_it() {
        let mut controls = controls();
        let point = DVec3::new(0.5, 0.4, -0.3);
        let before = controls.pose().position;
        controls.focus(point);
        assert_near(controls.pivot(), point);
        assert_near(controls.pose().position, before);
        controls.orbit(0.2, 0.1);
        assert_near(controls.pivot(), point);
        controls.focus(DVec3::NAN);
        assert_near(controls.pivot(), point);
    }

    #[test]
    fn keys_fly_keep_and_recall() {
        let mut controls = controls();
        assert!(!controls.fly(0.1));
        assert_eq!(controls.key("KeyW", true, false), None);
        let before = controls.pose();
        assert!(controls.fly(0.1));
        let moved = controls.pose().position - before.position;
        assert!(moved.normalize().dot(-controls.now.axis(DVec3::Z)) > 0.999 && (moved.length() - 0.08).abs() < 1e-9);
        assert_eq!(controls.key("Digit3", true, true), Some(Action::Keep(3)));
        let kept = controls.pose();
        controls.release_keys();
        assert!(!controls.fly(0.1));
        assert_eq!(controls.key("KeyR", true, false), Some(Action::Reset));
        assert_eq!(controls.pose(), before);
        assert_eq!(controls.key("Digit4", true, false), Some(Action::Recall(4)));
        assert_eq!(controls.pose(), before, "nothing was kept there");
        controls.key("Digit3", true, false);
        assert_eq!(controls.pose(), kept);
        assert_eq!([action_of("Digit0", false), action_of("KeyZ", false)], [None, None]);
        assert_eq!(controls.key("KeyF", false, false), None, "keys act when they go down");
    }

    #[test]
    fn in_a_room_dragging_looks_around_and_the_arrows_look_where_they_point() {
        let mut controls = Controls { looks_around: true, ..controls() };
        let before = controls.pose();
        controls.dragged([0.1, 0.05], Drag::Orbit);
        assert_eq!(controls.pose().position, before.position);
        assert_ne!(controls.pose().rotation, before.rotation);
        controls.dragged([0.1, 0.0], Drag::Look);
        assert_ne!(controls.pose().position, before.position);
        controls.act(Action::Reset);
        let left = -controls.now.axis(DVec3::X);
        assert!(controls.step("ArrowLeft"));
        assert!(left.dot(-controls.now.axis(DVec3::Z)) > 0.01);
        let up = controls.now.axis(DVec3::Y);
        assert!(controls.step("ArrowUp"));
        assert!(up.dot(-controls.now.axis(DVec3::Z)) > 0.01);
    }

    #[test]
    fn flying_in_the_surroundings_is_faster_the_farther_away_they_are() {
        let mut controls = Controls { is_unbounded: true, ..controls() };
        controls.key("KeyW", true, false);
        let mut flown = |at: DVec3| {
            controls.now.pose.position = at;
            controls.fly(0.1);
            (controls.pose().position - at).length()
        };
        assert!((flown(DVec3::splat(0.5)) - 0.08).abs() < 1e-9);
        assert!((flown(DVec3::new(0.0, -50.0, 1.0)) - 4.0).abs() < 1e-9);
    }

    #[test]
    fn wild_input_leaves_a_finite_camera() {
        let mut controls = controls();
        let random = strivec_format::random::Random::new(1, "input");
        for n in 0..2000 {
            let by = |k: u64| 20.0 * random.uniform(8 * n + k) - 10.0;
            match random.below(8 * n, 6) {
                0 => controls.orbit(by(1), by(2)),
                1 => controls.pan(by(1), by(2)),
                2 => controls.wheel(1e3 * by(1)),
                3 => controls.look(by(1), by(2)),
                4 => controls.focus(DVec3::new(by(1), by(2), by(3))),
                _ => drop(controls.key(
                    ["KeyW", "KeyR", "Digit1"][random.below(8 * n + 4, 3) as usize],
                    true,
                    by(5) > 0.0,
                )),
            }
            controls.fly(by(6));
            let pose = controls.pose();
            assert!(pose.position.is_finite() && pose.rotation.is_normalized(), "{n}: {pose:?}");
        }
    }
}
