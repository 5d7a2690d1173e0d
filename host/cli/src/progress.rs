//! How far something is: a bar on the terminal, and now and then a line where standard error is none.

use std::io::{self, IsTerminal};
use std::sync::Mutex;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};

use crate::notice;

/// How often a line says how far it is. What takes less says nothing.
const EVERY: Duration = Duration::from_secs(30);

/// A bar on the terminal, or lines.
pub struct Progress {
    bar: ProgressBar,
    /// When a line was written last, where lines are.
    said: Option<Mutex<Instant>>,
}

impl Progress {
    /// None, where lines are written while it would stand.
    pub fn hidden() -> Self {
        Self {
            bar: ProgressBar::hidden(),
            said: None,
        }
    }

    /// A bar, or lines, for so many steps.
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

    /// What runs now.
    pub fn say(&self, what: &str) {
        self.bar.set_message(what.to_owned());
    }

    /// A step is done.
    pub fn step(&self) {
        self.bar.inc(1);
        self.line();
    }

    /// So many steps are done.
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

    /// Takes the bar off the terminal.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }
}
