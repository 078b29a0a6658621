//! State, input and drawing that the desktop player and the page share.
//!
//! [`Session`] is the state of a player: scenes in [`SceneSlot`]s, the camera in [`Controls`], the settings, and the
//! loop that draws. [`Recorder`] records and plays camera paths, [`Pace`] chooses the resolution of the next picture,
//! [`Screen`] displays pictures of the graphics renderer, [`Comparison`] arranges two pictures, [`PhotographOverlay`] blends
//! in a photograph, [`Stream`] opens files while they arrive, [`facts()`] describe a file, and [`KEYS`] are the help.
//! Windows, menus and files belong to `desktop` and to the page.
#![forbid(unsafe_code)]

mod action;
mod boxes;
mod clock;
mod comparison;
mod controls;
mod facts;
mod first_view;
mod gestures;
mod keys;
mod pace;
mod photograph;
mod quality;
mod recorder;
mod scene_slot;
mod screen;
mod session;
mod streaming;

pub use action::{Action, action_of};
pub use boxes::{BoxLines, each_line};
pub use clock::now;
pub use comparison::{Comparison, PictureRect};
pub use controls::{Controls, Drag};
pub use facts::{Fact, facts};
pub use gestures::{Gesture, Gestures};
pub use keys::KEYS;
pub use pace::Pace;
pub use photograph::PhotographOverlay;
pub use quality::{adapted, named_choices};
pub use recorder::Recorder;
pub use scene_slot::{Painter, SceneSlot};
pub use screen::{Screen, Show, View};
pub use session::{Finished, Session};
pub use streaming::{Step, Stream, each_step, scale_count};
