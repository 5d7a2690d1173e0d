//! Start, sleep, recovery, and the drive current.

use embedded_hal::{delay::DelayNs, digital::OutputPin, i2c::I2c};
#[cfg(feature = "async")]
use embedded_hal_async::{delay::DelayNs as AsyncDelayNs, i2c::I2c as AsyncI2c};

#[cfg(feature = "async")]
use super::AsyncLdc161x;
use super::Ldc161x;
use crate::{
    Channel, Configuration, DEVICE_ID, DriveCode, Error, MANUFACTURER_ID, Register, register::RESET,
};

/// Time from the release of SD to the first transfer, us: the chip needs 2 ms at most (datasheet
/// 6.5). The same time is used after a reset by register, for which no source states one.
const RESET_US: u32 = 2_000;
/// Time for which SD is held high, us: no source gives a minimum, and one millisecond is a thousand
/// times what a digital input needs.
const SHUTDOWN_US: u32 = 1_000;

#[maybe_async_cfg::maybe(
    sync(keep_self),
    async(
        feature = "async",
        self = "AsyncLdc161x",
        idents(I2c(async = "AsyncI2c"), DelayNs(async = "AsyncDelayNs"))
    )
)]
impl<I2C: I2c> Ldc161x<I2C> {
    /// Reads and checks the chip's identity.
    ///
    /// # Errors
    ///
    /// [`Error::WrongIdentity`], whose advice names the likely cause, or a bus error.
    ///
    /// ```
    #[doc = include_str!("doctest_bus.txt")]
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

