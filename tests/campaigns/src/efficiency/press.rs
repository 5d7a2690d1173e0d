//! A press in use, evaluated with the bench's information about its sensor.

use palpate_design::plan::Information;
use palpate_sim::mechanics::load::Load;
use palpate_sim::parameters::ParameterError;

use super::bound::{BenchInformation, Differentiated, LOCAL, STEP};
use super::rung::{Evaluation, InformationLevel};
use super::train::{TrainTask, derivative};
use super::unknowns;

/// Indices of a press in use, after the unknowns of its train: ln(c_L), then the effects of
/// temperature.
const LOAD: usize = LOCAL;
const WARMER: usize = LOCAL + 1;
const OF_PRESS: usize = LOCAL + 3;

impl BenchInformation<'_> {
    /// Least variances of ln(c_L) of a press on a load of `load_n_per_m` N/m, frame included, in
    /// the order of [`InformationLevel::ALL`]; `None` if the readings do not determine it.
    pub(super) fn press(
        &self,
        load_n_per_m: f64,
        depth_m: f64,
    ) -> Result<Option<[f64; InformationLevel::ALL.len()]>, ParameterError> {
        let mut plant = self.plant.clone();
        // The load given here includes its frame.
        plant.press.frame_m_per_n = 0.0;
        let load = |n_per_m: f64| Some(Load::Spring { n_per_m });
        let train = self.train(&plant, load(load_n_per_m), depth_m)?;
        let mut of = self.differentiated(&plant, &train)?;
        let local = self.shared();
        let stiffer = |steps: f64| {
            TrainTask {
                load: load(load_n_per_m * (steps * STEP).exp()),
                ..train.clone()
            }
            .readings(&plant)
        };
        of.shared.push((
            local + LOAD,
            derivative(&stiffer(-1.0)?, &stiffer(1.0)?, 2.0 * STEP),
        ));
        let separated = self.separated(&of);
        let mut variances = [0.0; InformationLevel::ALL.len()];
        for (variance, rung) in variances.iter_mut().zip(InformationLevel::ALL) {
            let of = if rung == InformationLevel::WithoutOwnHeat {
                &separated
            } else {
                &of
            };
            match self.variance(of, rung) {
                Some(found) => *variance = found,
                None => return Ok(None),
            }
        }
        Ok(Some(variances))
    }

    fn variance(&self, of: &Differentiated, rung: InformationLevel) -> Option<f64> {
        let columns = self.shared() + OF_PRESS;
        let mut information = Information::new(columns);
        self.add(&mut information, of, rung.evaluation(), false);
        self.know_locals(&mut information);
        [WARMER, WARMER + 1]
            .iter()
            .for_each(|place| information.know(self.shared() + place, 1.0));
        if rung == InformationLevel::SensorKnown {
            // Knows the sensor practically exactly.
            (0..self.shared()).for_each(|unknown| information.know(unknown, 1e-12));
        } else {
            let evaluations = self.by_evaluation.iter().zip(Evaluation::ALL);
            let mut used = evaluations.filter(|(_, evaluation)| *evaluation == rung.evaluation());
            information.add(used.next()?.0);
        }
        let mut of_load = vec![0.0; columns];
        if let Some(entry) = of_load.get_mut(self.shared() + LOAD) {
            *entry = 1.0;
        }
        information.variance(&of_load)
    }

    /// Derivatives in two more unknowns of a press: its springs and its stiffening may differ from
    /// the bench's by the uncertainty of the temperature coefficients.
    fn separated(&self, of: &Differentiated) -> Differentiated {
        let away_k = self.plant.thermal.ambient_change_k;
        let deviation = |name: &str| {
            let unknown = self.unknowns.iter().find(|unknown| unknown.name == name);
            unknown.map_or(0.0, |unknown| unknown.deviation)
        };
        let springs = deviation(unknowns::SPRINGS_PER_KELVIN) * away_k;
        let stiffening = deviation(unknowns::STIFFENING_PER_KELVIN) * away_k;
        let sensor = self.plant;
        let relative = [
            (
                unknowns::SENSING,
                springs * sensor.sensing.spring_n_per_m,
                0,
            ),
            (
                unknowns::ACTUATED,
                springs * sensor.actuated.spring_n_per_m,
                0,
            ),
            (
                unknowns::STIFFENING,
                stiffening * sensor.magnetorheological.stiffening_at_peak,
                1,
            ),
        ];
        let zero = vec![(0.0, 0.0); of.readings.len()];
        let mut changed = [zero.clone(), zero];
        let named = |unknown: usize| self.unknowns.get(unknown).map_or("", |of| of.name);
        for (unknown, derivatives) in &of.shared {
            for (name, change, index) in relative {
                let Some(sum) = changed.get_mut(index).filter(|_| named(*unknown) == name) else {
                    continue;
                };
                let deviations = change / deviation(name);
                for (sum, derivative) in sum.iter_mut().zip(derivatives) {
                    sum.0 += derivative.0 * deviations;
                    sum.1 += derivative.1 * deviations;
                }
            }
        }
        let by_temperature = [
            unknowns::SPRINGS_PER_KELVIN,
            unknowns::STIFFENING_PER_KELVIN,
        ];
        let mut shared: Vec<_> = of
            .shared
            .iter()
            .filter(|(unknown, _)| !by_temperature.contains(&named(*unknown)))
            .cloned()
            .collect();
        let local = self.shared();
        shared.extend(
            changed
                .into_iter()
                .enumerate()
                .map(|(index, of)| (local + WARMER + index, of)),
        );
        Differentiated {
            readings: of.readings.clone(),
            shared,
            place: of.place.clone(),
        }
    }
}
