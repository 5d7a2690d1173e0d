//! The driver itself, blocking and asynchronous from this one source.

use embedded_hal::{
    delay::DelayNs,
    digital::{InputPin, OutputPin},
    i2c::{I2c, Operation},
};
use heapless::Vec;

#[cfg(feature = "async")]
use embedded_hal_async::{delay::DelayNs as AsyncDelayNs, i2c::I2c as AsyncI2c};

use crate::{
    Address, BusAccess, Canary, Channel, Configuration, DEVICE_ID, Direction, DriveCode,
    DriveCurrent, Error, Frame, InterruptRelease, MANUFACTURER_ID, Model, Register, Status,
    register::RESET,
    state::{FRAME_REGISTERS, State},
};

/// From the release of SD to the first transfer: 2 ms at most (datasheet 6.5). A reset by
/// register is given the same time, for which no source states another.
const RESET_US: u32 = 2_000;
/// SD is held high for this long; no source gives a least time. One millisecond is a thousand
/// times what a digital input needs.
const SHUTDOWN_US: u32 = 1_000;
/// INTB is looked at this often while waiting for it.
const INTERRUPT_POLL_US: u32 = 5;
/// How often a release of INTB is tried: a conversion that ends during the read of STATUS pulls it
/// down again, seldom three times in a row.
const RELEASE_TRIES: u8 = 3;

#[cfg_attr(
    not(feature = "async"),
    doc = "An LDC1612 or LDC1614 behind an `embedded-hal` I2C bus; see the crate's page."
)]
#[cfg_attr(
    feature = "async",
    doc = "An LDC1612 or LDC1614 behind an I2C bus: `Ldc161x` over `embedded-hal`, \
           `AsyncLdc161x` over `embedded-hal-async`, the same methods in both; see the crate's page."
)]
#[maybe_async_cfg::maybe(sync(keep_self), async(feature = "async", self = "AsyncLdc161x"))]
#[derive(Debug)]
pub struct Ldc161x<I2C> {
    i2c: I2C,
    model: Model,
    address: Address,
    state: State,
}

#[maybe_async_cfg::maybe(
    sync(keep_self),
    async(
        feature = "async",
        self = "AsyncLdc161x",
        idents(I2c(async = "AsyncI2c"), DelayNs(async = "AsyncDelayNs"))
    )
)]
impl<I2C: I2c> Ldc161x<I2C> {
    /// Takes the bus; nothing is sent yet.
    ///
    /// ```
    /// # use core::cell::RefCell;
    /// # use ldc161x::*;
    /// # let sensor = Sensor { highest_quality_factor: 25, lowest_rp_ohm: 3_000,
    /// #     highest_rp_ohm: 3_000, ..Sensor::new(2_900_000, 3_800_000) };
    /// # let clock = ReferenceClock::External { hz: 40_000_000 };
    /// # let plan = Request::new(Model::Ldc1614, clock, Acquisition::Single(Channel::Zero), sensor)
    /// #     .rate(Rate::PerSecond(1_000)).plan()?;
    /// # let chip = RefCell::new(ldc161x_sim::Chip::new(ldc161x_sim::Settings::default(), [3.1e6; 4]));
    /// # let mut interrupt = ldc161x_sim::IntbPin::new(&chip);
    /// # let mut shutdown = ldc161x_sim::ShutdownPin::new(&chip);
    /// # let mut delay = ldc161x_sim::Delay::new(&chip);
    /// # let i2c = ldc161x_sim::Bus::new(&chip, 400_000);
    /// let mut driver = Ldc161x::new(i2c, Model::Ldc1614, Address::AddrLow);
    /// driver.identify()?;
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub const fn new(i2c: I2C, model: Model, address: Address) -> Self {
        Self {
            i2c,
            model,
            address,
            state: State::new(),
        }
    }

    /// Gives the bus back. The chip goes on as it is.
    ///
    /// ```
    /// # use core::cell::RefCell;
    /// # use ldc161x::*;
    /// # let sensor = Sensor { highest_quality_factor: 25, lowest_rp_ohm: 3_000,
    /// #     highest_rp_ohm: 3_000, ..Sensor::new(2_900_000, 3_800_000) };
    /// # let clock = ReferenceClock::External { hz: 40_000_000 };
    /// # let plan = Request::new(Model::Ldc1614, clock, Acquisition::Single(Channel::Zero), sensor)
    /// #     .rate(Rate::PerSecond(1_000)).plan()?;
    /// # let chip = RefCell::new(ldc161x_sim::Chip::new(ldc161x_sim::Settings::default(), [3.1e6; 4]));
    /// # let mut interrupt = ldc161x_sim::IntbPin::new(&chip);
    /// # let mut shutdown = ldc161x_sim::ShutdownPin::new(&chip);
    /// # let mut delay = ldc161x_sim::Delay::new(&chip);
    /// # let i2c = ldc161x_sim::Bus::new(&chip, 400_000);
    /// # let mut driver = Ldc161x::new(i2c, Model::Ldc1614, Address::AddrLow);
    /// let i2c = driver.release();
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn release(self) -> I2C {
        self.i2c
    }

    /// Sets how registers are fetched; see [`BusAccess`].
    ///
    /// ```
    /// # use core::cell::RefCell;
    /// # use ldc161x::*;
    /// # let sensor = Sensor { highest_quality_factor: 25, lowest_rp_ohm: 3_000,
    /// #     highest_rp_ohm: 3_000, ..Sensor::new(2_900_000, 3_800_000) };
    /// # let clock = ReferenceClock::External { hz: 40_000_000 };
    /// # let plan = Request::new(Model::Ldc1614, clock, Acquisition::Single(Channel::Zero), sensor)
    /// #     .rate(Rate::PerSecond(1_000)).plan()?;
    /// # let chip = RefCell::new(ldc161x_sim::Chip::new(ldc161x_sim::Settings::default(), [3.1e6; 4]));
    /// # let mut interrupt = ldc161x_sim::IntbPin::new(&chip);
    /// # let mut shutdown = ldc161x_sim::ShutdownPin::new(&chip);
    /// # let mut delay = ldc161x_sim::Delay::new(&chip);
    /// # let i2c = ldc161x_sim::Bus::new(&chip, 400_000);
    /// # let mut driver = Ldc161x::new(i2c, Model::Ldc1614, Address::AddrLow);
    /// # driver.start(&plan.configuration)?;
    /// driver.set_access(BusAccess::RegisterPerTransaction);
    /// driver.read_frame()?;
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub const fn set_access(&mut self, access: BusAccess) {
        self.state.access = access;
    }

