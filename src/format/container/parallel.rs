//! Work on several sections at once, if the library has threads (feature `parallel`, not in browsers). The results do not
//! depend on it.

/// The results of `work` on each of `items`, in their order.
pub(super) fn map<I: Send, R: Send>(items: Vec<I>, work: impl Fn(I) -> R + Send + Sync) -> Vec<R> {
    #[cfg(all(feature = "parallel", not(target_arch = "wasm32")))]
    {
        use rayon::prelude::*;
        items.into_par_iter().with_max_len(1).map(work).collect()
    }
    #[cfg(any(not(feature = "parallel"), target_arch = "wasm32"))]
    {
        items.into_iter().map(work).collect()
    }
}
