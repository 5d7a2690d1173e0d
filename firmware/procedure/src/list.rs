//! Lists of fixed capacity.

use heapless::Vec;

/// Collects as many items as fit. `collect` into such a list panics if there are more.
pub(crate) fn gathered<T, const N: usize>(items: impl Iterator<Item = T>) -> Vec<T, N> {
    let mut list = Vec::new();
    for item in items.take(N) {
        let _ = list.push(item);
    }
    list
}
