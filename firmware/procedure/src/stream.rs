//! Sample records: evaluated, or packed raw words.

use ldc161x::Reading;
use palpate_model::contact::Touch;
use palpate_model::math::sqrt;
use palpate_wire::Record;
use palpate_wire::code::{Contact, Stream};
use palpate_wire::command::{Settings, Springs};
use palpate_wire::record::{Conversion, Raw, Sample};

use crate::deformation::Deformation;
use crate::event::Scan;
use crate::list::gathered;
use crate::time::{Instant, between};

/// State of one converter between its records.
#[derive(Clone, Debug, Default)]
pub(crate) struct Streamer {
    /// Number of scans since the last one that was sent.
    skipped: u16,
    /// Number of scans lost since the last record.
    missed: u32,
    gap: bool,
    raw: Option<(Instant, Raw)>,
    /// Time of the middle of the last scan.
    last: Option<Instant>,
}

/// Deformation at each channel of a scan, in order; `None` for a channel without one.
pub(crate) type DeformationScan = heapless::Vec<Option<Deformation>, 4>;

impl Streamer {
    /// Takes a scan and returns the record that is due, with its time.
    pub(crate) fn push(
        &mut self,
        scan: &Scan,
        deformations: &DeformationScan,
        settings: &Settings,
        springs: Option<&Springs>,
    ) -> Option<(Instant, Record)> {
        self.missed = self.missed.wrapping_add(scan.lost);
        self.gap |= scan.gap || scan.lost > 0;
        let record = match settings.stream {
            Stream::Samples => self.sample(scan, deformations, settings, springs),
            Stream::Raw => self.packed(scan, settings),
            _ => None,
        };
        self.last = Some(scan.middle);
        record
    }

    fn sample(
        &mut self,
        scan: &Scan,
        deformations: &DeformationScan,
        settings: &Settings,
        springs: Option<&Springs>,
    ) -> Option<(Instant, Record)> {
        self.skipped = self.skipped.saturating_add(1);
        if self.skipped < settings.decimation {
            return None;
        }
        self.skipped = 0;
        let conversions = scan.conversions.iter().zip(deformations);
        let channels = gathered(conversions.map(|(of, deformation)| {
            conversion(&of.reading, of.offset.as_ticks(), deformation.as_ref())
        }));
        let principal = deformations
            .first()
            .copied()
            .flatten()
            .filter(|_| scan.sensor == 0);
        let force = principal.zip(springs).map(|(deformation, springs)| {
            let newton = springs.sensing_n_per_m * deformation.value.0;
            let sensing = springs.sensing_n_per_m;
            let of_reading = sensing * sensing * deformation.variance_m2();
            // The curve's deformations are forces divided by c_S, so an error of c_S cancels. The error
            // of the force scale remains.
            let of_calibration = newton * springs.force_scale_uncertainty;
            // Forces from millinewtons to newtons: `f32` can represent their squares.
            let variance = of_reading + of_calibration * of_calibration;
            (newton, sqrt(variance))
        });
        let sample = Sample {
            sensor: scan.sensor,
            missed: core::mem::take(&mut self.missed),
            gap: core::mem::take(&mut self.gap),
            channels,
            contact: principal.map_or(Contact::Settling, |of| contact(of.touch)),
            force_n: force.map(|(newton, _)| newton),
            force_sigma_n: force.map(|(_, sigma)| sigma),
            current_a: scan.measured_current().map(|current| current.0),
            ripple_a: scan.known_ripple().map(|ripple| ripple.0),
        };
        Some((scan.middle, Record::Sample(sample)))
    }

    /// Packs the words of a scan; returns the previous run when it is full or interrupted.
    fn packed(&mut self, scan: &Scan, settings: &Settings) -> Option<(Instant, Record)> {
        let words = scan.conversions.iter().map(|of| of.reading.word.bits());
        let broken = scan.lost > 0 || scan.gap;
        let full = |raw: &Raw| raw.words.len() + scan.conversions.len() > raw.words.capacity();
        let finished = match &self.raw {
            Some((_, raw)) if broken || full(raw) => self.raw.take(),
            _ => None,
        };
        let finished = finished.map(|(at, mut raw)| {
            let scans = raw.words.len() / scan.conversions.len().max(1);
            if let Some(period_us) = self.period_us(at, scans) {
                raw.period_us = period_us;
            }
            (at, raw)
        });
        match &mut self.raw {
            // There is space for these words: a full run has been replaced above; see `full`.
            Some((_, raw)) => words.for_each(|word| {
                let _ = raw.words.push(word);
            }),
            None => {
                let raw = Raw {
                    sensor: scan.sensor,
                    missed: core::mem::take(&mut self.missed),
                    channels: settings.channels,
                    period_us: 1e6 / settings.rate_hz,
                    words: gathered(words),
                };
                self.raw = Some((scan.middle, raw));
            }
        }
        finished.map(|(at, raw)| (at, Record::Raw(raw)))
    }

    /// Returns the mean period of consecutive scans, from the first one's middle to the last one's.
    fn period_us(&self, first: Instant, scans: usize) -> Option<f32> {
        let span = between(first, self.last?);
        let periods = scans.checked_sub(1).filter(|periods| *periods > 0)?;
        Some(span.as_ticks() as f32 / periods as f32)
    }

    /// Returns the middle of the last scan.
    pub(crate) const fn last(&self) -> Option<Instant> {
        self.last
    }
}

fn conversion(reading: &Reading, offset_us: u64, deformation: Option<&Deformation>) -> Conversion {
    Conversion {
        channel: reading.channel.number(),
        offset_us: u16::try_from(offset_us).unwrap_or(u16::MAX),
        word: reading.word.bits(),
        frequency_hz: reading.frequency_hz,
        sigma_hz: reading.sigma_hz,
        deformation_m: deformation.map(|of| of.value.0),
        deformation_sigma_m: deformation.map(|of| sqrt(of.variance_m2())),
        extrapolated: deformation.is_some_and(|of| of.extrapolated),
    }
}

/// Converts the state of touch to the protocol's code.
pub(crate) const fn contact(touch: Touch) -> Contact {
    match touch {
        Touch::Settling => Contact::Settling,
        Touch::Clear => Contact::Clear,
        Touch::Began { .. } => Contact::Began,
        Touch::Held => Contact::Held,
        Touch::Ended => Contact::Ended,
    }
}
