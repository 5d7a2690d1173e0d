//! Describes results: stiffness, refusals, and the main cause of an interval with its remedy.

use palpate_wire::Record;
use palpate_wire::code::RefusalReason;
use palpate_wire::command::ContactTolerance;
use palpate_wire::record::{Estimate, Refusal, Relaxation, UncertaintyBudget};

/// Formats a stiffness in N/mm with three digits.
pub fn stiffness(n_per_m: f64) -> String {
    let n_per_mm = n_per_m * 1e-3;
    if !n_per_mm.is_finite() {
        return "rigid".to_owned();
    }
    let digits = (2 - n_per_mm.abs().max(1e-9).log10().floor() as i32).clamp(0, 4);
    format!("{n_per_mm:.*} N/mm", digits as usize)
}

/// Formats the stiffness of an estimate.
pub fn estimated(estimate: &Estimate) -> String {
    let value = estimate.stiffness_n_per_m.map(f64::from);
    value.map_or("as if rigid".to_owned(), stiffness)
}

/// Formats the 95 % interval of an estimate.
pub fn interval(estimate: &Estimate) -> String {
    let lower = stiffness(estimate.lower_n_per_m.into());
    match estimate.upper_n_per_m {
        Some(upper) => format!("{lower} to {}", stiffness(upper.into())),
        None => format!("{lower} or more"),
    }
}

/// Formats the contacts for which an interval holds; `None` for the calibrated contact alone.
pub fn contact(tolerance: Option<&ContactTolerance>) -> String {
    let of = |value: fn(&ContactTolerance) -> f32| tolerance.map_or(0.0, |of| f64::from(value(of)));
    let (within_mm, tilt_deg) = (
        1e3 * of(|of| of.within_m),
        of(|of| of.tilt_rad).to_degrees(),
    );
    let place = (within_mm > 0.0).then(|| format!("within {} mm of the centre", short(within_mm)));
    let tilt = (tilt_deg > 0.0).then(|| format!("tilted by at most {} deg", short(tilt_deg)));
    match (place, tilt) {
        (None, None) => "as on the bench (centred, flat)".to_owned(),
        (Some(place), None) => format!("{place}, flat"),
        (None, Some(tilt)) => format!("centred, {tilt}"),
        (Some(place), Some(tilt)) => format!("{place}, {tilt}"),
    }
}

/// Formats a number with two decimals at most.
fn short(value: f64) -> f64 {
    (value * 100.0).round() / 100.0
}

/// Formats a refusal with its numbers.
pub fn refusal(refusal: &Refusal) -> String {
    let text = first_sentence(refusal.reason.meaning());
    let number = |value: f32| quantity(refusal.reason, value);
    match (refusal.value, refusal.limit) {
        (Some(value), Some(limit)) => {
            format!("{text}: {}; limit {}", number(value), number(limit))
        }
        (Some(value), None) => format!("{text}: {}", number(value)),
        _ => text.to_owned(),
    }
}

/// Formats a value of a refusal in the unit for its reason.
fn quantity(reason: RefusalReason, value: f32) -> String {
    match reason {
        RefusalReason::PressedTooLittle
        | RefusalReason::PressedTooFar
        | RefusalReason::RestMoved => {
            format!("{:.1} µm", value * 1e6)
        }
        RefusalReason::OffCentre => format!("{:.2} mm", value * 1e3),
        RefusalReason::Unsteady => format!("{:.1} µm/s", value * 1e6),
        RefusalReason::ContactLost | RefusalReason::TimedOut => format!("{value:.3} s"),
        RefusalReason::CurrentOffTarget | RefusalReason::PeakNotReached => format!("{value:.2} A"),
        RefusalReason::CoilTooHot => format!("{value:.1} °C"),
        RefusalReason::TooMuchEnergy => format!("{value:.1} J"),
        RefusalReason::TooUncertain => format!("{:.0} %", value * 100.0),
        RefusalReason::SignalTooSmall | RefusalReason::SignalReversed => {
            format!("{value:.1} standard errors")
        }
        RefusalReason::NotCalibrated => format!("record 0x{:02x}", value as u8),
        _ => format!("{value}"),
    }
}

/// Returns the first sentence of a protocol description, without its full stop.
pub fn first_sentence(text: &str) -> &str {
    let text = text.trim();
    text.split_once(". ")
        .map_or(text, |(first, _)| first)
        .trim_end_matches('.')
}

/// Says how the object of a held press relaxes; two standard errors are the 95 % interval.
pub fn relaxation(relaxation: &Relaxation) -> String {
    let &Relaxation {
        held_s,
        relaxation,
        standard_error,
        ..
    } = relaxation;
    let percent = |part: f32| format!("{:.0} %", 100.0 * part);
    let [lower, upper] = [-2.0, 2.0].map(|errors| relaxation + errors * standard_error);
    if lower > 0.0 {
        format!(
            "The object gives way by {} in {held_s:.1} s (95 %: {} to {}), if the press does not move.",
            percent(relaxation),
            percent(lower),
            percent(upper)
        )
    } else if upper < 0.0 {
        format!("The press deepens in {held_s:.1} s by more than the sensor creeps: it moves.")
    } else {
        let limit = percent(upper);
        format!("No relaxation in {held_s:.1} s beyond the sensor's own creep (less than {limit}).")
    }
}

