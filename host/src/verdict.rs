//! The instrument's result of a press, compared with the truth.

use palpate_wire::Record;
use palpate_wire::code::RefusalReason;
use palpate_wire::record::{Estimate, Fault, Refusal};

use crate::press::PressOutcome;

/// What came of a press.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Verdict {
    Estimate(Box<Estimate>),
    Refusal(Refusal),
    Fault(Fault),
    /// Nothing, within the time given.
    Silence,
}

impl Verdict {
    /// The first result among the records.
    pub(crate) fn of(pressed: &PressOutcome) -> Self {
        let results = pressed.records().filter_map(|(_, record)| match record {
            Record::Estimate(estimate) => Some(Self::Estimate(Box::new(estimate.clone()))),
            Record::Refusal(refusal) => Some(Self::Refusal(refusal.clone())),
            Record::Fault(fault) => Some(Self::Fault(fault.clone())),
            _ => None,
        });
        results.into_iter().next().unwrap_or(Self::Silence)
    }

    /// The estimate, if there is one.
    pub(crate) fn estimate(&self) -> Option<&Estimate> {
        match self {
            Self::Estimate(estimate) => Some(estimate),
            _ => None,
        }
    }

    /// Whether the truth lies in the interval that was claimed; nothing without an estimate.
    pub(crate) fn holds(&self, true_n_per_m: f64) -> Option<bool> {
        let estimate = self.estimate()?;
        let lower = f64::from(estimate.lower_n_per_m) <= true_n_per_m;
        let upper = estimate
            .upper_n_per_m
            .is_none_or(|upper| f64::from(upper) >= true_n_per_m);
        Some(lower && upper)
    }

    /// Why there is no estimate.
    pub(crate) fn reason(&self) -> Option<String> {
        match self {
            Self::Estimate(_) => None,
            Self::Refusal(refusal) => Some(explain(refusal)),
            Self::Fault(fault) => Some(format!("fault: {}", first_sentence(fault.code.meaning()))),
            Self::Silence => Some("no result within half a minute".to_owned()),
        }
    }
}

/// A refusal in words, with its numbers.
pub(crate) fn explain(refusal: &Refusal) -> String {
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

/// A number of a refusal in the unit that its reason gives it.
fn quantity(reason: RefusalReason, value: f32) -> String {
    match reason {
        RefusalReason::PressedTooLittle
        | RefusalReason::PressedTooFar
        | RefusalReason::RestMoved => {
            format!("{:.1} µm", value * 1e6)
        }
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

fn first_sentence(text: &str) -> &str {
    let text = text.trim();
    text.split_once(". ")
        .map_or(text, |(first, _)| first)
        .trim_end_matches('.')
}
