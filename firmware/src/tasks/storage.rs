//! The storage: does what the instrument orders, when nothing else is to be done.

use core::pin::pin;
use core::task::{Context, Poll, Waker};

use heapless::spsc::{Consumer, Producer, Queue};
use palpate_node::storage::StorageTask;
use palpate_procedure::storage::{StorageOrder, StorageReport};

use super::StorageClient;
use crate::board::flash::Area;

/// What the storage works with.
pub struct StorageWork {
    task: StorageTask<Area>,
    orders: Consumer<'static, StorageOrder>,
    reports: Producer<'static, StorageReport>,
}

impl StorageWork {
    /// The storage in an area, and the way to it.
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

    /// Whether there is something to do. The idle task asks at every wake-up, and does not wait for
    /// flash for that.
    #[inline(always)]
    pub fn is_due(&self) -> bool {
        // In this order: there is nearly never anything, and the room takes a division.
        (self.orders.ready() || self.task.is_going())
            && self.reports.len() < self.reports.capacity()
    }
}

/// Goes on until there is no order and nothing to report, or no room for it.
// It lies in flash (build.rs), and the idle task does not: nothing may hold its sleep up.
#[inline(never)]
pub fn storage(work: &mut StorageWork) {
    let StorageWork {
        task,
        orders,
        reports,
    } = work;
    while reports.len() < reports.capacity() {
        let going = pin!(task.work(orders.dequeue()));
        // Flash never lets anybody wait: what it does is done when it returns.
        let Poll::Ready(Some(report)) = going.poll(&mut Context::from_waker(Waker::noop())) else {
            return;
        };
        // There is room.
        let _ = reports.enqueue(report);
    }
}
