//! Which photographs' colors are mapped.

use serde::{Deserialize, Serialize};

strivec_format::named! {
    /// The photographs whose colors are mapped.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
    #[serde(rename_all = "lowercase")]
    pub enum Exposure {
        /// All photographs, if it explains much of the error after a tenth of the steps.
        #[default]
        Auto = "auto",
        /// All photographs.
        On = "on",
        /// No photograph.
        Off = "off",
    }
}
