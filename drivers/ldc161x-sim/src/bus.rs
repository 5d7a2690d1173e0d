//! The chip behind `embedded-hal`: a bus, a delay and two pins share it through a `RefCell`.

use core::cell::{RefCell, RefMut};
use core::convert::Infallible;
use core::fmt;

use embedded_hal::delay::DelayNs;
use embedded_hal::digital;
use embedded_hal::i2c::{self, I2c, NoAcknowledgeSource, Operation, SevenBitAddress};

use crate::chip::Chip;
use crate::i2c::Ack;
use crate::sensor::Sensors;
use crate::time::Time;

/// Reason why a transfer failed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum I2cError {
    /// The address, or a byte after it, was not acknowledged.
    NoAcknowledge(NoAcknowledgeSource),
    /// SDA was low where the master had sent a 1.
    ArbitrationLoss,
    /// SDA stayed low before a START for longer than the deadline.
    Bus,
    /// SCL stayed low for longer than the deadline.
    Timeout,
    /// The test held a borrow of the chip while it called the driver.
    Borrowed,
}

impl i2c::Error for I2cError {
    fn kind(&self) -> i2c::ErrorKind {
        match self {
            Self::NoAcknowledge(source) => i2c::ErrorKind::NoAcknowledge(*source),
            Self::ArbitrationLoss => i2c::ErrorKind::ArbitrationLoss,
            Self::Bus => i2c::ErrorKind::Bus,
            Self::Timeout | Self::Borrowed => i2c::ErrorKind::Other,
        }
    }
}

impl fmt::Display for I2cError {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoAcknowledge(source) => write!(formatter, "{source}"),
            Self::ArbitrationLoss => formatter.write_str("arbitration lost"),
            Self::Bus => formatter.write_str("SDA held low"),
            Self::Timeout => formatter.write_str("SCL held low"),
            Self::Borrowed => formatter.write_str("the chip is borrowed by the test"),
        }
    }
}

impl core::error::Error for I2cError {}

/// An I2C master whose bus has one or more chips.
///
/// Every transfer takes the exact time of its bits: 1 for START, repeated START and STOP, 9 for a
/// byte. [`Chip::traffic`] returns the number of bits. A line that gets stuck takes effect from the
/// next byte on; callers of the byte-level methods, such as [`Chip::start`], choose that moment.
///
/// ```
/// use core::cell::RefCell;
/// use embedded_hal::i2c::I2c;
/// use ldc161x_sim::{Bus, Chip, Settings};
///
/// let chip = RefCell::new(Chip::new(Settings::default(), [3e6; 4]));
/// let mut bus = Bus::new(&chip, 400_000);
/// let mut identity = [0; 2];
/// bus.write_read(0x2A, &[0x7E], &mut identity)?;
/// assert_eq!(identity, [0x54, 0x49]);
/// assert_eq!(chip.borrow().traffic().bit_times(), 48);
/// # Ok::<(), ldc161x_sim::I2cError>(())
/// ```
#[derive(Debug)]
pub struct Bus<'a, S> {
    chips: &'a [RefCell<Chip<S>>],
    bit: Time,
    deadline: Time,
}

impl<'a, S: Sensors> Bus<'a, S> {
    /// Creates a bus with one chip and a clock of `scl_hz`, limited to 10 kHz to 400 kHz (datasheet
    /// 6.6).
    #[must_use]
    pub fn new(chip: &'a RefCell<Chip<S>>, scl_hz: u32) -> Self {
        Self::shared(core::slice::from_ref(chip), scl_hz)
    }

    /// Creates a bus with several chips of different addresses.
    #[must_use]
    pub fn shared(chips: &'a [RefCell<Chip<S>>], scl_hz: u32) -> Self {
        let scl_hz = u64::from(scl_hz.clamp(10_000, 400_000));
        Self {
            chips,
            bit: Time::from_ps(1_000_000_000_000 / scl_hz),
            deadline: Time::from_ms(10),
        }
    }

