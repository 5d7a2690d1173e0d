//! How results are reported in DATAx, in STATUS and on INTB, and what a read of DATAx or STATUS clears.

use crate::conversion::TrueConversion;
use crate::errors::Errors;
use crate::switches::{
    FlagRead, InterruptRelease, Overwrite, ShadowLatch, StatusReporting, Switches, UnreadCleared,
};
use crate::time::Time;

/// Number of channels of an LDC1614.
pub const CHANNELS: usize = 4;

/// Bit DRDY_2INT of ERROR_CONFIG.
const DATA_READY_TO_INTERRUPT: u16 = 1 << 0;
/// Bit DRDY of STATUS.
const DATA_READY: u16 = 1 << 6;
/// Bits of DATAx_MSB that hold the error flags.
const FLAGS: u16 = 0xF000;

/// Content of DATAx for one conversion.
#[derive(Clone, Copy, Debug)]
struct ConversionResult {
    /// DATAx_MSB, including flags, and DATAx_LSB.
    halves: (u16, u16),
    /// The conversion; `None` if it was aborted.
    conversion: Option<TrueConversion>,
}

/// The result registers of one channel, and the newest result behind them, the shadow (datasheet
/// 7.5.3).
#[derive(Clone, Copy, Debug, Default)]
struct ChannelRegisters {
    /// Newest result with its flags, as DATAx_MSB and DATAx_LSB.
    shadow: (u16, u16),
    /// DATAx_LSB, as latched by the last read of DATAx_MSB.
    latched_lsb: u16,
    /// Bit UNREADCONVx of STATUS.
    unread: bool,
    /// Whether the result in the shadow has not been read yet, independent of UNREADCONVx.
    waiting: bool,
    finished: u64,
    overwritten: u64,
    newest: Option<TrueConversion>,
    /// The conversion whose result is in the shadow.
    shown: Option<TrueConversion>,
    last_read: Option<TrueConversion>,
    /// A result that waits for the end of the autoscan cycle.
    pending: Option<ConversionResult>,
}

impl ChannelRegisters {
    fn publish(&mut self, outcome: ConversionResult) {
        self.shadow = outcome.halves;
        self.shown = outcome.conversion;
        if outcome.conversion.is_some() {
            self.overwritten += u64::from(self.waiting);
            self.unread = true;
            self.waiting = true;
        }
    }

    fn take(&mut self, outcome: ConversionResult, overwrite: Overwrite) {
        match overwrite {
            Overwrite::ByChannel => self.publish(outcome),
            Overwrite::ByScan => self.pending = Some(outcome),
        }
    }
}

/// All results and reports of conversions.
#[derive(Clone, Debug, Default)]
pub(crate) struct Results {
    channels: [ChannelRegisters; CHANNELS],
    errors: Errors,
    error_channel: u8,
    data_ready: bool,
    /// Whether INTB is asserted. With CONFIG.INTB_DIS set, the pin stays high nevertheless.
    interrupt: bool,
    falling_edges: u64,
    last_fall: Option<Time>,
}

/// Settings that determine which events are reported.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Reporting {
    pub(crate) error_config: u16,
    pub(crate) interrupt_disabled: bool,
    pub(crate) status: StatusReporting,
    pub(crate) overwrite: Overwrite,
    pub(crate) now: Time,
}

impl Results {
    /// Clears results, errors and INTB, as sleep, shutdown and reset do (7.4.2, 8.1.9). The ground
    /// truth and its counters are kept.
    pub(crate) fn clear(&mut self) {
        for channel in &mut self.channels {
            channel.shadow = (0, 0);
            channel.latched_lsb = 0;
            channel.unread = false;
            channel.waiting = false;
            channel.shown = None;
            channel.pending = None;
        }
        self.forget_errors();
        self.data_ready = false;
        self.interrupt = false;
    }

    /// Stores a finished conversion in DATAx of its channel and reports its errors.
    pub(crate) fn finish(&mut self, mut conversion: TrueConversion, reporting: Reporting) {
        let errors = conversion.errors;
        let Some(channel) = self.channels.get_mut(usize::from(conversion.channel)) else {
            return;
        };
        conversion.number = channel.finished;
        channel.finished += 1;
        channel.newest = Some(conversion);
        let outcome = ConversionResult {
            halves: halves(conversion.word, errors.to_data(reporting.error_config)),
            conversion: Some(conversion),
        };
        channel.take(outcome, reporting.overwrite);
        self.report(conversion.channel, errors, reporting);
    }

    /// Reports an aborted conversion. It has no valid result: the word is zero (SNOA959 3.3 and its
    /// table 2).
    pub(crate) fn abort(&mut self, channel: u8, errors: Errors, reporting: Reporting) {
        if let Some(channel) = self.channels.get_mut(usize::from(channel)) {
            let outcome = ConversionResult {
                halves: halves(0, errors.to_data(reporting.error_config)),
                conversion: None,
            };
            channel.take(outcome, reporting.overwrite);
        }
        self.report(channel, errors, reporting);
    }

