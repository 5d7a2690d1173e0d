//! Simulated hardware of a coil at rest, for tests: divider readings, and memory that keeps its content
//! in a reset.

use coil_hbridge::{Averages, Drive, Order, Trace};

use super::{
    AVERAGED_BLOCKS, CoilCircuit, CoilHardware, CoilManager, EnergyWords, LastPeriod, SlowReadings,
    TRACE_LENGTH,
};

/// ADC reading of a 12 V supply through a divider of 10 kiloohm and 100 kiloohm; 4096 counts are 3.3 V.
pub(super) const SUPPLY_12_V: u16 = 1_354;

pub(super) struct CoilTestBench {
    pub(super) now_us: u64,
    drive: Drive,
    pub(super) memory: EnergyWords,
    /// Supply reading.
    pub(super) supply: u16,
    averages: Averages<AVERAGED_BLOCKS>,
    trace: Trace<TRACE_LENGTH>,
}

impl CoilHardware for CoilTestBench {
    const CIRCUIT: CoilCircuit = CoilCircuit::REFERENCE;

    fn now_us(&self) -> u64 {
        self.now_us
    }

    fn bridge_off(&mut self) {}

    fn run(&mut self, _: bool) {}

    fn with_drive<T>(&mut self, work: impl FnOnce(&mut Drive) -> T) -> Option<T> {
        Some(work(&mut self.drive))
    }

    fn apply(&mut self, order: &Order) {
        self.drive.apply(order);
    }

    fn slow_readings(&self) -> SlowReadings {
        SlowReadings {
            thermistor: 2048,
            supply: self.supply,
        }
    }

    fn take_supply_at_off(&mut self) -> Option<u16> {
        None
    }

    fn kept_energy(&self) -> EnergyWords {
        self.memory
    }

    fn keep_energy(&mut self, words: EnergyWords) {
        self.memory = words;
    }

    fn last_period(&self) -> LastPeriod {
        LastPeriod {
            number: 0,
            ended_us: self.now_us,
        }
    }

    fn averages(&self) -> &Averages<AVERAGED_BLOCKS> {
        &self.averages
    }

    fn trace(&self) -> &Trace<TRACE_LENGTH> {
        &self.trace
    }
}

/// Creates a manager for a run that starts with these words in memory.
pub(super) fn run(memory: EnergyWords) -> CoilManager<CoilTestBench> {
    let (supervisor, drive) = CoilTestBench::CIRCUIT.drive().unwrap();
    let bench = CoilTestBench {
        now_us: 0,
        drive,
        memory,
        supply: SUPPLY_12_V,
        averages: Averages::new(),
        trace: Trace::new(),
    };
    CoilManager::new(bench, supervisor)
}