    /// Configures the chip and starts conversions: puts the chip to sleep, checks its identity,
    /// writes every register and reads it back, CONFIG last. Then reads every register again, since
    /// chips have been seen to lose them on leaving sleep. Releases INTB, so that its next falling
    /// edge is the end of a whole frame. The first frame is marked as following a gap.
    ///
    /// # Errors
    ///
    /// [`Error::NoSuchChannel`] before anything is sent. [`Error::WrongIdentity`],
    /// [`Error::ReadBack`], [`Error::RegistersLost`] or a bus error; the chip then counts as not
    /// running.
    ///
    /// ```
    #[doc = include_str!("doctest_bus.txt")]
    /// # let mut driver = Ldc161x::new(i2c, Model::Ldc1614, Address::AddrLow);
    /// driver.start(&plan.configuration)?;
    /// assert!(driver.read_frame()?.marks.gap);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub async fn start(&mut self, configuration: &Configuration) -> Result<(), Error<I2C::Error>> {
        if !configuration.fits(self.model) {
            return Err(Error::NoSuchChannel);
        }
        self.state.request(configuration);
        self.identify().await?;
        self.write_asleep(configuration).await?;
        let config = configuration.config(false).to_bits();
        self.write_verified(Register::Config, config).await?;
        self.state.started(configuration);
        self.verify().await?;
        self.release_interrupt().await
    }

    /// Stops converting. The chip keeps its registers and loses its results.
    ///
    /// # Errors
    ///
    /// [`Error::NotStarted`] before a configuration was started, or a bus error.
    ///
    /// ```
    #[doc = include_str!("doctest_bus.txt")]
    #[doc = include_str!("doctest_started.txt")]
    /// driver.sleep()?;
    /// assert_eq!(driver.read_frame(), Err(Error::NotRunning));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub async fn sleep(&mut self) -> Result<(), Error<I2C::Error>> {
        let configuration = self.state.requested.ok_or(Error::NotStarted)?;
        self.state.stopped();
        self.write_verified(Register::Config, configuration.config(true).to_bits())
            .await
    }

    /// Restarts conversions after [`sleep`](Self::sleep), then compares all registers.
    ///
    /// # Errors
    ///
    /// [`Error::NotStarted`], [`Error::RegistersLost`] or a bus error.
    ///
    /// ```
    #[doc = include_str!("doctest_bus.txt")]
    #[doc = include_str!("doctest_started.txt")]
    /// driver.sleep()?;
    /// driver.wake()?;
    /// driver.read_frame()?;
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub async fn wake(&mut self) -> Result<(), Error<I2C::Error>> {
        let configuration = self.state.requested.ok_or(Error::NotStarted)?;
        self.state.stopped();
        self.write_verified(Register::Config, configuration.config(false).to_bits())
            .await?;
        self.state.started(&configuration);
        self.verify().await?;
        self.release_interrupt().await
    }

    /// Resets the chip by its reset register and starts the requested configuration again.
    ///
    /// If the bus itself is stuck, its owner must clear it first (nine clocks, then a stop). After
    /// a failure call this again, up to a deadline of your own.
    ///
    /// # Errors
    ///
    /// Those of [`start`](Self::start), and [`Error::NotStarted`].
    ///
    /// ```
    #[doc = include_str!("doctest_bus.txt")]
    #[doc = include_str!("doctest_started.txt")]
    /// driver.recover(&mut delay)?;
    /// assert!(driver.read_frame()?.marks.gap);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub async fn recover(&mut self, delay: &mut impl DelayNs) -> Result<(), Error<I2C::Error>> {
        let configuration = self.state.requested.ok_or(Error::NotStarted)?;
        self.state.stopped();
        self.write_register(Register::ResetDev, RESET).await?;
        delay.delay_us(RESET_US).await;
        self.start(&configuration).await
    }

    /// Resets the chip by its SD pin and starts the requested configuration again. This also ends a
    /// transfer in which the chip is stuck.
    ///
    /// # Errors
    ///
    /// Those of [`start`](Self::start), [`Error::NotStarted`] and [`Error::Pin`].
    ///
    /// ```
    #[doc = include_str!("doctest_bus.txt")]
    #[doc = include_str!("doctest_started.txt")]
    /// driver.recover_by_shutdown(&mut shutdown, &mut delay)?;
    /// assert!(driver.read_frame()?.marks.gap);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub async fn recover_by_shutdown(
        &mut self,
        shutdown: &mut impl OutputPin,
        delay: &mut impl DelayNs,
    ) -> Result<(), Error<I2C::Error>> {
        let configuration = self.state.requested.ok_or(Error::NotStarted)?;
        self.state.stopped();
        shutdown.set_high().map_err(|_| Error::Pin)?;
        delay.delay_us(SHUTDOWN_US).await;
        shutdown.set_low().map_err(|_| Error::Pin)?;
        delay.delay_us(RESET_US).await;
        self.start(&configuration).await
    }

    /// Lets the chip find the drive current of every active channel, and continues with these
    /// currents (datasheet 8.1.5.2). Call it with the target at the largest distance that will
    /// occur. The next frame is marked as following a gap and a drive step.
    ///
    /// # Errors
    ///
    /// [`Error::NotStarted`], those of [`start`](Self::start), or a bus error.
    ///
    /// ```
    #[doc = include_str!("doctest_bus.txt")]
    #[doc = include_str!("doctest_started.txt")]
    /// let found = driver.calibrate_drive_current(&mut delay)?;
    /// assert!(found[0].is_some());
    /// assert!(driver.read_frame()?.marks.drive_step);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub async fn calibrate_drive_current(
        &mut self,
        delay: &mut impl DelayNs,
    ) -> Result<[Option<DriveCode>; 4], Error<I2C::Error>> {
        let mut configuration = self.state.requested.ok_or(Error::NotStarted)?;
        self.state.stopped();
        self.write_asleep(&configuration).await?;
        let config = configuration.calibrating_config(false).to_bits();
        self.write_verified(Register::Config, config).await?;
        // Waits for two frames, since the chip corrects the amplitude between conversions.
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

    /// Changes the drive current of one channel; the chip sleeps while registers are written. The
    /// next frame is marked as following a gap and a drive step, since the drive current shifts the
    /// code.
    ///
    /// # Errors
    ///
    /// [`Error::NotStarted`], those of [`start`](Self::start), or a bus error.
    ///
    /// ```
    #[doc = include_str!("doctest_bus.txt")]
    #[doc = include_str!("doctest_started.txt")]
    /// driver.set_drive_current(Channel::Zero, DriveCode::default())?;
    /// assert!(driver.read_frame()?.marks.drive_step);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub async fn set_drive_current(
        &mut self,
        channel: Channel,
        drive: DriveCode,
    ) -> Result<(), Error<I2C::Error>> {
        let mut configuration = self.state.requested.ok_or(Error::NotStarted)?;
        configuration.channel_mut(channel).drive = drive;
        self.start(&configuration).await?;
        self.state.drive_stepped();
        Ok(())
    }

    /// Releases INTB, which the chip may have pulled low since its last edge was handled. Once
    /// released, INTB falls at the end of the next frame, which can then be read before it is
    /// overwritten.
    pub(super) async fn release_interrupt(&mut self) -> Result<(), Error<I2C::Error>> {
        self.read_status().await.map(drop)
    }

    /// Puts the chip to sleep, writes every register except CONFIG, and reads each one back.
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
}
