//! Place, force and radius of a press, from all coils of an array.
//!
//! The image keeps this module in flash (firmware/build.rs): it may run only while flash can be read.

use palpate_model::math::sqrt;
use palpate_model::tank::{relative_frequency_change, relative_inductance_change};
use palpate_model::touch::{
    Array, BASE, BENT, BY_RADIUS, Coefficients, Coil, CommonError, LEAST_SIGNIFICANCE, MOST_COILS,
    Press, Profile, ReadingError, Region, Track, Verdict,
};
use palpate_model::units::{Metre, Newton};
use palpate_wire::code::{Outcome, TouchVerdict};
use palpate_wire::command::{ARRAY_NUMBERS, COIL_NUMBERS, TouchArray};
use palpate_wire::record::Touch;
use palpate_wire::{Invalid, Problem};

use crate::answer::{Answer, field};
use crate::board::BoardInfo;
use crate::configuration::{ActiveArray, Configuration};
use crate::event::Scan;

/// Number of the disc's radius in an array's calibration.
const DISC_RADIUS: u8 = 7;
const NO_COIL: Coil = Coil {
    x: Metre(0.0),
    y: Metre(0.0),
    gain: 1.0,
    noise: 1.0,
};

/// Numbers that were received in pairs, one after the other; NaN beyond the end, which no check passes.
struct Numbers<'a> {
    pairs: &'a [(f32, f32)],
    second: Option<f32>,
}

impl Numbers<'_> {
    // Written here, since generic functions of `core` would be placed in RAM.
    #[inline(never)]
    fn next(&mut self) -> f32 {
        if let Some(second) = self.second.take() {
            return second;
        }
        let [(first, second), rest @ ..] = self.pairs else {
            return f32::NAN;
        };
        self.pairs = rest;
        self.second = Some(*second);
        *first
    }

    fn fill(&mut self, all: &mut [f32]) {
        for to in all {
            *to = self.next();
        }
    }
}

/// Reads an array from its numbers in the order of the protocol.
#[inline(never)]
pub(crate) fn read(pairs: &[(f32, f32)], board: &BoardInfo) -> Result<ActiveArray, Answer> {
    let mut numbers = Numbers {
        pairs,
        second: None,
    };
    let mut next = || numbers.next();
    let channels = next();
    let [first, second] = board.channels;
    let of_board = first | second << 4;
    let all = channels as u8;
    if f32::from(all) != channels || all & !of_board != 0 {
        return Err(Outcome::NoSuchChannel.into());
    }
    if 2 * pairs.len() != ARRAY_NUMBERS + COIL_NUMBERS * all.count_ones() as usize {
        return Err(Outcome::Inconsistent.into());
    }
    let indenter = [next(), next(), next(), next()];
    let [is_declared, at_one_newton_m, _, uncertainty] = indenter;
    let is_one = is_declared == 1.0 && at_one_newton_m > 0.0 && uncertainty > 0.0;
    if !(is_declared == 0.0 || is_one) {
        return Err(Outcome::OutOfRange.into());
    }
    let disc = [next(), next(), next()];
    let errors = (
        ReadingError {
            relative: next(),
            of_largest: next(),
        },
        CommonError {
            place: Metre(next()),
            ln_force: next(),
            ln_radius: next(),
        },
    );
    let mut coefficients = Coefficients {
        spacing: Metre(next()),
        least_radius: Metre(next()),
        greatest_radius: Metre(next()),
        greatest_force: Newton(next()),
        base: [0.0; BASE],
        linear: [0.0; BY_RADIUS],
        quadratic: [0.0; BY_RADIUS],
        bent: [[0.0; BENT]; 3],
    };
    numbers.fill(&mut coefficients.base);
    numbers.fill(&mut coefficients.linear);
    numbers.fill(&mut coefficients.quadratic);
    numbers.fill(coefficients.bent.as_flattened_mut());
    let mut coils = [NO_COIL; MOST_COILS];
    let coils = coils
        .get_mut(..all.count_ones() as usize)
        .unwrap_or_default();
    for coil in coils.iter_mut() {
        *coil = Coil {
            x: Metre(numbers.next()),
            y: Metre(numbers.next()),
            gain: numbers.next(),
            noise: numbers.next(),
        };
    }
    let profile = Profile::new(coefficients).map_err(|_| Answer::from(Outcome::OutOfRange))?;
    covers(&profile, disc, coils)?;
    let [x, y, radius] = disc;
    let region = Region::Disc {
        centre: [Metre(x), Metre(y)],
        radius: Metre(radius),
    };
    let array = Array::new(coils, profile, errors, region);
    Ok(ActiveArray {
        array: array.map_err(|_| Answer::from(Outcome::OutOfRange))?,
        channels: all,
        indenter,
    })
}

