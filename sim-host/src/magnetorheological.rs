//! The magnetorheological effect: the actuated layer stiffens with the current.
//!
//! c_D = c_D0 (1 + ε σ). The stiffening σ is 0 without field and 1 at the peak current. σ follows
//! the current through three stages:
//!
//! 1. saturation: s(B)/s(B_peak) with s(B) = B²/(B² + Bc²), and the field B proportional to the
//!    current (SOURCES.md section 4, and the stack files);
//! 2. memory: a share m of the stiffening goes through a play operator, the elementary model of
//!    hysteresis (SOURCES.md 3.5; Visintin, "Differential models of hysteresis", 1994);
//! 3. a first-order lag (SOURCES.md 3.6).

/// Half the width of the play operator, in units of the stiffening at the peak (guess: the sources
/// give the remembered share, not the width). From a fresh sample, the full excursion still reaches
/// σ = 1, and a return to zero current leaves a third of the share m.
pub const PLAY_HALF_WIDTH: f64 = 0.25;

/// The law and its imperfections.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MagnetorheologicalParameters {
    /// ε, relative rise of the spring at the peak current, 0 to 20.
    pub stiffening_at_peak: f64,
    /// Field at the peak current, T, 10⁻⁴ to 3.
    pub field_at_peak_t: f64,
    /// Bc, field of half the saturated stiffening, T, 10⁻³ to 10.
    pub field_half_t: f64,
    /// Share of the stiffening that goes through the play operator, 0 to 0.9.
    pub memory: f64,
    /// Time constant of the lag, s, 0 to 1.
    pub lag_s: f64,
    /// d ln ε / dT, 1/K, ±0.05.
    pub stiffening_per_kelvin: f64,
}

impl MagnetorheologicalParameters {
    /// s(B)/s(B_peak) at a current relative to the peak; an even function.
    ///
    /// ```
    /// use palpate_sim::magnetorheological::MagnetorheologicalParameters;
    ///
    /// let law = MagnetorheologicalParameters {
    ///     stiffening_at_peak: 0.1,
    ///     field_at_peak_t: 0.25,
    ///     field_half_t: 0.25,
    ///     memory: 0.0,
    ///     lag_s: 0.0,
    ///     stiffening_per_kelvin: 0.0,
    /// };
    /// assert_eq!(law.saturation(0.0), 0.0);
    /// assert_eq!(law.saturation(-1.0), 1.0);
    /// assert!((law.saturation(0.5) - 0.4).abs() < 1e-15); // (1/5) / (1/2)
    /// ```
    #[must_use]
    pub fn saturation(&self, relative_current: f64) -> f64 {
        let square = relative_current * relative_current;
        let half = self.field_half_t / self.field_at_peak_t;
        square * (1.0 + half * half) / (square + half * half)
    }

    /// ε at a temperature `warmer_k` above that of calibration, K.
    #[must_use]
    pub fn strength(&self, warmer_k: f64) -> f64 {
        self.stiffening_at_peak * libm::exp(self.stiffening_per_kelvin * warmer_k)
    }

    /// Stiffening to which the lag settles.
    #[must_use]
    pub fn target(&self, saturation: f64, play: Play) -> f64 {
        let remembered = play.0 / (1.0 - PLAY_HALF_WIDTH);
        (1.0 - self.memory) * saturation + self.memory * remembered
    }

    /// Stiffening after a time in which its target moved linearly from `target.0` to `target.1`;
    /// exact.
    #[must_use]
    pub fn relax(&self, stiffening: f64, target: (f64, f64), duration_s: f64) -> f64 {
        if self.lag_s == 0.0 {
            return target.1;
        }
        if duration_s == 0.0 {
            return stiffening;
        }
        let periods = duration_s / self.lag_s;
        let grown = -libm::expm1(-periods);
        let behind = (target.1 - target.0) / periods;
        target.1 - behind * grown + (stiffening - target.0) * (1.0 - grown)
    }
}

/// State of the play operator: the output of a rod with backlash that follows its input. The
/// default is a fresh sample that has never been magnetised.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Play(f64);

