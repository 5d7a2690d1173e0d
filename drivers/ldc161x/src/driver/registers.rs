//! Reading single registers, and comparing them with their expected values.

use embedded_hal::i2c::{I2c, Operation};
#[cfg(feature = "async")]
use embedded_hal_async::i2c::I2c as AsyncI2c;
use heapless::Vec;

#[cfg(feature = "async")]
use super::AsyncLdc161x;
use super::Ldc161x;
use crate::{
    BusAccess, Canary, Channel, Configuration, Direction, DriveCurrent, Error, Register, Status,
    state::FRAME_REGISTERS,
};

#[maybe_async_cfg::maybe(
    sync(keep_self),
    async(
        feature = "async",
        self = "AsyncLdc161x",
        idents(I2c(async = "AsyncI2c"))
    )
)]
impl<I2C: I2c> Ldc161x<I2C> {
    /// Compares one register with its expected value; successive calls take the registers in turn,
    /// CONFIG last. Call it between frames; each call takes 48 bit times. A chip that has lost its
    /// registers still answers, with wrong frequencies: only this comparison detects that.
    ///
    /// # Errors
    ///
    /// [`Error::RegistersLost`]: the chip counts as not running, and every frame after the last
    /// confirmed one is in doubt. Otherwise as for [`read_frame`](Self::read_frame).
    ///
    /// ```
    #[doc = include_str!("doctest_bus.txt")]
    #[doc = include_str!("doctest_started.txt")]
    /// let number = driver.read_frame()?.number;
    /// while driver.check_canary()?.confirmed.is_none() {}
    /// // This round began before the frame, so only the next round confirms the frame.
    /// assert_eq!(driver.verify()?.confirmed, Some(number));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub async fn check_canary(&mut self) -> Result<Canary, Error<I2C::Error>> {
        let configuration = self.running()?;
        let (register, expected) = self.state.canary(&configuration);
        self.compare(register, expected).await?;
        Ok(self.state.canary_lives(&configuration, register))
    }

    /// Compares all registers at once, which confirms every frame read so far.
    ///
    /// # Errors
    ///
    /// As for [`check_canary`](Self::check_canary).
    ///
    /// ```
    #[doc = include_str!("doctest_bus.txt")]
    #[doc = include_str!("doctest_started.txt")]
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

    /// Reads STATUS, which clears it and releases INTB.
    ///
    /// # Errors
    ///
    /// A bus error.
    ///
    /// ```
    #[doc = include_str!("doctest_bus.txt")]
    #[doc = include_str!("doctest_started.txt")]
    /// driver.wait_for_interrupt(&mut interrupt, &mut delay)?;
    /// assert!(driver.read_status()?.data_ready());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub async fn read_status(&mut self) -> Result<Status, Error<I2C::Error>> {
        self.read_register(Register::Status)
            .await
            .map(Status::from_bits)
    }

    /// Reads the drive current of one channel, and the drive current that the chip's calibration
    /// found.
    ///
    /// # Errors
    ///
    /// A bus error.
    ///
    /// ```
    #[doc = include_str!("doctest_bus.txt")]
    #[doc = include_str!("doctest_started.txt")]
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

    /// Reads any register, for diagnosis. Note that reading DATAx_MSB or STATUS clears flags.
    ///
    /// # Errors
    ///
    /// A bus error.
    ///
    /// ```
    #[doc = include_str!("doctest_bus.txt")]
    #[doc = include_str!("doctest_started.txt")]
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

    /// Reads `registers` in order, with the selected [`BusAccess`].
    pub(super) async fn read_registers(
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
            // `pointers` has room for the longest frame, so no push can fail.
            let _ = pointers.push([register.address()]);
        }
        let mut data = [[0; 2]; FRAME_REGISTERS];
        let mut operations: Vec<Operation<'_>, { 2 * FRAME_REGISTERS }> = Vec::new();
        for (pointer, data) in pointers.iter().zip(&mut data) {
            // `operations` has room for two operations for each register, so no push can fail.
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

    pub(super) async fn write_register(
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

    pub(super) async fn write_verified(
        &mut self,
        register: Register,
        value: u16,
    ) -> Result<(), Error<I2C::Error>> {
        self.write_register(register, value).await?;
        self.read_back(register, value).await
    }

    pub(super) async fn read_back(
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

    /// Compares a register of the running chip; on a difference the chip counts as stopped.
    pub(super) async fn compare(
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

    pub(super) fn running(&self) -> Result<Configuration, Error<I2C::Error>> {
        let configuration = self.state.requested.ok_or(Error::NotStarted)?;
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
