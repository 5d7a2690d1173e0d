//! Setpoint of a converter, and the scheme that meets it.

use ldc161x::{Channel, Configuration, DriveCode, Rcount};

/// Requested operation of a converter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Setpoint {
    /// Active channels: bit n for channel n.
    pub channels: u8,
    /// Scans per second.
    pub rate_hz: f32,
    /// Another converter runs with the same settings on the same bus.
    pub shares_bus: bool,
}

/// Plan of a converter.
#[derive(Clone, Copy, Debug)]
pub struct Scheme {
    /// Setpoint that the plan was made for.
    pub setpoint: Setpoint,
    /// Configuration written to the converter.
    pub configuration: Configuration,
    /// Planned frame period, in microseconds.
    pub period_us: f32,
    /// Time from the middle of the first conversion to the frame's edge, in microseconds.
    pub before_edge_us: u32,
    /// Time from the middle of the first conversion to the middle of each, in microseconds.
    pub offsets_us: [u16; 4],
    /// Time from the end of each conversion to the frame's edge, in microseconds: 0 for the last one.
    pub ages_us: [f32; 4],
    /// Number of converted channels.
    pub channels: u8,
    /// Duration of a conversion, in microseconds.
    pub window_us: u16,
}

impl Scheme {
    /// Returns whether the scan rate is not higher than requested, and every time within a scan fits
    /// into a record. The rate is higher if the period exceeds the longest conversion.
    pub(crate) fn is_kept(&self) -> bool {
        let first = self.configuration.acquisition.channels().next();
        let settings = self.configuration.channel(first.unwrap_or_default());
        settings.rcount < Rcount::MAX && !self.offsets_us.contains(&u16::MAX)
    }

    /// Sets the drive currents found for the active channels.
    pub fn drive(&mut self, found: &[Option<DriveCode>; 4]) {
        for (channel, drive) in Channel::ALL.into_iter().zip(found) {
            if let Some(drive) = drive {
                self.configuration.channel_mut(channel).drive = *drive;
            }
        }
    }
}
