//! The sensing task: brings the converter up, reads it on every edge, and recovers it.

use heapless::spsc::Producer;
use ldc161x::{AsyncLdc161x, Direction, DriveCode, Error, InterruptRelease, Register};
use palpate_node::acquisition::{Fetch, Grid, Sampled, Scheme, Wanted, with_room};
use rtic_monotonics::rp2040::prelude::*;

use crate::board::pico::{self, IntbPin, ShutdownPin};
use crate::bus::{self, BusError, Master, engine::Stamp};
use crate::supervision::{Task, check_in};
use crate::tasks::instrument;
use crate::{Mono, SAMPLES, app, report};

/// Frames between two looks at a register that the converter might have lost.
const CANARY_EVERY: u32 = 64;
/// The reset that SD gives takes this long at most (datasheet 6.5), and a little.
const WAKE_UP_US: u64 = 2_500;
/// Between two attempts to bring a converter up, and between two schemes: SD is held high for as
/// long as the driver does to reset the converter.
const PAUSE_US: u64 = 20_000;
const RESET_US: u64 = 1_000;
/// Frames without an edge before the converter counts as silent, and what to add.
const SILENT_FRAMES: f32 = 4.0;
const SILENT_US: f32 = 2_000.0;
/// Single errors of the bus that are passed over before the converter is started anew.
const PATIENCE: u32 = 2;

/// How the converter runs while it is asked what releases INTB.
const PROBE: Wanted = Wanted {
    channels: 0b0001,
    rate_hz: 500.0,
};

type Result<T> = core::result::Result<T, Error<BusError>>;

/// The converter holds its registers and still makes its scans at another pace: its clock is off.
const OFF_PACE: Error<BusError> = Error::Bus {
    register: Register::Config,
    direction: Direction::Read,
    source: BusError::Pace,
};

/// What the task owns.
pub struct Sensing {
    /// The driver.
    pub driver: AsyncLdc161x<Master>,
    /// The way of samples to the instrument.
    pub samples: Producer<'static, Sampled>,
    /// What releases INTB on this converter, once it was asked.
    pub release: Option<InterruptRelease>,
    /// The drive that was found for each channel of the scheme under way.
    pub drives: Option<(u32, [Option<DriveCode>; 4])>,
    /// Frames since the last one that the instrument could take.
    pub not_taken: u32,
}

/// A delay that lets the supervisor know.
struct Delay;

impl embedded_hal_async::delay::DelayNs for Delay {
    async fn delay_ns(&mut self, nanoseconds: u32) {
        let mut left_us = u64::from(nanoseconds).div_ceil(1_000);
        while left_us > 0 {
            check_in(Task::Sensing);
            let slice_us = left_us.min(5_000);
            Mono::delay(slice_us.micros()).await;
            left_us -= slice_us;
        }
    }
}

/// Brings up, reads, recovers, for ever.
pub async fn sensing(cx: app::sensing::Context<'_>) {
    let sensing = cx.local.sensing;
    report::set_identity(sensing.who_is_there().await);
    loop {
        let Some((wanted, number)) = instrument::wanted() else {
            wait_us(1_000).await;
            continue;
        };
        let result = match Scheme::new(wanted) {
            Ok(scheme) => sensing.acquire(scheme, number).await,
            // Not accepted by the instrument.
            Err(_) => Ok(()),
        };
        bus::read_at_once();
        let off_us = if result.is_ok() { RESET_US } else { PAUSE_US };
        if let Err(error) = result {
            defmt::warn!("converter: {}", error);
            report::set_fault(Some(&error));
            report::RECOVERIES.add(1);
        }
        sensing.switch_off(off_us).await;
    }
}

impl Sensing {
    /// Reads with one scheme until another is wanted, or something fails.
    async fn acquire(&mut self, mut scheme: Scheme, number: u32) -> Result<()> {
        self.bring_up(&mut scheme, number).await?;
        let scheme = &scheme;
        let silence_us = scheme.period_us * SILENT_FRAMES + SILENT_US;
        let with_status = self.release == Some(InterruptRelease::ByStatusOnly);
        let mut grid = Grid::new(scheme, with_status);
        bus::read_on_edges(silence_us as u32, grid.latest_begin_us());
        let mut errors = 0;
        let mut until_canary = CANARY_EVERY;
        while instrument::wanted_number() == number {
            match self.driver.read_frame().await {
                Ok(frame) => {
                    errors = 0;
                    report::set_fault(None);
                    let stamp = bus::last_stamp();
                    if !stamp.is_known {
                        // Such a frame only releases INTB.
                        grid.skip();
                    } else if let Some(sampled) = grid.sampled(scheme, frame, &fetch(stamp)) {
                        self.hand_on(sampled);
                    } else {
                        // INTB may be low still; released, its next fall finds a free bus.
                        self.driver.read_status().await?;
                    }
                }
                Err(error @ Error::Bus { .. }) if errors < PATIENCE => {
                    errors += 1;
                    defmt::warn!("frame: {}", error);
                    report::BUS_ERRORS.add(1);
                    grid.interrupt();
                    self.read_past(silence_us as u32, grid.latest_begin_us())
                        .await?;
                }
                Err(error) => {
                    report::BUS_ERRORS.add(1);
                    return Err(error);
                }
            }
            until_canary -= 1;
            if until_canary == 0 {
                until_canary = CANARY_EVERY;
                // Where there is no room a register that changes the length of a conversion still
                // shows in the grid, and a reset of the converter in its silence.
                if grid.has_room() {
                    self.driver.check_canary().await?;
                }
            }
            if grid.is_suspect() {
                self.driver.verify().await?;
            } else if grid.is_off() {
                return Err(OFF_PACE);
            }
            #[cfg(planted_defect = "panic")]
            crate::planted::panic_if_asked(Task::Sensing);
        }
        Ok(())
    }

