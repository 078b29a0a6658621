//! The factors of tensors (spec 3.10).

use std::ops::Range;

use crate::Invalid;

/// The factorization of the tensors of a scale.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "kebab-case"))]
pub enum FactorKind {
    /// All components are products of three vectors.
    #[default]
    Cp,
    /// All components are products of a vector and a matrix.
    Vm,
}

/// The form of components: of which factors each is the product (spec 4.3).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Form {
    /// Three vectors, one along each axis (paper 3.1).
    Cp,
    /// A vector along this axis and a matrix over the other two (TensoRF; paper, appendix A).
    Vm(usize),
}

/// The components of one form, of density or of appearance, of a scale's tensors.
#[derive(Clone, Debug, PartialEq)]
pub struct Block {
    /// Their form.
    pub form: Form,
    /// R, components of a tensor; at least 1.
    pub rank: u32,
    /// \[tensor\]\[row\]\[component\] the factors, where [`Form::factors`] are the rows of a tensor. The component runs
    /// fastest, so that interpolation between two vertices reads two adjacent rows.
    pub values: Vec<f32>,
}

/// The factors of one scale's tensors. Density and appearance each have either one block of the form [`Form::Cp`], or blocks of
/// [`Form::Vm`] along different axes, in the order of these.
#[derive(Clone, Debug, PartialEq)]
pub struct Factors {
    /// Components of density.
    pub density: Vec<Block>,
    /// Components of appearance. Those of all blocks, one after the other, are the columns of the appearance matrix.
    pub appearance: Vec<Block>,
}

impl Form {
    /// The rows (vertices of all factors) of a tensor of `resolution` cells.
    pub fn rows(self, resolution: [u32; 3]) -> usize {
        self.factors(resolution).last().map_or(0, |rows| rows.end)
    }

    /// The rows of each factor within a tensor. Those of a matrix are by its second axis, then by its first, which runs fastest.
    pub fn factors(self, resolution: [u32; 3]) -> Vec<Range<usize>> {
        let [x, y, z] = resolution.map(|cells| cells as usize + 1);
        match self {
            Self::Cp => vec![0..x, x..x + y, x + y..x + y + z],
            Self::Vm(axis) => {
                let (along, matrix) = ([x, y, z][axis], x * y * z / [x, y, z][axis]);
                vec![0..along, along..along + matrix]
            }
        }
    }

    /// The number of vertices of each of the vectors that the factors consist of, one after the other: a matrix is one for each
    /// vertex of its second axis.
    pub fn vectors(self, resolution: [u32; 3]) -> Vec<usize> {
        let vertices = resolution.map(|cells| cells as usize + 1);
        match self {
            Self::Cp => vertices.to_vec(),
            Self::Vm(axis) => {
                let [first, second] = Self::matrix_axes(axis);
                [vec![vertices[axis]], vec![vertices[first]; vertices[second]]].concat()
            }
        }
    }

    /// The axes of the matrix of a component whose vector lies along `axis`, ascending.
    pub fn matrix_axes(axis: usize) -> [usize; 2] {
        [[1, 2], [0, 2], [0, 1]][axis]
    }
}

impl Block {
    /// Components that are products of three vectors: `rank` a tensor, with the factors `values`.
    pub fn cp(rank: u32, values: Vec<f32>) -> Self {
        Self { form: Form::Cp, rank, values }
    }

    /// Numbers of a tensor.
    pub fn tensor_len(&self, resolution: [u32; 3]) -> usize {
        self.form.rows(resolution) * self.rank as usize
    }

    /// \[tensor\]\[component\] whether any of its numbers is not zero, in tensors of `resolution` cells. Files hold no other
    /// components.
    pub fn nonzero_components(&self, resolution: [u32; 3]) -> Vec<bool> {
        let (rank, len) = (self.rank as usize, self.tensor_len(resolution));
        let mut nonzero = Vec::with_capacity(self.values.len() / len.max(1) * rank);
        for tensor in self.values.chunks_exact(len.max(1)) {
            let first = nonzero.len();
            nonzero.resize(first + rank, false);
            for row in tensor.chunks_exact(rank) {
                nonzero[first..].iter_mut().zip(row).for_each(|(nonzero, &v)| *nonzero |= v != 0.0);
            }
        }
        nonzero
    }
}

