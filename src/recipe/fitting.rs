//! Adjustment of the settings to the photographs and to a budget, once the prior is known.

use strivec_capture::prior::VoxelBoxes;
use strivec_format::geometry::Camera;
use strivec_train::{Budget, PrepareError, TrainConfig};

/// Adjustments of the settings. The default makes none.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Fitting {
    /// Derive tensors, resolutions and ranks from the scene's extent and the photographs' detail, and drop space that no
    /// photograph shows ([`strivec_train::fit_to_photographs`]).
    pub to_photographs: bool,
    /// The most parameters and bytes of the scene ([`strivec_train::fit_to_budget`]).
    pub budget: Budget,
}

impl Fitting {
    /// `config` and `occupied` fitted to the photographs of `cameras` and to the budget, and the reasons: one line for each
    /// choice.
    ///
    /// # Errors
    ///
    /// If the scene does not fit the budget.
    pub fn fit(
        &self,
        mut config: TrainConfig,
        cameras: &[Camera],
        mut occupied: VoxelBoxes,
    ) -> Result<(TrainConfig, VoxelBoxes, Vec<String>), PrepareError> {
        let mut reasons = Vec::new();
        if self.to_photographs {
            (config, occupied, reasons) = strivec_train::fit_to_photographs(&config, cameras, &occupied)?;
        }
        let (config, given_up) = strivec_train::fit_to_budget(&config, &occupied, self.budget)?;
        reasons.extend(given_up);
        Ok((config, occupied, reasons))
    }
}
