//! A quick estimate, in about a second, of the machine's speed at the main operations of a training step. For plans,
//! not for reports.

use std::hint::black_box;
use std::time::Instant;

use strivec_field::{Matrix, MatrixMut, multiply, vectorized};
use strivec_train::MachineSpeed;

/// Shape of the matrix products: the network's first layer on a chunk of samples.
const PRODUCT: [usize; 3] = [1024, 150, 128];
/// Length of a gathered row and number of rows; together they fit into a core's own cache.
const ROW: usize = 48;
const ROWS: usize = 4096;
/// Smallest duration and number of rounds. The best round counts, so that other load on the machine hardly matters.
const SECONDS: f64 = 0.3;
const FEWEST_ROUNDS: usize = 3;

/// The machine's speed on the threads of the current pool. Takes about a second.
pub fn machine_speed() -> MachineSpeed {
    let threads = rayon::current_num_threads();
    let mean = |rates: Vec<f64>| rates.iter().sum::<f64>() / threads as f64;
    MachineSpeed {
        threads,
        product_flops: mean(rayon::broadcast(|_| product_rate())),
        gathered: mean(rayon::broadcast(|_| gather_rate())),
    }
}

/// `amount` per second in the best round of `work`.
fn best_rate(amount: f64, mut work: impl FnMut()) -> f64 {
    work();
    let (begun, mut best, mut rounds) = (Instant::now(), f64::INFINITY, 0);
    while rounds < FEWEST_ROUNDS || begun.elapsed().as_secs_f64() < SECONDS {
        let start = Instant::now();
        work();
        best = start.elapsed().as_secs_f64().min(best);
        rounds += 1;
    }
    amount / best
}

fn product_rate() -> f64 {
    let [rows, inner, columns] = PRODUCT;
    let (left, right) = (vec![0.5f32; rows * inner], vec![0.25f32; inner * columns]);
    let mut product = vec![0f32; rows * columns];
    best_rate(2.0 * (rows * inner * columns) as f64, || {
        multiply(
            MatrixMut::new(&mut product, rows, columns, columns),
            Matrix::new(&left, rows, inner, inner),
            Matrix::new(&right, inner, columns, columns),
            false,
        );
        black_box(&mut product);
    })
}

fn gather_rate() -> f64 {
    let table = vec![0.5f32; ROWS * ROW];
    // Each row once, in an order that jumps.
    let order: Vec<usize> = (0..ROWS).map(|n| n * 1597 % ROWS).collect();
    best_rate((ROWS * ROW) as f64, || {
        let mut sums = [0f32; ROW];
        vectorized(
            #[inline(always)]
            || {
                for &row in &order {
                    for (sum, value) in sums.iter_mut().zip(&table[row * ROW..][..ROW]) {
                        *sum += value;
                    }
                }
            },
        );
        black_box(sums);
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_are_of_this_world() {
        let MachineSpeed { threads, product_flops, gathered } = machine_speed();
        assert_eq!(threads, rayon::current_num_threads());
        for rate in [product_flops, gathered] {
            assert!((1e5..1e14).contains(&rate), "{rate}");
        }
    }
}
