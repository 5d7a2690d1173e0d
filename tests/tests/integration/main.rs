//! External tests of `system-tests`: one program, with one module per area.

mod carrier;
mod chip;
mod coil_guards;
mod copies;
mod corpus;
mod fault_schedules;
mod hostile;
mod on_target;
mod sigma;
mod touch;

// Functions that the firmware example on_target runs on the processor.
#[path = "../../../firmware/examples/on_target/arithmetic.rs"]
#[allow(unreachable_pub)]
mod arithmetic;
#[path = "../../../firmware/procedure/tests/integration/support/mod.rs"]
mod support;
#[path = "../../../firmware/examples/on_target/tape.rs"]
#[allow(dead_code, unreachable_pub)]
mod tape;
