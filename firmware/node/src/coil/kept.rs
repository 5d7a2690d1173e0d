//! Energy in the coil, in memory that no reset clears: a new run continues the account of the previous
//! run. A loss of power clears it; `Heat` of the procedure has its own bound for the energy that is then
//! left in the copper.

/// Energy and its complement. After a loss of power, memory contains a valid pair by chance once in
/// 2^32 times.
pub type EnergyWords = [u32; 2];

/// Returns the words for an energy.
pub(super) const fn words(energy_j: f32) -> EnergyWords {
    let bits = energy_j.to_bits();
    [bits, !bits]
}

/// Returns the energy of the words, J; `None` if they are not valid.
pub(super) fn energy_j([bits, complement]: EnergyWords) -> Option<f32> {
    let energy_j = f32::from_bits(bits);
    (complement == !bits && energy_j >= 0.0).then_some(energy_j)
}

#[cfg(test)]
mod tests {
    use super::super::bench::run;
    use super::*;

    #[test]
    fn a_reset_forgets_no_energy_and_a_loss_of_power_does() {
        let mut before = run(words(40.0));
        assert_eq!(before.account().energy_j(), 40.0);
        for _ in 0..2_000 {
            before.hardware.now_us += 1_000;
            before.poll();
        }
        // The coil gives off 3.5 W for 2 s.
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
