//! Checkpoints of the Strivec authors' program (Gao et al., ICCV 2023) as scenes, and scenes as checkpoints of it: the classes
//! `StrivecCP_hier`, whose components are products of three vectors, and `Strivec_DBase`, whose components are products of a
//! vector and a matrix.
//!
//! A checkpoint holds factors, matrices and the decoder. The centers and half edges of the tensors are in other files
//! ([`Places`]), and the rules of the field in the configuration ([`Config`]). All of these are untrusted. What the program
//! computes and a scene cannot express is refused by name, but for one difference: the program chooses neighbors for the cells of a
//! grid, not for each sample. Within a cell, a scene may have other neighbors, and none where the cell reaches beyond a tensor's box.

mod config;
mod export;
mod places;
mod scene;

pub use config::Config;
pub use export::{AuthorsFiles, authors_files};
pub use places::{Places, read_points};
pub use scene::{Model, model, read};
