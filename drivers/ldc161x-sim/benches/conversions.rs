//! Measures how many conversions and frames the model runs per second.
#![allow(missing_docs, reason = "divan's macro makes public items")]

use core::cell::RefCell;

use divan::{Bencher, counter::ItemsCount};
use embedded_hal::i2c::{I2c, Operation};
use ldc161x_sim::{Bus, Chip, Settings, Time};

fn main() {
    divan::main();
}

type SensorFunction = fn(usize, f64) -> f64;

/// A chip converting on one channel (MUX_CONFIG 0x020D) or on four (0xC20D).
fn converting(mux: u16) -> RefCell<Chip<SensorFunction>> {
    let sensor: SensorFunction = |_, time| 3.2e6 + 50.0 * time;
    let chip = RefCell::new(Chip::new(Settings::default(), sensor));
    let mut bus = Bus::new(&chip, 400_000);
    let mut write = |register: u8, value: u16| {
        let [high, low] = value.to_be_bytes();
        bus.write(0x2A, &[register, high, low])
            .expect("the chip answers");
    };
    for channel in 0..4 {
        write(0x08 + channel, 612);
        write(0x10 + channel, 100);
        write(0x14 + channel, 0x1001);
        write(0x1E + channel, 0xA800);
    }
    write(0x19, 0xF8FD);
    write(0x1B, mux);
    write(0x1A, 0x1601);
    chip
}

const CONVERSIONS: u64 = 10_000;

#[divan::bench(args = [("single", 0x020D), ("autoscan", 0xC20D)])]
fn conversions(bencher: Bencher<'_, '_>, (_, mux): (&str, u16)) {
    let chip = converting(mux);
    bencher
        .counter(ItemsCount::new(CONVERSIONS))
        .bench_local(|| {
            let mut chip = chip.borrow_mut();
            let done =
                |chip: &Chip<_>| (0..4).map(|channel| chip.conversions(channel)).sum::<u64>();
            let target = done(&chip) + CONVERSIONS;
            while done(&chip) < target {
                let time = chip.now() + Time::from_ms(1);
                chip.advance_to(time);
            }
        });
}

#[divan::bench]
fn frames_over_the_bus(bencher: Bencher<'_, '_>) {
    let chip = converting(0x020D);
    let mut bus = Bus::new(&chip, 400_000);
    bencher.counter(ItemsCount::new(1_u64)).bench_local(|| {
        let (mut high, mut low) = ([0; 2], [0; 2]);
        bus.transaction(
            0x2A,
            &mut [
                Operation::Write(&[0x00]),
                Operation::Read(&mut high),
                Operation::Write(&[0x01]),
                Operation::Read(&mut low),
            ],
        )
    });
}
