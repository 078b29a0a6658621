//! Work on several sections at once, where the library has threads (feature `toolkit`). What comes out does not depend on it.

/// Calls `work` with each of `items`; its results in their order.
pub(super) fn map<I: Send, R: Send>(items: Vec<I>, work: impl Fn(I) -> R + Send + Sync) -> Vec<R> {
    #[cfg(feature = "toolkit")]
    {
        use rayon::prelude::*;
        items.into_par_iter().with_max_len(1).map(work).collect()
    }
    #[cfg(not(feature = "toolkit"))]
    {
        items.into_iter().map(work).collect()
    }
}
