//! The factors of tensors (spec 3.10).

use super::error::BrokenInvariant;

/// The factorization of a tensor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "kebab-case"))]
pub enum FactorKind {
    /// CP: three vectors for each component (paper 3.1).
    Cp,
}

/// The factors of one scale's tensors.
///
/// `density` and `appearance` have the same layout, each with its own rank R:
/// \[tensor\]\[axis\]\[vertex\]\[component\], where axis a has resolution\[a\] + 1 vertices. The component runs
/// fastest, so that interpolation between two vertices reads two adjacent rows.
#[derive(Clone, Debug, PartialEq)]
pub struct Factors {
    /// The factorization.
    pub kind: FactorKind,
    /// Density components of a tensor.
    pub density_rank: u32,
    /// Appearance components of a tensor.
    pub appearance_rank: u32,
    /// Density vectors.
    pub density: Vec<f32>,
    /// Appearance vectors.
    pub appearance: Vec<f32>,
}

impl Factors {
    /// Rows (vertices of all three axes) of a tensor of `resolution` cells.
    pub fn rows(resolution: [u32; 3]) -> usize {
        resolution.iter().map(|&d| d as usize + 1).sum()
    }

    /// The first row of each axis within a tensor.
    pub fn axis_rows(resolution: [u32; 3]) -> [usize; 3] {
        [0, resolution[0] as usize + 1, resolution[0] as usize + resolution[1] as usize + 2]
    }

    /// The rows of each axis within a tensor.
    pub fn axis_ranges(resolution: [u32; 3]) -> [std::ops::Range<usize>; 3] {
        let first = Self::axis_rows(resolution);
        [0, 1, 2].map(|a| first[a]..first[a] + resolution[a] as usize + 1)
    }

    /// Number of factor entries.
    pub fn parameter_count(&self) -> u64 {
        (self.density.len() + self.appearance.len()) as u64
    }

    /// \[tensor\]\[component\] whether any number of `values`, of tensors of `rows` rows and `rank` components, is not
    /// zero. Files hold no other components.
    pub fn nonzero_components(values: &[f32], rows: usize, rank: usize) -> Vec<bool> {
        let mut nonzero = Vec::with_capacity(values.len() / rows.max(1));
        for tensor in values.chunks_exact((rows * rank).max(1)) {
            let first = nonzero.len();
            nonzero.resize(first + rank, false);
            for row in tensor.chunks_exact(rank) {
                nonzero[first..].iter_mut().zip(row).for_each(|(nonzero, &v)| *nonzero |= v != 0.0);
            }
        }
        nonzero
    }

    /// Number of entries of the nonzero components, of tensors of `rows` rows.
    pub(super) fn nonzero_parameter_count(&self, rows: usize) -> u64 {
        let of = |values: &[f32], rank: u32| {
            Self::nonzero_components(values, rows, rank as usize).into_iter().filter(|n| *n).count()
        };
        (rows * (of(&self.density, self.density_rank) + of(&self.appearance, self.appearance_rank))) as u64
    }

    /// Keeps the factors of the tensors of the numbers `kept`, of `tensors`.
    pub(super) fn keep_tensors(&mut self, kept: &[usize], tensors: usize) {
        for values in [&mut self.density, &mut self.appearance] {
            let len = values.len() / tensors.max(1);
            *values = kept.iter().flat_map(|&n| &values[n * len..(n + 1) * len]).copied().collect();
        }
    }

    pub(super) fn check(&self, place: &str, tensors: usize, resolution: [u32; 3]) -> Result<(), BrokenInvariant> {
        let expected = |rank: u32| tensors as u128 * Self::rows(resolution) as u128 * u128::from(rank);
        for (name, rank, values) in
            [("density", self.density_rank, &self.density), ("appearance", self.appearance_rank, &self.appearance)]
        {
            if rank == 0 {
                return Err(BrokenInvariant::new(format!("{place} {name} rank"), "at least 1", rank));
            }
            BrokenInvariant::unless_equal(|| format!("{place} {name} factors"), expected(rank), values.len() as u128)?;
        }
        Ok(())
    }

    /// Checks that all are finite.
    pub(super) fn check_numbers(&self, place: &str) -> Result<(), BrokenInvariant> {
        BrokenInvariant::unless_finite(|| format!("{place} density factors"), &self.density)?;
        BrokenInvariant::unless_finite(|| format!("{place} appearance factors"), &self.appearance)
    }
}
