//! The SparkFun OpenScale, a load-cell amplifier (HX711) with a USB serial port.
//!
//! It is built in because it is sold ready to use, its firmware and its lines are published, and it
//! works with any bridge load cell. A line has fields separated by commas, some of which the user
//! can switch off: time in ms, weight, its unit, temperatures. The weight is the field before the
//! unit (OpenScale Applications and Hookup Guide, learn.sparkfun.com; firmware/OpenScale of
//! github.com/sparkfun/OpenScale).

use std::io::{self, ErrorKind, Read};
use std::time::Duration;

use palpate_cli::failure::Failure;
use serialport::SerialPort;

use super::program::{GaugeLine, LONGEST_LINE, Source};

/// Factory setting of the baud rate.
const BAUD: u32 = 9_600;
/// Newtons per kilogram and per pound: standard gravity, and the pound of 1959.
const NEWTON_PER_KG: f64 = 9.806_65;
const NEWTON_PER_LB: f64 = 0.453_592_37 * NEWTON_PER_KG;
/// Timeout of the port: short, since the board's samples must be read meanwhile.
const WAIT: Duration = Duration::from_millis(1);

/// The amplifier at a serial port.
pub(super) struct OpenScale {
    name: String,
    port: Box<dyn SerialPort>,
    received: Vec<u8>,
}

impl OpenScale {
    /// Opens PORT, or PORT:BAUD.
    ///
    /// # Errors
    /// If there is no such port, or it is in use.
    pub(super) fn open(name: &str) -> Result<Self, Failure> {
        let (path, baud) = match name.rsplit_once(':') {
            Some((path, rate)) => match rate.parse() {
                Ok(rate) => (path, rate),
                Err(_) => (name, BAUD),
            },
            None => (name, BAUD),
        };
        let port = serialport::new(path, baud).timeout(WAIT).open();
        let port = port.map_err(|error| {
            Failure::Argument(format!(
                "--force openscale:{name}: {error}. Name its serial port, as openscale:/dev/ttyUSB0, and its \
                 rate behind another colon if it is not {BAUD}"
            ))
        })?;
        Ok(Self {
            name: name.to_owned(),
            port,
            received: Vec::new(),
        })
    }

    fn read(&mut self) -> io::Result<()> {
        let waiting = self.port.bytes_to_read()?;
        if waiting == 0 {
            return Ok(());
        }
        let mut bytes = vec![0; waiting as usize];
        match self.port.read(&mut bytes) {
            Ok(count) => self.received.extend(bytes.iter().take(count)),
            Err(error) if error.kind() == ErrorKind::TimedOut => {}
            Err(error) => return Err(error),
        }
        Ok(())
    }

    fn uncalibrated(&self, weight: &str) -> Failure {
        Failure::Refused(format!(
            "the OpenScale at {} sends the weight {weight}: calibrate it with a mass, in the menu that it shows \
             in a terminal after x",
            self.name
        ))
    }
}

impl Source for OpenScale {
    fn lines(&mut self) -> Result<Vec<GaugeLine>, Failure> {
        self.read().map_err(|error| {
            Failure::Refused(format!(
                "the OpenScale at {} was disconnected ({error}): check its cable and plug it in again",
                self.name
            ))
        })?;
        let mut lines = Vec::new();
        while let Some(end) = self.received.iter().position(|byte| *byte == b'\n') {
            let line: Vec<u8> = self.received.drain(..=end).collect();
            let value = match force_n(&String::from_utf8_lossy(&line)) {
                Some(Ok(value)) => value,
                Some(Err(weight)) => return Err(self.uncalibrated(&weight)),
                None => continue,
            };
            lines.push(GaugeLine::Reading {
                time_s: None,
                value,
            });
        }
        if self.received.len() as u64 > LONGEST_LINE {
            return Err(Failure::Refused(format!(
                "the OpenScale at {} sends no end of line: name its rate, as openscale:PORT:BAUD, if \
                 it is not {BAUD}",
                self.name
            )));
        }
        Ok(lines)
    }

    fn send(&mut self, _: &str) -> Result<(), Failure> {
        Ok(())
    }
}