    /// After an error: one frame at once, which asks the converter who it is and releases INTB.
    /// It may be old, and is not handed on.
    async fn read_past(&mut self, silence_us: u32, latest_us: u32) -> Result<()> {
        bus::read_at_once();
        let result = self.driver.read_frame().await;
        bus::read_on_edges(silence_us, latest_us);
        result.map(drop)
    }

    /// Lets the converter wake, and asks it who it is; then what can be found out beforehand.
    async fn who_is_there(&mut self) -> Result<()> {
        pico::set_clkin(pico::CLKIN_SINGLE);
        pico::set(pico::SHUTDOWN, false);
        wait_us(WAKE_UP_US).await;
        self.driver.identify().await?;
        // What fails here fails again, and is reported, when the converter is brought up.
        let _ = self.ask_what_releases().await;
        Ok(())
    }

    async fn bring_up(&mut self, scheme: &mut Scheme, number: u32) -> Result<()> {
        let divisor = if scheme.is_single {
            pico::CLKIN_SINGLE
        } else {
            pico::CLKIN_SCAN
        };
        pico::set_clkin(divisor);
        pico::set(pico::SHUTDOWN, false);
        wait_us(WAKE_UP_US).await;
        let release = match self.release {
            Some(release) => release,
            None => self.ask_what_releases().await?,
        };
        self.driver.set_interrupt_release(release);
        match self.drives.filter(|(of, _)| *of == number) {
            Some((_, drives)) => scheme.drive(&drives),
            None => self.seek_drives(scheme, number).await?,
        }
        self.driver.start(&scheme.configuration).await?;
        let by_data = release == InterruptRelease::ByData;
        defmt::info!("converter up; INTB released by data: {}", by_data);
        Ok(())
    }

    /// Asks with slow conversions: with fast ones the next would have ended before it was looked.
    async fn ask_what_releases(&mut self) -> Result<InterruptRelease> {
        let Ok(slow) = Scheme::new(PROBE) else {
            return Ok(InterruptRelease::ByStatusOnly);
        };
        self.driver.start(&slow.configuration).await?;
        let (mut interrupt, mut delay) = (IntbPin, Delay);
        let asked = self
            .driver
            .probe_interrupt_release(&mut interrupt, &mut delay);
        let release = asked.await?;
        self.driver.sleep().await?;
        self.release = Some(release);
        Ok(release)
    }

    /// Lets the converter find the drive of every channel: it depends on the sensor that is there.
    async fn seek_drives(&mut self, scheme: &mut Scheme, number: u32) -> Result<()> {
        self.driver.start(&scheme.configuration).await?;
        let found = self.driver.calibrate_drive_current(&mut Delay).await?;
        let drives = found.map(|found| found.map(with_room));
        scheme.drive(&drives);
        self.drives = Some((number, drives));
        Ok(())
    }

    /// Off, with the bus free.
    async fn switch_off(&mut self, time_us: u64) {
        use embedded_hal::digital::OutputPin;
        let _ = ShutdownPin.set_high();
        wait_us(time_us).await;
    }

    fn hand_on(&mut self, sampled: Sampled) {
        defmt::debug!("sample of {} us", sampled.time_us);
        let missed = sampled.missed.saturating_add(self.not_taken);
        let sampled = Sampled {
            missed,
            gap: sampled.gap || missed > 0,
            ..sampled
        };
        self.not_taken = match self.samples.enqueue(sampled) {
            Ok(()) => 0,
            Err(_) => missed.saturating_add(1),
        };
        SAMPLES.call();
    }
}

/// When a frame was read.
fn fetch(stamp: Stamp) -> Fetch {
    #[cfg(planted_defect = "late_stamp")]
    let stamp = stamp.taken_at(Mono::now().as_ticks() as u32);
    Fetch {
        edge_us: extended(stamp.time_us),
        ended_us: stamp.ended_us.wrapping_sub(stamp.time_us),
        edges: stamp.edges,
    }
}

/// A recent time of which only the lower half is known.
fn extended(low_us: u32) -> u64 {
    let now_us = Mono::now().as_ticks();
    now_us - u64::from((now_us as u32).wrapping_sub(low_us))
}

async fn wait_us(time_us: u64) {
    use embedded_hal_async::delay::DelayNs;
    Delay
        .delay_us(u32::try_from(time_us).unwrap_or(u32::MAX))
        .await;
}
