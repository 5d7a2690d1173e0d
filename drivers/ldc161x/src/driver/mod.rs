//! The driver itself, blocking and asynchronous from one source: life cycle, frames, registers.

mod frames;
mod lifecycle;
mod registers;

use embedded_hal::i2c::I2c;
#[cfg(feature = "async")]
use embedded_hal_async::i2c::I2c as AsyncI2c;

use crate::{Address, BusAccess, Configuration, InterruptRelease, Model, state::DriverState};

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
    state: DriverState,
}

#[maybe_async_cfg::maybe(
    sync(keep_self),
    async(
        feature = "async",
        self = "AsyncLdc161x",
        idents(I2c(async = "AsyncI2c"))
    )
)]
impl<I2C: I2c> Ldc161x<I2C> {
    /// Creates the driver on a bus; sends nothing.
    ///
    /// ```
    #[doc = include_str!("doctest_bus.txt")]
    /// let mut driver = Ldc161x::new(i2c, Model::Ldc1614, Address::AddrLow);
    /// driver.identify()?;
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub const fn new(i2c: I2C, model: Model, address: Address) -> Self {
        Self {
            i2c,
            model,
            address,
            state: DriverState::new(),
        }
    }

    /// Drops the driver and returns the bus. The chip keeps its state.
    ///
    /// ```
    #[doc = include_str!("doctest_bus.txt")]
    /// # let mut driver = Ldc161x::new(i2c, Model::Ldc1614, Address::AddrLow);
    /// let i2c = driver.release();
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn release(self) -> I2C {
        self.i2c
    }

    /// Sets how registers are read; see [`BusAccess`].
    ///
    /// ```
    #[doc = include_str!("doctest_bus.txt")]
    #[doc = include_str!("doctest_started.txt")]
    /// driver.set_access(BusAccess::RegisterPerTransaction);
    /// driver.read_frame()?;
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub const fn set_access(&mut self, access: BusAccess) {
        self.state.access = access;
    }

    /// Sets whether every word is read twice and compared, since I2C has no checksum. This doubles
    /// the bus time.
    ///
    /// ```
    #[doc = include_str!("doctest_bus.txt")]
    #[doc = include_str!("doctest_started.txt")]
    /// driver.set_read_twice(true);
    /// driver.wait_for_interrupt(&mut interrupt, &mut delay)?;
    /// assert_eq!(driver.read_frame()?.readings()[0].agrees, Some(true));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub const fn set_read_twice(&mut self, twice: bool) {
        self.state.read_twice = twice;
    }

    /// Sets which reads release INTB, for example as determined by an earlier probe.
    ///
    /// ```
    #[doc = include_str!("doctest_bus.txt")]
    #[doc = include_str!("doctest_started.txt")]
    /// driver.set_interrupt_release(InterruptRelease::ByData);
    /// assert!(driver.read_frame()?.status.is_none());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub const fn set_interrupt_release(&mut self, release: InterruptRelease) {
        self.state.release = release;
    }

    /// The configuration started last.
    ///
    /// ```
    #[doc = include_str!("doctest_bus.txt")]
    #[doc = include_str!("doctest_started.txt")]
    /// assert_eq!(driver.configuration(), Some(&plan.configuration));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub const fn configuration(&self) -> Option<&Configuration> {
        self.state.requested.as_ref()
    }
}
