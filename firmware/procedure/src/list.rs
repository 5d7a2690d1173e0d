//! Lists in fixed memory.

use heapless::Vec;

/// As many items as there is room for. `collect` into such a list panics where there are more.
pub(crate) fn gathered<T, const N: usize>(items: impl Iterator<Item = T>) -> Vec<T, N> {
    let mut list = Vec::new();
    for item in items.take(N) {
        let _ = list.push(item);
    }
    list
}