/// Returns the uncertainty budget of a measurement from the records of its result.
pub fn budget_of<'r>(
    mut records: impl Iterator<Item = &'r Record>,
    measurement: u32,
) -> Option<&'r UncertaintyBudget> {
    records.find_map(|record| match record {
        Record::UncertaintyBudget(budget) if budget.measurement == measurement => Some(budget),
        _ => None,
    })
}

/// Names the largest cause of an interval, its share of the variance, and its remedy.
pub fn limited_by(budget: &UncertaintyBudget) -> String {
    let causes = causes(budget);
    let whole: f32 = causes.iter().map(|cause| cause.part * cause.part).sum();
    let [first, others @ ..] = causes;
    let greatest = others.into_iter().fold(first, |greatest, cause| {
        if cause.part > greatest.part {
            cause
        } else {
            greatest
        }
    });
    let share = 100.0 * greatest.part * greatest.part / whole.max(f32::MIN_POSITIVE);
    format!(
        "{share:.0} % of the interval is by {}. To narrow it: {}.",
        greatest.name, greatest.remedy
    )
}

/// One cause of an interval.
struct Cause {
    part: f32,
    name: String,
    remedy: &'static str,
}

fn causes(budget: &UncertaintyBudget) -> [Cause; 6] {
    let cause = |part, name: &str, remedy| Cause {
        part,
        name: name.to_owned(),
        remedy,
    };
    const CHECK: &str =
        "`palpate check` with a known spring; then a calibration with more accurate springs";
    let temperature = match budget.off_calibration_k {
        Some(off_k) => Cause {
            part: budget.temperature,
            name: format!("the temperature, {off_k:+.1} K from the calibration's"),
            remedy: "`palpate check` with a known spring, or calibrate at a second temperature",
        },
        None => cause(
            budget.temperature,
            "the unknown temperature",
            "connect the coil's thermometer",
        ),
    };
    [
        cause(
            budget.noise,
            "noise and vibration",
            "hold still, press deeper, or set more ramps",
        ),
        cause(budget.springs, "the calibrated springs", CHECK),
        cause(budget.stiffening, "the calibrated stiffening", CHECK),
        cause(
            budget.zero,
            "the zero of the deformation",
            "lift off, let the sensor recover, and measure soon after the press",
        ),
        temperature,
        cause(
            budget.bend,
            "a line that is not straight",
            "press less deep, or steady the contact",
        ),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_relaxation_is_named_where_it_is_significant() {
        let text = |part, standard_error| {
            relaxation(&Relaxation {
                measurement: 1,
                held_s: 3.04,
                relaxation: part,
                standard_error,
            })
        };
        assert_eq!(
            text(0.12, 0.03),
            "The object gives way by 12 % in 3.0 s (95 %: 6 % to 18 %), if the press does not move."
        );
        assert!(text(0.12, 0.07).contains("No relaxation in 3.0 s"));
        assert!(text(0.02, 0.03).contains("(less than 8 %)"));
        assert!(text(-0.12, 0.03).contains("it moves"));
    }

    const BUDGET: UncertaintyBudget = UncertaintyBudget {
        measurement: 3,
        noise: 0.02,
        springs: 0.01,
        stiffening: 0.0,
        zero: 0.0,
        temperature: 0.06,
        bend: 0.0,
        off_calibration_k: Some(4.9),
    };

    #[test]
    fn the_greatest_cause_is_named_with_its_share_and_remedy() {
        let text = limited_by(&BUDGET);
        // Temperature has 36 of 41 parts of the variance.
        assert_eq!(
            text,
            "88 % of the interval is by the temperature, +4.9 K from the calibration's. To narrow it: \
             `palpate check` with a known spring, or calibrate at a second temperature."
        );
        let unmeasured = UncertaintyBudget {
            off_calibration_k: None,
            ..BUDGET
        };
        assert!(limited_by(&unmeasured).contains("thermometer"));
        let noisy = UncertaintyBudget {
            noise: 0.1,
            ..BUDGET
        };
        // Noise has 100 of 137 parts of the variance.
        assert!(limited_by(&noisy).starts_with("73 % of the interval is by noise"));
        // Without any uncertainty the share must be a number, not NaN.
        let certain = UncertaintyBudget {
            noise: 0.0,
            springs: 0.0,
            temperature: 0.0,
            ..BUDGET
        };
        assert!(limited_by(&certain).starts_with("0 %"));
    }

    #[test]
    fn a_budget_belongs_to_its_measurement() {
        let records = [Record::UncertaintyBudget(BUDGET)];
        assert_eq!(budget_of(records.iter(), 3), Some(&BUDGET));
        assert_eq!(budget_of(records.iter(), 4), None);
    }
}
