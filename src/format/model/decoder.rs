//! The decoder: an MLP from appearance features and a direction to a color (spec 3.5 and 4.7; paper 3.4).

use crate::Invalid;

/// A fully connected layer y = W·x + b.
#[derive(Clone, Debug, PartialEq)]
pub struct Linear {
    /// Length of x.
    pub inputs: u32,
    /// Length of y.
    pub outputs: u32,
    /// \[outputs\]\[inputs\], row-major.
    pub weights: Vec<f32>,
    /// \[outputs\].
    pub bias: Vec<f32>,
}

crate::named! {
    /// The points of a ray at which the decoder is evaluated (spec 4.8).
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    #[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "kebab-case"))]
    pub enum DecoderMode {
        /// At every shaded sample; colors are composited (the paper).
        PerSample = "per-sample",
        /// Once for each ray, on composited features.
        PerRay = "per-ray",
        /// Once for each ray, on composited features. Before the sigmoid, the output is added to the first three features
        /// of each shaded sample, so that samples have their own colors. Colors are composited.
        Residual = "residual",
    }
}

impl DecoderMode {
    /// The smallest number of appearance features P of this mode.
    pub fn min_features(self) -> u32 {
        if self == Self::Residual { 3 } else { 1 }
    }
}

/// The MLP. Its input is \[features, direction, PE(features), PE(direction)\]. PE multiplies every element by
/// 1, 2, 4, … (no π) and takes all sines first, then all cosines, the frequency running fastest within each. ReLU
/// follows each layer but the last, a sigmoid the last (spec 4.7).
#[derive(Clone, Debug, PartialEq)]
pub struct Decoder {
    /// The points of a ray at which the decoder is evaluated.
    pub mode: DecoderMode,
    /// Frequencies of PE(features): 2 gives 1 and 2.
    pub feature_frequencies: u32,
    /// Frequencies of PE(direction).
    pub direction_frequencies: u32,
    /// First to last; the last has 3 outputs: red, green, blue.
    pub layers: Vec<Linear>,
}

impl Decoder {
    /// The length of the input for `features` appearance features; `u32::MAX` if it overflows.
    pub fn input_len(&self, features: u32) -> u32 {
        let encoded = |length: u32, frequencies: u32| {
            let copies = frequencies.saturating_mul(2).saturating_add(1);
            length.saturating_mul(copies)
        };
        encoded(features, self.feature_frequencies).saturating_add(encoded(3, self.direction_frequencies))
    }

    /// Number of weights and biases.
    pub fn parameter_count(&self) -> u64 {
        self.layers.iter().map(|l| (l.weights.len() + l.bias.len()) as u64).sum()
    }

    pub(super) fn check(&self, features: u32) -> Result<(), Invalid> {
        if features < self.mode.min_features() {
            let expected = format!("at least {} for a {} decoder", self.mode.min_features(), self.mode.name());
            return Err(Invalid::new("features", expected, features));
        }
        let mut width = self.input_len(features);
        for (i, layer) in self.layers.iter().enumerate() {
            let place = |what: &str| format!("decoder layer {i} {what}");
            Invalid::unless_equal(|| place("inputs"), width, layer.inputs)?;
            if layer.outputs == 0 {
                return Err(Invalid::new(place("outputs"), "at least 1", 0));
            }
            let weights = u64::from(layer.inputs) * u64::from(layer.outputs);
            Invalid::unless_equal(|| place("weights"), weights, layer.weights.len() as u64)?;
            Invalid::unless_equal(|| place("bias"), layer.outputs as usize, layer.bias.len())?;
            Invalid::unless_finite(|| place("weights"), &layer.weights)?;
            Invalid::unless_finite(|| place("bias"), &layer.bias)?;
            width = layer.outputs;
        }
        Invalid::unless_equal(|| "decoder outputs".into(), 3, width)
    }
}