    /// Reports that all channels of the sequence have new results.
    pub(crate) fn sequence_done(&mut self, reporting: Reporting) {
        for channel in &mut self.channels {
            if let Some(outcome) = channel.pending.take() {
                channel.publish(outcome);
            }
        }
        let enabled = reporting.error_config & DATA_READY_TO_INTERRUPT != 0;
        self.data_ready |= enabled || reporting.status == StatusReporting::Always;
        if enabled {
            self.assert_interrupt(reporting);
        }
    }

    /// Reports errors in STATUS. STATUS keeps the first channel with an error; errors of other
    /// channels are lost until STATUS is read (SNOA959 1.2).
    fn report(&mut self, channel: u8, errors: Errors, reporting: Reporting) {
        let enabled = errors.to_interrupt(reporting.error_config);
        let shown = match reporting.status {
            StatusReporting::OnlyWhenEnabled => enabled,
            StatusReporting::Always => errors,
        };
        if self.errors.is_empty() && !shown.is_empty() {
            self.error_channel = channel;
        }
        if self.error_channel == channel {
            self.errors |= shown;
        }
        if !enabled.is_empty() {
            self.assert_interrupt(reporting);
        }
    }

    fn assert_interrupt(&mut self, reporting: Reporting) {
        if !self.interrupt && !reporting.interrupt_disabled {
            self.falling_edges += 1;
            self.last_fall = Some(reporting.now);
        }
        self.interrupt = true;
    }

    /// Current value of STATUS.
    pub(crate) fn status(&self) -> u16 {
        let unread = (0_u16..)
            .zip(&self.channels)
            .map(|(index, channel)| u16::from(channel.unread) << (3 - index))
            .fold(0, |bits, bit| bits | bit);
        (u16::from(self.error_channel) << 14)
            | self.errors.to_status()
            | if self.data_ready { DATA_READY } else { 0 }
            | unread
    }

    /// Applies a read of STATUS: clears errors, DRDY and INTB, and by switch UNREADCONVx.
    pub(crate) fn status_was_read(&mut self, switches: &Switches) {
        self.forget_errors();
        self.data_ready = false;
        self.interrupt = false;
        if switches.unread_cleared == UnreadCleared::DataOrStatus {
            for channel in &mut self.channels {
                channel.unread = false;
            }
        }
    }

    fn forget_errors(&mut self) {
        self.errors = Errors::NONE;
        self.error_channel = 0;
    }

    /// Value that a read of DATAx_MSB returns.
    pub(crate) fn msb(&self, channel: u8) -> u16 {
        self.channel(channel).map_or(0, |channel| channel.shadow.0)
    }

    /// Value that a read of DATAx_LSB returns.
    pub(crate) fn lsb(&self, channel: u8, latch: ShadowLatch) -> u16 {
        self.channel(channel).map_or(0, |channel| match latch {
            ShadowLatch::OnMsbRead => channel.latched_lsb,
            ShadowLatch::None => channel.shadow.1,
        })
    }

    /// Applies a read of DATAx_MSB: latches DATAx_LSB, and clears what the switches select.
    pub(crate) fn msb_was_read(&mut self, channel: u8, switches: &Switches) {
        let index = channel;
        let Some(channel) = self.channels.get_mut(usize::from(index)) else {
            return;
        };
        channel.latched_lsb = channel.shadow.1;
        channel.unread = false;
        channel.waiting = false;
        channel.last_read = channel.shown;
        if switches.flag_read == FlagRead::Clears {
            channel.shadow.0 &= !FLAGS;
        }
        if switches.interrupt_release == InterruptRelease::StatusOrData {
            self.interrupt = false;
            self.data_ready = false;
            if self.error_channel == index {
                self.forget_errors();
            }
        }
    }

    pub(crate) fn interrupt(&self) -> bool {
        self.interrupt
    }

    pub(crate) fn falling_edges(&self) -> u64 {
        self.falling_edges
    }

    pub(crate) fn last_fall(&self) -> Option<Time> {
        self.last_fall
    }

    pub(crate) fn finished(&self, channel: u8) -> u64 {
        self.channel(channel).map_or(0, |channel| channel.finished)
    }

    pub(crate) fn overwritten(&self, channel: u8) -> u64 {
        self.channel(channel)
            .map_or(0, |channel| channel.overwritten)
    }

    pub(crate) fn newest(&self, channel: u8) -> Option<&TrueConversion> {
        self.channel(channel)?.newest.as_ref()
    }

    pub(crate) fn last_read(&self, channel: u8) -> Option<&TrueConversion> {
        self.channel(channel)?.last_read.as_ref()
    }

    fn channel(&self, channel: u8) -> Option<&ChannelRegisters> {
        self.channels.get(usize::from(channel))
    }
}

/// Splits a word and its flags into DATAx_MSB and DATAx_LSB.
fn halves(word: u32, flags: u16) -> (u16, u16) {
    let upper = (word >> 16) as u16 & !FLAGS;
    (upper | flags, word as u16)
}