    /// Sets the time after which the master gives up on a line held low; 10 ms by default.
    #[must_use]
    pub fn with_deadline(self, deadline: Time) -> Self {
        Self { deadline, ..self }
    }

    /// Sends SCL pulses, as a master does to free SDA.
    ///
    /// # Errors
    /// [`I2cError::Borrowed`].
    pub fn clock_pulses(&mut self, pulses: u32) -> Result<(), I2cError> {
        let time = now(self.chips)? + self.bit.times(u64::from(pulses));
        each(self.chips, |chip| chip.clock_pulses(time, pulses))
    }

    fn start(&mut self, address: SevenBitAddress, read: bool) -> Result<(), I2cError> {
        self.await_scl()?;
        self.await_sda()?;
        self.clock(1)?;
        let byte = (address << 1) | u8::from(read);
        self.send(byte, NoAcknowledgeSource::Address, |chip, time| {
            chip.start(time, byte)
        })
    }

    fn write_byte(&mut self, byte: u8) -> Result<(), I2cError> {
        self.send(byte, NoAcknowledgeSource::Data, |chip, time| {
            chip.write(time, byte)
        })
    }

    /// Sends a byte from the master. While SDA is stuck low, the master loses arbitration at the
    /// first 1 of the byte; a byte of zeros seems to be acknowledged.
    fn send(
        &mut self,
        byte: u8,
        source: NoAcknowledgeSource,
        to: impl Fn(&mut Chip<S>, Time) -> Ack,
    ) -> Result<(), I2cError> {
        let time = self.clock(9)?;
        match self.sda_release()? {
            None => self.acknowledged(|chip| to(chip, time), source),
            Some(_) if byte == 0 => Ok(()),
            Some(_) => Err(I2cError::ArbitrationLoss),
        }
    }

    /// Reads the wired-AND of the bytes of all chips; chips that are not addressed leave the line
    /// high.
    fn read_byte(&mut self, ack: Ack) -> Result<u8, I2cError> {
        let time = now(self.chips)?;
        let mut byte = 0xFF;
        each(self.chips, |chip| byte &= chip.read(time, ack))?;
        self.clock(9)?;
        Ok(byte)
    }

    /// Advances by a number of bits, then until SCL is released, if it is held low. Returns the
    /// time reached.
    fn clock(&mut self, bits: u64) -> Result<Time, I2cError> {
        let time = now(self.chips)? + self.bit.times(bits);
        each(self.chips, |chip| chip.advance_to(time))?;
        self.await_scl()?;
        now(self.chips)
    }

    fn stop(&mut self) -> Result<(), I2cError> {
        let time = now(self.chips)? + self.bit;
        each(self.chips, |chip| {
            chip.stop(time);
            chip.advance_to(time);
        })
    }

    fn acknowledged(
        &mut self,
        mut send: impl FnMut(&mut Chip<S>) -> Ack,
        source: NoAcknowledgeSource,
    ) -> Result<(), I2cError> {
        let mut taken = false;
        each(self.chips, |chip| taken |= send(chip).is_ack())?;
        if taken {
            Ok(())
        } else {
            Err(I2cError::NoAcknowledge(source))
        }
    }

    fn await_scl(&mut self) -> Result<(), I2cError> {
        let release = self.held_until(|chip, time| chip.scl_held_until(time))?;
        self.await_release(release, I2cError::Timeout)
    }

    fn await_sda(&mut self) -> Result<(), I2cError> {
        let release = self.sda_release()?;
        self.await_release(release, I2cError::Bus)
    }

    fn sda_release(&mut self) -> Result<Option<Time>, I2cError> {
        self.held_until(|chip, time| chip.sda_held_until(time))
    }

    fn held_until(
        &mut self,
        line: impl Fn(&mut Chip<S>, Time) -> Option<Time>,
    ) -> Result<Option<Time>, I2cError> {
        let time = now(self.chips)?;
        let mut release = None;
        each(self.chips, |chip| release = release.max(line(chip, time)))?;
        Ok(release)
    }

