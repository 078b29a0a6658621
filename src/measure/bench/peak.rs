//! Peak rates of the machine, measured in the same run as the work that is compared with them.

use std::hint::black_box;
use std::sync::Mutex;
use std::time::Instant;

use pulp::{Simd, WithSimd};
use serde::Serialize;

use super::Spread;
use crate::field::{Matrix, MatrixMut, multiply};

/// Rows, inner length and columns of the matrix products: one far larger than the caches, and the decoder's first
/// layer.
const PRODUCTS: [[usize; 3]; 2] = [[1024, 1024, 1024], [4096, 150, 128]];
/// Bytes that all threads together read, and as many that they write: far more than the caches hold.
const COPIED: usize = 256 << 20;
/// FLOP of a round: enough that its start does not matter.
const ROUND_FLOP: f64 = 2e9;
/// Number of timed rounds, unless they take longer than `SECONDS` together.
const ROUNDS: usize = 9;
const FEWEST_ROUNDS: usize = 3;
const SECONDS: f64 = 0.6;

/// A rate on one thread alone, and of all threads together.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Rate {
    /// The calling thread alone.
    pub one: f64,
    /// All threads of the pool at once, summed.
    pub all: f64,
}

/// A matrix product's rate.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct ProductRate {
    /// Rows, inner length, columns.
    pub shape: [usize; 3],
    /// FLOP/s; a multiply-add counts as two.
    pub flops: Rate,
}

/// The machine's limits on the threads of the current pool.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Peak {
    /// Threads of the pool.
    pub threads: usize,
    /// FLOP/s of fused multiply-adds that stay in registers.
    pub registers: Rate,
    /// FLOP/s of single-precision matrix products.
    pub products: Vec<ProductRate>,
    /// Bytes/s of copying arrays larger than the caches; a byte that is read and written counts twice.
    pub copy: Rate,
}

impl Peak {
    /// Takes about three seconds.
    pub fn measure() -> Self {
        let threads = rayon::current_num_threads();
        let repeats = (ROUND_FLOP / registers(1).0).ceil() as usize;
        let registers = rate(vec![(); threads], 1, registers(repeats).0, |()| {
            black_box(registers(black_box(repeats)));
        });
        let products = PRODUCTS.map(|shape| ProductRate { shape, flops: product_rate(shape, threads) }).into();
        let values = COPIED / size_of::<f32>() / threads;
        // Write once, so that every page is allocated.
        let arrays: Vec<_> = (0..threads).map(|i| (vec![i as f32 + 1.0; values], vec![0.5f32; values])).collect();
        // A single thread copies all arrays: its share of them would fit into a cache.
        let copy = rate(arrays, threads, 2.0 * (values * size_of::<f32>()) as f64, |(from, to)| {
            to.copy_from_slice(from);
            black_box(to);
        });
        Self { threads, registers, products, copy }
    }

    /// FLOP/s of a thread while all run: the best rate measured.
    pub fn flops_per_thread(&self) -> f64 {
        self.products.iter().map(|p| p.flops.all).fold(self.registers.all, f64::max) / self.threads as f64
    }

    /// Bytes/s of a thread while all copy.
    pub fn bytes_per_thread(&self) -> f64 {
        self.copy.all / self.threads as f64
    }
}

/// The median rate of `work`, which does `amount` on one of `states`. Each thread has one state; a single thread works
/// on the first `alone` of them.
fn rate<S: Send>(states: Vec<S>, alone: usize, amount: f64, work: impl Fn(&mut S) + Sync) -> Rate {
    let states: Vec<Mutex<S>> = states.into_iter().map(Mutex::new).collect();
    let one_state = |state: &Mutex<S>| work(&mut state.lock().expect("no work panics"));
    let median = |round: &dyn Fn()| {
        round();
        let (begun, mut seconds) = (Instant::now(), Vec::new());
        while seconds.len() < FEWEST_ROUNDS || (seconds.len() < ROUNDS && begun.elapsed().as_secs_f64() < SECONDS) {
            let start = Instant::now();
            round();
            seconds.push(start.elapsed().as_secs_f64());
        }
        Spread::of(&seconds).expect("several rounds").median
    };
    let one = alone as f64 * amount / median(&|| states[..alone].iter().for_each(one_state));
    let all = median(&|| {
        rayon::broadcast(|thread| one_state(&states[thread.index()]));
    });
    Rate { one, all: states.len() as f64 * amount / all }
}

fn product_rate(shape: [usize; 3], threads: usize) -> Rate {
    let [rows, inner, columns] = shape;
    let flop = 2.0 * (rows * inner * columns) as f64;
    let repeats = (ROUND_FLOP / flop).ceil() as usize;
    let state = || (vec![0.5f32; rows * inner], vec![0.25f32; inner * columns], vec![0f32; rows * columns]);
    rate((0..threads).map(|_| state()).collect(), 1, flop * repeats as f64, |(left, right, product)| {
        for _ in 0..repeats {
            multiply(
                MatrixMut::new(product, rows, columns, columns),
                Matrix::new(left, rows, inner, inner),
                Matrix::new(right, inner, columns, columns),
                false,
            );
            black_box(&mut *product);
        }
    })
}

/// Chains of multiply-adds side by side: enough for the latency of two units, few enough for sixteen registers.
const CHAINS: usize = 12;

/// `repeats` multiply-adds on every chain, with the widest registers that kernels here use. Returns the FLOP, and the
/// chains' sum, so that the compiler keeps the work.
fn registers(repeats: usize) -> (f64, f32) {
    struct Chains(usize);
    impl WithSimd for Chains {
        type Output = (f64, f32);
        // Explicit vectors: the compiler may keep the sums of a plain loop in memory.
        #[inline(always)]
        fn with_simd<S: Simd>(self, simd: S) -> (f64, f32) {
            // Each chain converges to 1, so that values stay normal.
            let (factor, addend) = (simd.splat_f32s(black_box(0.999)), simd.splat_f32s(black_box(0.001)));
            let mut chains = [addend; CHAINS];
            for _ in 0..self.0 {
                for chain in &mut chains {
                    *chain = simd.mul_add_e_f32s(*chain, factor, addend);
                }
            }
            let sum = chains.iter().map(|&chain| simd.reduce_sum_f32s(chain)).sum();
            ((2 * self.0 * CHAINS * S::F32_LANES) as f64, sum)
        }
    }
    pulp::Arch::new().dispatch(Chains(repeats))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn register_work_is_counted_by_lane_and_chain() {
        let ([one, ten], sum) = ([registers(1).0, registers(10).0], registers(10).1);
        assert_eq!(ten, 10.0 * one);
        assert_eq!(one % (2 * CHAINS) as f64, 0.0);
        // Each chain holds 1 − 0.999·0.999^repeats.
        let chain = 1.0 - 0.999f64.powi(11);
        assert!((f64::from(sum) / (one / 2.0) - chain).abs() < 1e-6, "{sum}");
    }

    #[test]
    fn the_limit_of_a_thread_is_the_best_of_all_measurements() {
        let product = |all| ProductRate { shape: [1; 3], flops: Rate { one: 90.0, all } };
        let copy = Rate { one: 20.0, all: 30.0 };
        let peak = |registers| Peak {
            threads: 2,
            registers: Rate { one: 0.0, all: registers },
            products: vec![product(100.0), product(110.0)],
            copy,
        };
        assert_eq!((peak(80.0).flops_per_thread(), peak(120.0).flops_per_thread()), (55.0, 60.0));
        assert_eq!(peak(80.0).bytes_per_thread(), 15.0);
    }
}
