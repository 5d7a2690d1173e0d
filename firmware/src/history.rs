//! A quantity over the last hundred milliseconds, as steps.

use core::cell::Cell;

use critical_section::Mutex;

/// Steps that are kept: longer than the slowest conversion of the first channel (26 ms at 40 MHz)
/// and the three that follow it.
const STEPS: usize = 128;

#[derive(Clone, Copy)]
struct Step {
    since_us: u64,
    value: f32,
}

/// Steps, written by one task and read by another.
pub struct History {
    steps: [Mutex<Cell<Step>>; STEPS],
    /// How many were written.
    count: Mutex<Cell<usize>>,
}

impl History {
    /// Without any step.
    pub const fn new() -> Self {
        const NONE: Step = Step {
            since_us: 0,
            value: 0.0,
        };
        Self {
            steps: [const { Mutex::new(Cell::new(NONE)) }; STEPS],
            count: Mutex::new(Cell::new(0)),
        }
    }

    /// Adds the step that began then.
    pub fn push(&self, since_us: u64, value: f32) {
        critical_section::with(|section| {
            let count = self.count.borrow(section);
            if let Some(step) = self.steps.get(count.get() % STEPS) {
                step.borrow(section).set(Step { since_us, value });
            }
            count.set(count.get().wrapping_add(1));
        });
    }

    /// Mean over a window that has passed; the last step counts as lasting. Nothing if the window
    /// is older than the steps, or empty.
    pub fn mean(&self, from_us: u64, to_us: u64) -> Option<f32> {
        let count = critical_section::with(|section| self.count.borrow(section).get());
        let mut end_us = to_us;
        let mut sum = 0.0;
        for back in 1..=count.min(STEPS - 1) {
            let step = self.steps.get(count.wrapping_sub(back) % STEPS)?;
            let Step { since_us, value } =
                critical_section::with(|section| step.borrow(section).get());
            if since_us >= end_us {
                continue;
            }
            let begin_us = since_us.max(from_us);
            sum += value * (end_us - begin_us) as f32;
            end_us = begin_us;
            if begin_us == from_us {
                let length_us = to_us.saturating_sub(from_us);
                return (length_us > 0).then(|| sum / length_us as f32);
            }
        }
        None
    }
}