impl Factors {
    /// Factors of so many `tensors` of `resolution` cells, with zeros for numbers. `density` and `appearance` are forms with their
    /// ranks, of which blocks of rank 0 are left out.
    pub fn zeros(tensors: usize, resolution: [u32; 3], [density, appearance]: [&[(Form, u32)]; 2]) -> Self {
        let block = |&(form, rank): &(Form, u32)| {
            let values = vec![0.0; tensors * form.rows(resolution) * rank as usize];
            (rank > 0).then_some(Block { form, rank, values })
        };
        let blocks = |forms: &[(Form, u32)]| forms.iter().filter_map(block).collect();
        Self { density: blocks(density), appearance: blocks(appearance) }
    }

    /// The factorization.
    pub fn kind(&self) -> FactorKind {
        match self.density.first().map(|block| block.form) {
            Some(Form::Vm(_)) => FactorKind::Vm,
            Some(Form::Cp) | None => FactorKind::Cp,
        }
    }

    /// Density components of a tensor.
    pub fn density_rank(&self) -> u32 {
        self.density.iter().map(|block| block.rank).sum()
    }

    /// Appearance components of a tensor.
    pub fn appearance_rank(&self) -> u32 {
        self.appearance.iter().map(|block| block.rank).sum()
    }

    /// The blocks of density, then those of appearance.
    pub fn blocks(&self) -> impl Iterator<Item = &Block> {
        self.density.iter().chain(&self.appearance)
    }

    /// The blocks of density, then those of appearance, to change.
    pub fn blocks_mut(&mut self) -> impl Iterator<Item = &mut Block> {
        self.density.iter_mut().chain(&mut self.appearance)
    }

    /// Number of factor entries.
    pub fn parameter_count(&self) -> u64 {
        self.blocks().map(|block| block.values.len() as u64).sum()
    }

    /// Number of entries of the nonzero components.
    pub(super) fn nonzero_parameter_count(&self, resolution: [u32; 3]) -> u64 {
        let of_block = |block: &Block| {
            let components = block.nonzero_components(resolution).into_iter().filter(|n| *n).count();
            (block.form.rows(resolution) * components) as u64
        };
        self.blocks().map(of_block).sum()
    }

    /// Keeps the factors of the tensors of the numbers `kept`, of `tensors`.
    pub(super) fn keep_tensors(&mut self, kept: &[usize], tensors: usize) {
        for Block { values, .. } in self.blocks_mut() {
            let len = values.len() / tensors.max(1);
            *values = kept.iter().flat_map(|&n| &values[n * len..(n + 1) * len]).copied().collect();
        }
    }

    pub(super) fn check(&self, place: &str, tensors: usize, resolution: [u32; 3]) -> Result<(), Invalid> {
        for (name, blocks) in [("density", &self.density), ("appearance", &self.appearance)] {
            let is_one_kind = blocks.len() == 1 || blocks.iter().all(|block| block.form != Form::Cp);
            let ascends = blocks.windows(2).all(|two| two[0].form < two[1].form);
            let has_axes = blocks.iter().all(|block| matches!(block.form, Form::Cp | Form::Vm(0..3)));
            if blocks.is_empty() || !is_one_kind || !ascends || !has_axes {
                let found = blocks.iter().map(|block| format!("{:?}", block.form)).collect::<Vec<_>>().join(", ");
                let expected = "cp, or vm along axes 0 to 2 in their order";
                return Err(Invalid::new(format!("{place} {name} forms"), expected, format!("[{found}]")));
            }
            for Block { form, rank, values } in blocks {
                if *rank == 0 {
                    return Err(Invalid::new(format!("{place} {name} rank"), "at least 1", rank));
                }
                let expected = tensors as u128 * form.rows(resolution) as u128 * u128::from(*rank);
                let found = values.len() as u128;
                Invalid::unless_equal(|| format!("{place} {name} factors"), expected, found)?;
            }
        }
        let kinds = [&self.density, &self.appearance].map(|blocks| blocks[0].form == Form::Cp);
        if kinds[0] != kinds[1] {
            return Err(Invalid::new(format!("{place} forms"), "cp for both or vm for both", "one of each"));
        }
        Ok(())
    }

    /// Checks that all are finite.
    pub(super) fn check_numbers(&self, place: &str) -> Result<(), Invalid> {
        for (name, blocks) in [("density", &self.density), ("appearance", &self.appearance)] {
            for block in blocks {
                Invalid::unless_finite(|| format!("{place} {name} factors"), &block.values)?;
            }
        }
        Ok(())
    }
}