/// Weights that are not numbers: an OpenScale without a calibration divides by zero, and its
/// library prints `ovf` for a number beyond 32 bits.
const NO_NUMBERS: [&str; 4] = ["inf", "-inf", "nan", "ovf"];

/// Returns the force of a line, N, or the text of a weight that is not a number. `None` for the
/// amplifier's greeting, its menu and truncated lines.
fn force_n(line: &str) -> Option<Result<f64, String>> {
    let fields: Vec<&str> = line.split(',').map(str::trim).collect();
    let mut pairs = fields.windows(2);
    pairs.find_map(|pair| {
        let &[weight, unit] = pair else { return None };
        let newton = match unit {
            "kg" => NEWTON_PER_KG,
            "lbs" => NEWTON_PER_LB,
            _ => return None,
        };
        if NO_NUMBERS.contains(&weight.to_ascii_lowercase().as_str()) {
            return Some(Err(weight.to_owned()));
        }
        let weight: f64 = weight.parse().ok()?;
        weight.is_finite().then_some(Ok(weight * newton))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_weight_stands_before_its_unit_whatever_fields_are_switched_on() {
        for line in [
            "2041,0.1835,kg,24.62,",
            "0.1835,kg\r\n",
            "2041,24.62,0,0.1835,kg",
        ] {
            let force_n = force_n(line).unwrap().unwrap();
            assert!((force_n - 1.799_5).abs() < 1e-4, "{line}: {force_n}");
        }
        assert!((force_n("-0.4046,lbs,").unwrap().unwrap() + 1.799_8).abs() < 1e-4);
        for line in [
            "Readings:",
            "Press x to bring up settings.",
            "",
            "2041,0.1-3,kg",
            "kg",
        ] {
            assert_eq!(force_n(line), None, "{line}");
        }
    }

    #[test]
    fn a_weight_that_is_no_number_is_shown() {
        assert_eq!(force_n("2041,nan,kg"), Some(Err("nan".to_owned())));
    }

    /// Creates a serial line. Returns the amplifier's end of it and the reader at the other end.
    #[cfg(unix)]
    fn connected() -> (serialport::TTYPort, OpenScale) {
        let (scale, port) = serialport::TTYPort::pair().unwrap();
        let path = port.name().unwrap();
        drop(port);
        (scale, OpenScale::open(&path).unwrap())
    }

    #[cfg(unix)]
    #[test]
    fn lines_come_from_its_port_in_whole() {
        use std::io::Write;

        let (mut scale, mut open) = connected();
        scale
            .write_all(b"OpenScale\r\n12,0.1,kg,\r\n13,0.2,k")
            .unwrap();
        let mut lines = Vec::new();
        for _ in 0..1_000 {
            lines.extend(open.lines().unwrap());
            if !lines.is_empty() {
                break;
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        let value = 0.1 * NEWTON_PER_KG;
        let reading = GaugeLine::Reading {
            time_s: None,
            value,
        };
        assert_eq!(lines, [reading]);
    }

    /// The bytes have no line end, as with a wrong baud rate.
    #[cfg(unix)]
    #[test]
    fn a_line_without_an_end_is_refused() {
        use std::io::Write;

        let (mut scale, mut open) = connected();
        scale.write_all(&[0x81; 1_500]).unwrap();
        // The system delivers the bytes with a delay, so the test reads repeatedly.
        let refused = (0..5_000).find_map(|_| {
            std::thread::sleep(Duration::from_millis(1));
            open.lines().err()
        });
        let said = refused.map(|failure| failure.to_string());
        assert!(said.unwrap_or_default().contains("no end of line"));
    }

    #[cfg(unix)]
    #[test]
    fn a_scale_that_was_never_calibrated_says_so() {
        use std::io::Write;

        for weight in ["inf", "-inf", "nan", "ovf"] {
            let (mut scale, mut open) = connected();
            write!(scale, "OpenScale\r\n12,{weight},kg,\r\n").unwrap();
            let failure = (0..1_000).find_map(|_| {
                std::thread::sleep(Duration::from_millis(1));
                open.lines().err()
            });
            let said = failure
                .map(|failure| failure.to_string())
                .unwrap_or_default();
            assert!(
                said.contains(weight) && said.contains("calibrate it"),
                "{said}"
            );
        }
    }
}
