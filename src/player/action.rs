//! Actions of keys and buttons.

/// Action of a key or a button, besides flying.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Action {
    /// Set the pivot under the pointer.
    Focus,
    /// Return to the first view.
    Reset,
    /// Go to a saved view: 1 to 9.
    Recall(usize),
    /// Save this view: 1 to 9.
    Keep(usize),
    /// Show or hide the help.
    Help,
    /// Display the next quantity: color, depth, …
    NextView,
    /// Save a screenshot.
    Screenshot,
    /// Begin or end recording the camera's path.
    Record,
    /// Play the recorded path, or stop.
    Play,
    /// Go to the next training camera.
    NextCamera,
    /// Go to the previous training camera.
    PreviousCamera,
    /// Show or hide tensor boxes.
    Boxes,
    /// Show or hide the panel.
    Panel,
}

/// The action of the key of W3C code `code` ("KeyF", "Digit1"). With Control or Shift, digits save views.
pub fn action_of(code: &str, is_modified: bool) -> Option<Action> {
    if let Some(digit) = code.strip_prefix("Digit") {
        let n = digit.parse().ok().filter(|n| (1..=MAX_SAVED_VIEWS).contains(n))?;
        return Some(if is_modified { Action::Keep(n) } else { Action::Recall(n) });
    }
    match code {
        "KeyF" => Some(Action::Focus),
        "KeyR" | "Home" => Some(Action::Reset),
        "KeyH" | "F1" => Some(Action::Help),
        "KeyV" => Some(Action::NextView),
        "KeyP" | "F12" => Some(Action::Screenshot),
        "KeyC" => Some(Action::Record),
        "Space" => Some(Action::Play),
        "PageDown" => Some(Action::NextCamera),
        "PageUp" => Some(Action::PreviousCamera),
        "KeyB" => Some(Action::Boxes),
        "KeyI" => Some(Action::Panel),
        _ => None,
    }
}

/// Number of views that can be saved.
pub(super) const MAX_SAVED_VIEWS: usize = 9;
