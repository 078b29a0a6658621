//! Options for repeated measurements on several numbers of threads.

use crate::Error;
use crate::bench::lab::Runs;
use crate::table::plural;

/// Numbers of runs and of threads.
#[derive(Clone, Debug, clap::Args)]
pub(super) struct Repeats {
    /// Measured runs; the result is their median
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u16).range(1..))]
    runs: u16,
    /// Runs before the measured ones; 0 for none
    #[arg(long, value_name = "N", default_value_t = 2)]
    warm_up: u16,
    /// Numbers of threads to measure [default: --threads]
    #[arg(long, value_name = "N,N,…", value_delimiter = ',', value_parser = clap::value_parser!(u16).range(1..=4096))]
    threads_list: Vec<u16>,
}

impl Repeats {
    /// Few runs on the command's own threads.
    pub(super) fn quick(runs: u16) -> Self {
        Self { runs, warm_up: 1, threads_list: Vec::new() }
    }

    pub(super) fn runs(&self) -> Runs {
        Runs { warm_up: self.warm_up.into(), measured: self.runs.into() }
    }

    /// The numbers of threads to measure on.
    fn threads(&self) -> Vec<usize> {
        if self.threads_list.is_empty() {
            return vec![rayon::current_num_threads()];
        }
        self.threads_list.iter().map(|&threads| threads.into()).collect()
    }

    /// Calls `measure` within each pool of threads.
    pub(super) fn in_each_pool<R: Send>(
        &self,
        mut measure: impl FnMut() -> Result<R, Error> + Send,
    ) -> Result<Vec<R>, Error> {
        let mut measured = Vec::new();
        for threads in self.threads() {
            let pool = rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .map_err(|e| Error::Runtime(format!("cannot start {}: {e}", plural(threads, "thread"))))?;
            measured.push(pool.install(&mut measure)?);
        }
        Ok(measured)
    }
}
