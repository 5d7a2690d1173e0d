//! For any bus traffic at any time there is no panic and no hang, and a repetition gives the same
//! bytes.

use crate::common::*;
use ldc161x_sim::{
    Ack, Chip, ChipFault, ExternalClock, FaultEvent, Lost, Overhead, Path, Settings, Span, Strike,
    Switches, Time, Trigger,
};
use proptest::prelude::*;

/// One action of a master, a pin or a test.
#[derive(Clone, Debug)]
enum Act {
    Start(u8),
    Write(u8),
    Read(bool),
    Stop,
    Register(u8, u16),
    Wait(u64),
    Shutdown(bool),
    AddressPin(bool),
    BrownOut,
    Clocks(u32),
    Fault(FaultEvent),
    ClearFaults,
    Look(u8),
}

fn fault() -> impl Strategy<Value = ChipFault> {
    let path = prop_oneof![
        Just(Path::ReadData),
        Just(Path::WriteData),
        Just(Path::Pointer)
    ];
    let strike = prop_oneof![
        (0..5_u32).prop_map(Strike::Byte),
        (0.0..=1.0).prop_map(Strike::Probability)
    ];
    prop_oneof![
        (0..6_u32).prop_map(|after_bytes| ChipFault::Nack { after_bytes }),
        Just(ChipFault::Absent),
        proptest::option::of(0..12_u8).prop_map(|clocks| ChipFault::SdaStuck { clocks }),
        Just(ChipFault::SclStuck),
        Just(ChipFault::BrownOut(Lost::Everything)),
        any::<u64>().prop_map(|which| ChipFault::BrownOut(Lost::Registers(which))),
        (path, strike).prop_map(|(path, strike)| ChipFault::BitFlip { path, strike }),
        (any::<u8>(), any::<u16>())
            .prop_map(|(address, bits)| ChipFault::RegisterUpset { address, bits }),
        (any::<u16>(), any::<u16>()).prop_map(|(manufacturer, device)| ChipFault::WrongIdentity {
            manufacturer,
            device
        }),
        (0..6_u32).prop_map(|after_bytes| ChipFault::EarlyStop { after_bytes }),
        any::<bool>().prop_map(|low| ChipFault::IntbStuck { low }),
        Just(ChipFault::ClockLoss),
    ]
}

fn event() -> impl Strategy<Value = FaultEvent> {
    let trigger = prop_oneof![
        any::<u64>().prop_map(|time| Trigger::At(Time::from_ps(time))),
        (0..10_000_000_000_u64).prop_map(|time| Trigger::At(Time::from_ps(time))),
        (0..50_u64).prop_map(Trigger::Transaction),
    ];
    let span = prop_oneof![
        any::<u64>().prop_map(|time| Span::Time(Time::from_ps(time))),
        (0..1_000_000_000_u64).prop_map(|time| Span::Time(Time::from_ps(time))),
        (0..4_u32).prop_map(Span::Transactions),
        Just(Span::Forever),
    ];
    (trigger, span, fault()).prop_map(|(trigger, span, fault)| FaultEvent {
        trigger,
        span,
        fault,
    })
}

fn act() -> impl Strategy<Value = Act> {
    prop_oneof![
        4 => prop_oneof![Just(0x54), Just(0x55), any::<u8>()].prop_map(Act::Start),
        8 => any::<u8>().prop_map(Act::Write),
        8 => any::<bool>().prop_map(Act::Read),
        4 => Just(Act::Stop),
        6 => (0x08..0x22_u8, any::<u16>()).prop_map(|(register, value)| Act::Register(register, value)),
        4 => prop_oneof![
            Just(0x1601), Just(0x9601), Just(0x0201), Just(0x3601), Just(0x1401), any::<u16>()
        ].prop_map(|config| Act::Register(0x1A, config)),
        2 => (0..4_u8, Just(0x1001_u16))
            .prop_map(|(channel, dividers)| Act::Register(0x14 + channel, dividers)),
        6 => (0..20_000_000_000_u64).prop_map(Act::Wait),
        1 => any::<bool>().prop_map(Act::Shutdown),
        1 => any::<bool>().prop_map(Act::AddressPin),
        1 => Just(Act::BrownOut),
        1 => (0..20_u32).prop_map(Act::Clocks),
        2 => event().prop_map(Act::Fault),
        1 => Just(Act::ClearFaults),
        2 => any::<u8>().prop_map(Act::Look),
    ]
}

/// Frequencies, some of which no coil can have.
fn hertz() -> impl Strategy<Value = f64> {
    prop_oneof![
        4 => 1e3..1e7,
        1 => any::<f64>(),
        1 => Just(0.0),
        1 => Just(f64::NAN),
        1 => Just(f64::INFINITY),
        1 => 0.0..300.0,
    ]
}

fn perform(chip: &mut Chip<[f64; 4]>, act: &Act) -> u64 {
    let time = chip.now();
    match *act {
        Act::Start(byte) => u64::from(chip.start(time, byte).is_ack()),
        Act::Write(byte) => u64::from(chip.write(time, byte).is_ack()),
        Act::Read(more) => u64::from(chip.read(time, if more { Ack::Ack } else { Ack::Nack })),
        Act::Stop => {
            chip.stop(time);
            0
        }
        Act::Register(register, value) => {
            chip.stop(time);
            chip.start(time, 0x54);
            let [high, low] = value.to_be_bytes();
            for byte in [register, high, low] {
                chip.write(time, byte);
            }
            chip.stop(time);
            0
        }
        Act::Wait(picoseconds) => {
            chip.advance_to(time + Time::from_ps(picoseconds));
            0
        }
        Act::Shutdown(high) => {
            chip.set_shutdown(high);
            0
        }
        Act::AddressPin(high) => {
            chip.set_address_pin(high);
            0
        }
        Act::BrownOut => {
            chip.brown_out();
            0
        }
        Act::Clocks(pulses) => {
            chip.clock_pulses(time, pulses);
            u64::from(chip.sda_held_low(time)) + u64::from(chip.scl_held_until(time).is_some())
        }
        Act::Fault(event) => u64::from(chip.schedule(event).is_ok()),
        Act::ClearFaults => {
            chip.clear_faults();
            0
        }
        Act::Look(register) => u64::from(chip.register(register)) + u64::from(chip.intb_is_low()),
    }
}

