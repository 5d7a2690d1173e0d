//! Reading frames, and waiting for the interrupt that announces each frame.

use embedded_hal::{delay::DelayNs, digital::InputPin, i2c::I2c};
#[cfg(feature = "async")]
use embedded_hal_async::{delay::DelayNs as AsyncDelayNs, i2c::I2c as AsyncI2c};

#[cfg(feature = "async")]
use super::AsyncLdc161x;
use super::Ldc161x;
use crate::{
    Configuration, Error, Frame, FrameRequest, InterruptRelease, Register, Status,
    state::FRAME_REGISTERS,
};

/// Interval at which INTB is polled, in microseconds.
const INTERRUPT_POLL_US: u32 = 5;
/// Number of attempts to release INTB: a conversion that ends during the read of STATUS pulls INTB
/// low again, but hardly three times in a row.
const RELEASE_TRIES: u8 = 3;

#[maybe_async_cfg::maybe(
    sync(keep_self),
    async(
        feature = "async",
        self = "AsyncLdc161x",
        idents(I2c(async = "AsyncI2c"), DelayNs(async = "AsyncDelayNs"))
    )
)]
impl<I2C: I2c> Ldc161x<I2C> {
    /// Determines whether reading data releases INTB on this chip, and stores the result.
    ///
    /// Discards the frames that it reads. Takes up to two frame times and a few frames.
    ///
    /// # Errors
    ///
    /// [`Error::NoInterrupt`] if INTB does not fall, [`Error::InterruptStuck`] if neither data nor
    /// STATUS releases it, [`Error::NotRunning`], or a bus error.
    ///
    /// ```
    #[doc = include_str!("doctest_bus.txt")]
    #[doc = include_str!("doctest_started.txt")]
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
        // The last attempt may have left INTB low. Each frame would then be read while the next one
        // is converted.
        self.release_interrupt().await?;
        Ok(release)
    }

    /// Checks whether reading data releases INTB. Each attempt starts with a read of STATUS and
    /// waits until INTB falls, so that the data are read before the next conversion ends.
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

    /// Waits until INTB is low, polling every few microseconds, for at most the time of two frames,
    /// start-up after sleep included. For programs without a microcontroller interrupt for INTB.
    ///
    /// # Errors
    ///
    /// [`Error::NoInterrupt`], [`Error::NotStarted`], [`Error::NotRunning`] or [`Error::Pin`].
    ///
    /// ```
    #[doc = include_str!("doctest_bus.txt")]
    #[doc = include_str!("doctest_started.txt")]
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

    /// Reads the latest result of every active channel. Call it when INTB has fallen: otherwise, if
    /// the driver does not read STATUS, it cannot distinguish a new result from one that was read
    /// before and whose flags are cleared. Boards without INTB use
    /// [`read_frame_if_ready`](Self::read_frame_if_ready).
    ///
    /// STATUS is read in the same transaction, unless reading data is known to release INTB. After
    /// a failed transfer the driver reads identity and CONFIG before the next frame, and marks that
    /// frame as following a gap.
    ///
    /// # Errors
    ///
    /// [`Error::NotStarted`], [`Error::NotRunning`], a bus error, or, if the check after a failed
    /// transfer fails, [`Error::WrongIdentity`] or [`Error::RegistersLost`].
    ///
    /// ```
    #[doc = include_str!("doctest_bus.txt")]
    #[doc = include_str!("doctest_started.txt")]
    /// driver.wait_for_interrupt(&mut interrupt, &mut delay)?;
    /// let frame = driver.read_frame()?;
    /// assert!(frame.covers(Acquisition::Single(Channel::Zero)));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub async fn read_frame(&mut self) -> Result<Frame, Error<I2C::Error>> {
        self.read_data(None, self.state.reads_status()).await
    }

    /// Reads STATUS. If STATUS reports a finished frame, reads and returns it; otherwise returns
    /// `None`.
    ///
    /// # Errors
    ///
    /// As [`read_frame`](Self::read_frame).
    ///
    /// ```
    #[doc = include_str!("doctest_bus.txt")]
    #[doc = include_str!("doctest_started.txt")]
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

    /// Returns the register pointers of a frame, for a bus master that reads frames by itself at
    /// each edge of INTB, without the program. Pass the bytes that it reads to
    /// [`decode_frame`](Self::decode_frame). The pointers stay the same until the driver starts
    /// another configuration or [`set_interrupt_release`](Self::set_interrupt_release) changes
    /// them.
    ///
    /// # Errors
    ///
    /// [`Error::NotStarted`] or [`Error::NotRunning`].
    ///
    /// ```
    #[doc = include_str!("doctest_bus.txt")]
    #[doc = include_str!("doctest_started.txt")]
    /// use embedded_hal::i2c::I2c;
    /// driver.wait_for_interrupt(&mut interrupt, &mut delay)?;
    /// let request = driver.frame_request()?;
    /// let mut bytes = [0; 6]; // STATUS, MSB and LSB of one channel
    /// for (pointer, data) in request.pointers().zip(bytes.chunks_mut(2)) {
    ///     ldc161x_sim::Bus::new(&chip, 400_000).write_read(0x2A, &[pointer], data)?;
    /// }
    /// let frame = driver.decode_frame(&bytes)?;
    /// assert!(frame.covers(Acquisition::Single(Channel::Zero)));
    /// // a sensor of 3.1 MHz
    /// assert!(frame.readings().iter().all(|of| (of.frequency_hz - 3.1e6).abs() < 1e3));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn frame_request(&self) -> Result<FrameRequest, Error<I2C::Error>> {
        let configuration = self.running()?;
        Ok(self.state.frame_request(&configuration))
    }

    /// Decodes a frame from bytes that were read in the order of
    /// [`frame_request`](Self::frame_request): two per register, the high byte first. Does not use
    /// the bus.
    ///
    /// # Errors
    ///
    /// [`Error::NotStarted`], [`Error::NotRunning`], or [`Error::FrameLength`] if the number of
    /// bytes does not match the request.
    ///
    /// ```
    #[doc = include_str!("doctest_bus.txt")]
    #[doc = include_str!("doctest_started.txt")]
    /// let error = driver.decode_frame(&[0; 3]).unwrap_err();
    /// assert_eq!(error, Error::FrameLength { expected: 6, found: 3 });
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn decode_frame(&mut self, bytes: &[u8]) -> Result<Frame, Error<I2C::Error>> {
        let configuration = self.running()?;
        let expected = 2 * self.state.frame_request(&configuration).register_count();
        if bytes.len() != expected {
            return Err(Error::FrameLength {
                expected,
                found: bytes.len(),
            });
        }
        let mut words = [0; FRAME_REGISTERS];
        for (word, pair) in words.iter_mut().zip(bytes.chunks_exact(2)) {
            if let [high, low] = *pair {
                *word = u16::from_be_bytes([high, low]);
            }
        }
        let words = words.get(..expected / 2).unwrap_or_default();
        let with_status = self.state.reads_status();
        let frame = self
            .state
            .assemble(&configuration, None, words, with_status);
        Ok(frame)
    }

    /// Reports that the bus master lost a frame, or that its transfer of a frame failed. The next
    /// frame is marked as following a gap, and the next [`read_frame`](Self::read_frame) first
    /// checks the chip's identity.
    ///
    /// ```
    #[doc = include_str!("doctest_bus.txt")]
    #[doc = include_str!("doctest_started.txt")]
    /// driver.read_frame()?;
    /// driver.frame_lost();
    /// assert!(driver.read_frame()?.marks.gap);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn frame_lost(&mut self) {
        self.state.transfer_failed();
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

    /// Checks, after a failed transfer, that the chip answers with its identity and is awake. A
    /// transfer that was cut short may corrupt the following one (datasheet 7.5.2): because of this
    /// check, the following transfer is not a frame.
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
}
