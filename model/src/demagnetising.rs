//! Current burst that removes an elastomer's magnetic memory.
//!
//! An alternating current of falling amplitude, I(t) = I_0 exp(-t/tau) sin(2 pi f t), takes the
//! material through ever smaller hysteresis loops towards zero. Only the decay matters, not the
//! exact values, so the burst is computed with the coarse functions of
//! [`math::coarse`](crate::math::coarse).

use crate::math::coarse;
use crate::units::{Ampere, Hertz, OutOfRange, Second};

/// A decaying sine of current: I(t) = I_0 exp(-t/tau) sin(2 pi f t).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Burst {
    amplitude: Ampere,
    decay: Second,
    frequency: Hertz,
}

impl Burst {
    /// Creates a burst from I_0, tau and f, all above zero.
    pub fn new(amplitude: Ampere, decay: Second, frequency: Hertz) -> Result<Self, OutOfRange> {
        Ok(Self {
            amplitude: Ampere::positive(amplitude.0)?,
            decay: Second::positive(decay.0)?,
            frequency: Hertz::positive(frequency.0)?,
        })
    }

    /// Current at `time` since the start; zero before it.
    ///
    /// Error at most 2.0e-3 of I_0 within 1000 periods and 10 tau.
    ///
    /// ```
    /// use palpate_model::demagnetising::Burst;
    /// use palpate_model::units::{Ampere, Hertz, Second};
    /// let burst = Burst::new(Ampere(8.0), Second(0.2), Hertz(25.0))?;
    /// assert!((burst.current(Second(0.01)).0 - 8.0 * 0.951_229).abs() < 0.016);
    /// # Ok::<(), palpate_model::units::OutOfRange>(())
    /// ```
    pub fn current(&self, time: Second) -> Ampere {
        if time.0 <= 0.0 {
            return Ampere(0.0);
        }
        let envelope = coarse::decay(time / self.decay);
        self.amplitude * (envelope * coarse::sin_turns(time.0 * self.frequency.0))
    }

    /// Time until the envelope has fallen to `residual`: tau ln(I_0/residual), with a relative
    /// error of at most 3.0e-7 for a residual below half of I_0. Zero if the residual is not below
    /// I_0.
    pub fn duration(&self, residual: Ampere) -> Second {
        let ratio = self.amplitude / residual;
        if ratio > 1.0 {
            self.decay * crate::math::ln(ratio)
        } else {
            Second(0.0)
        }
    }
}
