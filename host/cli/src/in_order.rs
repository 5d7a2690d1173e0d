//! Ordered output of a long parallel computation. Results are passed on as soon as possible, so an
//! interrupted run keeps the results so far.

use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};

use rayon::prelude::*;

use crate::failure::Failure;

/// Computes `count` results on all cores. Passes each to `receive` as soon as it and all earlier
/// results are available; an error of `receive` ends the computation.
pub fn in_order<T: Send>(
    count: usize,
    compute: impl Fn(usize) -> T + Sync,
    receive: impl FnMut(usize, T) -> Result<(), Failure> + Send,
) -> Result<(), Failure> {
    let queue = Mutex::new(Queue {
        next: 0,
        waiting: BTreeMap::new(),
        receive,
    });
    // `par_bridge` takes indices from the front; a parallel range would also start in its middle.
    (0..count).par_bridge().try_for_each(|index| {
        let result = compute(index);
        let mut queue = queue.lock().unwrap_or_else(PoisonError::into_inner);
        queue.add(index, result)
    })
}

struct Queue<T, R> {
    /// Index of the next result to be passed on.
    next: usize,
    /// Later results that are already available.
    waiting: BTreeMap<usize, T>,
    receive: R,
}

impl<T, R: FnMut(usize, T) -> Result<(), Failure>> Queue<T, R> {
    fn add(&mut self, index: usize, result: T) -> Result<(), Failure> {
        self.waiting.insert(index, result);
        while let Some(result) = self.waiting.remove(&self.next) {
            (self.receive)(self.next, result)?;
            self.next += 1;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicUsize, Ordering};
    use std::thread::sleep;
    use std::time::Duration;

    use super::*;

    #[test]
    fn results_come_in_order_and_before_the_end() {
        let computed = AtomicUsize::new(0);
        let compute = |index: usize| {
            // Even indices take longer, so neighbours finish in the wrong order.
            sleep(Duration::from_millis(if index.is_multiple_of(2) {
                4
            } else {
                1
            }));
            computed.fetch_add(1, Ordering::Relaxed);
            index * index
        };
        let mut received = Vec::new();
        let mut computed_at_first = None;
        in_order(64, compute, |index, square| {
            computed_at_first.get_or_insert(computed.load(Ordering::Relaxed));
            received.push((index, square));
            Ok(())
        })
        .unwrap();
        let squares: Vec<(usize, usize)> = (0..64).map(|index| (index, index * index)).collect();
        assert_eq!(received, squares);
        assert!(computed_at_first.unwrap() < 32, "{computed_at_first:?}");
    }

    #[test]
    fn a_reader_that_has_gone_ends_the_computation() {
        let computed = AtomicUsize::new(0);
        let compute = |_| {
            sleep(Duration::from_millis(1));
            computed.fetch_add(1, Ordering::Relaxed)
        };
        let gone = || Failure::Output(std::io::ErrorKind::BrokenPipe.into());
        let ended = in_order(10_000, compute, |_, _| Err(gone()));
        assert!(matches!(ended, Err(Failure::Output(_))));
        assert!(computed.load(Ordering::Relaxed) < 1_000);
    }
}
