//! Helpers of all tests. Registers are plain numbers on purpose: the tests must not use the crate's
//! own transcription of the datasheet.

use core::cell::RefCell;

use embedded_hal::i2c::{I2c, Operation};
use ldc161x_sim::{
    Bus, Chip, ChipFault, Conversions, ExternalClock, FaultEvent, I2cError, Sensors, Settings,
    Switches, Time, TrueConversion,
};

pub(crate) const ADDRESS: u8 = 0x2A;

pub(crate) fn us(microseconds: u64) -> Time {
    Time::from_us(microseconds)
}

pub(crate) fn ms(milliseconds: u64) -> Time {
    Time::from_ms(milliseconds)
}

/// Settings without noise and without shifts of the frequency, but with quantisation by the
/// counter.
pub(crate) fn quiet(clkin_hz: f64) -> Settings {
    let ideal = Settings::ideal();
    Settings {
        external_clock: Some(ExternalClock::exact(clkin_hz)),
        conversions: Conversions {
            quantised: true,
            ..ideal.conversions
        },
        ..ideal
    }
}

pub(crate) fn with_switches(settings: Settings, change: impl FnOnce(&mut Switches)) -> Settings {
    let mut switches = settings.switches;
    change(&mut switches);
    Settings {
        switches,
        ..settings
    }
}

/// A chip on a 400 kHz bus.
pub(crate) struct ChipRig<S> {
    pub(crate) chip: RefCell<Chip<S>>,
}

impl<S: Sensors> ChipRig<S> {
    pub(crate) fn new(settings: Settings, sensors: S) -> Self {
        Self {
            chip: RefCell::new(Chip::new(settings, sensors)),
        }
    }

    pub(crate) fn bus(&self) -> Bus<'_, S> {
        Bus::new(&self.chip, 400_000)
    }

    pub(crate) fn try_read(&self, register: u8) -> Result<u16, I2cError> {
        let mut bytes = [0; 2];
        self.bus().write_read(ADDRESS, &[register], &mut bytes)?;
        Ok(u16::from_be_bytes(bytes))
    }

    pub(crate) fn read(&self, register: u8) -> u16 {
        self.try_read(register).expect("the chip answers")
    }

    pub(crate) fn try_write(&self, register: u8, value: u16) -> Result<(), I2cError> {
        let [high, low] = value.to_be_bytes();
        self.bus().write(ADDRESS, &[register, high, low])
    }

    pub(crate) fn write(&self, register: u8, value: u16) {
        self.try_write(register, value).expect("the chip answers");
    }

    pub(crate) fn configure(&self, writes: &[(u8, u16)]) {
        for &(register, value) in writes {
            self.write(register, value);
        }
    }

    /// Reads one channel's result as a driver does: both halves in one transaction.
    pub(crate) fn frame(&self, channel: u8) -> (u16, u32) {
        let (mut high, mut low) = ([0; 2], [0; 2]);
        self.bus()
            .transaction(
                ADDRESS,
                &mut [
                    Operation::Write(&[2 * channel]),
                    Operation::Read(&mut high),
                    Operation::Write(&[2 * channel + 1]),
                    Operation::Read(&mut low),
                ],
            )
            .expect("the chip answers");
        let [high, low] = [u16::from_be_bytes(high), u16::from_be_bytes(low)];
        (
            high & 0xF000,
            u32::from(high & 0x0FFF) << 16 | u32::from(low),
        )
    }

    /// Writes the registers of one channel: RCOUNT, a SETTLECOUNT of `settle`, dividers of 1, drive
    /// current.
    pub(crate) fn prepare(&self, channel: u8, rcount: u16, settle: u16) {
        self.write(0x08 + channel, rcount);
        self.write(0x10 + channel, settle);
        self.write(0x14 + channel, 0x1001);
        self.write(0x1E + channel, 0xA000); // code 20: 297 uA, 1.13 V at 3 kohm
    }

    /// Starts single-channel conversions on channel 0 with all events reported.
    pub(crate) fn single(&self, rcount: u16) {
        self.prepare(0, rcount, 16);
        self.write(0x1E, 0xA800); // code 21: 342 uA, 1.31 V at 3 kohm
        self.configure(&[(0x19, 0xF8FD), (0x1B, 0x020D), (0x1A, 0x1601)]);
    }

    /// As [`ChipRig::single`], with other values in some registers.
    pub(crate) fn single_with(&self, rcount: u16, writes: &[(u8, u16)]) {
        self.single(rcount);
        self.write(0x1A, 0x3601);
        self.configure(writes);
        self.write(0x1A, 0x1601);
    }

    /// Starts autoscan over channels 0 to `last` with all events reported.
    pub(crate) fn autoscan(&self, last: u8, rcount: u16, settle: u16) {
        for channel in 0..=last {
            self.prepare(channel, rcount, settle);
            self.write(0x1E + channel, 0xA800);
        }
        let sequence = [0, 0, 0x2000, 0x4000][usize::from(last)];
        self.configure(&[(0x19, 0xF8FD), (0x1B, 0x820D | sequence), (0x1A, 0x1601)]);
    }

    pub(crate) fn schedule(&self, event: FaultEvent) {
        self.chip.borrow_mut().schedule(event).expect("a free slot");
    }

    /// Schedules a fault for the next `count` transactions.
    pub(crate) fn in_next(&self, count: u32, fault: ChipFault) {
        let number = self.chip.borrow().traffic().transactions;
        self.schedule(FaultEvent::in_transactions(number, count, fault));
    }

    /// Schedules a fault that starts now and lasts for a time.
    pub(crate) fn for_time(&self, lasting: Time, fault: ChipFault) {
        self.schedule(FaultEvent::at(self.now(), fault, lasting));
    }

    pub(crate) fn now(&self) -> Time {
        self.chip.borrow().now()
    }

    pub(crate) fn wait(&self, time: Time) {
        let end = self.now() + time;
        self.chip.borrow_mut().advance_to(end);
    }

    /// Runs to the next falling edge of INTB. If the pin is low already, reads STATUS first to
    /// release it.
    pub(crate) fn next_interrupt(&self) -> Time {
        if self.chip.borrow().intb_is_low() {
            self.read(0x18);
        }
        let limit = self.now() + Time::from_ms(2_000);
        let edge = self.chip.borrow_mut().advance_to_interrupt(limit);
        edge.expect("an interrupt")
    }

    pub(crate) fn intb_is_low(&self) -> bool {
        self.chip.borrow().intb_is_low()
    }

    /// The truth about a channel's last conversion.
    pub(crate) fn last(&self, channel: u8) -> TrueConversion {
        let chip = self.chip.borrow();
        *chip.last_conversion(channel).expect("a conversion")
    }

    /// Runs until a channel has finished `count` more conversions.
    pub(crate) fn convert(&self, channel: u8, count: u64) {
        let mut chip = self.chip.borrow_mut();
        let target = chip.conversions(channel) + count;
        let limit = chip.now() + ms(2_000_000);
        while chip.conversions(channel) < target {
            let due = chip.next_event().expect("the chip converts");
            assert!(due < limit, "no conversion in half an hour");
            chip.advance_to(due);
        }
    }
}
