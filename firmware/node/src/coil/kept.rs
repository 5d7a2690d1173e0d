//! The energy that the coil has taken, in memory that no reset clears: a new run's account goes on where
//! that of the run before ended. A loss of power clears it; what is left in the copper by then has a
//! bound of its own (`Heat` of the procedure).

/// The energy, and its complement: a pattern that memory has after a loss of power once in 2^32 times.
pub type EnergyWords = [u32; 2];

/// The words for an energy.
pub(super) const fn words(energy_j: f32) -> EnergyWords {
    let bits = energy_j.to_bits();
    [bits, !bits]
}

/// The energy of words, J; nothing if they are none.
pub(super) fn energy_j([bits, complement]: EnergyWords) -> Option<f32> {
    let energy_j = f32::from_bits(bits);
    (complement == !bits && energy_j >= 0.0).then_some(energy_j)
}

#[cfg(test)]
mod tests {
    use coil_hbridge::{Averages, Drive, Order, Trace};

    use super::super::{
        AVERAGED_BLOCKS, CoilCircuit, CoilHardware, CoilManager, LastPeriod, SlowReadings,
        TRACE_LENGTH,
    };
    use super::*;

    /// A coil at rest, and memory that a reset leaves.
    struct Bench {
        now_us: u64,
        drive: Drive,
        memory: EnergyWords,
        averages: Averages<AVERAGED_BLOCKS>,
        trace: Trace<TRACE_LENGTH>,
    }

    impl CoilHardware for Bench {
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
            // 12 V behind 100 over 10 kiloohm.
            SlowReadings {
                thermistor: 2048,
                supply: 1354,
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

    /// A run that begins with these words in memory.
    fn run(memory: EnergyWords) -> CoilManager<Bench> {
        let (supervisor, drive) = CoilManager::<Bench>::drive().unwrap();
        let bench = Bench {
            now_us: 0,
            drive,
            memory,
            averages: Averages::new(),
            trace: Trace::new(),
        };
        CoilManager::new(bench, supervisor)
    }

    #[test]
    fn a_reset_forgets_no_energy_and_a_loss_of_power_does() {
        let mut before = run(words(40.0));
        assert_eq!(before.account().energy_j(), 40.0);
        for _ in 0..2_000 {
            before.hardware.now_us += 1_000;
            before.poll();
        }
        // 3.5 W for 2 s.
        let left_j = before.account().energy_j();
        assert!((left_j - 33.0).abs() < 0.3, "{left_j}");
        let after = run(before.hardware.memory);
        assert_eq!(after.account().energy_j(), left_j);
        assert_eq!(run([0x5A5A_5A5A; 2]).account().energy_j(), 0.0);
    }

    #[test]
    fn an_energy_comes_back_and_nothing_else_does() {
        for of in [0.0, 1e-3, 17.5, 60.0] {
            assert_eq!(energy_j(words(of)), Some(of));
            let [bits, complement] = words(of);
            assert_eq!(energy_j([bits ^ 1 << 20, complement]), None);
        }
        for other in [[0, 0], [u32::MAX, u32::MAX], words(-1.0), words(f32::NAN)] {
            assert_eq!(energy_j(other), None, "{other:?}");
        }
    }
}
