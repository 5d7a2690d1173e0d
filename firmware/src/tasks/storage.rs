//! The storage: does what the instrument orders, when nothing else is to be done.

use heapless::spsc::{Consumer, Producer, Queue};
use palpate_procedure::storage::{StorageFailure, StorageOrder, StorageReport, Stored};

use super::StorageClient;

/// What the storage works with.
pub struct StorageWork {
    orders: Consumer<'static, StorageOrder>,
    reports: Producer<'static, StorageReport>,
}

impl StorageWork {
    /// The storage, and the way to it.
    pub fn new(
        orders: &'static mut Queue<StorageOrder, 2>,
        reports: &'static mut Queue<StorageReport, 2>,
    ) -> (Self, StorageClient) {
        let (to, orders) = orders.split();
        let (reports, from) = reports.split();
        let client = StorageClient {
            orders: to,
            reports: from,
        };
        (Self { orders, reports }, client)
    }
}

/// Carries out an order, if there is one.
pub fn storage(work: &mut StorageWork) {
    if work.orders.dequeue().is_some() {
        let _ = work.reports.enqueue(StorageReport::Done {
            failure: Some(StorageFailure::Absent),
            stored: Stored::UNAVAILABLE,
        });
    }
}
