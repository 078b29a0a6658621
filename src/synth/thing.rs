//! The solids of a scene with their textures, and the heights at which they stand.

use super::solid::Solid;
use super::texture::Texture;

/// The height of the plinth's top, on which all other solids stand.
pub(super) const FLOOR: f64 = -0.74;
/// The height of its foot.
pub(super) const FOOT: f64 = FLOOR - 0.12;

/// A solid and its texture.
pub(super) struct Thing {
    pub(super) solid: Solid,
    pub(super) texture: Texture,
    /// The number that selects a variant of the texture, from the seed.
    pub(super) texture_seed: u64,
    /// True if it throws no shadow: otherwise a closed room would be dark.
    pub(super) lets_light_through: bool,
}
