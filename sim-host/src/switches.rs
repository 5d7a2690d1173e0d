//! One switch for each disturbance. A number in brackets is a section of SOURCES.md, a name in
//! brackets a section of `stacks/disturbances.toml`.

/// Declares the switches once, so that fields, names and access by name agree.
macro_rules! switches {
    ($($(#[$doc:meta])* $name:ident),+ $(,)?) => {
        /// Which disturbances act.
        ///
        /// A disabled switch sets the disturbance's parameters to their neutral values before the
        /// simulation starts (see [`crate::parameters::Parameters::effective`]). The parameters are
        /// drawn in any case, so disabling one disturbance changes no other.
        ///
        /// ```
        /// use palpate_sim::switches::Switches;
        ///
        /// let switches = Switches { crosstalk: false, ..Switches::all() };
        /// assert_eq!(switches.get("crosstalk"), Some(false));
        /// for name in Switches::NAMES {
        ///     assert_eq!(Switches::none().with(name, true).get(name), Some(true));
        /// }
        /// ```
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub struct Switches {
            $($(#[$doc])* pub $name: bool,)+
        }

        impl Switches {
            /// Names of all disturbances, in the order of the fields.
            pub const NAMES: [&'static str; [$(stringify!($name)),+].len()] =
                [$(stringify!($name)),+];

            const fn uniform(on: bool) -> Self {
                Self { $($name: on,)+ }
            }

            /// Whether the disturbance of that name is enabled; `None` for an unknown name.
            #[must_use]
            pub fn get(&self, name: &str) -> Option<bool> {
                match name {
                    $(stringify!($name) => Some(self.$name),)+
                    _ => None,
                }
            }

            /// The switches with one disturbance on or off. An unknown name changes nothing.
            #[must_use]
            pub fn with(mut self, name: &str, on: bool) -> Self {
                match name {
                    $(stringify!($name) => self.$name = on,)+
                    _ => {}
                }
                self
            }
        }
    };
}

switches! {
    /// The actuating field lowers the sensing layer's permeability: an apparent displacement, even
    /// in the current, that grows with the press (SOURCES.md 3.1).
    crosstalk,
    /// The halves of the actuated layer attract each other, the more the closer they are (3.2).
    attraction,
    /// The coils heat themselves (3.3).
    heating,
    /// The ambient temperature has changed since the calibration (`[thermal]`).
    ambient_change,
    /// The sensor grows with temperature (3.3).
    growth,
    /// The springs of both layers change with temperature (3.3).
    spring_temperature,
    /// The stiffening by the field changes with temperature (`[magnetorheological]`).
    stiffening_temperature,
    /// The resistance of the copper rises with temperature (3.3).
    copper_temperature,
    /// The tank's capacitance changes with temperature (`[tank]`).
    capacitance_temperature,
    /// Springs of the sensor creep (3.4).
    creep,
    /// The stiffening has hysteresis (3.5).
    memory,
    /// The stiffening lags behind the field (3.6).
    lag,
    /// The supply sags and limits the current (3.6).
    supply,
    /// The load stands on a compliant frame (3.7); the true stiffness is that of both in series.
    frame,
    /// A stand vibrates (`[press]`); acts with [`crate::world::Holder::Stand`].
    vibration,
    /// A hand trembles (3.7); acts with [`crate::world::Holder::Hand`].
    tremor,
    /// The current measurement has a gain error (`[current_chain]`).
    current_gain,
    /// The ADC is not linear (3.8).
    adc_nonlinearity,
    /// The ADC is noisy (3.8).
    adc_noise,
    /// The converter's reference clock has an error (3.9).
    reference_clock,
    /// The converter counts whole edges (3.9).
    ldc_quantisation,
    /// The converter's frequency is noisy (3.9).
    ldc_noise,
    /// The drive current of the converter shifts its frequency (3.9).
    ldc_drive_shift,
    /// The current has a ripple from the bridge's switching. Its square adds to heat, attraction,
    /// stiffening and crosstalk (3.11). The circuit of an emulated board always has its own ripple.
    ripple,
    /// Harmonics of the bridge's switching pull the oscillation of the sensing coil (3.11).
    pwm_coupling,
    /// The sensing coil bends with the layer (3.10).
    coil_bending,
    /// Copper of the actuated layer lies under the sensing coil (3.10).
    copper_image,
    /// The calibration rig's frame is compliant (`[calibration_rig]`).
    rig_frame,
    /// The load cell is noisy.
    load_cell_noise,
    /// The load cell has a gain error.
    load_cell_gain,
    /// The stage's scale has an error.
    stage_error,
    /// The rig's springs differ from their nominal values.
    spring_tolerance,
}

impl Switches {
    /// Every disturbance acts.
    #[must_use]
    pub const fn all() -> Self {
        Self::uniform(true)
    }

    /// No disturbance acts: the three springs of the paper.
    #[must_use]
    pub const fn none() -> Self {
        Self::uniform(false)
    }

    /// Only one disturbance acts. Effects of temperature need a temperature change, so `heating`
    /// and `ambient_change` act beside them. `None` for an unknown name.
    #[must_use]
    pub fn only(name: &str) -> Option<Self> {
        Self::none().get(name)?;
        let by_temperature = [
            "growth",
            "spring_temperature",
            "stiffening_temperature",
            "copper_temperature",
            "capacitance_temperature",
        ]
        .contains(&name);
        let one = Self::none().with(name, true);
        Some(Self {
            heating: one.heating || by_temperature,
            ambient_change: one.ambient_change || by_temperature,
            ..one
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_one_is_on_but_for_temperature() {
        for name in Switches::NAMES {
            let switches = Switches::only(name).expect("a name");
            let on: Vec<_> = Switches::NAMES
                .into_iter()
                .filter(|name| switches.get(name) == Some(true))
                .collect();
            assert!(on.contains(&name));
            assert!(on.len() == 1 || on.len() == 3, "{on:?}");
        }
        assert_eq!(Switches::only("magic"), None);
        assert_eq!(Switches::none().get("magic"), None);
    }

    #[test]
    fn all_and_none_are_that() {
        for name in Switches::NAMES {
            assert_eq!(Switches::all().get(name), Some(true));
            assert_eq!(Switches::none().get(name), Some(false));
            assert_ne!(Switches::all().with(name, false), Switches::all());
        }
    }
}
