//! Task of one converter: starts it, reads it on every edge of INTB, and recovers it.

mod error;
mod port;
mod state;

use embedded_hal::digital::InputPin;
use embedded_hal_async::delay::DelayNs;
use embedded_hal_async::i2c::I2c;
use heapless::Vec;
use ldc161x::{
    Address, AsyncLdc161x, BusAccess, Channel, DriveCode, InterruptRelease, Model, Quality, Reading,
};
use palpate_wire::code::Chip;

use crate::acquisition::{Grid, Parts, Sampled, Scheme, Setpoint, stronger, with_room};
use crate::board::Clkin;
pub use error::{ConverterError, TransferError};
use error::{OFF_PACE, edge_error};
pub use port::{EdgeDeadlines, EdgeFrame, EdgeReader, MOST_FRAME_BYTES, Port};
pub use state::{CONVERTERS, ConverterState};

/// Number of frames between two checks of a register whose value a reset of the converter would change.
const CANARY_EVERY: u32 = 64;
/// Time for which the converter wakes after its shutdown pin SD goes low: the maximum (datasheet 6.5)
/// plus a margin.
const WAKE_UP_US: u32 = 2_500;
/// Time in shutdown between two attempts to start a converter.
const PAUSE_US: u32 = 20_000;
/// Time in shutdown between two setpoints: as long as the driver holds SD high to reset the converter.
const RESET_US: u32 = 1_000;
/// Poll period for the first setpoint.
const NO_SETPOINT_US: u32 = 1_000;
/// Poll period of the task of a second converter that did not answer: it never gets a setpoint and only
/// checks in.
const ABSENT_US: u32 = 5_000;
/// Poll period while the other converter runs from a different clock.
const CLOCK_POLL_US: u32 = 1_000;
/// Number of polls after which a different clock of the other converter is a fault. That converter
/// handles a new setpoint after a frame of 31 ms, or after its start: five frames and 20 ms.
const CLOCK_POLLS: u32 = 1_000;
/// A converter counts as silent after this number of frame periods without an edge, plus [`SILENT_US`].
const SILENT_FRAMES: f32 = 4.0;
/// Time added to [`SILENT_FRAMES`] frame periods.
const SILENT_US: f32 = 2_000.0;
/// Number of planned frame periods after which the oscillation has settled; includes a margin, since a
/// frame may be longer than planned.
const SETTLED_FRAMES: f32 = 2.5;
/// Number of consecutive frames without a known edge, read because INTB was low, after which INTB is
/// checked. One or two such frames may follow a late frame.
const MOST_WITHOUT_EDGE: u32 = 4;
/// Number of frame periods within which a conversion certainly ends.
const INTERRUPT_FRAMES: f32 = 1.5;
/// Number of attempts to see whether INTB follows the conversions.
const INTERRUPT_TRIES: u32 = 3;
/// Number of consecutive bus errors that are tolerated before the converter is restarted.
const PATIENCE: u32 = 2;
/// Number of consecutive frames without a sample, each read too late to belong to one scan, after which
/// the bus counts as too slow for the scan rate. At the limit of the bus every second frame is too late.
const WITHOUT_SAMPLE: u32 = 16;

/// Setpoint of the test that finds out what releases INTB. With faster conversions, the next conversion
/// would end before INTB is read.
const PROBE: Setpoint = Setpoint {
    channels: 0b0001,
    rate_hz: 500.0,
    shares_bus: false,
};

type Result<T> = core::result::Result<T, ConverterError>;

/// Returns whether the sensor of a reading does not oscillate. The converter's watchdog ends the
/// conversions of such a sensor at irregular times.
fn is_silent(reading: &Reading) -> bool {
    matches!(reading.quality(), Quality::Watchdog | Quality::UnderRange)
}

/// Task of one converter.
#[derive(Debug)]
pub struct ConverterTask<I2C, E, P> {
    driver: AsyncLdc161x<I2C>,
    edges: E,
    port: P,
    /// Number of the converter, 0 or 1.
    converter: usize,
    /// Access that releases INTB on this converter, once known.
    release: Option<InterruptRelease>,
    /// Drive found for each channel, with the generation of the setpoint for which it was found.
    drives: Option<(u32, [Option<DriveCode>; 4])>,
    /// Number of frames since the last one for which the instrument had space.
    not_taken: u32,
}

