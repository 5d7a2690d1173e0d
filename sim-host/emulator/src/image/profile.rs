//! Profile of the processor's cycles, by instruction and by exception.

use std::collections::BTreeMap;
use std::ops::Range;

use ldc161x_sim::Time;

use crate::image::{FLASH, Image};
use crate::rp2040::memory::{RAM, RAM_SIZE};

/// Cost of an instruction.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Cost {
    /// Number of executions.
    pub count: u64,
    /// Own cycles, wait states included.
    pub own_cycles: u64,
    /// Own cycles plus those of the shared functions that it called, directly or indirectly; zero
    /// for an instruction of a shared function.
    pub charged_cycles: u64,
}

/// Cost of an exception handler. Exception 0 is the code outside of all handlers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Handler {
    /// Number of completed runs.
    pub runs: u64,
    /// Cycles of all runs, entries included, without those of handlers that interrupted them.
    pub cycles: u64,
    /// Cycles of the longest run.
    pub worst_cycles: u64,
    /// Shortest and longest latency from pending to the first instruction. The latency counts from
    /// the start of the instruction during which the exception became pending, so it is too long by
    /// part of an instruction, never too short.
    pub start: Option<(Time, Time)>,
}

impl Handler {
    /// Difference between the longest and the shortest latency.
    #[must_use]
    pub fn start_jitter(&self) -> Time {
        self.start
            .map_or(Time::ZERO, |(least, greatest)| greatest - least)
    }

    /// Adds another profile's runs of this handler.
    pub fn join(&mut self, other: &Self) {
        self.runs += other.runs;
        self.cycles += other.cycles;
        self.worst_cycles = self.worst_cycles.max(other.worst_cycles);
        if let Some((least, greatest)) = other.start {
            self.started_after(least);
            self.started_after(greatest);
        }
    }

    fn started_after(&mut self, delay: Time) {
        let (least, greatest) = self.start.unwrap_or((delay, delay));
        self.start = Some((least.min(delay), greatest.max(delay)));
    }

    fn ended_after(&mut self, cycles: u64) {
        self.runs += 1;
        self.worst_cycles = self.worst_cycles.max(cycles);
    }
}

/// A run of a handler that has not ended.
#[derive(Clone, Copy, Debug)]
struct HandlerRun {
    exception: u32,
    cycles: u64,
    /// Index of the run's last instruction outside of shared functions.
    caller: usize,
    /// Whether the run was observed from its entry on.
    is_whole: bool,
}

/// Counts since the start of [`EmulatedBoard::profile`](crate::EmulatedBoard::profile).
#[derive(Clone, Debug)]
pub struct Profile {
    /// Costs by half-word: first those of memory, then those of the image's flash.
    costs: Vec<Cost>,
    is_shared: Vec<bool>,
    handlers: BTreeMap<u32, Handler>,
    runs: Vec<HandlerRun>,
    /// Pending interrupts, one bit each; `pending_since` has the times since when they are pending.
    pending: u32,
    pending_since: [Time; 32],
}

/// Number of half-words of memory, whose costs precede those of flash.
const RAM_HALF_WORDS: usize = RAM_SIZE / 2;
/// Exception number of interrupt 0.
const FIRST_INTERRUPT: u32 = 16;

fn index(address: u32) -> usize {
    match address.checked_sub(RAM) {
        Some(offset) => offset as usize / 2,
        None => RAM_HALF_WORDS + address.saturating_sub(FLASH) as usize / 2,
    }
}

const fn address(index: usize) -> u32 {
    match index.checked_sub(RAM_HALF_WORDS) {
        Some(flash) => FLASH + 2 * flash as u32,
        None => RAM + 2 * index as u32,
    }
}

impl Profile {
    /// An empty profile. The cost of functions at shared addresses is charged to their callers.
    pub(crate) fn new(image: &Image, shared: &[Range<u32>]) -> Self {
        let half_words = index(FLASH + image.flash_bytes()) + 1;
        let mut is_shared = vec![false; half_words];
        for range in shared {
            let range = index(range.start)..index(range.end);
            if let Some(functions) = is_shared.get_mut(range) {
                functions.fill(true);
            }
        }
        Self {
            costs: vec![Cost::default(); half_words],
            is_shared,
            handlers: BTreeMap::new(),
            runs: Vec::new(),
            pending: 0,
            pending_since: [Time::ZERO; 32],
        }
    }