    /// Waits until a line that is held low is released, but no longer than the deadline.
    fn await_release(&mut self, release: Option<Time>, late: I2cError) -> Result<(), I2cError> {
        let Some(release) = release else {
            return Ok(());
        };
        let deadline = now(self.chips)? + self.deadline;
        each(self.chips, |chip| chip.advance_to(release.min(deadline)))?;
        if release <= deadline {
            Ok(())
        } else {
            Err(late)
        }
    }

    fn run(
        &mut self,
        address: SevenBitAddress,
        operations: &mut [Operation<'_>],
    ) -> Result<(), I2cError> {
        let mut direction = None;
        let mut rest = operations;
        while let Some((operation, later)) = rest.split_first_mut() {
            let reads = matches!(operation, Operation::Read(_));
            // Adjacent operations of the same direction are one transfer, without a START between
            // them.
            if direction != Some(reads) {
                self.start(address, reads)?;
                direction = Some(reads);
            }
            match operation {
                Operation::Write(bytes) => {
                    bytes.iter().try_for_each(|&byte| self.write_byte(byte))?;
                }
                Operation::Read(buffer) => self.fill(buffer, reads_on(later))?,
            }
            rest = later;
        }
        Ok(())
    }

    /// Reads into a buffer; the last byte of a transfer is not acknowledged.
    fn fill(&mut self, buffer: &mut [u8], more_follow: bool) -> Result<(), I2cError> {
        let count = buffer.len();
        for (position, byte) in (1..).zip(buffer) {
            let ack = if position < count || more_follow {
                Ack::Ack
            } else {
                Ack::Nack
            };
            *byte = self.read_byte(ack)?;
        }
        Ok(())
    }
}

/// Whether the first byte that the operations transfer is a read.
fn reads_on(operations: &[Operation<'_>]) -> bool {
    operations
        .iter()
        .map_while(|operation| match operation {
            Operation::Read(buffer) => Some(!buffer.is_empty()),
            Operation::Write(_) => None,
        })
        .any(|has_bytes| has_bytes)
}

impl<S> i2c::ErrorType for Bus<'_, S> {
    type Error = I2cError;
}

impl<S: Sensors> I2c for Bus<'_, S> {
    fn transaction(
        &mut self,
        address: SevenBitAddress,
        operations: &mut [Operation<'_>],
    ) -> Result<(), I2cError> {
        if operations.is_empty() {
            return Ok(());
        }
        let outcome = self.run(address, operations);
        let stopped = self.stop();
        outcome.and(stopped)
    }
}

/// A delay in simulated time.
#[derive(Clone, Copy, Debug)]
pub struct Delay<'a, S> {
    chips: &'a [RefCell<Chip<S>>],
}

impl<'a, S: Sensors> Delay<'a, S> {
    /// Creates a delay that advances one chip.
    #[must_use]
    pub fn new(chip: &'a RefCell<Chip<S>>) -> Self {
        Self::shared(core::slice::from_ref(chip))
    }

    /// Creates a delay that advances all chips of a bus.
    #[must_use]
    pub const fn shared(chips: &'a [RefCell<Chip<S>>]) -> Self {
        Self { chips }
    }

    fn wait(&self, length: Time) {
        // A delay cannot return an error: if the test holds a borrow, the next transfer reports it.
        if let Ok(time) = now(self.chips) {
            let _ = each(self.chips, |chip| chip.advance_to(time + length));
        }
    }
}

impl<S: Sensors> DelayNs for Delay<'_, S> {
    fn delay_ns(&mut self, nanoseconds: u32) {
        self.wait(Time::from_ns(u64::from(nanoseconds)));
    }

    fn delay_us(&mut self, microseconds: u32) {
        self.wait(Time::from_us(u64::from(microseconds)));
    }

    fn delay_ms(&mut self, milliseconds: u32) {
        self.wait(Time::from_ms(u64::from(milliseconds)));
    }
}

