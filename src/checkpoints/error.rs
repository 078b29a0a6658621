//! Errors of scenes as checkpoints.

use std::io;

/// Reasons why a scene is not written as a checkpoint.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// The scene has a property that the other program lacks.
    #[error("the scene cannot be expressed there: expected {expected}, found {found}")]
    NotExpressible {
        /// The property of the other program.
        expected: &'static str,
        /// The scene's property.
        found: String,
    },
    /// The file cannot be written.
    #[error("cannot write it: {0}")]
    Io(#[from] io::Error),
}

impl Error {
    /// Fails at the first condition that is not met; each has the expected and the found value.
    pub(crate) fn unless_expressible(
        conditions: impl IntoIterator<Item = (bool, &'static str, String)>,
    ) -> Result<(), Self> {
        match conditions.into_iter().find(|(is_met, ..)| !is_met) {
            Some((_, expected, found)) => Err(Self::NotExpressible { expected, found }),
            None => Ok(()),
        }
    }
}
