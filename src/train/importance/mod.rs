//! The importance of parameters: how much the pictures change with them. There is one estimate per question.
//!
//! | question | estimate | used by |
//! |---|---|---|
//! | error of the pictures if a component is removed | `train::lean` | training, `train::shrink` |
//! | error of the pictures if a factor entry changes, or a component of a trained scene is absent | [`FactorImportance`] | [`mod@crate::pack`] |
//! | components that no ray depends on | [`prune_dead_components`] | the end of training |

mod dead_components;
mod factors;

pub use dead_components::{DeadComponents, MAX_LOSS, prune_dead_components};
pub use factors::{BlockImportance, FactorImportance};