/// The INTB pin as an input of the microcontroller. It reads high while the test holds a borrow.
#[derive(Clone, Copy, Debug)]
pub struct IntbPin<'a, S> {
    chip: &'a RefCell<Chip<S>>,
}

impl<'a, S: Sensors> IntbPin<'a, S> {
    /// Returns the INTB pin of a chip.
    #[must_use]
    pub const fn new(chip: &'a RefCell<Chip<S>>) -> Self {
        Self { chip }
    }
}

impl<S> digital::ErrorType for IntbPin<'_, S> {
    type Error = Infallible;
}

impl<S: Sensors> digital::InputPin for IntbPin<'_, S> {
    fn is_high(&mut self) -> Result<bool, Infallible> {
        self.is_low().map(|low| !low)
    }

    fn is_low(&mut self) -> Result<bool, Infallible> {
        Ok(self.chip.try_borrow().is_ok_and(|chip| chip.intb_is_low()))
    }
}

/// The SD pin as an output of the microcontroller. Levels set while the test holds a borrow are
/// lost.
#[derive(Clone, Copy, Debug)]
pub struct ShutdownPin<'a, S> {
    chip: &'a RefCell<Chip<S>>,
}

impl<'a, S: Sensors> ShutdownPin<'a, S> {
    /// Returns the SD pin of a chip.
    #[must_use]
    pub const fn new(chip: &'a RefCell<Chip<S>>) -> Self {
        Self { chip }
    }

    fn set(&self, high: bool) {
        if let Ok(mut chip) = self.chip.try_borrow_mut() {
            chip.set_shutdown(high);
        }
    }
}

impl<S> digital::ErrorType for ShutdownPin<'_, S> {
    type Error = Infallible;
}

impl<S: Sensors> digital::OutputPin for ShutdownPin<'_, S> {
    fn set_low(&mut self) -> Result<(), Infallible> {
        self.set(false);
        Ok(())
    }

    fn set_high(&mut self) -> Result<(), Infallible> {
        self.set(true);
        Ok(())
    }
}

fn borrowed<S>(chip: &RefCell<Chip<S>>) -> Result<RefMut<'_, Chip<S>>, I2cError> {
    chip.try_borrow_mut().map_err(|_| I2cError::Borrowed)
}

fn each<S>(chips: &[RefCell<Chip<S>>], mut act: impl FnMut(&mut Chip<S>)) -> Result<(), I2cError> {
    chips
        .iter()
        .try_for_each(|chip| borrowed(chip).map(|mut chip| act(&mut chip)))
}

/// The bus's current time: that of its most advanced chip.
fn now<S: Sensors>(chips: &[RefCell<Chip<S>>]) -> Result<Time, I2cError> {
    let mut time = Time::ZERO;
    each(chips, |chip| time = time.max(chip.now()))?;
    Ok(time)
}

#[cfg(feature = "async")]
mod asynchronous {
    //! The bus and the delay as asynchronous traits of `embedded-hal-async`; simulated time needs
    //! no waiting.

    use super::{Bus, Delay, I2c, Operation, Sensors, SevenBitAddress};
    use embedded_hal::delay::DelayNs;

    impl<S: Sensors> embedded_hal_async::i2c::I2c for Bus<'_, S> {
        async fn transaction(
            &mut self,
            address: SevenBitAddress,
            operations: &mut [Operation<'_>],
        ) -> Result<(), Self::Error> {
            I2c::transaction(self, address, operations)
        }
    }

    impl<S: Sensors> embedded_hal_async::delay::DelayNs for Delay<'_, S> {
        async fn delay_ns(&mut self, nanoseconds: u32) {
            DelayNs::delay_ns(self, nanoseconds);
        }

        async fn delay_us(&mut self, microseconds: u32) {
            DelayNs::delay_us(self, microseconds);
        }

        async fn delay_ms(&mut self, milliseconds: u32) {
            DelayNs::delay_ms(self, milliseconds);
        }
    }
}