    /// Reads every word twice and compares the two, since the bus carries no checksum. Costs
    /// twice the bus time.
    ///
    /// ```
    /// # use core::cell::RefCell;
    /// # use ldc161x::*;
    /// # let sensor = Sensor { highest_quality_factor: 25, lowest_rp_ohm: 3_000,
    /// #     highest_rp_ohm: 3_000, ..Sensor::new(2_900_000, 3_800_000) };
    /// # let clock = ReferenceClock::External { hz: 40_000_000 };
    /// # let plan = Request::new(Model::Ldc1614, clock, Acquisition::Single(Channel::Zero), sensor)
    /// #     .rate(Rate::PerSecond(1_000)).plan()?;
    /// # let chip = RefCell::new(ldc161x_sim::Chip::new(ldc161x_sim::Settings::default(), [3.1e6; 4]));
    /// # let mut interrupt = ldc161x_sim::IntbPin::new(&chip);
    /// # let mut shutdown = ldc161x_sim::ShutdownPin::new(&chip);
    /// # let mut delay = ldc161x_sim::Delay::new(&chip);
    /// # let i2c = ldc161x_sim::Bus::new(&chip, 400_000);
    /// # let mut driver = Ldc161x::new(i2c, Model::Ldc1614, Address::AddrLow);
    /// # driver.start(&plan.configuration)?;
    /// driver.set_read_twice(true);
    /// driver.wait_for_interrupt(&mut interrupt, &mut delay)?;
    /// assert_eq!(driver.read_frame()?.readings()[0].agrees, Some(true));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub const fn set_read_twice(&mut self, twice: bool) {
        self.state.read_twice = twice;
    }

    /// States what releases INTB, as an earlier probe found.
    ///
    /// ```
    /// # use core::cell::RefCell;
    /// # use ldc161x::*;
    /// # let sensor = Sensor { highest_quality_factor: 25, lowest_rp_ohm: 3_000,
    /// #     highest_rp_ohm: 3_000, ..Sensor::new(2_900_000, 3_800_000) };
    /// # let clock = ReferenceClock::External { hz: 40_000_000 };
    /// # let plan = Request::new(Model::Ldc1614, clock, Acquisition::Single(Channel::Zero), sensor)
    /// #     .rate(Rate::PerSecond(1_000)).plan()?;
    /// # let chip = RefCell::new(ldc161x_sim::Chip::new(ldc161x_sim::Settings::default(), [3.1e6; 4]));
    /// # let mut interrupt = ldc161x_sim::IntbPin::new(&chip);
    /// # let mut shutdown = ldc161x_sim::ShutdownPin::new(&chip);
    /// # let mut delay = ldc161x_sim::Delay::new(&chip);
    /// # let i2c = ldc161x_sim::Bus::new(&chip, 400_000);
    /// # let mut driver = Ldc161x::new(i2c, Model::Ldc1614, Address::AddrLow);
    /// # driver.start(&plan.configuration)?;
    /// driver.set_interrupt_release(InterruptRelease::ByData);
    /// assert!(driver.read_frame()?.status.is_none());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub const fn set_interrupt_release(&mut self, release: InterruptRelease) {
        self.state.release = release;
    }

    /// The configuration last started.
    ///
    /// ```
    /// # use core::cell::RefCell;
    /// # use ldc161x::*;
    /// # let sensor = Sensor { highest_quality_factor: 25, lowest_rp_ohm: 3_000,
    /// #     highest_rp_ohm: 3_000, ..Sensor::new(2_900_000, 3_800_000) };
    /// # let clock = ReferenceClock::External { hz: 40_000_000 };
    /// # let plan = Request::new(Model::Ldc1614, clock, Acquisition::Single(Channel::Zero), sensor)
    /// #     .rate(Rate::PerSecond(1_000)).plan()?;
    /// # let chip = RefCell::new(ldc161x_sim::Chip::new(ldc161x_sim::Settings::default(), [3.1e6; 4]));
    /// # let mut interrupt = ldc161x_sim::IntbPin::new(&chip);
    /// # let mut shutdown = ldc161x_sim::ShutdownPin::new(&chip);
    /// # let mut delay = ldc161x_sim::Delay::new(&chip);
    /// # let i2c = ldc161x_sim::Bus::new(&chip, 400_000);
    /// # let mut driver = Ldc161x::new(i2c, Model::Ldc1614, Address::AddrLow);
    /// # driver.start(&plan.configuration)?;
    /// assert_eq!(driver.configuration(), Some(&plan.configuration));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub const fn configuration(&self) -> Option<&Configuration> {
        self.state.wanted.as_ref()
    }

    /// Asks the chip who it is.
    ///
    /// # Errors
    ///
    /// [`Error::WrongIdentity`] with a plain-words cause, or a bus error.
    ///
    /// ```
    /// # use core::cell::RefCell;
    /// # use ldc161x::*;
    /// # let sensor = Sensor { highest_quality_factor: 25, lowest_rp_ohm: 3_000,
    /// #     highest_rp_ohm: 3_000, ..Sensor::new(2_900_000, 3_800_000) };
    /// # let clock = ReferenceClock::External { hz: 40_000_000 };
    /// # let plan = Request::new(Model::Ldc1614, clock, Acquisition::Single(Channel::Zero), sensor)
    /// #     .rate(Rate::PerSecond(1_000)).plan()?;
    /// # let chip = RefCell::new(ldc161x_sim::Chip::new(ldc161x_sim::Settings::default(), [3.1e6; 4]));
    /// # let mut interrupt = ldc161x_sim::IntbPin::new(&chip);
    /// # let mut shutdown = ldc161x_sim::ShutdownPin::new(&chip);
    /// # let mut delay = ldc161x_sim::Delay::new(&chip);
    /// # let i2c = ldc161x_sim::Bus::new(&chip, 400_000);
    /// # let mut driver = Ldc161x::new(i2c, Model::Ldc1614, Address::AddrLow);
    /// driver.identify()?;
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub async fn identify(&mut self) -> Result<(), Error<I2C::Error>> {
        let manufacturer = self.read_register(Register::ManufacturerId).await?;
        let device = self.read_register(Register::DeviceId).await?;
        if (manufacturer, device) == (MANUFACTURER_ID, DEVICE_ID) {
            Ok(())
        } else {
            Err(Error::WrongIdentity {
                manufacturer,
                device,
            })
        }
    }

    /// Sleep, identity, every register written and read back, CONFIG last; then every register
    /// once more, since chips were seen to lose them on leaving sleep. The first frame comes
    /// marked as following a gap.
    ///
    /// # Errors
    ///
    /// [`Error::NoSuchChannel`] before anything is sent; [`Error::WrongIdentity`],
    /// [`Error::ReadBack`], [`Error::RegistersLost`] or a bus error, after any of which the chip
    /// counts as not running.
    ///
    /// ```
    /// # use core::cell::RefCell;
    /// # use ldc161x::*;
    /// # let sensor = Sensor { highest_quality_factor: 25, lowest_rp_ohm: 3_000,
    /// #     highest_rp_ohm: 3_000, ..Sensor::new(2_900_000, 3_800_000) };
    /// # let clock = ReferenceClock::External { hz: 40_000_000 };
    /// # let plan = Request::new(Model::Ldc1614, clock, Acquisition::Single(Channel::Zero), sensor)
    /// #     .rate(Rate::PerSecond(1_000)).plan()?;
    /// # let chip = RefCell::new(ldc161x_sim::Chip::new(ldc161x_sim::Settings::default(), [3.1e6; 4]));
    /// # let mut interrupt = ldc161x_sim::IntbPin::new(&chip);
    /// # let mut shutdown = ldc161x_sim::ShutdownPin::new(&chip);
    /// # let mut delay = ldc161x_sim::Delay::new(&chip);
    /// # let i2c = ldc161x_sim::Bus::new(&chip, 400_000);
    /// # let mut driver = Ldc161x::new(i2c, Model::Ldc1614, Address::AddrLow);
    /// driver.start(&plan.configuration)?;
    /// assert!(driver.read_frame()?.marks.gap);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub async fn start(&mut self, configuration: &Configuration) -> Result<(), Error<I2C::Error>> {
        if !configuration.fits(self.model) {
            return Err(Error::NoSuchChannel);
        }
        self.state.stopped();
        self.state.wanted = Some(*configuration);
        self.identify().await?;
        self.write_asleep(configuration).await?;
        let config = configuration.config(false).to_bits();
        self.write_verified(Register::Config, config).await?;
        self.state.started(*configuration);
        self.verify().await?;
        Ok(())
    }

    /// Stops converting. The chip keeps its registers and forgets its results.
    ///
    /// # Errors
    ///
    /// [`Error::NotStarted`] before a configuration was started, or a bus error.
    ///
    /// ```
    /// # use core::cell::RefCell;
    /// # use ldc161x::*;
    /// # let sensor = Sensor { highest_quality_factor: 25, lowest_rp_ohm: 3_000,
    /// #     highest_rp_ohm: 3_000, ..Sensor::new(2_900_000, 3_800_000) };
    /// # let clock = ReferenceClock::External { hz: 40_000_000 };
    /// # let plan = Request::new(Model::Ldc1614, clock, Acquisition::Single(Channel::Zero), sensor)
    /// #     .rate(Rate::PerSecond(1_000)).plan()?;
    /// # let chip = RefCell::new(ldc161x_sim::Chip::new(ldc161x_sim::Settings::default(), [3.1e6; 4]));
    /// # let mut interrupt = ldc161x_sim::IntbPin::new(&chip);
    /// # let mut shutdown = ldc161x_sim::ShutdownPin::new(&chip);
    /// # let mut delay = ldc161x_sim::Delay::new(&chip);
    /// # let i2c = ldc161x_sim::Bus::new(&chip, 400_000);
    /// # let mut driver = Ldc161x::new(i2c, Model::Ldc1614, Address::AddrLow);
    /// # driver.start(&plan.configuration)?;
    /// driver.sleep()?;
    /// assert_eq!(driver.read_frame(), Err(Error::NotRunning));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub async fn sleep(&mut self) -> Result<(), Error<I2C::Error>> {
        let configuration = self.state.wanted.ok_or(Error::NotStarted)?;
        self.state.stopped();
        self.write_verified(Register::Config, configuration.config(true).to_bits())
            .await
    }

    /// Converts again after [`sleep`](Self::sleep), all registers compared first.
    ///
    /// # Errors
    ///
    /// [`Error::NotStarted`], [`Error::RegistersLost`] or a bus error.
    ///
    /// ```
    /// # use core::cell::RefCell;
    /// # use ldc161x::*;
    /// # let sensor = Sensor { highest_quality_factor: 25, lowest_rp_ohm: 3_000,
    /// #     highest_rp_ohm: 3_000, ..Sensor::new(2_900_000, 3_800_000) };
    /// # let clock = ReferenceClock::External { hz: 40_000_000 };
    /// # let plan = Request::new(Model::Ldc1614, clock, Acquisition::Single(Channel::Zero), sensor)
    /// #     .rate(Rate::PerSecond(1_000)).plan()?;
    /// # let chip = RefCell::new(ldc161x_sim::Chip::new(ldc161x_sim::Settings::default(), [3.1e6; 4]));
    /// # let mut interrupt = ldc161x_sim::IntbPin::new(&chip);
    /// # let mut shutdown = ldc161x_sim::ShutdownPin::new(&chip);
    /// # let mut delay = ldc161x_sim::Delay::new(&chip);
    /// # let i2c = ldc161x_sim::Bus::new(&chip, 400_000);
    /// # let mut driver = Ldc161x::new(i2c, Model::Ldc1614, Address::AddrLow);
    /// # driver.start(&plan.configuration)?;
    /// driver.sleep()?;
    /// driver.wake()?;
    /// driver.read_frame()?;
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub async fn wake(&mut self) -> Result<(), Error<I2C::Error>> {
        let configuration = self.state.wanted.ok_or(Error::NotStarted)?;
        self.state.stopped();
        self.write_verified(Register::Config, configuration.config(false).to_bits())
            .await?;
        self.state.started(configuration);
        self.verify().await?;
        Ok(())
    }

    /// Resets the chip by its register and starts the wanted configuration again.
    ///
    /// Where the bus itself is stuck, clear it first (nine clocks, then a stop), which is the
    /// business of the bus's owner. Call again, within a deadline of your own, where it fails.
    ///
    /// # Errors
    ///
    /// Those of [`start`](Self::start), and [`Error::NotStarted`].
    ///
    /// ```
    /// # use core::cell::RefCell;
    /// # use ldc161x::*;
    /// # let sensor = Sensor { highest_quality_factor: 25, lowest_rp_ohm: 3_000,
    /// #     highest_rp_ohm: 3_000, ..Sensor::new(2_900_000, 3_800_000) };
    /// # let clock = ReferenceClock::External { hz: 40_000_000 };
    /// # let plan = Request::new(Model::Ldc1614, clock, Acquisition::Single(Channel::Zero), sensor)
    /// #     .rate(Rate::PerSecond(1_000)).plan()?;
    /// # let chip = RefCell::new(ldc161x_sim::Chip::new(ldc161x_sim::Settings::default(), [3.1e6; 4]));
    /// # let mut interrupt = ldc161x_sim::IntbPin::new(&chip);
    /// # let mut shutdown = ldc161x_sim::ShutdownPin::new(&chip);
    /// # let mut delay = ldc161x_sim::Delay::new(&chip);
    /// # let i2c = ldc161x_sim::Bus::new(&chip, 400_000);
    /// # let mut driver = Ldc161x::new(i2c, Model::Ldc1614, Address::AddrLow);
    /// # driver.start(&plan.configuration)?;
    /// driver.recover(&mut delay)?;
    /// assert!(driver.read_frame()?.marks.gap);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub async fn recover(&mut self, delay: &mut impl DelayNs) -> Result<(), Error<I2C::Error>> {
        let configuration = self.state.wanted.ok_or(Error::NotStarted)?;
        self.state.stopped();
        self.write_register(Register::ResetDev, RESET).await?;
        delay.delay_us(RESET_US).await;
        self.start(&configuration).await
    }

    /// Resets the chip by its SD pin, which also ends a transfer that it hangs in, and starts
    /// the wanted configuration again.
    ///
    /// # Errors
    ///
    /// Those of [`start`](Self::start), [`Error::NotStarted`] and [`Error::Pin`].
    ///
    /// ```
    /// # use core::cell::RefCell;
    /// # use ldc161x::*;
    /// # let sensor = Sensor { highest_quality_factor: 25, lowest_rp_ohm: 3_000,
    /// #     highest_rp_ohm: 3_000, ..Sensor::new(2_900_000, 3_800_000) };
    /// # let clock = ReferenceClock::External { hz: 40_000_000 };
    /// # let plan = Request::new(Model::Ldc1614, clock, Acquisition::Single(Channel::Zero), sensor)
    /// #     .rate(Rate::PerSecond(1_000)).plan()?;
    /// # let chip = RefCell::new(ldc161x_sim::Chip::new(ldc161x_sim::Settings::default(), [3.1e6; 4]));
    /// # let mut interrupt = ldc161x_sim::IntbPin::new(&chip);
    /// # let mut shutdown = ldc161x_sim::ShutdownPin::new(&chip);
    /// # let mut delay = ldc161x_sim::Delay::new(&chip);
    /// # let i2c = ldc161x_sim::Bus::new(&chip, 400_000);
    /// # let mut driver = Ldc161x::new(i2c, Model::Ldc1614, Address::AddrLow);
    /// # driver.start(&plan.configuration)?;
    /// driver.recover_by_shutdown(&mut shutdown, &mut delay)?;
    /// assert!(driver.read_frame()?.marks.gap);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub async fn recover_by_shutdown(
        &mut self,
        shutdown: &mut impl OutputPin,
        delay: &mut impl DelayNs,
    ) -> Result<(), Error<I2C::Error>> {
        let configuration = self.state.wanted.ok_or(Error::NotStarted)?;
        self.state.stopped();
        shutdown.set_high().map_err(|_| Error::Pin)?;
        delay.delay_us(SHUTDOWN_US).await;
        shutdown.set_low().map_err(|_| Error::Pin)?;
        delay.delay_us(RESET_US).await;
        self.start(&configuration).await
    }

    /// Finds out whether reading data releases INTB on this chip, and remembers it.
    ///
    /// Discards the frames that it reads. Takes up to two frame times and a few frames.
    ///
    /// # Errors
    ///
    /// [`Error::NoInterrupt`] when INTB does not fall, [`Error::InterruptStuck`] when nothing
    /// releases it, [`Error::NotRunning`], or a bus error.
    ///
    /// ```
    /// # use core::cell::RefCell;
    /// # use ldc161x::*;
    /// # let sensor = Sensor { highest_quality_factor: 25, lowest_rp_ohm: 3_000,
    /// #     highest_rp_ohm: 3_000, ..Sensor::new(2_900_000, 3_800_000) };
    /// # let clock = ReferenceClock::External { hz: 40_000_000 };
    /// # let plan = Request::new(Model::Ldc1614, clock, Acquisition::Single(Channel::Zero), sensor)
    /// #     .rate(Rate::PerSecond(1_000)).plan()?;
    /// # let chip = RefCell::new(ldc161x_sim::Chip::new(ldc161x_sim::Settings::default(), [3.1e6; 4]));
    /// # let mut interrupt = ldc161x_sim::IntbPin::new(&chip);
    /// # let mut shutdown = ldc161x_sim::ShutdownPin::new(&chip);
    /// # let mut delay = ldc161x_sim::Delay::new(&chip);
    /// # let i2c = ldc161x_sim::Bus::new(&chip, 400_000);
    /// # let mut driver = Ldc161x::new(i2c, Model::Ldc1614, Address::AddrLow);
    /// # driver.start(&plan.configuration)?;
    /// let found = driver.probe_interrupt_release(&mut interrupt, &mut delay)?;
    /// assert_eq!(found, InterruptRelease::ByStatusOnly); // this simulated chip
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub async fn probe_interrupt_release(
        &mut self,
        interrupt: &mut impl InputPin,
        delay: &mut impl DelayNs,
    ) -> Result<InterruptRelease, Error<I2C::Error>> {
        self.running()?;
        let release = self.find_interrupt_release(interrupt, delay).await?;
        self.state.release = release;
        self.state.frames_discarded();
        Ok(release)
    }

    /// Each try begins with INTB released by STATUS and waits for it to fall: the read that
    /// follows is then over before the next conversion is.
    async fn find_interrupt_release(
        &mut self,
        interrupt: &mut impl InputPin,
        delay: &mut impl DelayNs,
    ) -> Result<InterruptRelease, Error<I2C::Error>> {
        let mut released = false;
        for _ in 0..RELEASE_TRIES {
            self.wait_for_interrupt(interrupt, delay).await?;
            self.read_status().await?;
            if interrupt.is_low().map_err(|_| Error::Pin)? {
                continue;
            }
            released = true;
            self.wait_for_interrupt(interrupt, delay).await?;
            self.read_data(None, false).await?;
            if interrupt.is_high().map_err(|_| Error::Pin)? {
                return Ok(InterruptRelease::ByData);
            }
        }
        if released {
            Ok(InterruptRelease::ByStatusOnly)
        } else {
            Err(Error::InterruptStuck)
        }
    }

    /// Waits until INTB is low, looking every few microseconds, and no longer than two frames
    /// after leaving sleep take. For programs without interrupts of their own.
    ///
    /// # Errors
    ///
    /// [`Error::NoInterrupt`], [`Error::NotStarted`], [`Error::NotRunning`] or [`Error::Pin`].
    ///
    /// ```
    /// # use core::cell::RefCell;
    /// # use ldc161x::*;
    /// # let sensor = Sensor { highest_quality_factor: 25, lowest_rp_ohm: 3_000,
    /// #     highest_rp_ohm: 3_000, ..Sensor::new(2_900_000, 3_800_000) };
    /// # let clock = ReferenceClock::External { hz: 40_000_000 };
    /// # let plan = Request::new(Model::Ldc1614, clock, Acquisition::Single(Channel::Zero), sensor)
    /// #     .rate(Rate::PerSecond(1_000)).plan()?;
    /// # let chip = RefCell::new(ldc161x_sim::Chip::new(ldc161x_sim::Settings::default(), [3.1e6; 4]));
    /// # let mut interrupt = ldc161x_sim::IntbPin::new(&chip);
    /// # let mut shutdown = ldc161x_sim::ShutdownPin::new(&chip);
    /// # let mut delay = ldc161x_sim::Delay::new(&chip);
    /// # let i2c = ldc161x_sim::Bus::new(&chip, 400_000);
    /// # let mut driver = Ldc161x::new(i2c, Model::Ldc1614, Address::AddrLow);
    /// # driver.start(&plan.configuration)?;
    /// driver.wait_for_interrupt(&mut interrupt, &mut delay)?;
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub async fn wait_for_interrupt(
        &mut self,
        interrupt: &mut impl InputPin,
        delay: &mut impl DelayNs,
    ) -> Result<(), Error<I2C::Error>> {
        let limit_us = self.running()?.first_frame_us().saturating_mul(2);
        let mut waited_us = 0;
        while interrupt.is_high().map_err(|_| Error::Pin)? {
            if waited_us >= limit_us {
                return Err(Error::NoInterrupt { waited_us });
            }
            delay.delay_us(INTERRUPT_POLL_US).await;
            waited_us += INTERRUPT_POLL_US;
        }
        Ok(())
    }

    /// Reads the latest result of every active channel. Call it when INTB has fallen: without
    /// that, and without STATUS, a result that was read before cannot be told from a new one,
    /// and its flags are gone; [`read_frame_if_ready`](Self::read_frame_if_ready) is for boards
    /// without INTB.
    ///
    /// STATUS is read in the same transaction unless the chip is known to release INTB by
    /// itself. After a failed transfer the identity and CONFIG are read before the next frame,
    /// which is then marked as following a gap.
    ///
    /// # Errors
    ///
    /// [`Error::NotStarted`], [`Error::NotRunning`], a bus error, or what is found after one:
    /// [`Error::WrongIdentity`], [`Error::RegistersLost`].
    ///
    /// ```
    /// # use core::cell::RefCell;
    /// # use ldc161x::*;
    /// # let sensor = Sensor { highest_quality_factor: 25, lowest_rp_ohm: 3_000,
    /// #     highest_rp_ohm: 3_000, ..Sensor::new(2_900_000, 3_800_000) };
    /// # let clock = ReferenceClock::External { hz: 40_000_000 };
    /// # let plan = Request::new(Model::Ldc1614, clock, Acquisition::Single(Channel::Zero), sensor)
    /// #     .rate(Rate::PerSecond(1_000)).plan()?;
    /// # let chip = RefCell::new(ldc161x_sim::Chip::new(ldc161x_sim::Settings::default(), [3.1e6; 4]));
    /// # let mut interrupt = ldc161x_sim::IntbPin::new(&chip);
    /// # let mut shutdown = ldc161x_sim::ShutdownPin::new(&chip);
    /// # let mut delay = ldc161x_sim::Delay::new(&chip);
    /// # let i2c = ldc161x_sim::Bus::new(&chip, 400_000);
    /// # let mut driver = Ldc161x::new(i2c, Model::Ldc1614, Address::AddrLow);
    /// # driver.start(&plan.configuration)?;
    /// driver.wait_for_interrupt(&mut interrupt, &mut delay)?;
    /// let frame = driver.read_frame()?;
    /// assert!(frame.covers(Acquisition::Single(Channel::Zero)));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub async fn read_frame(&mut self) -> Result<Frame, Error<I2C::Error>> {
        let with_status = self.state.release == InterruptRelease::ByStatusOnly;
        self.read_data(None, with_status).await
    }

    /// Reads STATUS and, when it says that a frame has ended, the frame; `None` otherwise.
    ///
    /// # Errors
    ///
    /// As [`read_frame`](Self::read_frame).
    ///
    /// ```
    /// # use core::cell::RefCell;
    /// # use ldc161x::*;
    /// # let sensor = Sensor { highest_quality_factor: 25, lowest_rp_ohm: 3_000,
    /// #     highest_rp_ohm: 3_000, ..Sensor::new(2_900_000, 3_800_000) };
    /// # let clock = ReferenceClock::External { hz: 40_000_000 };
    /// # let plan = Request::new(Model::Ldc1614, clock, Acquisition::Single(Channel::Zero), sensor)
    /// #     .rate(Rate::PerSecond(1_000)).plan()?;
    /// # let chip = RefCell::new(ldc161x_sim::Chip::new(ldc161x_sim::Settings::default(), [3.1e6; 4]));
    /// # let mut interrupt = ldc161x_sim::IntbPin::new(&chip);
    /// # let mut shutdown = ldc161x_sim::ShutdownPin::new(&chip);
    /// # let mut delay = ldc161x_sim::Delay::new(&chip);
    /// # let i2c = ldc161x_sim::Bus::new(&chip, 400_000);
    /// # let mut driver = Ldc161x::new(i2c, Model::Ldc1614, Address::AddrLow);
    /// # driver.start(&plan.configuration)?;
    /// assert!(driver.read_frame_if_ready()?.is_none());
    /// driver.wait_for_interrupt(&mut interrupt, &mut delay)?;
    /// assert!(driver.read_frame_if_ready()?.is_some());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub async fn read_frame_if_ready(&mut self) -> Result<Option<Frame>, Error<I2C::Error>> {
        self.running()?;
        let status = self.read_status().await?;
        if !status.data_ready() {
            return Ok(None);
        }
        self.read_data(Some(status), false).await.map(Some)
    }

    async fn read_data(
        &mut self,
        asked: Option<Status>,
        with_status: bool,
    ) -> Result<Frame, Error<I2C::Error>> {
        let configuration = self.running()?;
        if self.state.suspect {
            self.resynchronise(&configuration).await?;
        }
        let registers = self
            .state
            .frame_registers(configuration.acquisition, with_status);
        let mut words = [0; FRAME_REGISTERS];
        let words = words.get_mut(..registers.len()).unwrap_or_default();
        self.read_registers(&registers, words).await?;
        Ok(self
            .state
            .assemble(&configuration, asked, words, with_status))
    }

    /// After a failed transfer: is it still the chip, and still awake? A transfer that was cut
    /// short may spoil the following one (datasheet 7.5.2), which here is not a frame.
    async fn resynchronise(
        &mut self,
        configuration: &Configuration,
    ) -> Result<(), Error<I2C::Error>> {
        self.identify().await?;
        self.compare(Register::Config, configuration.config(false).to_bits())
            .await?;
        self.state.suspect = false;
        Ok(())
    }

    /// Compares one register with what it should hold, the next one at each call, CONFIG last.
    /// Call it between frames; each costs 48 bit times. A chip that lost its registers goes on
    /// answering, with wrong frequencies: only this finds it.
    ///
    /// # Errors
    ///
    /// [`Error::RegistersLost`]: the chip counts as not running, and every frame since the last
    /// confirmed one is in doubt. Otherwise as [`read_frame`](Self::read_frame).
    ///
    /// ```
    /// # use core::cell::RefCell;
    /// # use ldc161x::*;
    /// # let sensor = Sensor { highest_quality_factor: 25, lowest_rp_ohm: 3_000,
    /// #     highest_rp_ohm: 3_000, ..Sensor::new(2_900_000, 3_800_000) };
    /// # let clock = ReferenceClock::External { hz: 40_000_000 };
    /// # let plan = Request::new(Model::Ldc1614, clock, Acquisition::Single(Channel::Zero), sensor)
    /// #     .rate(Rate::PerSecond(1_000)).plan()?;
    /// # let chip = RefCell::new(ldc161x_sim::Chip::new(ldc161x_sim::Settings::default(), [3.1e6; 4]));
    /// # let mut interrupt = ldc161x_sim::IntbPin::new(&chip);
    /// # let mut shutdown = ldc161x_sim::ShutdownPin::new(&chip);
    /// # let mut delay = ldc161x_sim::Delay::new(&chip);
    /// # let i2c = ldc161x_sim::Bus::new(&chip, 400_000);
    /// # let mut driver = Ldc161x::new(i2c, Model::Ldc1614, Address::AddrLow);
    /// # driver.start(&plan.configuration)?;
    /// let number = driver.read_frame()?.number;
    /// while driver.check_canary()?.confirmed.is_none() {}
    /// // The round began before the frame: the next one confirms it.
    /// assert_eq!(driver.verify()?.confirmed, Some(number));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub async fn check_canary(&mut self) -> Result<Canary, Error<I2C::Error>> {
        let configuration = self.running()?;
        let (register, expected) = self.state.canary(&configuration);
        self.compare(register, expected).await?;
        Ok(self.state.canary_lives(&configuration, register))
    }

    /// A whole round of canaries at once: confirms every frame read so far.
    ///
    /// # Errors
    ///
    /// As [`check_canary`](Self::check_canary).
    ///
    /// ```
    /// # use core::cell::RefCell;
    /// # use ldc161x::*;
    /// # let sensor = Sensor { highest_quality_factor: 25, lowest_rp_ohm: 3_000,
    /// #     highest_rp_ohm: 3_000, ..Sensor::new(2_900_000, 3_800_000) };
    /// # let clock = ReferenceClock::External { hz: 40_000_000 };
    /// # let plan = Request::new(Model::Ldc1614, clock, Acquisition::Single(Channel::Zero), sensor)
    /// #     .rate(Rate::PerSecond(1_000)).plan()?;
    /// # let chip = RefCell::new(ldc161x_sim::Chip::new(ldc161x_sim::Settings::default(), [3.1e6; 4]));
    /// # let mut interrupt = ldc161x_sim::IntbPin::new(&chip);
    /// # let mut shutdown = ldc161x_sim::ShutdownPin::new(&chip);
    /// # let mut delay = ldc161x_sim::Delay::new(&chip);
    /// # let i2c = ldc161x_sim::Bus::new(&chip, 400_000);
    /// # let mut driver = Ldc161x::new(i2c, Model::Ldc1614, Address::AddrLow);
    /// # driver.start(&plan.configuration)?;
    /// let number = driver.read_frame()?.number;
    /// assert_eq!(driver.verify()?.confirmed, Some(number));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub async fn verify(&mut self) -> Result<Canary, Error<I2C::Error>> {
        self.state.begin_round();
        loop {
            let canary = self.check_canary().await?;
            if canary.confirmed.is_some() {
                return Ok(canary);
            }
        }
    }

    /// Lets the chip seek the drive current of every active channel, and goes on with what it
    /// found (datasheet 8.1.5.2). Keep the sensor at the largest distance it will meet. The
    /// next frame is marked as following a gap and a step of the drive.
    ///
    /// # Errors
    ///
    /// [`Error::NotStarted`], those of [`start`](Self::start), or a bus error.
    ///
    /// ```
    /// # use core::cell::RefCell;
    /// # use ldc161x::*;
    /// # let sensor = Sensor { highest_quality_factor: 25, lowest_rp_ohm: 3_000,
    /// #     highest_rp_ohm: 3_000, ..Sensor::new(2_900_000, 3_800_000) };
    /// # let clock = ReferenceClock::External { hz: 40_000_000 };
    /// # let plan = Request::new(Model::Ldc1614, clock, Acquisition::Single(Channel::Zero), sensor)
    /// #     .rate(Rate::PerSecond(1_000)).plan()?;
    /// # let chip = RefCell::new(ldc161x_sim::Chip::new(ldc161x_sim::Settings::default(), [3.1e6; 4]));
    /// # let mut interrupt = ldc161x_sim::IntbPin::new(&chip);
    /// # let mut shutdown = ldc161x_sim::ShutdownPin::new(&chip);
    /// # let mut delay = ldc161x_sim::Delay::new(&chip);
    /// # let i2c = ldc161x_sim::Bus::new(&chip, 400_000);
    /// # let mut driver = Ldc161x::new(i2c, Model::Ldc1614, Address::AddrLow);
    /// # driver.start(&plan.configuration)?;
    /// let found = driver.calibrate_drive_current(&mut delay)?;
    /// assert!(found[0].is_some());
    /// assert!(driver.read_frame()?.marks.drive_step);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub async fn calibrate_drive_current(
        &mut self,
        delay: &mut impl DelayNs,
    ) -> Result<[Option<DriveCode>; 4], Error<I2C::Error>> {
        let mut configuration = self.state.wanted.ok_or(Error::NotStarted)?;
        self.state.stopped();
        self.write_asleep(&configuration).await?;
        let config = configuration.calibrating_config(false).to_bits();
        self.write_verified(Register::Config, config).await?;
        // Two frames: the chip corrects the amplitude between conversions.
        delay
            .delay_us(configuration.first_frame_us().saturating_mul(2))
            .await;
        let mut found = [None; 4];
        for (channel, slot) in Channel::ALL.into_iter().zip(&mut found) {
            if configuration
                .acquisition
                .channels()
                .any(|active| active == channel)
            {
                let drive = self.read_drive_current(channel).await?.calibrated;
                configuration.channel_mut(channel).drive = drive;
                *slot = Some(drive);
            }
        }
        self.start(&configuration).await?;
        self.state.drive_stepped();
        Ok(found)
    }

    /// Changes the drive current of one channel; the chip sleeps meanwhile. The next frame is
    /// marked as following a gap and a step of the drive, with which the code steps too.
    ///
    /// # Errors
    ///
    /// [`Error::NotStarted`], those of [`start`](Self::start), or a bus error.
    ///
    /// ```
    /// # use core::cell::RefCell;
    /// # use ldc161x::*;
    /// # let sensor = Sensor { highest_quality_factor: 25, lowest_rp_ohm: 3_000,
    /// #     highest_rp_ohm: 3_000, ..Sensor::new(2_900_000, 3_800_000) };
    /// # let clock = ReferenceClock::External { hz: 40_000_000 };
    /// # let plan = Request::new(Model::Ldc1614, clock, Acquisition::Single(Channel::Zero), sensor)
    /// #     .rate(Rate::PerSecond(1_000)).plan()?;
    /// # let chip = RefCell::new(ldc161x_sim::Chip::new(ldc161x_sim::Settings::default(), [3.1e6; 4]));
    /// # let mut interrupt = ldc161x_sim::IntbPin::new(&chip);
    /// # let mut shutdown = ldc161x_sim::ShutdownPin::new(&chip);
    /// # let mut delay = ldc161x_sim::Delay::new(&chip);
    /// # let i2c = ldc161x_sim::Bus::new(&chip, 400_000);
    /// # let mut driver = Ldc161x::new(i2c, Model::Ldc1614, Address::AddrLow);
    /// # driver.start(&plan.configuration)?;
    /// driver.set_drive_current(Channel::Zero, DriveCode::default())?;
    /// assert!(driver.read_frame()?.marks.drive_step);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub async fn set_drive_current(
        &mut self,
        channel: Channel,
        drive: DriveCode,
    ) -> Result<(), Error<I2C::Error>> {
        let mut configuration = self.state.wanted.ok_or(Error::NotStarted)?;
        configuration.channel_mut(channel).drive = drive;
        self.start(&configuration).await?;
        self.state.drive_stepped();
        Ok(())
    }

    /// Reads STATUS, which clears it and releases INTB.
    ///
    /// # Errors
    ///
    /// A bus error.
    ///
    /// ```
    /// # use core::cell::RefCell;
    /// # use ldc161x::*;
    /// # let sensor = Sensor { highest_quality_factor: 25, lowest_rp_ohm: 3_000,
    /// #     highest_rp_ohm: 3_000, ..Sensor::new(2_900_000, 3_800_000) };
    /// # let clock = ReferenceClock::External { hz: 40_000_000 };
    /// # let plan = Request::new(Model::Ldc1614, clock, Acquisition::Single(Channel::Zero), sensor)
    /// #     .rate(Rate::PerSecond(1_000)).plan()?;
    /// # let chip = RefCell::new(ldc161x_sim::Chip::new(ldc161x_sim::Settings::default(), [3.1e6; 4]));
    /// # let mut interrupt = ldc161x_sim::IntbPin::new(&chip);
    /// # let mut shutdown = ldc161x_sim::ShutdownPin::new(&chip);
    /// # let mut delay = ldc161x_sim::Delay::new(&chip);
    /// # let i2c = ldc161x_sim::Bus::new(&chip, 400_000);
    /// # let mut driver = Ldc161x::new(i2c, Model::Ldc1614, Address::AddrLow);
    /// # driver.start(&plan.configuration)?;
    /// driver.wait_for_interrupt(&mut interrupt, &mut delay)?;
    /// assert!(driver.read_status()?.data_ready());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub async fn read_status(&mut self) -> Result<Status, Error<I2C::Error>> {
        self.read_register(Register::Status)
            .await
            .map(Status::from_bits)
    }

    /// Reads the drive current of one channel, and what calibration found for it.
    ///
    /// # Errors
    ///
    /// A bus error.
    ///
    /// ```
    /// # use core::cell::RefCell;
    /// # use ldc161x::*;
    /// # let sensor = Sensor { highest_quality_factor: 25, lowest_rp_ohm: 3_000,
    /// #     highest_rp_ohm: 3_000, ..Sensor::new(2_900_000, 3_800_000) };
    /// # let clock = ReferenceClock::External { hz: 40_000_000 };
    /// # let plan = Request::new(Model::Ldc1614, clock, Acquisition::Single(Channel::Zero), sensor)
    /// #     .rate(Rate::PerSecond(1_000)).plan()?;
    /// # let chip = RefCell::new(ldc161x_sim::Chip::new(ldc161x_sim::Settings::default(), [3.1e6; 4]));
    /// # let mut interrupt = ldc161x_sim::IntbPin::new(&chip);
    /// # let mut shutdown = ldc161x_sim::ShutdownPin::new(&chip);
    /// # let mut delay = ldc161x_sim::Delay::new(&chip);
    /// # let i2c = ldc161x_sim::Bus::new(&chip, 400_000);
    /// # let mut driver = Ldc161x::new(i2c, Model::Ldc1614, Address::AddrLow);
    /// # driver.start(&plan.configuration)?;
    /// let planned = plan.configuration.channel(Channel::Zero).drive;
    /// assert_eq!(driver.read_drive_current(Channel::Zero)?.drive, planned);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub async fn read_drive_current(
        &mut self,
        channel: Channel,
    ) -> Result<DriveCurrent, Error<I2C::Error>> {
        self.read_register(Register::DriveCurrent(channel))
            .await
            .map(DriveCurrent::from_bits)
    }

    /// Reads any register, for diagnosis. Mind that reading DATAx_MSB and STATUS clears flags.
    ///
    /// # Errors
    ///
    /// A bus error.
    ///
    /// ```
    /// # use core::cell::RefCell;
    /// # use ldc161x::*;
    /// # let sensor = Sensor { highest_quality_factor: 25, lowest_rp_ohm: 3_000,
    /// #     highest_rp_ohm: 3_000, ..Sensor::new(2_900_000, 3_800_000) };
    /// # let clock = ReferenceClock::External { hz: 40_000_000 };
    /// # let plan = Request::new(Model::Ldc1614, clock, Acquisition::Single(Channel::Zero), sensor)
    /// #     .rate(Rate::PerSecond(1_000)).plan()?;
    /// # let chip = RefCell::new(ldc161x_sim::Chip::new(ldc161x_sim::Settings::default(), [3.1e6; 4]));
    /// # let mut interrupt = ldc161x_sim::IntbPin::new(&chip);
    /// # let mut shutdown = ldc161x_sim::ShutdownPin::new(&chip);
    /// # let mut delay = ldc161x_sim::Delay::new(&chip);
    /// # let i2c = ldc161x_sim::Bus::new(&chip, 400_000);
    /// # let mut driver = Ldc161x::new(i2c, Model::Ldc1614, Address::AddrLow);
    /// # driver.start(&plan.configuration)?;
    /// assert_eq!(driver.read_register(Register::DeviceId)?, 0x3055);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub async fn read_register(&mut self, register: Register) -> Result<u16, Error<I2C::Error>> {
        let address = self.address.bits();
        let pointer = [register.address()];
        let mut data = [0; 2];
        let result = match self.state.access {
            BusAccess::SeparateTransfers => match self.i2c.write(address, &pointer).await {
                Ok(()) => self.i2c.read(address, &mut data).await,
                Err(error) => Err(error),
            },
            _ => self.i2c.write_read(address, &pointer, &mut data).await,
        };
        match result {
            Ok(()) => Ok(u16::from_be_bytes(data)),
            Err(source) => Err(self.failed(register, Direction::Read, source)),
        }
    }

    /// Fetches `registers` in order, as `BusAccess` says.
    async fn read_registers(
        &mut self,
        registers: &[Register],
        words: &mut [u16],
    ) -> Result<(), Error<I2C::Error>> {
        if self.state.access == BusAccess::FramePerTransaction {
            return self.read_in_one_transaction(registers, words).await;
        }
        for (register, word) in registers.iter().zip(words) {
            *word = self.read_register(*register).await?;
        }
        Ok(())
    }

    async fn read_in_one_transaction(
        &mut self,
        registers: &[Register],
        words: &mut [u16],
    ) -> Result<(), Error<I2C::Error>> {
        let mut pointers: Vec<[u8; 1], FRAME_REGISTERS> = Vec::new();
        for register in registers {
            // A frame has no more registers than there is room for.
            let _ = pointers.push([register.address()]);
        }
        let mut data = [[0; 2]; FRAME_REGISTERS];
        let mut operations: Vec<Operation<'_>, { 2 * FRAME_REGISTERS }> = Vec::new();
        for (pointer, data) in pointers.iter().zip(&mut data) {
            // Twice as many operations as registers: no push can fail.
            let _ = operations.push(Operation::Write(pointer));
            let _ = operations.push(Operation::Read(data));
        }
        let result = self
            .i2c
            .transaction(self.address.bits(), &mut operations)
            .await;
        drop(operations);
        if let Err(source) = result {
            let register = registers.first().copied().unwrap_or(Register::Status);
            return Err(self.failed(register, Direction::Read, source));
        }
        for (word, bytes) in words.iter_mut().zip(data) {
            *word = u16::from_be_bytes(bytes);
        }
        Ok(())
    }

    async fn write_register(
        &mut self,
        register: Register,
        value: u16,
    ) -> Result<(), Error<I2C::Error>> {
        let [high, low] = value.to_be_bytes();
        let bytes = [register.address(), high, low];
        match self.i2c.write(self.address.bits(), &bytes).await {
            Ok(()) => Ok(()),
            Err(source) => Err(self.failed(register, Direction::Write, source)),
        }
    }

    /// Puts the chip to sleep, writes every register but CONFIG, and reads each back.
    async fn write_asleep(
        &mut self,
        configuration: &Configuration,
    ) -> Result<(), Error<I2C::Error>> {
        self.write_verified(Register::Config, configuration.config(true).to_bits())
            .await?;
        for index in 0..configuration.register_count() {
            if let Some((register, value)) = configuration.register(index) {
                self.write_register(register, value).await?;
            }
        }
        for index in 0..configuration.register_count() {
            if let Some((register, value)) = configuration.register(index) {
                self.read_back(register, value).await?;
            }
        }
        Ok(())
    }

    async fn write_verified(
        &mut self,
        register: Register,
        value: u16,
    ) -> Result<(), Error<I2C::Error>> {
        self.write_register(register, value).await?;
        self.read_back(register, value).await
    }

    async fn read_back(
        &mut self,
        register: Register,
        written: u16,
    ) -> Result<(), Error<I2C::Error>> {
        let read = self.read_register(register).await?;
        if (read ^ written) & register.readback_mask() == 0 {
            Ok(())
        } else {
            Err(Error::ReadBack {
                register,
                written,
                read,
            })
        }
    }

    /// Compares a register of the running chip; where it differs the chip counts as stopped.
    async fn compare(
        &mut self,
        register: Register,
        expected: u16,
    ) -> Result<(), Error<I2C::Error>> {
        let found = self.read_register(register).await?;
        if (found ^ expected) & register.readback_mask() == 0 {
            return Ok(());
        }
        self.state.stopped();
        Err(Error::RegistersLost {
            register,
            expected,
            found,
        })
    }

    fn running(&self) -> Result<Configuration, Error<I2C::Error>> {
        let configuration = self.state.wanted.ok_or(Error::NotStarted)?;
        if self.state.running {
            Ok(configuration)
        } else {
            Err(Error::NotRunning)
        }
    }

    fn failed(
        &mut self,
        register: Register,
        direction: Direction,
        source: I2C::Error,
    ) -> Error<I2C::Error> {
        self.state.transfer_failed();
        Error::Bus {
            register,
            direction,
            source,
        }
    }
}
