//! 256 numbers that stand for many.

/// Numbers of a codebook.
const CODES: usize = 256;
/// Bins of the histogram that the first codebook comes from.
const BINS: usize = 1 << 12;
/// Rounds of k-means.
const ROUNDS: usize = 100;

/// A codebook of one dimension by k-means (Lloyd, "Least Squares Quantization in PCM", 1982).
pub(super) struct Codebook {
    /// Ascending.
    pub(super) numbers: [f64; CODES],
}

impl Codebook {
    /// The codebook of `values`, which are finite and at least one.
    pub(super) fn of(mut values: Vec<f64>) -> Self {
        values.sort_unstable_by(f64::total_cmp);
        let mut distinct = values.clone();
        distinct.dedup();
        if distinct.len() <= CODES {
            distinct.resize(CODES, values[values.len() - 1]);
            return Self { numbers: std::array::from_fn(|code| distinct[code]) };
        }
        // The sums of the first 0, 1, 2, … values.
        let mut sums = vec![0.0];
        sums.extend(values.iter().scan(0.0, |sum, value| {
            *sum += value;
            Some(*sum)
        }));
        let mut book = Self { numbers: first_numbers(&values) };
        for _ in 0..ROUNDS {
            let mut begin = 0;
            for code in 0..CODES {
                let end = match book.numbers.get(code + 1) {
                    Some(next) => {
                        let middle = 0.5 * (book.numbers[code] + next);
                        begin + values[begin..].partition_point(|&value| value < middle)
                    }
                    None => values.len(),
                };
                if end > begin {
                    book.numbers[code] = (sums[end] - sums[begin]) / (end - begin) as f64;
                }
                begin = end;
            }
        }
        book
    }

    /// The index of the number next to `value`.
    pub(super) fn index(&self, value: f64) -> u8 {
        let after = self.numbers.partition_point(|&number| number < value).clamp(1, CODES - 1);
        let [below, above] = [self.numbers[after - 1], self.numbers[after]];
        (if value - below <= above - value { after - 1 } else { after }) as u8
    }
}

/// Ascending numbers that are as dense as the cube root of the density of `values`, which are sorted: asymptotically the best
/// (Panter and Dite, "Quantization Distortion in Pulse-Count Modulation with Nonuniform Spacing of Levels", 1951).
fn first_numbers(values: &[f64]) -> [f64; CODES] {
    let (min, max) = (values[0], values[values.len() - 1]);
    let mut counts = vec![0_u32; BINS];
    for value in values {
        let bin = (value - min) / (max - min) * BINS as f64;
        counts[(bin as usize).min(BINS - 1)] += 1;
    }
    let weights: Vec<f64> = counts.into_iter().map(|count| f64::from(count).cbrt()).collect();
    let step = weights.iter().sum::<f64>() / CODES as f64;
    let (mut bin, mut before) = (0, 0.0);
    std::array::from_fn(|code| {
        let wanted = (code as f64 + 0.5) * step;
        while bin < BINS - 1 && before + weights[bin] <= wanted {
            before += weights[bin];
            bin += 1;
        }
        let share = if weights[bin] > 0.0 { ((wanted - before) / weights[bin]).clamp(0.0, 1.0) } else { 0.0 };
        min + (max - min) * (bin as f64 + share) / BINS as f64
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use strivec_format::random::Random;

    #[test]
    fn few_values_are_kept_and_many_are_near_a_number() {
        for values in [vec![3.0], vec![-1.0, 2.0, 2.0], (0..200).map(|n| f64::from(n * n)).collect()] {
            let book = Codebook::of(values.clone());
            assert!(book.numbers.is_sorted());
            for value in values {
                let found = book.numbers[usize::from(book.index(value))];
                assert!((found - value).abs() < 1e-9 * (1.0 + value.abs()), "{found}, not {value}");
            }
        }
        let random = Random::new(5, "codebook");
        let values: Vec<f64> = (0..100_000).map(|n| random.normal(n)).collect();
        let book = Codebook::of(values.clone());
        let error = |value: &f64| (book.numbers[usize::from(book.index(*value))] - value).powi(2);
        let mean = values.iter().map(error).sum::<f64>() / values.len() as f64;
        // Panter and Dite's bound for a normal distribution: √3·π/2 / 256².
        let bound = 3.0_f64.sqrt() * std::f64::consts::PI / 2.0 / 65536.0;
        assert!(mean < 1.25 * bound, "{mean}, not {bound}");
        // An index is that of the nearest number.
        for value in values.iter().step_by(97) {
            let nearest = book.numbers.iter().map(|number| (number - value).abs()).fold(f64::INFINITY, f64::min);
            assert_eq!((book.numbers[usize::from(book.index(*value))] - value).abs(), nearest);
        }
    }
}
