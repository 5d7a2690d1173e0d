//! Creep of both layers, from two presses that are held after their train.
//!
//! Block and springs do not relax, and the press is held, so x (1 + kappa + g) changes by the layers' creep
//! alone. Let s_S and s_D be the creep of sensing and actuated layer while the age of the deformation x
//! grows by a factor of e. Then, between a time before the train and one after it,
//!
//! (1 + kappa + g) D ln x = (kappa s_S - g (s_D - s_S)) D ln age,
//!
//! a line over kappa. The instrument uses the same law for the same span of time, so s_S and s_D contain
//! what the law leaves out: the heat of the train, and the creep that is over before it.

use palpate_wire::Command;
use palpate_wire::command::Creep;

use crate::session::{BenchSample, Pressed, Run, Session};

/// Time from the request of a train for which a press is held, s: as long as the instrument follows an
/// object.
pub(crate) const HELD_S: f64 = 3.0;
/// Time over which a deformation is averaged, s, as in the instrument.
const MEAN_S: f64 = 0.1;
/// Standard uncertainty of either layer's creep in use. On 39 sensors from seed 2500001 the root of the
/// mean square of the error is 0.02 to 0.1 % after 3 s and 0.19 to 0.26 % just after the train, at 0.2 to
/// 5 c_S, and 0.1 % at 0.7 of the depth. Another temperature may change the creep by a tenth, 0.14 %.
const UNCERTAINTY: f64 = 0.0025;

/// The command that sets the creep; `None` unless the block and a spring were held. Takes the deformation
/// over the relative change of inductance, up to a factor; g; c_S; and the compliance of the frame.
pub(crate) fn command(
    session: &Session,
    deformation: &dyn Fn(f64) -> f64,
    actuated_ratio: f64,
    (sensing_n_per_m, frame_m_per_n): (f64, f64),
) -> Option<Command> {
    let point = |is_one: fn(Pressed) -> bool| {
        let mut runs = session.runs.iter();
        let run = runs.find(|run| is_one(run.pressed) && !run.held.is_empty())?;
        let compliance = run.pressed.compliance_m_per_n()? + frame_m_per_n;
        let kappa = compliance * sensing_n_per_m;
        let (grown, older) = growth(run, deformation)?;
        Some((kappa, (1.0 + kappa + actuated_ratio) * grown / older))
    };
    let (hard, of_hard) = point(|pressed| pressed == Pressed::Block)?;
    let (soft, of_soft) = point(|pressed| matches!(pressed, Pressed::Spring { .. }))?;
    let sensing = (of_soft - of_hard) / (soft - hard);
    let creep = Creep {
        sensing: sensing as f32,
        actuated: (sensing - (of_hard - sensing * hard) / actuated_ratio) as f32,
        uncertainty: UNCERTAINTY as f32,
    };
    creep.validate().is_ok().then_some(Command::SetCreep(creep))
}

/// Growth of the deformation from before the train to the end of a run, and that of its mean age, as
/// logarithms.
fn growth(run: &Run, deformation: &dyn Fn(f64) -> f64) -> Option<(f64, f64)> {
    let rest_hz = run.rest_hz()?;
    let of = |line: &BenchSample| deformation((rest_hz / line.frequency_hz).powi(2) - 1.0).max(0.0);
    let level = |end_s: f64| {
        let (mut sum, mut count, mut integral) = (0.0, 0.0, 0.0);
        let mut from_s = Run::UNTOUCHED_S.1;
        let lines = run.lines.iter().chain(&run.held);
        let until = lines.filter(|line| line.time_s <= end_s);
        for line in until.filter(|line| line.time_s > Run::UNTOUCHED_S.1) {
            integral += of(line) * (line.time_s - from_s);
            from_s = line.time_s;
            if line.time_s > end_s - MEAN_S {
                sum += of(line);
                count += 1.0;
            }
        }
        let mean = sum / count;
        (mean, integral / mean)
    };
    let (before, after) = (level(run.began_s), level(run.held.last()?.time_s));
    let [grown, older] = [after.0 / before.0, after.1 / before.1].map(f64::ln);
    (grown.is_finite() && older > 0.0).then_some((grown, older))
}

#[cfg(test)]
mod tests {
    use super::*;

    const RATIO: f64 = 1.5;
    const SENSING_N_PER_M: f64 = 6e3;
    const REST_HZ: f64 = 3e6;

    /// A press at 1 s with a train at 3 s, held for `held_s`, of layers that creep by 1 and 3 %.
    fn run(pressed: Pressed, held_s: f64) -> Run {
        let kappa = SENSING_N_PER_M * pressed.compliance_m_per_n().unwrap();
        let rate = (kappa * 0.01 - RATIO * 0.02) / (1.0 + kappa + RATIO);
        let depth = |time_s: f64| {
            if time_s > 1.0 {
                0.1 * (time_s - 1.0).powf(rate)
            } else {
                0.0
            }
        };
        let line = |ms: u32| {
            let time_s = f64::from(ms) * 1e-3;
            BenchSample {
                time_s,
                frequency_hz: REST_HZ / (1.0 + depth(time_s)).sqrt(),
                current_a: 0.0,
                gauges_time_s: time_s,
                force_n: None,
                stage_m: None,
            }
        };
        let end_ms = (1e3 * (3.0 + held_s)) as u32;
        let mut lines: Vec<_> = (1..end_ms).map(line).collect();
        let held = lines.split_off(lines.len().min(4_300));
        Run {
            lines,
            held,
            began_s: 3.0,
            pressed_s: 1.0,
            ..Run::new(pressed, 0.3e-3)
        }
    }

    fn found(held_s: f64) -> Option<Creep> {
        let spring = Pressed::Spring { n_per_m: 3e3 };
        let session = Session {
            runs: vec![run(Pressed::Block, held_s), run(spring, held_s)],
            contact: Vec::new(),
            deepest_press: Run::new(Pressed::Block, 0.0),
            bare: Vec::new(),
            temperature_c: 25.0,
        };
        match command(&session, &|change| change, RATIO, (SENSING_N_PER_M, 0.0))? {
            Command::SetCreep(creep) => Some(creep),
            _ => None,
        }
    }

    /// Means lie half their time before their end, where the age is taken, as in the instrument: 2 %.
    #[test]
    fn block_and_spring_show_the_creep_of_both_layers() {
        let creep = found(HELD_S).unwrap();
        assert!((creep.sensing - 0.01).abs() < 1e-3, "{creep:?}");
        assert!((creep.actuated - 0.03).abs() < 1e-3, "{creep:?}");
        assert_eq!(found(1.3), None);
    }
}
