//! The emulated board with its USB cable.

use palpate_cli::failure::Failure;
use palpate_emulator::usb::TransferId;
use palpate_emulator::{Image, Instrument, Options};
use palpate_sim::Time;
use palpate_sim::world::World;

use super::flash_file::FlashFile;
use super::touch::Touch;

/// Longest time from power-on until the board is enumerated on USB.
const STARTED: Time = Time::from_ms(500);
/// Longest time from the answer to the command for the boot loader until the boot loader runs.
const BOOT_LOADER: Time = Time::from_ms(500);

/// RTT channel of the debug probe that carries the image's log (docs/firmware.md, links).
const LOG: u32 = 0;

/// The emulated board. A program opens and closes its serial port as on a PC.
pub(crate) struct PluggedBoard {
    image: Image,
    seed: u64,
    instrument: Instrument,
    /// Time from the first power-on to the last one.
    before: Time,
    touch: Option<Touch>,
    is_open: bool,
    /// Request to open or close the port, until the board has handled it.
    changing: Option<TransferId>,
    /// Bytes from the program that wait until the port is open. If they were sent earlier, their
    /// answers would be lost.
    unsent: Vec<u8>,
    flash: FlashFile,
}

impl PluggedBoard {
    /// Powers on a board in a world.
    pub(super) fn new(
        image: Image,
        world: World,
        seed: u64,
        flash: FlashFile,
    ) -> Result<Self, Failure> {
        let instrument = powered(&image, world, seed);
        let mut board = Self {
            image,
            seed,
            instrument,
            before: Time::ZERO,
            touch: None,
            is_open: true,
            changing: None,
            unsent: Vec::new(),
            flash,
        };
        board.fill_flash()?;
        board.plug();
        Ok(board)
    }

    /// Starts repeated presses of an object in the board's world, or stops them with `None`.
    pub(super) const fn set_touch(&mut self, touch: Option<Touch>) {
        self.touch = touch;
    }

    /// Powers the board off and on in another world, without repeated presses. The storage is kept.
    pub(crate) fn power_on_in(&mut self, world: World) -> Result<(), Failure> {
        self.before = self.now();
        self.touch = None;
        self.instrument = powered(&self.image, world, self.seed);
        self.fill_flash()?;
        self.unsent.clear();
        self.changing = None;
        self.is_open = true;
        self.plug();
        Ok(())
    }

    fn fill_flash(&mut self) -> Result<(), Failure> {
        self.flash.fill(self.instrument.board_mut().flash_mut())
    }

    fn plug(&mut self) {
        let usb = self.instrument.board_mut().usb_mut();
        usb.plug();
        usb.enumerate();
    }

    /// Lets time pass until the board is a serial port of the PC, at most half a second after
    /// power-on.
    pub(crate) fn start(&mut self) -> Result<(), Failure> {
        let end = self.now() + STARTED;
        while self
            .instrument
            .board_mut()
            .usb_mut()
            .description()
            .is_none()
        {
            if self.now() >= end {
                return Err(Failure::Refused(
                    "the emulated board does not appear on USB: is it an image of the firmware?"
                        .to_owned(),
                ));
            }
            self.advance(Time::from_ms(1))?;
        }
        Ok(())
    }

    /// Writes a UF2 file as to the boot loader's drive. The board must have received the command
    /// for the boot loader. The board starts the new image after the last block.
    ///
    /// # Errors
    /// If the board does not start the boot loader, or the emulation does not support the file.
    pub(crate) fn write_uf2(&mut self, uf2: &[u8]) -> Result<(), Failure> {
        let end = self.now() + BOOT_LOADER;
        while !self.instrument.board().is_in_boot_loader() {
            if self.now() >= end {
                return Err(Failure::Refused(
                    "the emulated board does not start its boot loader: is it an image of the firmware?"
                        .to_owned(),
                ));
            }
            self.advance(Time::from_ms(1))?;
        }
        let board = self.instrument.board_mut();
        let written = board.write_uf2(uf2);
        written.map_err(|error| Failure::Refused(format!("the emulated board: {error}")))?;
        self.flash.follow(board.flash())
    }

    /// Time since the first power-on.
    pub(crate) fn now(&self) -> Time {
        self.before + self.instrument.board().now()
    }

    /// The world of the board, at its present time.
    pub(crate) fn world_mut(&mut self) -> &mut World {
        let board = self.instrument.board_mut();
        let now = board.now();
        let world = board.plant_mut().world_mut();
        world.advance_to(now);
        world
    }

    /// The instrument, to disturb or inspect it.
    pub(crate) const fn instrument_mut(&mut self) -> &mut Instrument {
        &mut self.instrument
    }

    /// Opens or closes the port, as a program does.
    pub(crate) fn set_open(&mut self, is_open: bool) {
        if is_open == self.is_open || self.changing.is_some() {
            return;
        }
        // `None` before the end of the enumeration, when there is no port.
        self.changing = self.instrument.board_mut().usb_mut().set_dtr(is_open);
        if self.changing.is_none() {
            return;
        }
        self.is_open = is_open;
        // Closing drops the unsent bytes. Opening keeps them: they wait for the open port.
        if !is_open {
            self.unsent.clear();
        }
    }

    /// Sends bytes to the board.
    pub(crate) fn write(&mut self, bytes: &[u8]) {
        self.unsent.extend(bytes);
        let host = self.instrument.board_mut().usb_mut();
        let ended = host.take_results();
        let is_over = |changing: &TransferId| ended.iter().any(|(id, _)| id == changing);
        self.changing = self.changing.take().filter(|changing| !is_over(changing));
        let is_ready = host.description().is_some() && self.changing.is_none();
        if is_ready && self.is_open {
            host.write(&self.unsent);
            self.unsent.clear();
        }
    }

    /// Sets whether the PC reads the board's bytes.
    pub(crate) fn set_reading(&mut self, reading: bool) {
        self.instrument.board_mut().usb_mut().set_reading(reading);
    }

    /// Reads bytes from the board.
    pub(crate) fn read(&mut self) -> Vec<u8> {
        self.instrument.board_mut().usb_mut().read()
    }

    /// Reads the image's log as a debug probe does: defmt frames.
    pub(crate) fn read_log(&mut self) -> Vec<u8> {
        self.instrument.board_mut().read_channel(LOG)
    }

    /// Lets time pass.
    pub(crate) fn advance(&mut self, time: Time) -> Result<(), Failure> {
        if let Some(mut touch) = self.touch {
            touch.follow(self.world_mut());
            self.touch = Some(touch);
        }
        let ran = self.instrument.run_for(time);
        let board = self.instrument.board();
        ran.map_err(|stop| Failure::Refused(format!("the image at {}: {stop}", board.now())))?;
        self.flash.follow(board.flash())
    }
}

fn powered(image: &Image, world: World, seed: u64) -> Instrument {
    let options = Options {
        seed,
        ..Options::default()
    };
    Instrument::new(image, world, options)
}
