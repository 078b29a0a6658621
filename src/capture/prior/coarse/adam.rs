//! Adam on the grid: one task for each plane of vertices sums the gradients of the samples in a fixed order and updates
//! the plane. It needs no atomics and no copy of the gradients per thread, and gives the same bits on any number of
//! threads.

use rayon::prelude::*;

use super::grid::{Channels, CoarseGrid, Scalar};
use super::ray_loss::Sample;

const BETA1: f64 = 0.9;
const BETA2: f64 = 0.99;

/// The samples of a chunk of rays, sorted by the plane of their cell's smallest vertex; the sort is stable.
#[derive(Debug, Default)]
pub(super) struct SortedSamples<T> {
    samples: Vec<Sample<T>>,
    /// \[plane + 1\]: index of the plane's first sample, then the number of samples.
    begins: Vec<u32>,
}

impl<T: Scalar> SortedSamples<T> {
    /// Replaces the samples by `unsorted`, in a counting sort that reuses the memory.
    pub(super) fn sort(&mut self, unsorted: &[Sample<T>], plane: usize, planes: usize) {
        self.begins.clear();
        self.begins.resize(planes + 1, 0);
        for sample in unsorted {
            self.begins[sample.first as usize / plane + 1] += 1;
        }
        for z in 0..planes {
            self.begins[z + 1] += self.begins[z];
        }
        self.samples.clear();
        self.samples.resize(unsorted.len(), Sample::default());
        for sample in unsorted {
            let at = &mut self.begins[sample.first as usize / plane];
            self.samples[*at as usize] = *sample;
            *at += 1;
        }
        // Each entry has moved to its plane's end, which is the next one's beginning.
        self.begins.rotate_right(1);
        self.begins[0] = 0;
    }

    fn of_plane(&self, z: usize) -> &[Sample<T>] {
        &self.samples[self.begins[z] as usize..self.begins[z + 1] as usize]
    }
}

/// Adam's state for a grid, β = (0.9, 0.99). A value whose gradient is exactly zero keeps its value and its moments
/// (DVGO: `skip_zero_grad_fields`).
#[derive(Debug)]
pub(super) struct GridAdam<T> {
    moments: Vec<[Channels<T>; 2]>,
    rate: f64,
    epsilon: T,
    step: u32,
}

/// The gradient of one plane of vertices, and which of its rows have one.
struct PlaneGradient<T> {
    values: Vec<Channels<T>>,
    rows: Vec<bool>,
}

impl<T: Scalar> GridAdam<T> {
    pub(super) fn new(entries: usize, rate: f64, epsilon: f64) -> Self {
        Self { moments: vec![[[T::zero(); 4]; 2]; entries], rate, epsilon: T::of(epsilon), step: 0 }
    }

    /// One step along the gradients of `batches`; `rates` \[vertex\] scales the learning rate.
    pub(super) fn step(&mut self, grid: &mut CoarseGrid<T>, batches: &[SortedSamples<T>], rates: &[T]) {
        self.step += 1;
        let correction = |beta: f64| 1.0 - beta.powf(f64::from(self.step));
        let rate = T::of(self.rate / correction(BETA1));
        let to_variance = T::of(1.0 / correction(BETA2));
        let (plane, row, epsilon) = (grid.plane(), grid.vertices.x as usize, self.epsilon);
        let arch = pulp::Arch::new();
        let scratch = || PlaneGradient { values: vec![[T::zero(); 4]; plane], rows: vec![false; plane / row] };
        grid.values
            .par_chunks_mut(plane)
            .zip(self.moments.par_chunks_mut(plane))
            .zip(rates.par_chunks(plane))
            .enumerate()
            .with_max_len(1)
            .for_each_init(scratch, |gradient, (z, ((values, moments), rates))| {
                arch.dispatch(|| {
                    gradient.gather(batches, z, row);
                    for y in (0..plane / row).filter(|&y| gradient.rows[y]) {
                        let here = y * row..(y + 1) * row;
                        descend(
                            &mut values[here.clone()],
                            &mut moments[here.clone()],
                            &mut gradient.values[here.clone()],
                            &rates[here],
                            rate,
                            to_variance,
                            epsilon,
                        );
                    }
                    gradient.rows.fill(false);
                });
            });
    }
}

impl<T: Scalar> PlaneGradient<T> {
    /// Adds the contributions to plane `z` of the samples in the cells below and above it.
    #[inline(always)]
    fn gather(&mut self, batches: &[SortedSamples<T>], z: usize, row: usize) {
        let plane = self.values.len();
        for batch in batches {
            if z > 0 {
                for s in batch.of_plane(z - 1) {
                    self.add(s, (z - 1) * plane, row, s.fraction[2]);
                }
            }
            for s in batch.of_plane(z) {
                self.add(s, z * plane, row, T::one() - s.fraction[2]);
            }
        }
    }

    /// The transpose of [`CoarseGrid::interpolate`] in one plane; `along_z` is the weight of the plane.
    #[inline(always)]
    fn add(&mut self, sample: &Sample<T>, plane_begin: usize, row: usize, along_z: T) {
        let first = sample.first as usize - plane_begin;
        let [fx, fy, _] = sample.fraction;
        for (pair, w) in [(first, along_z * (T::one() - fy)), (first + row, along_z * fy)] {
            let (near, far) = (w * (T::one() - fx), w * fx);
            for c in 0..4 {
                self.values[pair][c] = self.values[pair][c] + near * sample.gradient[c];
                self.values[pair + 1][c] = self.values[pair + 1][c] + far * sample.gradient[c];
            }
        }
        let y = first / row;
        self.rows[y] = true;
        self.rows[y + 1] = true;
    }
}

/// Updates one row and sets its gradient to zero.
#[inline(always)]
fn descend<T: Scalar>(
    values: &mut [Channels<T>],
    moments: &mut [[Channels<T>; 2]],
    gradient: &mut [Channels<T>],
    rates: &[T],
    rate: T,
    to_variance: T,
    epsilon: T,
) {
    let (beta1, beta2) = (T::of(BETA1), T::of(BETA2));
    for (((value, moment), gradient), &vertex_rate) in values.iter_mut().zip(moments).zip(gradient).zip(rates) {
        let rate = rate * vertex_rate;
        for c in 0..4 {
            let g = gradient[c];
            let m = beta1 * moment[0][c] + (T::one() - beta1) * g;
            let v = beta2 * moment[1][c] + (T::one() - beta2) * g * g;
            let moved = value[c] - rate * m / ((v * to_variance).sqrt() + epsilon);
            let counts = g != T::zero();
            moment[0][c] = if counts { m } else { moment[0][c] };
            moment[1][c] = if counts { v } else { moment[1][c] };
            value[c] = if counts { moved } else { value[c] };
        }
        *gradient = [T::zero(); 4];
    }
}

/// The whole gradient at once, for tests: \[vertex\] channels.
#[cfg(test)]
pub(super) fn gradient<T: Scalar>(grid: &CoarseGrid<T>, batches: &[SortedSamples<T>]) -> Vec<Channels<T>> {
    let (plane, row) = (grid.plane(), grid.vertices.x as usize);
    (0..grid.vertices.z as usize)
        .flat_map(|z| {
            let mut gradient = PlaneGradient { values: vec![[T::zero(); 4]; plane], rows: vec![false; plane / row] };
            gradient.gather(batches, z, row);
            gradient.values
        })
        .collect()
}
