//! The bridge on pins of `embedded-hal`'s traits.

use embedded_hal::digital::{InputPin, OutputPin};
use embedded_hal::pwm::SetDutyCycle;

use crate::output::Output;

/// A bridge whose inputs IN1 and IN2 are two outputs of one phase-correct PWM, with its nSLEEP and
/// nFAULT pins.
///
/// If one register holds both compare values, writing that register is shorter and changes both at
/// once; a program may do that instead of using this type, as the Pico's firmware does
/// (`firmware/src/board/rp2040/control`).
#[derive(Debug)]
pub struct HBridge<A, B, S, F> {
    in1: A,
    in2: B,
    sleep: S,
    fault: F,
    full_level: u16,
}

/// The pin that failed, with its error.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PinError<A, B, S> {
    /// IN1.
    In1(A),
    /// IN2.
    In2(B),
    /// nSLEEP.
    Sleep(S),
}

/// Error of a bridge with these pins.
type PinFailure<A, B, S> = PinError<
    <A as embedded_hal::pwm::ErrorType>::Error,
    <B as embedded_hal::pwm::ErrorType>::Error,
    <S as embedded_hal::digital::ErrorType>::Error,
>;

impl<A: SetDutyCycle, B: SetDutyCycle, S: OutputPin, F: InputPin> HBridge<A, B, S, F> {
    /// Creates a bridge and puts it to sleep.
    ///
    /// # Errors
    /// A pin failed.
    pub fn new(
        (in1, in2): (A, B),
        sleep: S,
        fault: F,
        full_level: u16,
    ) -> Result<Self, PinFailure<A, B, S>> {
        let mut bridge = Self {
            in1,
            in2,
            sleep,
            fault,
            full_level,
        };
        bridge.apply(&Output::OFF)?;
        Ok(bridge)
    }

    /// Applies an output of the drive. A bridge that goes to sleep does so before the levels
    /// change; a bridge that wakes does so after they have changed.
    ///
    /// # Errors
    /// A pin failed. The other pins have been set nevertheless.
    pub fn apply(&mut self, output: &Output) -> Result<(), PinFailure<A, B, S>> {
        let asleep = if output.awake {
            Ok(())
        } else {
            self.sleep.set_low().map_err(PinError::Sleep)
        };
        let scaled = |level: u16, most: u16| {
            let level = u32::from(level.min(self.full_level)) * u32::from(most);
            // The result is at most `most`, which fits in 16 bits.
            (level / u32::from(self.full_level.max(1))) as u16
        };
        let (first, second) = (self.in1.max_duty_cycle(), self.in2.max_duty_cycle());
        let in1 = scaled(output.levels.in1, first);
        let in2 = scaled(output.levels.in2, second);
        let in1 = self.in1.set_duty_cycle(in1).map_err(PinError::In1);
        let in2 = self.in2.set_duty_cycle(in2).map_err(PinError::In2);
        asleep.and(in1).and(in2)?;
        if output.awake {
            self.sleep.set_high().map_err(PinError::Sleep)?;
        }
        Ok(())
    }

    /// Whether the bridge reports a fault.
    ///
    /// # Errors
    /// The pin failed.
    pub fn is_faulty(&mut self) -> Result<bool, F::Error> {
        self.fault.is_low()
    }
}

#[cfg(test)]
mod tests {
    use embedded_hal_mock::eh1::digital::{
        Mock as Pin, State as Level, Transaction as PinTransaction,
    };
    use embedded_hal_mock::eh1::pwm::{Mock as Pwm, Transaction as PwmTransaction};

    use super::*;
    use crate::output::Levels;

    fn duty(most: u16, of: [u16; 3]) -> Pwm {
        let calls = of
            .into_iter()
            .flat_map(|duty| {
                [
                    PwmTransaction::max_duty_cycle(most),
                    PwmTransaction::set_duty_cycle(duty),
                ]
            })
            .collect::<heapless::Vec<_, 6>>();
        Pwm::new(&calls)
    }

    #[test]
    fn it_sleeps_first_wakes_last_and_scales_the_levels() {
        let (mut in1, mut in2) = (duty(1_920, [0, 1_920, 0]), duty(960, [0, 240, 0]));
        let mut sleep = Pin::new(&[
            PinTransaction::set(Level::Low),
            PinTransaction::set(Level::High),
            PinTransaction::set(Level::Low),
        ]);
        let mut fault = Pin::new(&[PinTransaction::get(Level::Low)]);
        let pins = (in1.clone(), in2.clone());
        let mut bridge = HBridge::new(pins, sleep.clone(), fault.clone(), 960).unwrap();
        let output = Output {
            awake: true,
            levels: Levels { in1: 960, in2: 240 },
            limit_low: false,
        };
        bridge.apply(&output).unwrap();
        bridge.apply(&Output::OFF).unwrap();
        assert!(bridge.is_faulty().unwrap());
        in1.done();
        in2.done();
        sleep.done();
        fault.done();
    }
}
