//! Progress: a bar on a terminal, otherwise an occasional line on standard error.

use std::io::{self, IsTerminal};
use std::sync::Mutex;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};

use crate::notice;

/// Interval between two lines of progress. A computation that is shorter prints none.
const EVERY: Duration = Duration::from_secs(30);

/// A progress bar on the terminal, or lines of progress on standard error.
pub struct Progress {
    bar: ProgressBar,
    /// Time of the last line; `None` with a bar.
    said: Option<Mutex<Instant>>,
}

impl Progress {
    /// Creates a hidden progress, for verbs that print lines while they run.
    pub fn hidden() -> Self {
        Self {
            bar: ProgressBar::hidden(),
            said: None,
        }
    }

    /// Creates a bar, or lines, for `steps` steps.
    pub fn new(steps: usize) -> Self {
        if !io::stderr().is_terminal() {
            let bar = ProgressBar::hidden();
            bar.set_length(steps as u64);
            let said = Some(Mutex::new(Instant::now()));
            return Self { bar, said };
        }
        let bar = ProgressBar::new(steps as u64);
        if let Ok(style) = ProgressStyle::with_template("{bar:30} {pos}/{len}  {eta} left  {msg}") {
            bar.set_style(style);
        }
        Self { bar, said: None }
    }

    /// Sets the message beside the bar.
    pub fn say(&self, what: &str) {
        self.bar.set_message(what.to_owned());
    }

    /// Counts one completed step.
    pub fn step(&self) {
        self.bar.inc(1);
        self.line();
    }

    /// Sets the number of completed steps.
    pub fn at(&self, steps: u64) {
        self.bar.set_position(steps);
        self.line();
    }

    fn line(&self) {
        let said = self.said.as_ref().and_then(|said| said.lock().ok());
        let Some(mut said) = said.filter(|said| said.elapsed() >= EVERY) else {
            return;
        };
        *said = Instant::now();
        let (done, all) = (self.bar.position(), self.bar.length().unwrap_or_default());
        notice::say(format_args!("{done} of {all} done"));
    }

    /// Removes the bar from the terminal.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }
}
