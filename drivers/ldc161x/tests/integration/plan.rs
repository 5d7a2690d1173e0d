//! Plans against the datasheet's limits, computed independently in floating point.

use std::cell::Cell;

use ldc161x::{
    Acquisition, BusAccess, Channel, Deglitch, LimitError, Model, Plan, Rate, Rcount,
    ReferenceClock, Request, Sensor, Sequence,
};
use proptest::{prelude::*, test_runner::TestRunner};

/// A fixed plan, computed at compile time.
const AUTOSCAN: Plan = match Request::new(
    Model::Ldc1614,
    ReferenceClock::External { hz: 40_000_000 },
    Acquisition::Autoscan(Sequence::ZeroToThree),
    Sensor::new(2_900_000, 3_800_000),
)
.rate(Rate::PerSecond(500))
.plan()
{
    Ok(plan) => plan,
    Err(_) => panic!("the plan breaks a limit"),
};

#[test]
fn the_reference_board_is_planned_as_worked_out_by_hand() {
    let zero = AUTOSCAN.configuration.channel(Channel::Zero);
    // Settle count for Q 50 at 2.9 MHz: 50 x 40 / (16 x 2.9) = 43.1, rounded up.
    assert_eq!(zero.settle_count.get(), 44);
    assert_eq!(zero.dividers.to_bits(), 0x1001);
    assert_eq!(AUTOSCAN.configuration.deglitch, Deglitch::Mhz10);
    // 2 ms / 4 = 500 us per channel are 20,000 periods. Without 704 periods of settling, and 5 and
    // 27.7 of switching, 19,263.3 = 16 x 1203.95 remain.
    assert_eq!(zero.rcount.get(), 1_203);
    // Four channels of 692 ns of switching and (44 + 1203) x 16 + 5 periods of 25 ns.
    assert_eq!(AUTOSCAN.frame_period_ns, 1_998_468);
    // 424 bit times at 400 kHz, STATUS included, and 10 us for the master's own delay.
    assert_eq!(AUTOSCAN.frame_read_ns, 1_070_000);
    // 4 V RP I / pi <= 1.8 V at 5 kiloohm allows 282.7 uA: the next lower code has 244 uA.
    assert_eq!(zero.drive.current_ua(), 244);
}

fn single(hz: u32) -> Request {
    Request::new(
        Model::Ldc1614,
        ReferenceClock::External { hz },
        Acquisition::Single(Channel::Zero),
        Sensor::new(2_900_000, 3_800_000),
    )
}

#[test]
fn one_channel_at_40_mhz_is_divided_below_35() {
    let plan = single(40_000_000).plan().unwrap();
    assert_eq!(
        plan.configuration
            .channel(Channel::Zero)
            .dividers
            .reference(),
        2
    );
}

#[test]
fn fast_sensors_are_divided() {
    let mut request = single(35_000_000);
    request = request.sensor(Channel::Zero, Sensor::new(8_000_000, 8_749_999));
    let plan = request.plan().unwrap();
    assert_eq!(
        plan.configuration.channel(Channel::Zero).dividers.sensor(),
        1
    );
    request = request.sensor(Channel::Zero, Sensor::new(8_000_000, 8_750_000));
    let plan = request.plan().unwrap();
    assert_eq!(
        plan.configuration.channel(Channel::Zero).dividers.sensor(),
        2
    );
}

