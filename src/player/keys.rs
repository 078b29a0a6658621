//! The help of keys and pointer, for the desktop player and the page.

/// Input and effect.
pub const KEYS: [(&str, &str); 18] = [
    ("Left drag, one finger", "Orbit around the pivot; in a room, look around"),
    ("Right drag, Shift + drag, two fingers", "Pan"),
    ("Ctrl + drag", "Look around; in a room, orbit"),
    ("Wheel, pinch", "Zoom in, out"),
    ("W A S D Q E", "Fly; with Shift four times as fast"),
    ("Arrow keys, + and −", "Orbit or, in a room, look around; zoom in, out"),
    ("F", "Set the pivot under the pointer"),
    ("R, Home", "Return to the first view"),
    ("1 … 9", "Go to a saved view; with Ctrl or Shift save it"),
    ("V", "Next of color, depth, opacity, normals, samples"),
    ("B", "Show or hide tensor boxes"),
    ("P, F12", "Save a screenshot"),
    ("C, Space", "Record a camera path; play it"),
    ("Page Down, Page Up", "Next or previous training camera"),
    ("I", "Show or hide the panel"),
    ("H, F1, Escape", "Show or hide this help; hide it"),
    ("Drop a file", "Open a scene or a camera path; with Ctrl compare with the scene"),
    ("Drop a dataset folder", "Blend in its photographs"),
];
