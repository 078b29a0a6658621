//! Looking at scenes: what the desktop's and the web's players share.
//!
//! [`Controls`] turn input into cameras, [`Recorder`] keeps and plays their path, [`Pace`] decides how good the next picture may
//! be, [`Screen`] puts what the graphics renderer drew on a surface, [`Comparison`] says where two pictures go and
//! [`Photograph`] what is seen through one, [`Stream`] opens files while they arrive, and [`facts()`] say what they hold.
//! Windows, menus and files are left to `desktop` and to the web page.

mod boxes;
mod comparison;
mod controls;
#[cfg(feature = "player")]
pub mod desktop;
mod facts;
mod gestures;
mod pace;
mod photograph;
mod quality;
mod recorder;
mod screen;
mod streaming;

pub use boxes::{BoxLines, each_line};
pub use comparison::{Comparison, Place};
pub use controls::{Action, Controls, Drag, action_of};
pub use facts::{Fact, facts};
pub use gestures::{Gesture, Gestures};
pub use pace::Pace;
pub use photograph::Photograph;
pub use quality::{adapted, named_choices};
pub use recorder::Recorder;
pub use screen::{Screen, Show, View};
pub use streaming::{Step, Stream, scale_count};
