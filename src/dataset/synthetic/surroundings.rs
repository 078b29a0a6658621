//! What may be around the still life.

/// What is around the still life.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Surroundings {
    /// Nothing: the background is transparent.
    #[default]
    None,
    /// A meadow without an edge, far hills and a sky.
    Meadow,
    /// A closed room, with cameras in it.
    Room,
}
