//! The command line.

use clap::{Parser, Subcommand};

/// Development tasks of palpate.
#[derive(Parser)]
#[command(name = "cargo xtask", bin_name = "cargo xtask")]
pub(crate) struct Arguments {
    /// Toolchain of every child cargo, instead of the one rust-toolchain.toml names
    #[arg(long, global = true, value_name = "NAME")]
    pub(crate) toolchain: Option<String>,
    #[command(subcommand)]
    pub(crate) verb: Verb,
}

/// Verb to run.
#[derive(Subcommand)]
pub(crate) enum Verb {
    /// Run the whole test suite on the host
    Test,
    /// Run all checks that a change must pass
    Ci {
        /// Skip the tests, after `cargo xtask test`
        #[arg(long)]
        skip_tests: bool,
        /// Run only this step; may be given more than once
        #[arg(long, value_name = "STEP")]
        only: Vec<String>,
    },
    /// Run a long campaign and keep its result in docs/evidence; without a name, list them
    Evidence {
        /// Name of the campaign
        name: Option<String>,
    },
    /// Build the firmware image into target/image, and check its size against its budget
    Firmware {
        /// Build it with this defect of firmware/planted-defects.toml instead; print only its path
        #[arg(long, value_name = "DEFECT")]
        planted: Option<String>,
    },
    /// Plant each defect of tests/planted-defects.toml and run the tests that must find it
    PlantedDefects,
    /// Flash the firmware through a debug probe, and show its log
    Flash,
    /// Write a release for this platform into target/release-files: image, tool, licences, checksums
    Release,
    /// Run every fuzz target for a while, on a nightly toolchain
    Fuzz {
        /// Seconds per target
        #[arg(long, default_value_t = 60)]
        seconds: u32,
        /// Seed of the fuzzer's random numbers; 0 for a different one in every run
        #[arg(long, default_value_t = 0)]
        seed: u32,
    },
    /// Add the microcontroller targets and install the tools that `ci` needs
    Setup {
        /// Install the tools for `release` as well
        #[arg(long)]
        release: bool,
    },
}
