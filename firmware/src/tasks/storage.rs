//! Storage task: executes the instrument's orders when no other task is ready.

use core::pin::pin;
use core::task::{Context, Poll, Waker};

use heapless::spsc::{Consumer, Producer, Queue};
use palpate_node::storage::StorageTask;
use palpate_procedure::storage::{StorageOrder, StorageReport};

use super::StorageClient;
use crate::board::flash::Area;

/// Resources of the storage task.
pub struct StorageWork {
    task: StorageTask<Area>,
    orders: Consumer<'static, StorageOrder>,
    reports: Producer<'static, StorageReport>,
}

impl StorageWork {
    /// Creates the storage in an area, and the queues to and from it.
    pub fn new(
        area: Area,
        orders: &'static mut Queue<StorageOrder, 2>,
        reports: &'static mut Queue<StorageReport, 2>,
    ) -> (Self, StorageClient) {
        let (to, orders) = orders.split();
        let (reports, from) = reports.split();
        let task = StorageTask::new(area);
        let client = StorageClient {
            orders: to,
            reports: from,
        };
        let work = Self {
            task,
            orders,
            reports,
        };
        (work, client)
    }

    /// Returns whether there is work. The idle task calls it at every wake-up, so it does not wait for
    /// flash.
    #[inline(always)]
    pub fn is_due(&self) -> bool {
        // The checks are in this order because there is rarely an order, and the space check needs a
        // division.
        (self.orders.ready() || self.task.is_going())
            && self.reports.len() < self.reports.capacity()
    }
}

/// Works until there is no order left and no report to make, or no space for a report.
// This function is in flash (build.rs). The idle task is in RAM, so that flash cannot delay its sleep.
#[inline(never)]
pub fn storage(work: &mut StorageWork) {
    let StorageWork {
        task,
        orders,
        reports,
    } = work;
    while reports.len() < reports.capacity() {
        let going = pin!(task.work(orders.dequeue()));
        // The flash driver is blocking: an operation has completed when it returns.
        let Poll::Ready(Some(report)) = going.poll(&mut Context::from_waker(Waker::noop())) else {
            return;
        };
        // The space for a report was checked before the storage started to work.
        let _ = reports.enqueue(report);
    }
}
