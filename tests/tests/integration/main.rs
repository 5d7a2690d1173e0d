//! Tests of `system-tests` from outside: one program, whose modules are its parts.

mod chip;
mod coil_guards;
mod copies;
mod corpus;
mod fault_schedules;
mod hostile;
mod on_target;
mod sigma;

// What the example on_target of the firmware runs on the processor.
#[path = "../../../firmware/examples/on_target/arithmetic.rs"]
#[allow(unreachable_pub)]
mod arithmetic;
#[path = "../../../firmware/procedure/tests/integration/support/mod.rs"]
mod support;
#[path = "../../../firmware/examples/on_target/tape.rs"]
#[allow(dead_code, unreachable_pub)]
mod tape;
