//! Touch gestures: one finger orbits, two fingers pan and pinch.

use std::collections::BTreeMap;

/// A gesture. Movements are to the right and down, in parts of the window's height.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Gesture {
    /// One finger moved by this vector.
    Turn([f64; 2]),
    /// The middle of two fingers moved by this vector, and their distance changed by this factor.
    MoveAndPinch([f64; 2], f64),
}

/// Fingers that touch the window.
#[derive(Clone, Debug, Default)]
pub struct Gestures {
    /// Position of each finger by its id.
    fingers: BTreeMap<u64, [f64; 2]>,
}

impl Gestures {
    /// Puts finger `id` down at `at`, or moves it there. Returns the gesture, if one or two fingers are down and `id`
    /// is not new.
    pub fn touch(&mut self, id: u64, at: [f64; 2]) -> Option<Gesture> {
        let before = self.state();
        let is_new = self.fingers.insert(id, at).is_none();
        let after = self.state();
        if is_new {
            return None;
        }
        let moved = [after.0[0] - before.0[0], after.0[1] - before.0[1]];
        match self.fingers.len() {
            1 => Some(Gesture::Turn(moved)),
            2 => Some(Gesture::MoveAndPinch(moved, (after.1 / before.1.max(1e-3)).clamp(0.1, 10.0))),
            _ => None,
        }
    }

    /// Lifts finger `id`.
    pub fn lift(&mut self, id: u64) {
        self.fingers.remove(&id);
    }

    /// Mean position of the fingers, and the distance between the first two.
    fn state(&self) -> ([f64; 2], f64) {
        let count = self.fingers.len().max(1) as f64;
        let sum = |axis: usize| self.fingers.values().map(|at| at[axis]).sum::<f64>();
        let mut fingers = self.fingers.values();
        let apart = match (fingers.next(), fingers.next()) {
            (Some(a), Some(b)) => (a[0] - b[0]).hypot(a[1] - b[1]),
            _ => 0.0,
        };
        ([sum(0) / count, sum(1) / count], apart)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_finger_turns_and_two_move_and_pinch() {
        let mut gestures = Gestures::default();
        assert_eq!(gestures.touch(7, [0.5, 0.5]), None);
        assert_eq!(gestures.touch(7, [0.75, 0.5]), Some(Gesture::Turn([0.25, 0.0])));
        assert_eq!(gestures.touch(9, [0.25, 0.5]), None, "a new finger moves nothing");
        let Some(Gesture::MoveAndPinch(moved, factor)) = gestures.touch(9, [0.5, 0.5]) else { panic!() };
        assert_eq!((moved, factor), ([0.125, 0.0], 0.5));
        gestures.touch(11, [0.0, 0.0]);
        assert_eq!(gestures.touch(11, [0.1, 0.0]), None, "three fingers are no gesture");
        gestures.lift(11);
        gestures.lift(7);
        assert_eq!(gestures.touch(9, [0.5, 0.25]), Some(Gesture::Turn([0.0, -0.25])));
        gestures.lift(1);
    }
}
