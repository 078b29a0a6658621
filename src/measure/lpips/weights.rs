//! The weights of a network, from the safetensors file that `tools/lpips/convert.py` makes.

use safetensors::SafeTensors;
use safetensors::tensor::Dtype;

use super::architecture::{Convolution, LpipsNetwork};

/// A file of weights that was refused.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum LpipsWeightsError {
    /// Not a sound safetensors file.
    #[error("not a safetensors file: {0}")]
    NotSafetensors(String),
    /// A tensor is absent.
    #[error("the tensor {tensor} is missing")]
    Missing {
        /// Its name.
        tensor: String,
    },
    /// A tensor of another type.
    #[error("the tensor {tensor}: expected 32-bit floats (F32), found {found}")]
    Type {
        /// Its name.
        tensor: String,
        /// The type, as in the file.
        found: String,
    },
    /// A tensor of another shape.
    #[error("the tensor {tensor}: expected the shape {expected:?}, found {found:?}")]
    Shape {
        /// Its name.
        tensor: String,
        /// The network's.
        expected: Vec<usize>,
        /// The file's.
        found: Vec<usize>,
    },
    /// An infinite number or NaN.
    #[error("the tensor {tensor}: expected finite numbers, found {found} at {index}")]
    NotFinite {
        /// Its name.
        tensor: String,
        /// Position in the tensor's numbers, row-major.
        index: usize,
        /// The number.
        found: String,
    },
}

/// Weights of a convolution.
#[derive(Debug)]
pub(super) struct Kernel {
    /// \[rows\]\[columns\]\[inputs\]\[outputs\].
    pub(super) values: Vec<f32>,
    /// \[outputs\].
    pub(super) bias: Vec<f32>,
}

/// Weights of a stage.
#[derive(Debug)]
pub(super) struct StageWeights {
    /// One for each convolution.
    pub(super) kernels: Vec<Kernel>,
    /// \[channels\] of the squared differences.
    pub(super) linear: Vec<f32>,
}

/// The weights of `network`'s stages in the safetensors file `bytes`. Other tensors are ignored.
pub(super) fn read(bytes: &[u8], network: LpipsNetwork) -> Result<Vec<StageWeights>, LpipsWeightsError> {
    let file = SafeTensors::deserialize(bytes).map_err(|e| LpipsWeightsError::NotSafetensors(e.to_string()))?;
    let name = network.name();
    let mut layer = 0..;
    let mut kernel = |convolution: &Convolution| {
        let n: usize = layer.next().expect("numbers do not end");
        let &Convolution { edge, inputs, outputs, .. } = convolution;
        Ok(Kernel {
            values: tensor(&file, format!("{name}.conv.{n}.kernel"), &[edge, edge, inputs, outputs])?,
            bias: tensor(&file, format!("{name}.conv.{n}.bias"), &[outputs])?,
        })
    };
    let stages = network.stages().iter().enumerate();
    let stage = stages.map(|(n, stage)| {
        Ok(StageWeights {
            kernels: stage.convolutions.iter().map(&mut kernel).collect::<Result<_, _>>()?,
            linear: tensor(&file, format!("{name}.linear.{n}"), &[stage.channels()])?,
        })
    });
    stage.collect()
}

fn tensor(file: &SafeTensors<'_>, tensor: String, expected: &[usize]) -> Result<Vec<f32>, LpipsWeightsError> {
    let Ok(view) = file.tensor(&tensor) else { return Err(LpipsWeightsError::Missing { tensor }) };
    if view.dtype() != Dtype::F32 {
        return Err(LpipsWeightsError::Type { tensor, found: format!("{:?}", view.dtype()) });
    }
    if view.shape() != expected {
        return Err(LpipsWeightsError::Shape { tensor, expected: expected.to_vec(), found: view.shape().to_vec() });
    }
    let values: Vec<f32> = bytemuck::pod_collect_to_vec(view.data());
    match values.iter().position(|value| !value.is_finite()) {
        Some(index) => Err(LpipsWeightsError::NotFinite { tensor, index, found: values[index].to_string() }),
        None => Ok(values),
    }
}