/// For each limit: a request that breaks it, and the text that names it.
#[test]
fn each_limit_is_refused_by_name() {
    let good = single(30_000_000);
    let with = |change: fn(&mut Sensor)| {
        let mut sensor = Sensor::new(2_900_000, 3_800_000);
        change(&mut sensor);
        good.sensor(Channel::Zero, sensor)
    };
    let cases: Vec<(&str, Request)> = vec![
        (
            "channels",
            Request {
                model: Model::Ldc1612,
                acquisition: Acquisition::Single(Channel::Two),
                ..good
            },
        ),
        (
            "I2C clock",
            Request {
                bus_hz: 400_001,
                ..good
            },
        ),
        (
            "I2C clock",
            Request {
                bus_hz: 9_999,
                ..good
            },
        ),
        ("CLKIN", single(1_999_999)),
        ("CLKIN", single(40_000_001)),
        ("sensor 1 kHz", with(|sensor| sensor.lowest_hz = 999)),
        (
            "sensor 1 kHz",
            with(|sensor| sensor.highest_hz = 10_000_001),
        ),
        ("sensor 1 kHz", with(|sensor| sensor.highest_hz = 2_000_000)),
        (
            "parallel resistance",
            with(|sensor| sensor.lowest_rp_ohm = 999),
        ),
        (
            "parallel resistance",
            with(|sensor| sensor.highest_rp_ohm = 100_001),
        ),
        (
            "quarter",
            single(2_000_000).sensor(Channel::Zero, Sensor::new(9_000_000, 10_000_000)),
        ),
        (
            "SETTLECOUNT",
            with(|sensor| {
                (sensor.lowest_hz, sensor.highest_hz) = (1_000, 2_000);
                sensor.highest_quality_factor = u16::MAX;
            }),
        ),
        ("up to 1.8 V", with(|sensor| sensor.highest_rp_ohm = 99_000)),
        (
            "from 0.6 to 1.8",
            with(|sensor| sensor.highest_rp_ohm = 50_000),
        ),
        ("rate", good.rate(Rate::PerSecond(0))),
        (
            "settling and switching",
            good.rate(Rate::PerSecond(300_000)),
        ),
        ("time on the bus", good.rate(Rate::PerSecond(5_000))),
        ("time on the bus", good.rate(Rate::Conversion(Rcount::MIN))),
        (
            "six periods",
            good.sensor(Channel::Zero, Sensor::new(100_000, 110_000))
                .rate(Rate::Conversion(Rcount::new(100).unwrap())),
        ),
    ];
    let mut seen = std::collections::HashSet::new();
    for (name, request) in cases {
        let refusal = request.plan().expect_err(name);
        assert!(refusal.limit().contains(name), "{name}: {refusal}");
        assert!(refusal.to_string().contains(refusal.remedy()));
        seen.insert(std::mem::discriminant(&refusal));
    }
    assert_eq!(seen.len(), 13, "every kind of refusal is met");
}

fn clocks() -> impl Strategy<Value = ReferenceClock> {
    prop_oneof![
        (1_500_000_u32..45_000_000).prop_map(|hz| ReferenceClock::External { hz }),
        Just(ReferenceClock::Internal),
    ]
}

fn acquisitions() -> impl Strategy<Value = Acquisition> {
    prop_oneof![
        (0_u8..4).prop_map(|n| Acquisition::Single(Channel::from_number(n).unwrap())),
        Just(Acquisition::Autoscan(Sequence::ZeroToOne)),
        Just(Acquisition::Autoscan(Sequence::ZeroToTwo)),
        Just(Acquisition::Autoscan(Sequence::ZeroToThree)),
    ]
}

fn sensors() -> impl Strategy<Value = Sensor> {
    (
        2.9_f64..7.05,
        0.0_f64..0.5,
        1_u16..400,
        2.9_f64..5.05,
        0.0_f64..0.6,
    )
        .prop_map(|(lowest, span, quality, rp, rp_span)| Sensor {
            lowest_hz: 10_f64.powf(lowest) as u32,
            highest_hz: 10_f64.powf(lowest + span) as u32,
            highest_quality_factor: quality,
            lowest_rp_ohm: 10_f64.powf(rp) as u32,
            highest_rp_ohm: 10_f64.powf(rp + rp_span) as u32,
        })
}

fn rates() -> impl Strategy<Value = Rate> {
    prop_oneof![
        (1_u32..6_000).prop_map(Rate::PerSecond),
        Just(Rate::AsTheBusAllows),
        (9_u16..).prop_map(|count| Rate::Conversion(Rcount::new(count).unwrap())),
    ]
}

fn requests() -> impl Strategy<Value = Request> {
    let sensors = [sensors(), sensors(), sensors(), sensors()];
    (
        clocks(),
        acquisitions(),
        sensors,
        rates(),
        9_000_u32..410_000,
        any::<(bool, bool)>(),
    )
        .prop_map(
            |(reference, acquisition, sensors, rate, bus_hz, (status_reads, read_twice))| Request {
                sensors,
                rate,
                bus_hz,
                status_reads,
                read_twice,
                ..Request::new(Model::Ldc1614, reference, acquisition, sensors[0])
            },
        )
}

