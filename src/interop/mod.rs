//! Scenes of other programs: checkpoints of TensoRF.

mod state;
pub mod tensorf;
