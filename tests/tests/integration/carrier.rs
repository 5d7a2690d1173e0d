//! The carrier board, the page that describes the wiring, and the firmware agree.
//!
//! Read as text: `hardware/palpate-one/netlist.txt`, the table under "Wiring" of `docs/firmware.md`, and
//! `pins.rs` of the firmware, which is built for the board alone.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::PathBuf;

use palpate_node::board::{DRIVE_LIMITS, HARDWARE};

/// First cell of a row of docs/firmware.md, and for each of the row's pins the constant of pins.rs (with the
/// index in an array) and the pin of a part that it reaches on the board.
const SIGNALS: &[(&str, &str, &[&str])] = &[
    ("LDC SDA, SCL", "SDA SCL", &["U2.SDA", "U2.SCL"]),
    ("LDC INTB", "INTB_LINES.0", &["U2.INTB"]),
    ("LDC SD", "SHUTDOWN.0", &["U2.SD"]),
    ("LDC CLKIN", "CLKIN", &["U2.CLKIN"]),
    (
        "second LDC: ADDR, INTB, SD",
        "INTB_LINES.1 SHUTDOWN.1",
        &["U3.INTB", "U3.SD"],
    ),
    ("H-bridge IN1, IN2", "IN1 IN2", &["U4.IN1", "U4.IN2"]),
    ("H-bridge enable (nSLEEP)", "BRIDGE_ENABLE", &["U4.nSLEEP"]),
    ("H-bridge fault (nFAULT)", "BRIDGE_FAULT", &["U4.nFAULT"]),
    ("H-bridge limit", "BRIDGE_LIMIT", &["R13.2"]),
    ("coil current", "ANALOGUE.0", &["U5.OUT"]),
    ("coil temperature", "ANALOGUE.1", &["J3.9"]),
    ("coil supply", "ANALOGUE.2", &["R9.1"]),
];
/// Pins of the Pico that lead to nothing on the carrier: its LED, and the third of VSYS.
const ON_THE_PICO: [usize; 2] = [25, 29];

