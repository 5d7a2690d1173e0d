//! Runs the drive on a simulated coil of 40 uH and 0.4 ohm at 12 V, on any PC: the self-test, then
//! two ramps from 8 A to 2 A. Prints one text line per millisecond.
//!
//! ```text
//! cargo run -p coil-hbridge --example simulated
//! ```

use coil_hbridge::{
    Averages, CurrentLine, Decay, Drive, Hardware, Limits, Output, Refusal, Supervisor,
};

const HARDWARE: Hardware = Hardware {
    period_s: 16e-6,
    full_level: 960,
    ampere_per_count: 3.3 / 4096.0 / 0.125,
    zero_count: 2048,
    zero_tolerance: 64,
    greatest_count: 4095,
    diode_v: 0.8,
    decay: Decay::Fast,
    wake_s: 2e-3,
    reduced_limit_a: None,
};
const LIMITS: Limits = Limits {
    setpoint_a: 12.0,
    trip_a: 12.7,
    duty: 0.98,
    on_time_s: 20.0,
    energy_j: 60.0,
    continuous_w: 3.5,
    supply_v: [4.5, 14.0],
    resistance_ohm: [0.15, 3.0],
    inductance_h: [10e-6, 400e-6],
};
const SUPPLY_V: f32 = 12.0;
/// Periods of the PWM in a millisecond.
const PERIODS: u32 = 62;

static AVERAGES: Averages<512> = Averages::new();

/// Bridge, coil and amplifier.
#[derive(Default)]
struct SimulatedBoard {
    current_a: f32,
    written: Output,
}

impl SimulatedBoard {
    /// Runs one PWM period: feeds two samples to the drive, whose two levels take effect from the
    /// next period on.
    fn period(&mut self, drive: &mut Drive) {
        let count = (2048.5 + self.current_a / HARDWARE.ampere_per_count) as u16;
        let output = drive.tick(false, || Some([count, count]));
        let acts = core::mem::replace(&mut self.written, output);
        if drive.account(&AVERAGES) {
            self.written = Output::OFF;
        }
        let Output { awake, levels, .. } = acts;
        let part = (f32::from(levels.in1) - f32::from(levels.in2)) / 960.0;
        let coil_v = if awake { SUPPLY_V * part } else { 0.0 };
        self.current_a += (coil_v - 0.4 * self.current_a) * HARDWARE.period_s / 40e-6;
    }

    /// Runs one millisecond: the PWM periods of the interrupt, then the supervisor's task.
    fn millisecond(&mut self, drive: &mut Drive, supervisor: &mut Supervisor) {
        (0..PERIODS).for_each(|_| self.period(drive));
        let order = supervisor.attend(&drive.report(), SUPPLY_V, PERIODS * 16);
        drive.apply(&order);
    }
}

fn main() -> Result<(), Refusal> {
    let (mut supervisor, mut drive) = Supervisor::new(HARDWARE, LIMITS)?;
    let mut board = SimulatedBoard::default();

    drive.apply(&supervisor.test(&drive.report(), SUPPLY_V)?);
    (0..300).for_each(|_| board.millisecond(&mut drive, &mut supervisor));
    println!("{:?}", supervisor.findings());

    // Current lines of two ramps: current at the end of the line, A, and duration, s.
    let mut lines = [(8.0, 2e-3), (8.0, 3e-3), (2.0, 10e-3)]
        .repeat(2)
        .into_iter();
    for time_ms in 1..=32_u64 {
        // The next line starts when the previous one has ended.
        if drive.report().holds || time_ms == 1 {
            let (to_a, over_s) = lines.next().unwrap_or((0.0, 2e-3));
            let line = CurrentLine::at_once(to_a, over_s);
            drive.apply(&supervisor.follow(&drive.report(), &line, || time_ms * 1_000)?);
        }
        board.millisecond(&mut drive, &mut supervisor);
        let now = AVERAGES.now();
        let since = now.wrapping_sub(PERIODS);
        let mean_a = AVERAGES.mean_a(since.into(), now.into(), &HARDWARE);
        println!("{time_ms:3} ms  {:6.3} A", mean_a.unwrap_or_default());
    }
    println!("{:?}", drive.state());
    Ok(())
}