impl Play {
    /// State after the input has moved monotonically to `input`.
    #[must_use]
    pub fn follow(self, input: f64) -> Self {
        Self(
            self.0
                .clamp(input - PLAY_HALF_WIDTH, input + PLAY_HALF_WIDTH),
        )
    }

    /// Output of the operator.
    #[must_use]
    pub fn value(self) -> f64 {
        self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LAW: MagnetorheologicalParameters = MagnetorheologicalParameters {
        stiffening_at_peak: 0.5,
        field_at_peak_t: 0.07,
        field_half_t: 0.3,
        memory: 0.2,
        lag_s: 0.004,
        stiffening_per_kelvin: -0.005,
    };

    #[test]
    fn the_law_is_that_of_the_stack_files() {
        for share in [0.0, 0.1, 0.5, 0.9, 1.0, 1.3] {
            let (b, peak, half): (f64, f64, f64) = (0.07 * share, 0.07, 0.3);
            let expected =
                b * b / (b * b + half * half) / (peak * peak / (peak * peak + half * half));
            assert!((LAW.saturation(share) - expected).abs() < 1e-14);
            assert_eq!(LAW.saturation(share), LAW.saturation(-share));
        }
    }

    #[test]
    fn rising_stiffens_less_than_falling() {
        let rising = Play::default().follow(0.5);
        let falling = Play::default().follow(1.0).follow(0.5);
        let gap = LAW.target(0.5, falling) - LAW.target(0.5, rising);
        // Gap: full width of the play operator, 0.5, times share 0.2, over 1 − PLAY_HALF_WIDTH.
        assert!((gap - 0.2 * 0.5 / 0.75).abs() < 1e-14, "{gap}");
        assert!((LAW.target(1.0, Play::default().follow(1.0)) - 1.0).abs() < 1e-15);
        let left = LAW.target(0.0, Play::default().follow(1.0).follow(0.0));
        assert!((left - 0.2 / 3.0).abs() < 1e-15);
    }

    #[test]
    fn the_peak_of_a_train_wipes_every_memory_out() {
        for earlier in [0.3, 0.7, 1.0] {
            let demagnetised = Play::default();
            let magnetised = demagnetised.follow(earlier).follow(0.0);
            // A train starts with a rise to the peak; only its falls are evaluated.
            assert_eq!(magnetised.follow(1.0), demagnetised.follow(1.0));
        }
        let [fresh, used] = [0.0, 0.7].map(|earlier| Play::default().follow(earlier).follow(0.4));
        assert_ne!(fresh, used, "a lower peak would not");
    }

    #[test]
    fn a_loop_closes_and_a_small_one_stays_inside() {
        let up = |play: Play| play.follow(1.0).follow(0.0);
        assert_eq!(up(Play::default()), up(up(Play::default())));
        let outer = Play::default().follow(1.0).follow(0.4);
        assert_eq!(outer.follow(0.6), outer, "less than the play's width");
    }

    #[test]
    fn the_lag_is_exact_for_a_ramp() {
        // fine explicit integration of y' = (u - y)/lag
        let (y0, u, time) = (0.2, (0.9, 0.3), 0.003);
        let steps = 400_000;
        let h = time / f64::from(steps);
        let mut y = y0;
        for step in 0..steps {
            let mid = (f64::from(step) + 0.5) / f64::from(steps);
            let input = u.0 + (u.1 - u.0) * mid;
            let half = y + 0.5 * h * (input - 0.5 * h * (u.1 - u.0) / time - y) / LAW.lag_s;
            y += h * (input - half) / LAW.lag_s;
        }
        assert!((LAW.relax(y0, u, time) - y).abs() < 1e-10);
        assert_eq!(LAW.relax(0.2, (0.9, 0.3), 0.0), 0.2);
        let at_once = MagnetorheologicalParameters { lag_s: 0.0, ..LAW };
        assert_eq!(at_once.relax(0.2, (0.9, 0.3), 0.0), 0.3);
    }

    #[test]
    fn steps_may_be_cut_anywhere() {
        let whole = LAW.relax(0.2, (0.9, 0.3), 0.003);
        let first = LAW.relax(0.2, (0.9, 0.7), 0.001);
        let rest = LAW.relax(first, (0.7, 0.3), 0.002);
        assert!((whole - rest).abs() < 1e-15);
    }
}
