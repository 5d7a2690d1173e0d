//! The rules, as tables.
//!
//! A crate is given by its package name, or by its folder with `/*` for all crates in it. A rule
//! may name a crate that does not exist yet.

/// The firmware, the only crate that depends on the hardware.
pub(super) const FIRMWARE: &str = "palpate-firmware";
/// The physics. One of its examples runs on a microcontroller, to show that the bits are equal.
pub(super) const MODEL: &str = "palpate-model";

/// Folder of the drivers.
pub(super) const DRIVERS: &str = "drivers/*";

/// Allowed dependencies of a crate within the workspace, in any table of its manifest.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rule {
    /// Name of the rule, for messages.
    pub(super) name: &'static str,
    /// Crates to which the rule applies.
    pub(super) who: &'static str,
    /// Crates on which those crates may depend.
    pub(super) may_depend: On,
    /// Reason.
    pub(super) because: &'static str,
}

/// A set of crates of the workspace, by name.
#[derive(Debug, Clone, Copy)]
pub(super) enum On {
    /// Only these crates.
    Only(&'static [&'static str]),
    /// All crates except these.
    AnyBut(&'static [&'static str]),
}

/// All rules. Several rules may apply to a crate; at least one must.
pub(super) const RULES: &[Rule] = &[
    Rule {
        name: "model-alone",
        who: "palpate-model",
        may_depend: On::Only(&[]),
        because: "physics knows neither chip nor wire",
    },
    Rule {
        name: "wire-alone",
        who: "palpate-wire",
        may_depend: On::Only(&[]),
        because: "the contract between device and PC belongs to neither",
    },
    Rule {
        name: "field-on-model",
        who: "palpate-field",
        may_depend: On::Only(&["palpate-model"]),
        because: "the field solver is a tool of the model",
    },
    Rule {
        name: "calibration-independent",
        who: "palpate-calibration",
        may_depend: On::Only(&["palpate-wire", "palpate-sim"]),
        because: "it judges what instrument and world do, and shares no function with them; its \
                  tests hold the prior of its curve against the simulated coil",
    },
    Rule {
        name: "drivers-apart",
        who: DRIVERS,
        may_depend: On::Only(&[DRIVERS]),
        because: "a driver is published by itself and knows nothing of this instrument",
    },
    Rule {
        name: "simulator-independent",
        who: "ldc161x-sim",
        may_depend: On::AnyBut(&["ldc161x"]),
        because: "a simulated chip that shares a line with the driver shares its errors",
    },
    Rule {
        name: "procedure-sans-io",
        who: "palpate-procedure",
        may_depend: On::Only(&["palpate-model", "palpate-wire", "ldc161x", "coil-hbridge"]),
        because: "the procedure takes the drivers' values and knows no bus, clock or board",
    },
    Rule {
        name: "node-without-hardware",
        who: "palpate-node",
        may_depend: On::Only(&[
            "palpate-procedure",
            "palpate-storage",
            "palpate-wire",
            DRIVERS,
        ]),
        because: "what the firmware decides is tested on a PC, without bus, clock or board",
    },
    Rule {
        name: "storage-on-wire",
        who: "palpate-storage",
        may_depend: On::Only(&["palpate-wire"]),
        because: "what is stored are the commands of the protocol; what they set is none of its business",
    },
    Rule {
        name: "float-alone",
        who: "palpate-float",
        may_depend: On::Only(&[]),
        because: "arithmetic knows nothing of what is computed with it",
    },
    Rule {
        name: "firmware-below",
        who: FIRMWARE,
        may_depend: On::Only(&[
            "palpate-float",
            "palpate-node",
            "palpate-procedure",
            "palpate-storage",
            "palpate-wire",
            DRIVERS,
            "palpate-model",
        ]),
        because: "the firmware is wiring; physics reaches it through the procedure, but for the \
                  example that holds the model's bits against a PC's",
    },
    Rule {
        name: "simulation-without-firmware",
        who: "palpate-sim",
        may_depend: On::AnyBut(&[FIRMWARE, "host/*", "system-tests", "xtask"]),
        because: "the simulation runs the procedure on a PC, where no firmware builds",
    },
    Rule {
        name: "board-below",
        who: "palpate-emulator",
        may_depend: On::Only(&[
            "palpate-sim",
            "palpate-procedure",
            "palpate-wire",
            "ldc161x-sim",
        ]),
        because: "the emulated board runs the firmware as an image; of the procedure it takes the \
                  type of a time only",
    },
    Rule {
        name: "cli-below",
        who: "palpate-cli",
        may_depend: On::Only(&["palpate-calibration", "palpate-sim", "palpate-wire"]),
        because: "it has what all programs say and write, and knows no verb",
    },
    Rule {
        name: "simulate-small",
        who: "palpate-simulate",
        may_depend: On::Only(&[
            "palpate-calibration",
            "palpate-cli",
            "palpate-sim",
            "palpate-wire",
        ]),
        because: "the first program that a newcomer builds has neither emulator nor field solver nor links",
    },
    Rule {
        name: "design-without-boards",
        who: "palpate-design",
        may_depend: On::Only(&[
            "palpate-calibration",
            "palpate-cli",
            "palpate-field",
            "palpate-sim",
            "palpate-simulate",
            "palpate-wire",
            "ldc161x",
        ]),
        because: "what is computed of a sensor before it is built needs no board",
    },
    Rule {
        name: "tool-above",
        who: "palpate",
        may_depend: On::Only(&[
            "palpate-calibration",
            "palpate-cli",
            "palpate-design",
            "palpate-emulator",
            "palpate-sim",
            "palpate-simulate",
            "palpate-wire",
            DRIVERS,
        ]),
        because: "the program reaches physics and procedure through the simulation",
    },
    Rule {
        name: "campaigns-above",
        who: "palpate-campaigns",
        may_depend: On::AnyBut(&[FIRMWARE, "xtask"]),
        because: "campaigns judge what users run",
    },
    Rule {
        name: "tests-without-firmware",
        who: "system-tests",
        may_depend: On::AnyBut(&[FIRMWARE, "xtask"]),
        because: "the tests run the firmware as an image, not as a library",
    },
    Rule {
        name: "xtask-alone",
        who: "xtask",
        may_depend: On::Only(&[]),
        because: "the gate has to build when what it judges does not",
    },
];

/// Crates that only the firmware may name: HALs, register crates, RTIC, start-up code, panic
/// handlers, and transports of defmt logs. `*` matches any prefix or suffix.
pub(super) const MCU_ONLY: &[&str] = &[
    "*-hal",
    "*-pac",
    "cortex-m",
    "cortex-m-*",
    "defmt-itm",
    "defmt-rtt",
    "defmt-semihosting",
    "embassy-*",
    "panic-*",
    "rp2040-*",
    "rp235x-*",
    "rtic",
    "rtic-*",
    "rtt-target",
    "semihosting",
    "stm32*",
];

/// Names that match [`MCU_ONLY`] but are allowed: traits, and emulators for a PC.
pub(super) const NOT_MCU: &[&str] = &["embedded-hal", "rp2040-emu", "rp2350-emu"];

/// Log format, which libraries may offer behind a feature.
pub(super) const LOG_FORMAT: &str = "defmt";
