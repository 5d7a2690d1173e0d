//! The emulated board with its cable in a PC, and what presses its sensor.

use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use palpate_emulator::usb::TransferId;
use palpate_emulator::{Image, Instrument, Options};
use palpate_sim::Time;
use palpate_sim::mechanics::load::Load;
use palpate_sim::mechanics::press::Profile;
use palpate_sim::parameters::draw;
use palpate_sim::stack::{Disturbances, Stack};
use palpate_sim::switches::Switches;
use palpate_sim::world::{Holder, Setup, World};

use crate::failure::Failure;
use crate::instrument::SPEED_M_PER_S;

/// Where the object waits above the sensor, m.
const CLEARANCE_M: f64 = 0.5e-3;
/// How long nothing touches: the baseline is learnt in less.
const LIFTED: Time = Time::from_ms(3_000);
/// How long it is pressed: settling, train and result.
const PRESSED: Time = Time::from_ms(5_000);

/// Something that is pressed again and again.
#[derive(Clone, Copy)]
pub(super) struct Touch {
    load: Load,
    is_down: bool,
    due: Time,
}

impl Touch {
    pub(super) fn of(stack: &Stack, ratio: f64) -> Result<Self, Failure> {
        if !(ratio.is_finite() && ratio > 0.0) {
            return Err(Failure::Argument(format!(
                "--press {ratio}: the multiple of the sensing layer's stiffness is a positive number"
            )));
        }
        let n_per_m = ratio * stack.sensing_spring_n_per_m.centre();
        Ok(Self {
            load: Load::Spring { n_per_m },
            is_down: false,
            due: LIFTED,
        })
    }

    /// Lowers or lifts it, if it is time.
    fn follow(&mut self, world: &mut World, depth_m: f64) {
        if world.now() < self.due {
            return;
        }
        self.is_down = !self.is_down;
        let (position_m, lasts) = if self.is_down {
            (world.press_for_depth_m(depth_m), PRESSED)
        } else {
            (-CLEARANCE_M, LIFTED)
        };
        world.move_press(position_m, SPEED_M_PER_S);
        self.due = world.now() + lasts;
    }
}

/// The board.
pub(super) struct Served {
    instrument: Instrument,
    touch: Option<Touch>,
    /// How deep the sensing layer is pressed, m.
    depth_m: f64,
    is_open: bool,
    /// The request that opens or closes the port, until the board has taken it.
    changing: Option<TransferId>,
    /// What the program has sent meanwhile: an answer from a closed port would be lost.
    unsent: Vec<u8>,
    flash: Option<FlashFile>,
}

impl Served {
    pub(super) fn new(
        image: &Image,
        stack: &Stack,
        disturbances: &Disturbances,
        seed: u64,
        touch: Option<Touch>,
        flash: Option<&Path>,
    ) -> Result<Self, Failure> {
        let plant = draw(stack, disturbances, seed);
        let setup = Setup {
            load: touch.map_or(Load::Rigid, |touch| touch.load),
            holder: Holder::Stand,
            profile: Profile::at(-CLEARANCE_M),
            ..Setup::default()
        };
        let world = World::new(&plant, Switches::all(), setup)?;
        let options = Options {
            seed,
            ..Options::default()
        };
        let mut instrument = Instrument::new(image, world, options);
        let board = instrument.board_mut();
        let flash = flash
            .map(|path| FlashFile::open(path, board.flash_mut()))
            .transpose()?;
        board.usb_mut().plug();
        board.usb_mut().enumerate();
        Ok(Self {
            instrument,
            touch,
            depth_m: plant.press.depth_m,
            is_open: true,
            changing: None,
            unsent: Vec::new(),
            flash,
        })
    }

    pub(super) fn now(&self) -> Time {
        self.instrument.board().now()
    }

    /// A program opens the port, or closes it.
    pub(super) fn set_open(&mut self, is_open: bool) {
        if is_open == self.is_open || self.changing.is_some() {
            return;
        }
        // Before the end of the enumeration there is no port.
        self.changing = self.instrument.board_mut().usb_mut().set_dtr(is_open);
        if self.changing.is_none() {
            return;
        }
        self.is_open = is_open;
        // What a program sent before its port was open stays: it is sent once the port is.
        if !is_open {
            self.unsent.clear();
        }
    }

    /// Bytes for the board.
    pub(super) fn write(&mut self, bytes: &[u8]) {
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

    /// Whether the PC takes more of the board's bytes.
    pub(super) fn set_reading(&mut self, reading: bool) {
        self.instrument.board_mut().usb_mut().set_reading(reading);
    }

    /// Bytes of the board.
    pub(super) fn read(&mut self) -> Vec<u8> {
        self.instrument.board_mut().usb_mut().read()
    }

    /// Lets time pass.
    pub(super) fn advance(&mut self, time: Time) -> Result<(), Failure> {
        let depth_m = self.depth_m;
        let board = self.instrument.board_mut();
        if let Some(touch) = &mut self.touch {
            let now = board.now();
            let world = board.plant_mut().world_mut();
            world.advance_to(now);
            touch.follow(world, depth_m);
        }
        let ran = board.run_for(time);
        ran.map_err(|stop| Failure::Refused(format!("the image at {}: {stop}", board.now())))?;
        if let Some(flash) = &mut self.flash {
            flash.follow(board.flash())?;
        }
        Ok(())
    }
}

/// The flash's contents in a file.
struct FlashFile {
    path: PathBuf,
    /// Operations up to what was written.
    written: usize,
}

impl FlashFile {
    /// Brings the settings and calibration of the file, if there is one, into the flash.
    fn open(path: &Path, flash: &mut palpate_emulator::Flash) -> Result<Self, Failure> {
        match fs::read(path) {
            Ok(area) => {
                let mut contents = flash.export();
                let start = contents.len().saturating_sub(AREA);
                if area.len() != AREA {
                    return Err(Failure::Argument(format!(
                        "--flash {}: {} bytes, where the board keeps {AREA}; name a file that this command \
                         has written, or one that is not there yet",
                        path.display(),
                        area.len()
                    )));
                }
                if let Some(place) = contents.get_mut(start..) {
                    place.copy_from_slice(&area);
                }
                flash.import(&contents);
            }
            Err(error) if error.kind() == ErrorKind::NotFound => {}
            Err(reason) => {
                return Err(Failure::Unreadable {
                    file: path.to_path_buf(),
                    reason,
                });
            }
        }
        Ok(Self {
            path: path.to_path_buf(),
            written: flash.operations().len(),
        })
    }

    /// Writes the file, if something was stored since: anew beside it, then in its place.
    fn follow(&mut self, flash: &palpate_emulator::Flash) -> Result<(), Failure> {
        let operations = flash.operations().len();
        if operations == self.written || flash.is_busy() {
            return Ok(());
        }
        let unwritable = |reason| Failure::Unwritable {
            file: self.path.clone(),
            argument: "--flash",
            reason,
        };
        let contents = flash.export();
        let area = contents.get(contents.len().saturating_sub(AREA)..);
        let beside = self.path.with_extension("partial");
        fs::write(&beside, area.unwrap_or_default()).map_err(unwritable)?;
        fs::rename(&beside, &self.path).map_err(unwritable)?;
        self.written = operations;
        Ok(())
    }
}

/// Bytes at the end of the flash that keep settings and calibration.
const AREA: usize = 64 * 1024;