/// Delays of the driver, through the port.
struct Delay<'a, P>(&'a mut P);

impl<P: Port> DelayNs for Delay<'_, P> {
    async fn delay_ns(&mut self, time_ns: u32) {
        self.0.wait_us(time_ns.div_ceil(1_000)).await;
    }
}

impl<I2C, E, P> ConverterTask<I2C, E, P>
where
    I2C: I2c<Error = TransferError>,
    E: EdgeReader,
    P: Port,
{
    /// Creates the task of converter 0 or 1. The number selects its address as well: ADDR is low at the
    /// first, high at the second.
    pub fn new(converter: usize, i2c: I2C, edges: E, port: P) -> Self {
        let address = if converter == 0 {
            Address::AddrLow
        } else {
            Address::AddrHigh
        };
        Self {
            driver: AsyncLdc161x::new(i2c, Model::Ldc1614, address),
            edges,
            port,
            converter,
            release: None,
            drives: None,
            not_taken: 0,
        }
    }

    /// Task loop: starts, reads and recovers the converter.
    pub async fn run(&mut self) -> ! {
        let identified = self.identify().await;
        let chip = error::chip(&identified);
        self.shut_down(RESET_US).await;
        self.with_state(|state| state.chip = Some(chip));
        let idle_us = if chip == Chip::Absent {
            ABSENT_US
        } else {
            NO_SETPOINT_US
        };
        loop {
            let setpoint = self.with_state(|state| state.setpoint());
            let Some((setpoint, generation)) = setpoint else {
                self.port.wait_us(idle_us).await;
                continue;
            };
            let with_status = self.release != Some(InterruptRelease::ByData);
            let result = match Scheme::new(setpoint, with_status) {
                Ok(scheme) => self.acquire(scheme, generation).await,
                // The instrument accepts no setpoint that the converter cannot follow.
                Err(_) => Ok(()),
            };
            self.edges.stop();
            let off_us = match result {
                Ok(()) => RESET_US,
                Err(error) => {
                    self.failed(&error);
                    PAUSE_US
                }
            };
            self.shut_down(off_us).await;
        }
    }

    /// Holds the converter in shutdown for a time, in which it does not disturb any other part.
    async fn shut_down(&mut self, off_us: u32) {
        self.port.shut_down(true);
        self.with_state(|state| state.clkin = None);
        self.port.wait_us(off_us).await;
    }

    fn with_state<T>(&mut self, work: impl FnOnce(&mut ConverterState) -> T) -> T {
        let is_first = self.converter == 0;
        self.port
            .with_states(|[first, second]| work(if is_first { first } else { second }))
    }

    fn failed(&mut self, error: &ConverterError) {
        #[cfg(feature = "defmt")]
        defmt::warn!("converter: {}", error);
        let failure = error::failure(error, self.converter);
        self.with_state(|state| {
            state.failure = Some(failure);
            state.recoveries = state.recoveries.wrapping_add(1);
        });
    }

    fn generation(&mut self) -> Option<u32> {
        let setpoint = self.with_state(|state| state.setpoint());
        setpoint.map(|(_, generation)| generation)
    }

    fn count_error(&mut self) {
        self.with_state(|state| state.transfer_errors = state.transfer_errors.wrapping_add(1));
    }

    // ---- reading ----

    /// Reads with one scheme until the setpoint changes or an error occurs.
    async fn acquire(&mut self, mut scheme: Scheme, generation: u32) -> Result<()> {
        if !self.take_clock(scheme.setpoint.clkin()).await? {
            return Ok(());
        }
        self.driver.set_access(if scheme.setpoint.shares_bus {
            // The other converter gets its turn after each transaction.
            BusAccess::RegisterPerTransaction
        } else {
            BusAccess::FramePerTransaction
        });
        self.bring_up(&mut scheme, generation).await?;
        let scheme = &scheme;
        let request = self.driver.frame_request()?;
        let with_status = self.release == Some(InterruptRelease::ByStatusOnly);
        let mut grid = Grid::new(scheme, with_status, generation);
        let parts = Parts::new(scheme, with_status);
        let deadlines = EdgeDeadlines {
            silence_us: (scheme.period_us * SILENT_FRAMES + SILENT_US) as u32,
            parts: parts.count() as u8,
            latest_begin_us: parts.latest_begin_us(),
        };
        self.edges.start(&request, deadlines);
        let mut errors = 0;
        let mut without_sample = 0;
        let mut without_edge = 0;
        let mut until_canary = CANARY_EVERY;
        while self.generation() == Some(generation) {
            match self.edges.next().await {
                Ok(frame) => {
                    if frame.fetch.is_some() {
                        errors = 0;
                        without_edge = 0;
                        without_sample += 1;
                    } else {
                        // A frame without a known edge was not started by INTB, so it does not prove
                        // that INTB works.
                        without_edge += 1;
                    }
                    if self.take(scheme, &mut grid, &frame).await? {
                        without_sample = 0;
                        self.with_state(|state| state.failure = None);
                    } else if without_sample >= WITHOUT_SAMPLE {
                        return Err(edge_error(TransferError::Timeout));
                    }
                    if without_edge == MOST_WITHOUT_EDGE {
                        // INTB was low before each of these frames, and no edge came.
                        without_edge = 0;
                        self.edges.stop();
                        self.check_interrupt(scheme).await?;
                        self.edges.start(&request, deadlines);
                    }
                }
                Err(error) if errors < PATIENCE => {
                    errors += 1;
                    #[cfg(feature = "defmt")]
                    defmt::warn!("frame: {}", error);
                    self.count_error();
                    grid.interrupt();
                    self.driver.frame_lost();
                    self.edges.stop();
                    if error == TransferError::Silent {
                        self.check_interrupt(scheme).await?;
                    }
                    // This read identifies the converter and releases INTB. The frame that it returns
                    // may be old and is not used.
                    self.driver.read_frame().await?;
                    self.edges.start(&request, deadlines);
                }
                Err(error) => {
                    self.count_error();
                    self.driver.frame_lost();
                    return Err(edge_error(error));
                }
            }
            until_canary -= 1;
            if until_canary == 0 {
                until_canary = CANARY_EVERY;
                // If there is no time for this check, a changed conversion time still shows in the grid,
                // and a reset of the converter shows in its silence.
                if grid.has_room() {
                    self.driver.check_canary().await?;
                }
            }
            if grid.needs_verify() {
                self.driver.verify().await?;
            } else if grid.is_off() {
                return Err(OFF_PACE);
            }
        }
        Ok(())
    }

    /// Called if no edges come: checks whether conversions end while INTB stays at one level. INTB must
    /// be high after its release, and low after a frame period. The check is repeated, because a conversion
    /// may end between release and reading of INTB.
    async fn check_interrupt(&mut self, scheme: &Scheme) -> Result<()> {
        let mut intb = self.port.intb();
        let mut stuck = None;
        for _ in 0..INTERRUPT_TRIES {
            self.driver.read_status().await?;
            let is_released = intb.is_high().unwrap_or(true);
            self.port
                .wait_us((INTERRUPT_FRAMES * scheme.period_us) as u32)
                .await;
            let is_raised = intb.is_low().unwrap_or(true);
            if !self.driver.read_status().await?.data_ready() {
                return Ok(());
            }
            stuck = match (is_released, is_raised) {
                (true, true) => return Ok(()),
                (high, _) => Some(high),
            };
        }
        match stuck {
            Some(high) => Err(edge_error(TransferError::InterruptStuck { high })),
            None => Ok(()),
        }
    }

    /// Passes a frame on if it belongs to one scan of a known time; returns whether it did.
    async fn take(&mut self, scheme: &Scheme, grid: &mut Grid, read: &EdgeFrame) -> Result<bool> {
        let frame = self.driver.decode_frame(&read.bytes)?;
        // With several channels the converter's watchdog does not act, and each conversion takes its
        // full time.
        if scheme.channels == 1 && frame.readings().iter().any(is_silent) {
            grid.interrupt();
        }
        let Some(fetch) = &read.fetch else {
            grid.skip();
            return Ok(false);
        };
        let Some(sampled) = grid.sampled(scheme, frame, fetch) else {
            // This read releases INTB if it is still low, so its next falling edge finds a free bus.
            self.driver.read_status().await?;
            return Ok(false);
        };
        self.hand_over(sampled);
        Ok(true)
    }

    fn hand_over(&mut self, sampled: Sampled) {
        let missed = sampled.missed.saturating_add(self.not_taken);
        let sampled = Sampled {
            missed,
            gap: sampled.gap || missed > 0,
            ..sampled
        };
        self.not_taken = if self.port.hand_over(sampled) {
            0
        } else {
            missed.saturating_add(1)
        };
    }

    // ---- start-up ----

    /// Wakes the converter and identifies it, then tests its INTB.
    async fn identify(&mut self) -> Result<()> {
        self.take_clock(PROBE.clkin()).await?;
        self.wake().await;
        self.driver.identify().await?;
        // An error here occurs again at the start of the converter and is reported then.
        let _ = self.probe_release().await;
        Ok(())
    }

    /// Sets the clock when the other converter does not need a different one: a conversion during which
    /// the clock changes is wrong by a sixth, and no flag shows this. Returns `false` if the setpoint
    /// has changed meanwhile.
    async fn take_clock(&mut self, clkin: Clkin) -> Result<bool> {
        let generation = self.generation();
        for _ in 0..CLOCK_POLLS {
            let is_first = self.converter == 0;
            let is_free = self.port.with_states(|[first, second]| {
                let (own, other) = if is_first {
                    (first, second)
                } else {
                    (second, first)
                };
                let is_free = other.clkin.is_none_or(|runs_by| runs_by == clkin);
                if is_free {
                    own.clkin = Some(clkin);
                }
                is_free
            });
            if is_free {
                self.port.set_clkin(clkin);
                return Ok(true);
            }
            self.port.wait_us(CLOCK_POLL_US).await;
            if self.generation() != generation {
                return Ok(false);
            }
        }
        Err(OFF_PACE)
    }

    async fn wake(&mut self) {
        self.port.shut_down(false);
        self.port.wait_us(WAKE_UP_US).await;
    }

    async fn bring_up(&mut self, scheme: &mut Scheme, generation: u32) -> Result<()> {
        self.wake().await;
        let release = match self.release {
            Some(release) => release,
            None => self.probe_release().await?,
        };
        self.driver.set_interrupt_release(release);
        match self.drives.filter(|(of, _)| *of == generation) {
            Some((_, drives)) => scheme.drive(&drives),
            None => self.find_drives(scheme, generation).await?,
        }
        self.driver.start(&scheme.configuration).await?;
        #[cfg(feature = "defmt")]
        defmt::info!(
            "converter up; INTB released by data: {}",
            release == InterruptRelease::ByData
        );
        Ok(())
    }

    /// Finds out what releases INTB.
    async fn probe_release(&mut self) -> Result<InterruptRelease> {
        let Ok(probe) = Scheme::new(PROBE, true) else {
            return Ok(InterruptRelease::ByStatusOnly);
        };
        self.driver.start(&probe.configuration).await?;
        let mut intb = self.port.intb();
        let mut delay = Delay(&mut self.port);
        let release = self
            .driver
            .probe_interrupt_release(&mut intb, &mut delay)
            .await?;
        self.driver.sleep().await?;
        self.release = Some(release);
        self.with_state(|state| state.release = Some(release));
        Ok(release)
    }

    /// Lets the converter find the drive of every channel, which depends on the attached sensor.
    async fn find_drives(&mut self, scheme: &mut Scheme, generation: u32) -> Result<()> {
        self.driver.start(&scheme.configuration).await?;
        let mut delay = Delay(&mut self.port);
        let found = self.driver.calibrate_drive_current(&mut delay).await?;
        let mut drives = found.map(|found| found.map(with_room));
        scheme.drive(&drives);
        for channel in self.faint(scheme).await? {
            if let Some(Some(drive)) = drives.get_mut(usize::from(channel.number())) {
                *drive = stronger(*drive);
            }
        }
        scheme.drive(&drives);
        self.drives = Some((generation, drives));
        Ok(())
    }

    /// Returns the channels whose oscillation is too weak with this scheme's drives.
    async fn faint(&mut self, scheme: &Scheme) -> Result<Vec<Channel, 4>> {
        self.driver.start(&scheme.configuration).await?;
        // In the first frame the oscillation may still build up.
        self.port
            .wait_us((SETTLED_FRAMES * scheme.period_us) as u32)
            .await;
        let frame = self.driver.read_frame().await?;
        let mut faint = Vec::new();
        for reading in frame.readings() {
            if reading.word.flags().amplitude {
                // There is space for every channel.
                let _ = faint.push(reading.channel);
            }
        }
        Ok(faint)
    }
}