    /// Counts an instruction executed in an exception.
    pub(crate) fn executed(&mut self, pc: u32, cycles: u64, exception: u32) {
        let index = index(pc);
        let shared = self.is_shared.get(index).copied().unwrap_or_default();
        let run = self.run_of(exception);
        run.cycles += cycles;
        if !shared {
            run.caller = index;
        }
        let caller = run.caller;
        if let Some(cost) = self.costs.get_mut(index) {
            cost.count += 1;
            cost.own_cycles += cycles;
        }
        if let Some(cost) = self.costs.get_mut(caller) {
            cost.charged_cycles += cycles;
        }
        self.handlers.entry(exception).or_default().cycles += cycles;
    }

    /// The current run of an exception; drops runs whose end was not observed.
    fn run_of(&mut self, exception: u32) -> &mut HandlerRun {
        if let Some(depth) = self.runs.iter().rposition(|it| it.exception == exception) {
            self.runs.truncate(depth + 1);
        } else {
            self.runs.push(HandlerRun {
                exception,
                cycles: 0,
                caller: 0,
                is_whole: false,
            });
        }
        let last = self.runs.len() - 1;
        &mut self.runs[last]
    }

    /// Ends the run of the handler that has returned.
    pub(crate) fn returned(&mut self) {
        if let Some(run) = self.runs.pop().filter(|run| run.is_whole) {
            let handler = self.handlers.entry(run.exception).or_default();
            handler.ended_after(run.cycles);
        }
    }

    /// Enters an exception; its first instruction follows.
    pub(crate) fn entered(&mut self, exception: u32, cycles: u64, now: Time) {
        self.runs.push(HandlerRun {
            exception,
            cycles,
            caller: 0,
            is_whole: true,
        });
        let handler = self.handlers.entry(exception).or_default();
        handler.cycles += cycles;
        if let Some(number) = exception.checked_sub(FIRST_INTERRUPT)
            && self.pending >> number & 1 == 1
        {
            self.pending &= !(1 << number);
            handler.started_after(now - self.pending_since[number as usize]);
        }
    }

    /// Sets the pending interrupts; new ones are pending since `since`.
    pub(crate) fn pending(&mut self, pending: u32, since: Time) {
        let new = pending & !self.pending;
        self.pending = pending;
        for number in (0..32).filter(|number| new >> number & 1 == 1) {
            self.pending_since[number] = since;
        }
    }

    /// Drops unfinished runs and pending interrupts, after a reset of the chip.
    pub(crate) fn interrupted(&mut self) {
        self.runs.clear();
        self.pending = 0;
    }

    /// Cost of every executed instruction, by the instruction's address.
    pub fn instructions(&self) -> impl Iterator<Item = (u32, Cost)> {
        let executed = self.costs.iter().enumerate();
        executed
            .filter(|(_, cost)| cost.count > 0 || cost.charged_cycles > 0)
            .map(|(index, cost)| (address(index), *cost))
    }

    /// Cost of every exception's handler, by the exception's number.
    #[must_use]
    pub const fn handlers(&self) -> &BTreeMap<u32, Handler> {
        &self.handlers
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CODE: u32 = RAM + 0x100;
    const HELPER: u32 = RAM + 0x200;

    fn profile() -> Profile {
        let helper = HELPER..HELPER + 4;
        Profile {
            costs: vec![Cost::default(); RAM_HALF_WORDS],
            is_shared: (0..RAM_HALF_WORDS)
                .map(|index| helper.contains(&address(index)))
                .collect(),
            handlers: BTreeMap::new(),
            runs: Vec::new(),
            pending: 0,
            pending_since: [Time::ZERO; 32],
        }
    }

    fn cost(profile: &Profile, at: u32) -> Cost {
        let found = profile.instructions().find(|(address, _)| *address == at);
        found.map(|(_, cost)| cost).unwrap_or_default()
    }

    #[test]
    fn what_a_shared_function_costs_is_charged_to_its_caller_in_the_same_handler() {
        let mut profile = profile();
        profile.executed(CODE, 1, 0);
        profile.executed(HELPER, 10, 0);
        profile.entered(16, 16, Time::ZERO);
        profile.executed(CODE + 2, 2, 16);
        profile.executed(HELPER, 10, 16);
        profile.returned();
        profile.executed(HELPER + 2, 100, 0);
        assert_eq!(cost(&profile, CODE).charged_cycles, 111);
        assert_eq!(cost(&profile, CODE + 2).charged_cycles, 12);
        assert_eq!(cost(&profile, HELPER).own_cycles, 20);
        assert_eq!(cost(&profile, HELPER).charged_cycles, 0);
    }
}
