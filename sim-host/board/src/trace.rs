//! Pins, bus and current over time, as a value change dump (IEEE 1364-2005, clause 18).

use std::fmt::Write as _;

/// The digital signals, by name.
pub(crate) const SIGNALS: [&str; 6] = ["sda", "scl", "intb", "sd", "nsleep", "led"];

/// A trace in nanoseconds; write its text to a file that ends with `.vcd`.
#[derive(Clone, Debug)]
pub struct Trace {
    text: String,
    levels: [Option<bool>; SIGNALS.len()],
    current_a: f64,
    time_ns: Option<u64>,
}

impl Trace {
    pub(crate) fn new() -> Self {
        let mut text = String::from("$timescale 1ns $end\n$scope module board $end\n");
        for (code, name) in ('!'..).zip(SIGNALS) {
            let _ = writeln!(text, "$var wire 1 {code} {name} $end");
        }
        text.push_str("$var real 64 i current_a $end\n$upscope $end\n$enddefinitions $end\n");
        Self {
            text,
            levels: [None; SIGNALS.len()],
            current_a: f64::NAN,
            time_ns: None,
        }
    }

    fn at(&mut self, now_ps: u64) {
        let now_ns = now_ps / 1_000;
        if self.time_ns != Some(now_ns) {
            self.time_ns = Some(now_ns);
            let _ = writeln!(self.text, "#{now_ns}");
        }
    }

    pub(crate) fn level(&mut self, now_ps: u64, signal: usize, level: bool) {
        let Some(known) = self.levels.get_mut(signal) else {
            return;
        };
        if *known != Some(level) {
            *known = Some(level);
            self.at(now_ps);
            let code = char::from(b'!' + signal as u8);
            let _ = writeln!(self.text, "{}{code}", u8::from(level));
        }
    }

    pub(crate) fn current(&mut self, now_ps: u64, current_a: f64) {
        if self.current_a != current_a {
            self.current_a = current_a;
            self.at(now_ps);
            let _ = writeln!(self.text, "r{current_a} i");
        }
    }

    /// The dump so far.
    #[must_use]
    pub fn text(&self) -> &str {
        &self.text
    }
}