#[test]
fn every_plan_keeps_every_limit() {
    let mut runner = TestRunner::new(ProptestConfig::with_cases(20_000));
    let (planned, too_fast) = (Cell::new(0), Cell::new(0));
    runner
        .run(&requests(), |request| match request.plan() {
            Ok(plan) => {
                planned.set(planned.get() + 1);
                check(&request, &plan)
            }
            Err(
                LimitError::RateTooHigh {
                    most_per_second, ..
                }
                | LimitError::BusTooSlow {
                    most_per_second, ..
                },
            ) => {
                too_fast.set(too_fast.get() + 1);
                check_most(&request, most_per_second)
            }
            Err(_) => Ok(()),
        })
        .unwrap();
    // Enough random requests can be planned, or are refused as too fast, for the checks to count.
    assert!(planned.get() > 2_000, "{}", planned.get());
    assert!(too_fast.get() > 1_000, "{}", too_fast.get());
}

/// Checks that the highest rate which a refusal names can be planned, and that one frame per second
/// more cannot.
fn check_most(request: &Request, most_per_second: u32) -> Result<(), TestCaseError> {
    let at = |rate| request.rate(Rate::PerSecond(rate)).plan();
    if most_per_second > 0 {
        prop_assert!(at(most_per_second).is_ok(), "{most_per_second}");
    }
    prop_assert!(at(most_per_second + 1).is_err(), "{most_per_second}");
    Ok(())
}

/// Checks the limits of the datasheet, which are written down here a second time.
fn check(request: &Request, plan: &Plan) -> Result<(), TestCaseError> {
    let (slowest, nominal, fastest) = match request.reference {
        ReferenceClock::External { hz } => (f64::from(hz), f64::from(hz), f64::from(hz)),
        ReferenceClock::Internal => (35e6, 43.4e6, 55e6),
    };
    if let ReferenceClock::External { hz } = request.reference {
        prop_assert!((2_000_000..=40_000_000).contains(&hz));
    }
    prop_assert!((10_000..=400_000).contains(&request.bus_hz));
    let single = matches!(request.acquisition, Acquisition::Single(_));
    let mut frame_s = [0.0, 0.0];
    let mut fastest_sensor = 0.0_f64;
    for channel in request.acquisition.channels() {
        let sensor = request.sensors[usize::from(channel.number())];
        let settings = plan.configuration.channel(channel);
        let reference_divider = f64::from(settings.dividers.reference());
        let input_divider = f64::from(settings.dividers.sensor());
        let (low, high) = (f64::from(sensor.lowest_hz), f64::from(sensor.highest_hz));
        fastest_sensor = fastest_sensor.max(high);
        let limit = match request.reference {
            _ if single => 35e6,
            ReferenceClock::External { .. } => 40e6,
            ReferenceClock::Internal => 55e6,
        };
        prop_assert!(fastest / reference_divider <= limit);
        prop_assert!(high / input_divider < slowest / reference_divider / 4.0);
        prop_assert!(high < 8.75e6 || input_divider >= 2.0);
        prop_assert!(low >= 1e3 && high <= 10e6 && low <= high);
        let settle = f64::from(settings.settle_count.get());
        let q = f64::from(sensor.highest_quality_factor);
        prop_assert!(settle >= q * (fastest / reference_divider) / (16.0 * low) - 1e-9);
        prop_assert!(settle > 3.0 && settings.rcount.get() > 8);
        // The shortest conversion has six periods of the sensor.
        let clocks = 16.0 * f64::from(settings.rcount.get());
        let period = input_divider / low * fastest / reference_divider;
        prop_assert!(clocks >= 6.0 * period - 1e-6, "{clocks} {period}");
        let volts = |ohm: u32| {
            4.0 * f64::from(settings.drive.current_ua()) * 1e-6 * f64::from(ohm)
                / std::f64::consts::PI
        };
        prop_assert!(volts(sensor.highest_rp_ohm) <= 1.8 + 1e-5);
        prop_assert!(volts(sensor.lowest_rp_ohm) >= 0.6 - 1e-5);
        for (clock, total) in [nominal, fastest].into_iter().zip(&mut frame_s) {
            let f = clock / reference_divider;
            let settling = if single { 0.0 } else { 16.0 * settle };
            let conversion = 16.0 * f64::from(settings.rcount.get());
            *total += (settling + conversion + 5.0) / f + 692e-9;
        }
    }
    let filter = match plan.configuration.deglitch {
        Deglitch::Mhz1 => 1e6,
        Deglitch::Mhz3_3 => 3.3e6,
        Deglitch::Mhz10 => 10e6,
        Deglitch::Mhz33 => 33e6,
    };
    prop_assert!(filter > fastest_sensor);
    let reads = if request.read_twice { 4 } else { 2 };
    let registers =
        reads * request.acquisition.channels().count() + usize::from(request.status_reads);
    let bits = match request.access {
        BusAccess::FramePerTransaction => 47 * registers + 1,
        BusAccess::RegisterPerTransaction => 48 * registers,
        BusAccess::SeparateTransfers => 49 * registers,
    };
    let read_s = bits as f64 / f64::from(request.bus_hz) + 10e-6;
    prop_assert!(frame_s[1] >= read_s - 2e-9, "{} {}", frame_s[1], read_s);
    prop_assert!((plan.frame_period_ns as f64 - frame_s[0] * 1e9).abs() < 10.0);
    if let Rate::PerSecond(rate) = request.rate {
        // The nominal clock is at least as fast as the slowest clock, for which the rate is
        // guaranteed.
        prop_assert!(frame_s[0] <= 1.0 / f64::from(rate) + 2e-9);
    }
    Ok(())
}

