//! The asynchronous driver sends exactly what the blocking one sends.
#![cfg(feature = "async")]

use crate::common::*;
use embedded_hal_mock::eh1::delay::NoopDelay;
use futures_lite::future::block_on;
use ldc161x::{
    Acquisition, Address, AsyncLdc161x, Channel, InterruptRelease, Ldc161x, Model, Rate,
    ReferenceClock, Request, Sensor,
};

#[test]
fn start_frame_canary_and_recovery_are_the_same_on_the_wire() {
    let plan = Request::new(
        Model::Ldc1612,
        ReferenceClock::External { hz: 30_000_000 },
        Acquisition::Single(Channel::Zero),
        Sensor::new(2_900_000, 3_800_000),
    )
    .rate(Rate::PerSecond(1_000))
    .plan()
    .unwrap();
    // At 30 MHz, Q 50 at 2.9 MHz requires a settle count of 32.3, so 33; RCOUNT 1873 as in the
    // crate's example; drive current 244 uA.
    let settings = [
        (RCOUNT, 1_873),
        (OFFSET, 0),
        (SETTLECOUNT, 33),
        (CLOCK_DIVIDERS, 0x1001),
        (DRIVE_CURRENT, 19 << 11),
        (ERROR_CONFIG, 0xF801),
        (MUX_CONFIG, 0x020D),
    ];
    let mut expected = start(0x3601, 0x1601, &settings);
    expected.extend(frame(&[(0, 0x0240), (1, 0x9E8B)]));
    expected.push(read(RCOUNT, 1_873));
    expected.push(write(RESET_DEV, 0x8000));
    expected.extend(start(0x3601, 0x1601, &settings));

    let (i2c, mut check) = bus(&expected);
    let mut chip = AsyncLdc161x::new(i2c, Model::Ldc1612, Address::AddrLow);
    chip.set_interrupt_release(InterruptRelease::ByData);
    let asynchronous = block_on(async {
        chip.start(&plan.configuration).await.unwrap();
        let frame = chip.read_frame().await.unwrap();
        chip.check_canary().await.unwrap();
        chip.recover(&mut NoopDelay).await.unwrap();
        frame
    });
    check.done();

    let (i2c, mut check) = bus(&expected);
    let mut chip = Ldc161x::new(i2c, Model::Ldc1612, Address::AddrLow);
    chip.set_interrupt_release(InterruptRelease::ByData);
    chip.start(&plan.configuration).unwrap();
    assert_eq!(chip.read_frame().unwrap(), asynchronous);
    chip.check_canary().unwrap();
    chip.recover(&mut NoopDelay).unwrap();
    check.done();
}