fn text(path: &str) -> String {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR"))
        .join("..")
        .join(path);
    fs::read_to_string(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// Nets by pin ("U1.GP4"), and values by part.
struct Board {
    nets: BTreeMap<String, String>,
    values: BTreeMap<String, String>,
}

impl Board {
    fn read() -> Self {
        let source = text("hardware/palpate-one/netlist.txt");
        let mut board = Self {
            nets: BTreeMap::new(),
            values: BTreeMap::new(),
        };
        for line in source.lines() {
            let words: Vec<&str> = line.split_whitespace().collect();
            match words[..] {
                ["net", net, ref pins @ ..] => {
                    for pin in pins {
                        let old = board.nets.insert((*pin).to_owned(), net.to_owned());
                        assert_eq!(old, None, "{pin} is in two nets");
                    }
                }
                ["part" | "-part", part, _, value, ..] => {
                    board.values.insert(part.to_owned(), value.to_owned());
                }
                _ => {}
            }
        }
        assert!(board.nets.len() > 200 && board.values.len() > 80);
        board
    }

    /// Value of a part in its unit: "2.5m", "10k".
    fn value(&self, part: &str) -> f64 {
        let text = &self.values[part];
        let number = text.trim_end_matches(['m', 'k']);
        let factor = match &text[number.len()..] {
            "m" => 1e-3,
            "k" => 1e3,
            _ => 1.0,
        };
        number
            .parse::<f64>()
            .unwrap_or_else(|_| panic!("{part}: {text}"))
            * factor
    }

    /// Whether a pin is on a net, directly or behind a resistor of at most 1 kΩ in line.
    fn reaches(&self, pin: &str, net: &str) -> bool {
        let own = &self.nets[pin];
        own == net
            || self.resistors().any(|(part, ends)| {
                ends.contains(own) && ends.contains(net) && self.value(part) <= 1e3
            })
    }

    /// Resistors with the nets of their ends.
    fn resistors(&self) -> impl Iterator<Item = (&str, BTreeSet<String>)> {
        let named = self.values.keys().filter(|part| part.starts_with('R'));
        named.map(|part| {
            let ends = [1, 2].map(|end| self.nets[&format!("{part}.{end}")].clone());
            (part.as_str(), BTreeSet::from(ends))
        })
    }

    /// Resistance between the nets of two pins, where a single resistor joins them.
    fn between(&self, pin: &str, net: &str) -> Option<f64> {
        let ends = BTreeSet::from([self.nets[pin].clone(), net.to_owned()]);
        let mut found = self.resistors().filter(|(_, of)| *of == ends);
        found.next().map(|(part, _)| self.value(part))
    }
}

/// Numbers behind "GP" in a text, in their order.
fn pins_in(text: &str) -> Vec<usize> {
    let digits = |rest: &str| {
        let end = rest.find(|c: char| !c.is_ascii_digit());
        rest[..end.unwrap_or(rest.len())].parse().ok()
    };
    text.split("GP").skip(1).filter_map(digits).collect()
}

/// Rows of the table of docs/firmware.md that name a pin: first cell, and pins.
fn page() -> BTreeMap<String, Vec<usize>> {
    let page = text("docs/firmware.md");
    let section = page.split("\n## ").find(|part| part.starts_with("Wiring"));
    let rows = section.expect("a section Wiring").lines();
    let cells = rows.map(|row| row.split('|').map(str::trim).collect::<Vec<_>>());
    let named = cells.filter(|cells| cells.len() > 3);
    let rows = named.map(|cells| (cells[1].to_owned(), pins_in(cells[2])));
    rows.filter(|(_, pins)| !pins.is_empty()).collect()
}

/// Pin numbers of the public constants of pins.rs, by name.
fn firmware() -> BTreeMap<String, Vec<usize>> {
    let source = text("firmware/src/board/rp2040/pins.rs");
    let numbers = |text: &str| -> Vec<usize> {
        let words = text.split(|c: char| !c.is_ascii_digit());
        words.filter_map(|word| word.parse().ok()).collect()
    };
    let constants = source.split("pub const ").skip(1).filter_map(|rest| {
        let (declared, value) = rest.split_once(';').and_then(|(first, rest)| {
            // The type of an array has a semicolon of its own.
            let whole = if first.contains('=') {
                first
            } else {
                &rest[..rest.find(';')?]
            };
            Some((first, whole.split_once('=')?.1))
        })?;
        let name = declared.split(':').next()?.to_owned();
        let pins = match name.as_str() {
            "INTB_LINES" => value
                .split("pin:")
                .skip(1)
                .map(|line| numbers(line)[0])
                .collect(),
            _ => numbers(value),
        };
        Some((name, pins))
    });
    constants
        .filter(|(name, _)| {
            name.chars()
                .all(|c| c.is_ascii_uppercase() || c == '_' || c.is_ascii_digit())
        })
        .filter(|(name, _)| name != "COIL_SLICE")
        .collect()
}

#[test]
fn the_board_the_page_and_the_firmware_name_the_same_pins() {
    let (board, page, firmware) = (Board::read(), page(), firmware());
    let mut used = BTreeSet::from(ON_THE_PICO);
    for (row, constants, reached) in SIGNALS {
        let pins = page
            .get(*row)
            .unwrap_or_else(|| panic!("no row {row:?} in docs/firmware.md"));
        assert_eq!(pins.len(), reached.len(), "{row}: pins of the page");
        let known = constants.split(' ').map(|constant| {
            let (name, index) = constant.split_once('.').unwrap_or((constant, "0"));
            let values = firmware
                .get(name)
                .unwrap_or_else(|| panic!("no {name} in pins.rs"));
            values[index.parse::<usize>().expect("an index")]
        });
        let known: Vec<usize> = known.collect();
        assert_eq!(
            *pins, known,
            "{row}: pins of the page, and of pins.rs ({constants})"
        );
        for (pin, reached) in pins.iter().zip(*reached) {
            let net = board.nets.get(&format!("U1.GP{pin}"));
            let net = net.unwrap_or_else(|| panic!("{row}: GP{pin} leads to nothing on the board"));
            assert!(
                board.reaches(reached, net),
                "{row}: GP{pin} does not reach {reached}"
            );
            used.insert(*pin);
        }
    }
    let of_page = page.values().flatten().copied().collect();
    let of_firmware: BTreeSet<usize> = firmware.values().flatten().copied().collect();
    let on_board = board
        .nets
        .keys()
        .flat_map(|pin| match pin.strip_prefix("U1.") {
            Some(pin) => pins_in(pin),
            None => Vec::new(),
        });
    assert_eq!(
        used.difference(&of_page).collect::<Vec<_>>(),
        [&29],
        "pins without a row in docs/firmware.md"
    );
    assert_eq!(of_firmware, used, "pins of pins.rs");
    let on_board = on_board.chain(ON_THE_PICO).collect::<BTreeSet<_>>();
    assert_eq!(on_board, used, "pins of the board");
}

#[test]
fn what_has_to_be_off_in_reset_is_off() {
    let board = Board::read();
    for (pin, rail) in [
        ("U4.IN1", "GND"),
        ("U4.IN2", "GND"),
        ("U4.nSLEEP", "GND"),
        ("U2.SD", "+3V3"),
        ("U3.SD", "+3V3"),
        ("U4.nFAULT", "+3V3"),
    ] {
        let resistance = board.between(pin, rail);
        assert!(
            resistance.is_some_and(|ohm| ohm <= 22e3),
            "{pin} to {rail}: {resistance:?}"
        );
    }
    assert_eq!(board.nets["U2.ADDR"], "GND", "address 0x2A");
    assert_eq!(board.nets["U3.ADDR"], board.nets["U3.VDD"], "address 0x2B");
}

#[test]
fn the_values_of_the_board_are_those_of_the_firmware() {
    let board = Board::read();
    let near = |found: f64, expected: f64, what: &str| {
        assert!(
            (found / expected - 1.0).abs() < 0.01,
            "{what}: {found} in place of {expected}"
        );
    };
    // Current: shunt times the gain of an INA240A2, against the counts of a converter of 3.3 V.
    assert_eq!(board.values["U5"], "INA240A2");
    let volt_per_count = 3.3 / 4096.0;
    let volt_per_ampere = volt_per_count / f64::from(HARDWARE.ampere_per_count);
    near(
        board.value("R20") * 50.0,
        volt_per_ampere,
        "volt per ampere",
    );
    assert_eq!(
        (
            board.nets["U5.REF1"].as_str(),
            board.nets["U5.REF2"].as_str()
        ),
        ("ADC_VREF", "GND")
    );
    near(
        board.value("R8") / board.value("R9"),
        10.0,
        "divider of the supply",
    );
    near(board.value("R23"), 10e3, "resistor of the thermistor");
    // Limit of the DRV8701: (VREF - offset)/(gain R). Typical 50 mV and 20, worst 250 mV and 22
    // (SLVSCX5B, 6.5); below 50 mV at the sense resistor the gain is 16 at least.
    let sense = board.value("R19");
    let reduced_v = 3.3 * board.value("R13") / (board.value("R12") + board.value("R13"));
    let reduced = f64::from(
        HARDWARE
            .reduced_limit_a
            .expect("a limit that can be reduced"),
    );
    assert!(
        ((reduced_v - 0.05) / (20.0 * sense) / reduced - 1.0).abs() < 0.1,
        "reduced limit"
    );
    assert!(
        reduced_v / (16.0 * sense) < 1.5 * reduced,
        "the self-test allows 1.5 times the limit"
    );
    let least = (3.3 * 0.98 - 0.25) / (22.0 * sense);
    assert!(
        least > f64::from(DRIVE_LIMITS.trip_a),
        "the firmware trips first: {least} A"
    );
}