fn settings() -> impl Strategy<Value = Settings> {
    (
        0..Switches::one_at_a_time().count(),
        any::<u64>(),
        proptest::option::of(prop_oneof![4 => 2e6..40e6, 1 => any::<f64>()]),
        any::<bool>(),
    )
        .prop_map(|(switches, seed, clkin_hz, quantised)| {
            let mut settings = Settings {
                seed,
                external_clock: clkin_hz.map(ExternalClock::exact),
                switches: Switches::one_at_a_time().nth(switches).unwrap_or_default(),
                ..Settings::default()
            };
            settings.conversions.quantised = quantised;
            settings
        })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]

    #[test]
    fn nothing_panics_or_hangs_and_all_of_it_repeats(
        settings in settings(),
        sensors in [hertz(), hertz(), hertz(), hertz()],
        acts in proptest::collection::vec(act(), 1..80),
    ) {
        let mut chip = Chip::new(settings, sensors);
        let mut twin = chip.clone();
        for act in &acts {
            let before = chip.now();
            prop_assert_eq!(perform(&mut chip, act), perform(&mut twin, act), "the same again");
            prop_assert!(chip.now() >= before, "time runs forward");
            for channel in 0..4 {
                if let Some(truth) = chip.last_conversion(channel) {
                    prop_assert!(truth.word < 1 << 28);
                    prop_assert!(truth.end >= truth.start);
                }
            }
            prop_assert_eq!(chip.register(0x18) & 0x00B0, 0, "reserved bits of STATUS");
        }
        prop_assert_eq!(chip.misuse(), twin.misuse());
        prop_assert_eq!(chip.disturbances(), twin.disturbances());
        prop_assert_eq!(chip.now(), twin.now());
    }
}

#[test]
fn a_senseless_time_is_skipped_to() {
    // The chip has the shortest possible conversions and is to run for 213 days.
    let settings = with_switches(Settings::ideal(), |s| s.overhead = Overhead::NONE);
    let rig = ChipRig::new(settings, [3e6]);
    rig.single(9);
    let mut chip = rig.chip.borrow_mut();
    chip.advance_to(Time::MAX - ms(1));
    assert_eq!(chip.now(), Time::MAX - ms(1));
    let done = chip.conversions(0);
    let now = chip.now();
    chip.advance_to(now + us(100));
    assert!(chip.conversions(0) > done, "and it still converts");
}

#[test]
fn absurd_clocks_make_no_endless_loop() {
    for hz in [1e300, 1e-300, f64::NAN, -1.0, 0.0, f64::INFINITY] {
        let settings = Settings {
            external_clock: Some(ExternalClock::exact(hz)),
            ..Settings::default()
        };
        let rig = ChipRig::new(settings, [3e6; 2]);
        rig.single(100);
        rig.wait(Time::from_ns(50));
        rig.write(0x1A, 0x3601);
        rig.autoscan(1, 100, 20);
        rig.wait(Time::from_ns(50));
    }
}

#[test]
fn the_same_seed_gives_the_same_bytes_and_another_does_not() {
    let run = |seed| {
        let rig = ChipRig::new(
            Settings {
                seed,
                ..Settings::default()
            },
            [3e6; 4],
        );
        rig.autoscan(3, 300, 50);
        (0..100)
            .map(|_| {
                rig.next_interrupt();
                (rig.now(), [0, 1, 2, 3].map(|channel| rig.frame(channel)))
            })
            .collect::<Vec<_>>()
    };
    assert_eq!(run(1), run(1));
    assert_ne!(run(1), run(2));
}

#[test]
fn the_step_of_time_does_not_matter() {
    let words = |step: Time| {
        let rig = ChipRig::new(Settings::default(), [3e6; 4]);
        rig.single(333);
        let end = ms(50);
        let mut chip = rig.chip.borrow_mut();
        while chip.now() < end {
            let next = (chip.now() + step).min(end);
            chip.advance_to(next);
        }
        (
            chip.conversions(0),
            *chip.last_conversion(0).expect("a conversion"),
        )
    };
    assert_eq!(words(Time::from_ns(1_777)), words(ms(50)));
}

#[test]
fn a_clone_is_a_snapshot() {
    let rig = ChipRig::new(Settings::default(), [3e6; 4]);
    rig.single(333);
    rig.wait(ms(7));
    let mut copy = rig.chip.borrow().clone();
    rig.wait(ms(7));
    copy.advance_to(rig.now());
    let chip = rig.chip.borrow();
    assert_eq!(copy.last_conversion(0), chip.last_conversion(0));
    assert_eq!(copy.interrupts(), chip.interrupts());
}

#[test]
fn a_sensor_can_be_changed_on_the_way() {
    let rig = ChipRig::new(Settings::ideal(), [3e6]);
    rig.single(1000);
    rig.convert(0, 1);
    *rig.chip.borrow_mut().sensors_mut() = [4e6];
    rig.convert(0, 2);
    let chip = rig.chip.borrow();
    assert_eq!(
        chip.last_conversion(0).expect("a conversion").sensor_hz,
        4e6
    );
    assert_eq!(chip.sensors()[0], 4e6);
    assert_eq!(chip.settings().seed, 0x1614);
}
