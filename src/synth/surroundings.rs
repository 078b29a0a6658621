//! The surroundings of the still life.

/// The surroundings of the still life, which its pictures show past it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Surroundings {
    /// Nothing: the background is transparent.
    #[default]
    None,
    /// A meadow without an edge, far hills and a sky.
    Meadow,
    /// A plain floor of one color without an edge, and a sky, in photographs whose exposures differ by up to a stop.
    Floor,
    /// A closed room, with cameras in it.
    Room,
}
