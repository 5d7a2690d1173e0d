//! A thread that owns a board, so that Python stays interruptible while the board is waited for.
//!
//! Threads cannot share a link, and Python runs its signal handlers only in the main thread: the main
//! thread waits here in short turns, and after a signal asks the board's thread to end its wait.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, TryRecvError, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use palpate::library::{self, set_check};
use palpate_cli::failure::Failure;
use palpate_wire::{Frame, Record};
use pyo3::prelude::*;

use crate::errors::{PalpateError, raised};

/// Interval at which signals are handled: a tenth of what a person notices.
const TURN: Duration = Duration::from_millis(20);
/// Longest time of one receive call.
const POLL: Duration = Duration::from_millis(10);
/// Records that are kept for Python: a minute at 1 kHz. Then the board drops and counts.
const KEPT: usize = 1 << 16;
/// Longest wait for the end of an interrupted job, and for the board to close.
const PATIENCE: Duration = Duration::from_millis(100);
const CLOSING: Duration = Duration::from_secs(5);

type Job = Box<dyn FnOnce(&mut library::Board) + Send>;

thread_local! {
    /// Whether this thread shall end its wait for the board.
    static IS_ASKED: RefCell<Arc<AtomicBool>> = RefCell::default();
}

fn is_asked() -> bool {
    IS_ASKED.with_borrow(|is_asked| is_asked.load(Ordering::Relaxed))
}

/// Thread of a board.
pub(crate) struct Worker {
    jobs: Sender<Job>,
    is_asked: Arc<AtomicBool>,
    received: Arc<Mutex<VecDeque<Frame<Record>>>>,
    thread: JoinHandle<()>,
}

impl Worker {
    /// Connects to a board.
    pub(crate) fn start(py: Python<'_>, arguments: Vec<String>) -> PyResult<Self> {
        set_check(is_asked);
        let asked = Arc::new(AtomicBool::new(false));
        let received = Arc::default();
        let (jobs, queue) = channel();
        let (answer, opened) = channel();
        let thread = {
            let (is_asked, received) = (Arc::clone(&asked), Arc::clone(&received));
            thread::spawn(move || {
                IS_ASKED.set(Arc::clone(&is_asked));
                match library::Board::open(&arguments) {
                    Ok(board) => {
                        let _ = answer.send(Ok(()));
                        serve(board, &queue, &is_asked, &received);
                    }
                    Err(failure) => {
                        let _ = answer.send(Err(failure));
                    }
                }
            })
        };
        let worker = Self {
            jobs,
            is_asked: asked,
            received,
            thread,
        };
        worker.wait(py, opened)?.map_err(raised)?;
        Ok(worker)
    }

    /// Does a job with the board. Ctrl-C ends its waits.
    pub(crate) fn run<T: Send + 'static>(
        &self,
        py: Python<'_>,
        job: impl FnOnce(&mut library::Board) -> Result<T, Failure> + Send + 'static,
    ) -> PyResult<T> {
        let (answer, done) = channel();
        let job: Job = Box::new(move |board| {
            // Python may have been interrupted meanwhile.
            let _ = answer.send(job(board));
        });
        self.is_asked.store(false, Ordering::Relaxed);
        self.jobs.send(job).map_err(|_| ended())?;
        self.wait(py, done)?.map_err(raised)
    }

    /// The next received record; `None` while there is none.
    pub(crate) fn next(&self) -> Option<Frame<Record>> {
        let mut received = self.received.lock().unwrap_or_else(PoisonError::into_inner);
        received.pop_front()
    }

    /// Keeps records for [`next`](Self::next).
    pub(crate) fn keep(&self, frames: Vec<Frame<Record>>) {
        let mut received = self.received.lock().unwrap_or_else(PoisonError::into_inner);
        received.extend(frames);
    }

    /// Waits for an answer, and handles signals meanwhile.
    fn wait<T: Send>(&self, py: Python<'_>, mut answer: Receiver<T>) -> PyResult<T> {
        loop {
            // Threads may not share a receiver, so it is moved there and back.
            let (turn, returned) = py.detach(move || (answer.recv_timeout(TURN), answer));
            answer = returned;
            match turn {
                Ok(value) => return Ok(value),
                Err(RecvTimeoutError::Disconnected) => return Err(ended()),
                Err(RecvTimeoutError::Timeout) => {}
            }
            if let Err(signal) = py.check_signals() {
                self.is_asked.store(true, Ordering::Relaxed);
                py.detach(move || {
                    // The job ends soon, or goes on without a receiver.
                    let _ = answer.recv_timeout(PATIENCE);
                });
                return Err(signal);
            }
        }
    }

    /// Closes the link. A board that this program armed is disarmed.
    pub(crate) fn close(self, py: Python<'_>) {
        self.is_asked.store(true, Ordering::Relaxed);
        drop(self.jobs);
        let thread = self.thread;
        py.detach(|| {
            let turns = CLOSING.as_millis() / POLL.as_millis();
            for _ in 0..turns {
                if thread.is_finished() {
                    return;
                }
                thread::sleep(POLL);
            }
        });
    }
}

/// Does jobs until the last sender is gone; reads a real board's records between them.
fn serve(
    mut board: library::Board,
    jobs: &Receiver<Job>,
    is_asked: &AtomicBool,
    received: &Mutex<VecDeque<Frame<Record>>>,
) {
    // The time of the emulated board and of a recording passes only while they are read.
    let mut reads_ahead = !board.is_recording() && !board.is_emulated();
    loop {
        let has_room = || received.lock().is_ok_and(|queue| queue.len() < KEPT);
        let job = if reads_ahead && has_room() {
            match jobs.try_recv() {
                Ok(job) => Some(job),
                Err(TryRecvError::Empty) => None,
                Err(TryRecvError::Disconnected) => return,
            }
        } else {
            match jobs.recv() {
                Ok(job) => Some(job),
                Err(_) => return,
            }
        };
        match job {
            Some(job) => job(&mut board),
            None => match board.receive(POLL) {
                Ok(frames) => {
                    let mut queue = received.lock().unwrap_or_else(PoisonError::into_inner);
                    queue.extend(frames);
                }
                // An interrupt ends a job, not the reading ahead; a lost board is reported to the next job.
                Err(_) => reads_ahead = is_asked.load(Ordering::Relaxed),
            },
        }
    }
}

fn ended() -> PyErr {
    PalpateError::new_err("the connection to the board has ended: connect again")
}