/// Refuses a disc of which some place is beyond the profile of a coil.
fn covers(profile: &Profile, [x, y, radius]: [f32; 3], coils: &[Coil]) -> Result<(), Answer> {
    let Metre(reach_m) = profile.reach();
    let mut farthest_m = 0.0_f32;
    for coil in coils {
        let [dx, dy] = [coil.x.0 - x, coil.y.0 - y];
        farthest_m = farthest_m.max(sqrt(dx * dx + dy * dy));
    }
    if farthest_m + radius <= reach_m {
        return Ok(());
    }
    Err(Answer::Invalid(Invalid {
        field: field!(TouchArray, numbers),
        item: Some(DISC_RADIUS),
        problem: Problem::OutOfRange {
            value: radius,
            low: 0.0,
            high: reach_m - farthest_m,
        },
    }))
}

/// Readings of an array's coils, pressed and untouched.
#[derive(Clone, Debug, Default)]
pub(crate) struct Touching {
    /// For each coil, the code of its first reading, from which changes are counted; 0 before it.
    references: [u32; MOST_COILS],
    /// Relative change of the inductance of the untouched sensor from the reference.
    rest: [f32; MOST_COILS],
    /// Last reading as relative change of inductance from the reference; NaN for a flagged one.
    readings: [f32; MOST_COILS],
    /// Number of scans from which the rest was learnt.
    learnt: u16,
    /// Converters with a scan since the last result: bits 0 and 1.
    scanned: u8,
    track: Track,
    /// Distance of the present press from the centre and the stated tolerance, m; `None` within it.
    /// A field, so that it can be read from RAM while flash cannot be read.
    pub(crate) off_centre: Option<(f32, f32)>,
}

impl Touching {
    /// Takes a scan of a converter; returns the result if all converters of the array have one.
    /// `memory`: number of scans over which the rest is averaged.
    #[inline(never)]
    pub(crate) fn push(
        &mut self,
        configuration: &Configuration,
        scan: &Scan,
        memory: u16,
    ) -> Option<Touch> {
        let of = configuration.array()?;
        let second = scan.sensor & 1;
        let nibble = |channels: u8| {
            if second == 1 {
                channels >> 4
            } else {
                channels & 0xF
            }
        };
        let below = if second == 1 {
            (of.channels & 0xF).count_ones()
        } else {
            0
        };
        let own = nibble(of.channels);
        for conversion in &scan.conversions {
            let reading = &conversion.reading;
            let bit = 1 << reading.channel.number();
            if own & bit != 0 {
                let coil = below + (own & (bit - 1)).count_ones();
                let is_usable = reading.is_good() && !scan.gap;
                let code = is_usable.then(|| reading.word.code().get());
                self.read(coil as usize, code);
            }
        }
        self.scanned |= 1 << second;
        let needed = u8::from(of.channels & 0xF != 0) | u8::from(of.channels >> 4 != 0) << 1;
        if self.scanned & needed != needed {
            return None;
        }
        self.scanned = 0;
        Some(self.judged(of, memory, configuration.contact_within_m()))
    }