/// A refusal names the highest possible rate. Three registers of 47 bit times and a stop at 400 kHz
/// take 355 us, the master 10 us more: 2,739 frames per second. Without STATUS the sum is 247.5 us,
/// or 4,040 frames per second. The step of RCOUNT makes a conversion up to 0.5 us longer.
#[test]
fn a_refusal_of_a_rate_says_what_is_possible() {
    for (status_reads, most) in [(true, 2_735..=2_739), (false, 4_030..=4_040)] {
        let request = Request {
            status_reads,
            ..single(30_000_000).rate(Rate::PerSecond(5_000))
        };
        let Err(LimitError::BusTooSlow {
            most_per_second, ..
        }) = request.plan()
        else {
            panic!("{:?}", request.plan());
        };
        assert!(most.contains(&most_per_second), "{most_per_second}");
        let text = request.plan().unwrap_err().to_string();
        let possible = format!("{most_per_second} frames a second are possible");
        assert!(text.contains(&possible), "{text}");
    }
}

/// A sensor of 1 kHz has half a period in the 0.5 ms of a frame: the plan lengthens conversions.
#[test]
fn a_conversion_holds_six_periods_of_a_slow_sensor() {
    let slow = single(40_000_000).sensor(Channel::Zero, Sensor::new(1_000, 2_000));
    let plan = slow.plan().unwrap();
    let scale = plan.configuration.scale(Channel::Zero);
    assert!((scale.conversion_s() - 6e-3).abs() < 1e-6);
    assert!(slow.rate(Rate::PerSecond(166)).plan().is_ok());
    let refusal = slow.rate(Rate::PerSecond(167)).plan().unwrap_err();
    assert!(
        matches!(
            refusal,
            LimitError::RateTooHigh {
                most_per_second: 166,
                ..
            }
        ),
        "{refusal}"
    );
}

/// At 20 MHz the longest conversion takes 52 ms, less than a frame at 10 Hz, more than at 20 Hz.
#[test]
fn at_a_slow_rate_a_conversion_is_as_long_as_the_counter_allows() {
    for (rate, longest) in [(1, true), (10, true), (20, false)] {
        let plan = single(40_000_000).rate(Rate::PerSecond(rate)).plan();
        let rcount = plan.unwrap().configuration.channel(Channel::Zero).rcount;
        assert_eq!(rcount == Rcount::MAX, longest, "{rate}: {rcount:?}");
    }
}
