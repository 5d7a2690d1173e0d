//! Supervision: the watchdog may be fed only when every task has checked in.

use core::sync::atomic::{AtomicBool, Ordering};

/// Supervised tasks. The supervisor itself feeds the watchdog and is not listed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Task {
    /// Reads the first converter.
    Sensing,
    /// Reads the second converter.
    SecondSensing,
    /// Polls the coil's drive.
    Coil,
    /// Runs the procedure.
    Instrument,
}

const TASKS: usize = 4;

/// Check-ins of all tasks since the last poll.
#[derive(Debug)]
pub struct CheckIns([AtomicBool; TASKS]);

impl Default for CheckIns {
    fn default() -> Self {
        Self::new()
    }
}

impl CheckIns {
    /// Creates the state before any check-in.
    #[must_use]
    pub const fn new() -> Self {
        Self([const { AtomicBool::new(false) }; TASKS])
    }

    /// Checks a task in.
    pub fn check_in(&self, task: Task) {
        if let Some(checked_in) = self.0.get(task as usize) {
            checked_in.store(true, Ordering::Relaxed);
        }
    }

    /// Returns whether all tasks have checked in since the last time that it returned `true`.
    pub fn all_alive(&self) -> bool {
        if !self.0.iter().all(|task| task.load(Ordering::Relaxed)) {
            return false;
        }
        for task in &self.0 {
            task.store(false, Ordering::Relaxed);
        }
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [Task; TASKS] = [
        Task::Sensing,
        Task::SecondSensing,
        Task::Coil,
        Task::Instrument,
    ];

    #[test]
    fn one_task_that_hung_is_enough() {
        for hung in ALL {
            let check_ins = CheckIns::new();
            for task in ALL {
                if task != hung {
                    check_ins.check_in(task);
                    check_ins.check_in(task);
                }
                assert!(!check_ins.all_alive());
            }
            check_ins.check_in(hung);
            assert!(check_ins.all_alive());
            assert!(!check_ins.all_alive(), "each has to check in again");
        }
    }
}