    /// Compares the place of a press with the tolerance of the contact. Not called for a reading
    /// without a place: the earlier comparison then stays.
    fn compare(&mut self, press: &Press, within_m: Option<f32>) {
        let distance_m = sqrt(press.x.0 * press.x.0 + press.y.0 * press.y.0);
        self.off_centre = within_m
            .filter(|within_m| distance_m > *within_m)
            .map(|within_m| (distance_m, within_m));
    }

    fn read(&mut self, coil: usize, code: Option<u32>) {
        let places = self
            .references
            .get_mut(coil)
            .zip(self.readings.get_mut(coil));
        let Some((reference, reading)) = places else {
            return;
        };
        if let (0, Some(code)) = (*reference, code) {
            *reference = code;
        }
        *reading = code.map_or(f32::NAN, |code| {
            relative_inductance_change(relative_frequency_change(*reference, code))
        });
    }

    fn judged(&mut self, of: &ActiveArray, memory: u16, within_m: Option<f32>) -> Touch {
        let coils = of.array.coils();
        let mut all = self.readings;
        all.iter_mut()
            .zip(self.rest)
            .for_each(|(of, rest)| *of -= rest);
        let readings = all.get(..coils.len()).unwrap_or_default();
        if !readings.iter().all(|reading| reading.is_finite()) {
            return Touch::without_claim(TouchVerdict::NotReadable);
        }
        if self.learnt < memory {
            self.learnt += 1;
            self.follow(&all, self.learnt);
            return Touch::without_claim(TouchVerdict::Settling);
        }
        let verdict = of.array.track(readings, &of.indenter(), &mut self.track);
        match &verdict {
            Verdict::Inside(press)
            | Verdict::RadiusNotDetermined(press)
            | Verdict::BeyondArray(press) => self.compare(press, within_m),
            Verdict::TooSmall => self.off_centre = None,
            _ => {}
        }
        match verdict {
            Verdict::Inside(press) => claimed(TouchVerdict::Inside, &press),
            Verdict::RadiusNotDetermined(press) => Touch {
                radius_m: None,
                radius_uncertainty: None,
                ..claimed(TouchVerdict::RadiusNotDetermined, &press)
            },
            Verdict::BeyondArray(_) => Touch::without_claim(TouchVerdict::BeyondArray),
            Verdict::DoesNotFit { .. } => Touch::without_claim(TouchVerdict::DoesNotFit),
            Verdict::NotConverged => Touch::without_claim(TouchVerdict::NotConverged),
            Verdict::NotReadable => Touch::without_claim(TouchVerdict::NotReadable),
            Verdict::TooSmall => {
                let is_below =
                    |(reading, coil): (&f32, &Coil)| *reading < -LEAST_SIGNIFICANCE * coil.noise;
                if readings.iter().zip(coils).any(is_below) {
                    return Touch::without_claim(TouchVerdict::BelowRest);
                }
                self.follow(&all, memory);
                Touch::without_claim(TouchVerdict::Clear)
            }
        }
    }

    /// Averages the rest over `count` readings, of which these are the last.
    fn follow(&mut self, readings: &[f32; MOST_COILS], count: u16) {
        let share = 1.0 / f32::from(count.max(1));
        for (rest, reading) in self.rest.iter_mut().zip(readings) {
            *rest += share * reading;
        }
    }
}

fn claimed(verdict: TouchVerdict, press: &Press) -> Touch {
    let [[xx, xy, ..], [_, yy, ..], [_, _, force, _], [.., radius]] = press.covariance;
    let [x_sigma, y_sigma, force, radius] = [xx, yy, force, radius].map(sqrt);
    Touch {
        verdict,
        x_m: Some(press.x.0),
        y_m: Some(press.y.0),
        x_sigma_m: Some(x_sigma),
        y_sigma_m: Some(y_sigma),
        correlation: Some((xy / (x_sigma * y_sigma)).clamp(-1.0, 1.0)),
        force_n: Some(press.force.0),
        force_uncertainty: Some(force),
        radius_m: Some(press.radius.0),
        radius_uncertainty: Some(radius),
        chi_square: Some(press.chi_square),
    }
}
