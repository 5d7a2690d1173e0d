//! Control interrupt: in every period of the bridge's PWM it takes two current samples and sets two
//! pulse widths.
//!
//! The PWM counts up and down (phase-correct), so its pulses are centred on the start of the period. The
//! ADC converts continuously and starts [`BRIDGE_DELAY_NS`] after the PWM: current at the start and in
//! the middle of every period of the bridge's outputs, and thermistor, supply and processor temperature in
//! between. DMA writes the eight results into a ring of eight slots, so each has its own slot. A second
//! PWM slice triggers the interrupt before the mid-period current is available.

#![allow(unsafe_code)]

pub mod precedence;
mod timing;

use core::cell::UnsafeCell;
use core::mem::MaybeUninit;
use core::sync::atomic::{AtomicBool, AtomicU32, Ordering, compiler_fence};

use coil_hbridge::{Averages, Drive, Order, Output, Trace};
use cortex_m::peripheral::NVIC;
use palpate_node::board::{BRIDGE_DELAY_NS, CORE_MHZ, FULL_LEVEL, cycles};
use palpate_node::coil::{AVERAGED_BLOCKS, LastPeriod, SlowReadings, TRACE_LENGTH};
use rp2040_pac::{ADC, DMA, Interrupt, PWM, RESETS};
use rtic_monotonics::rp2040::prelude::*;

use crate::Mono;
use crate::board::pins::{self, Function};
use crate::board::rp2040::wait;
use crate::board::safe;
use timing::{CONTROL_SLICE, CYCLES};

/// Mask of the two PWM slices: the one that triggers the interrupt, and the bridge's.
const SLICES: u32 = 1 << CONTROL_SLICE | 1 << pins::COIL_SLICE;
/// Time in the bridge's period at which the control slice triggers the interrupt, in nanoseconds. Levels
/// have to be written before the period's end, and what preempts the interrupt takes up to 4 us at a USB
/// host: a later trigger brings some levels too late.
const TRIGGER_NS: u32 = 10_250;
/// Count at which the control slice starts, together with a period of the bridge's slice.
const CONTROL_BEGINS: u32 = CYCLES - cycles(TRIGGER_NS);
/// Time in the bridge's period at which the mid-period current is in its slot, in nanoseconds: 8 us to the
/// middle, the bridge's delay, 2 us for the conversion, and 100 ns for the ADC's synchronisation and DMA.
const CONVERTED_NS: u32 = 8_000 + BRIDGE_DELAY_NS + 2_000 + 100;
/// [`CONVERTED_NS`] as a count of the control slice. What delays the interrupt, such as the stamp
/// of an edge, passes during the conversion.
const CONVERTED: u32 = cycles(CONVERTED_NS.saturating_sub(TRIGGER_NS));
/// Maximum number of polls of the count, four cycles or more each, until it reaches [`CONVERTED`].
const LOOKS: u32 = CONVERTED / 4;
/// Number of loops of 39 cycles in [`start_together`] for the bridge's delay; the rest of it takes nine.
const LOOPS: u32 = cycles(BRIDGE_DELAY_NS).saturating_sub(9) / 39;
/// Cycles for which a task masks the interrupt for short work, such as a report, which takes 110.
/// Includes bus interrupts that may run meanwhile.
const SHORT: u32 = 200;
/// Cycles for which a task masks the interrupt for long work, such as a waveform of 48 lines, which
/// takes 800. Includes bus interrupts that may run meanwhile.
const LONG: u32 = 1_200;
/// Maximum number of attempts of a task to mask the interrupt. An attempt takes twenty cycles, so all of
/// them take ten periods.
const TRIES: u32 = 10 * CYCLES / 20;
/// Register PWM.CSR: count up and down.
const PHASE_CORRECT: u32 = 1 << 1;
/// Register ADC.CS: enabled, temperature sensor on, free-running, round robin over inputs 0, 1, 2 and 4.
const CONVERT: u32 = 1 | 1 << 1 | 1 << 3 | 0b10111 << 16;
/// Register ADC.CS: enabled, temperature sensor on.
const POWERED: u32 = 1 | 1 << 1;
/// Register ADC.FCS: FIFO on, DMA request while the FIFO holds at least one result (datasheet 4.9.2.5).
/// With a threshold of 0 the ADC would always request, and DMA would copy results that do not exist.
const FIFO_TO_DMA: u32 = 1 | 1 << 3 | 1 << 24;
/// Register ADC.FCS: the FIFO underflowed or overflowed. Both bits stay set until they are cleared.
const RESULTS_LOST: u32 = 1 << 10 | 1 << 11;
/// Control register of a DMA channel: enabled, half-words, write address wrapping in a ring of 16 bytes,
/// paced by the ADC's FIFO.
const CARRY: u32 = 1 | 1 << 2 | 1 << 5 | 4 << 6 | 1 << 10 | 36 << 15;
/// Number of results after which one DMA channel hands over to the other, about once an hour. It is a
/// multiple of the ring length, so every result stays in its slot.
const RESULTS: u32 = 0x6000_0000;

/// Number of ADC results per period, and of slots in the ring.
const RING: usize = 8;
/// Ring slots that hold the two current samples of a period.
const CURRENT: [usize; 2] = [0, 4];
/// Slot in the ring of the thermistor's result.
const THERMISTOR: usize = 5;
/// Slot in the ring of the supply's result.
const SUPPLY: usize = 6;

#[repr(C, align(16))]
struct Ring(UnsafeCell<[u16; RING]>);

// SAFETY: written by DMA alone, read by half-words.
unsafe impl Sync for Ring {}

static RESULTS_RING: Ring = Ring(UnsafeCell::new([0; RING]));

/// State of the interrupt. For the order of the fields see [`Drive`].
#[repr(C)]
struct Control {
    /// The bridge is awake and its limit pin is in its normal state.
    drives: bool,
    awake: bool,
    limit_low: bool,
    drive: Drive,
}

struct ControlCell(UnsafeCell<MaybeUninit<Control>>);

// SAFETY: `start` writes the cell before it sets `IS_STARTED`, and the interrupt cannot run before that.
// After that the interrupt uses the cell, and tasks use it only while the interrupt is masked: `masked_for`.
unsafe impl Sync for ControlCell {}

static CONTROL: ControlCell = ControlCell(UnsafeCell::new(MaybeUninit::uninit()));
static IS_STARTED: AtomicBool = AtomicBool::new(false);

/// Block averages of the measured current.
pub static AVERAGES: Averages<AVERAGED_BLOCKS> = Averages::new();

/// Measured current period by period, when a trace is requested.
pub static TRACE: Trace<TRACE_LENGTH> = Trace::new();

/// Supply result when the bridge last went off; [`NONE`] after it was taken.
static SUPPLY_AT_OFF: AtomicU32 = AtomicU32::new(NONE);
/// Content of [`SUPPLY_AT_OFF`] without a result.
const NONE: u32 = u32::MAX;

/// Takes the supply result of the moment at which the bridge went off; `None` on later calls.
pub fn take_supply_at_off() -> Option<u16> {
    let result = SUPPLY_AT_OFF.load(Ordering::Relaxed);
    SUPPLY_AT_OFF.store(NONE, Ordering::Relaxed);
    u16::try_from(result).ok()
}

/// Sets up and starts PWM, ADC and DMA, with the bridge off.
pub fn start(drive: Drive) {
    // SAFETY: nothing else uses the cell; the interrupt is not enabled yet.
    unsafe {
        (*CONTROL.0.get()).write(Control {
            drive,
            drives: false,
            awake: false,
            limit_low: false,
        });
    }
    IS_STARTED.store(true, Ordering::Release);
    begin();
}

/// Sets up and starts PWM, ADC and DMA; ADC and DMA come from reset.
fn begin() {
    // SAFETY: nothing else uses these slices, the ADC or DMA.
    unsafe {
        let (pwm, adc) = (&*PWM::ptr(), &*ADC::ptr());
        let others = pwm.en().read().bits() & !SLICES;
        pwm.en().write(|w| w.bits(others));
        adc.cs().write(|w| w.bits(POWERED));
        wait(|| adc.cs().read().ready().bit_is_set());
        let dma = &*DMA::ptr();
        set_up(dma.ch(1));
        dma.ch(1).ch_al1_ctrl().write(|w| w.bits(CARRY));
        set_up(dma.ch(0));
        // At the end of this channel's results the other channel takes over.
        let chained = CARRY | 1 << 11;
        dma.ch(0).ch_ctrl_trig().write(|w| w.bits(chained));
        let bridge = pwm.ch(pins::COIL_SLICE);
        bridge.csr().write(|w| w.bits(PHASE_CORRECT));
        bridge.top().write(|w| w.bits(u32::from(FULL_LEVEL) - 1));
        bridge.cc().write(|w| w.bits(0));
        bridge.ctr().write(|w| w.bits(0));
        let control = pwm.ch(CONTROL_SLICE);
        control.csr().write(|w| w.bits(0));
        control.top().write(|w| w.bits(CYCLES - 1));
        control.ctr().write(|w| w.bits(CONTROL_BEGINS));
        adc.fcs().write(|w| w.bits(FIFO_TO_DMA));
        start_together(others | SLICES);
    }
}

/// Restarts ADC and DMA so that every result is in its slot again, while the bridge is off.
#[inline(never)]
fn begin_anew() {
    // SAFETY: only tasks change these registers, and no other task runs during this function.
    let resets = unsafe { &*RESETS::ptr() };
    resets
        .reset()
        .modify(|_, w| w.adc().set_bit().dma().set_bit());
    resets
        .reset()
        .modify(|_, w| w.adc().clear_bit().dma().clear_bit());
    let is_done = || {
        let done = resets.reset_done().read();
        done.adc().bit_is_set() && done.dma().bit_is_set()
    };
    if wait(is_done) {
        begin();
    }
}

/// Returns whether a result was lost, so that the results are not in their slots.
#[inline(always)]
fn has_lost_results() -> bool {
    // SAFETY: a register is read.
    unsafe { (*ADC::ptr()).fcs().read().bits() & RESULTS_LOST != 0 }
}

/// Starts the PWM and, after the bridge's delay, the ADC. Any other delay between the two moves every
/// sample away from the point where the ripple crosses its mean, and shifts all measured currents: a
/// fetch from flash takes 0.36 us, which is 45 mA at 12 V and 40 uH. So this function is never inlined
/// into its caller, which is in flash (build.rs), and runs with interrupts off. Most of its cycles are
/// `nop`, of one cycle each.
#[inline(never)]
fn start_together(slices: u32) {
    cortex_m::interrupt::free(|_| {
        // SAFETY: both blocks are set up, and nothing else writes these registers.
        unsafe {
            core::arch::asm!(
                "str {slices}, [{pwm}]",
                "b 3f",
                "2: .rept 36",
                "nop",
                ".endr",
                "3: subs {loops}, #1",
                "bpl 2b",
                "str {convert}, [{adc}]",
                slices = in(reg) slices,
                pwm = in(reg) (*PWM::ptr()).en().as_ptr(),
                convert = in(reg) CONVERT,
                adc = in(reg) (*ADC::ptr()).cs().as_ptr(),
                loops = inout(reg) LOOPS => _,
                options(nostack),
            );
        }
    });
}

/// Sets up a DMA channel from the ADC's FIFO into the ring.
fn set_up(channel: &rp2040_pac::dma::CH) {
    // SAFETY: an address of a register and one of a static.
    unsafe {
        let from = (*ADC::ptr()).fifo().as_ptr() as u32;
        channel.ch_read_addr().write(|w| w.bits(from));
        let to = RESULTS_RING.0.get() as u32;
        channel.ch_write_addr().write(|w| w.bits(to));
        channel.ch_trans_count().write(|w| w.bits(RESULTS));
    }
}

/// Enables or disables the interrupt. The bridge is off when it is disabled.
pub fn run(on: bool) {
    if !IS_STARTED.load(Ordering::Acquire) {
        return;
    }
    // SAFETY: no other slice's wrap triggers this interrupt.
    unsafe {
        let pwm = &*PWM::ptr();
        pwm.intr().write(|w| w.bits(1 << CONTROL_SLICE));
        pwm.inte().write(|w| w.bits(u32::from(on) << CONTROL_SLICE));
    }
    precedence::set_on(on);
}

/// Returns the number of the last period in [`AVERAGES`] and the time of its end.
///
/// The mean of its two samples, at the start and in the middle of a bridge period, is the current
/// halfway between them. It equals the mean over one period centred there, which ends three microseconds
/// after the interrupt was triggered.
pub fn last() -> LastPeriod {
    const AFTER_CALL_US: u32 = 3;
    // Reads the timer and the control slice's count together: anything that ran between the two reads
    // would shift the window by its run time.
    let read = || {
        cortex_m::interrupt::free(|_| {
            let count = count();
            let now_us = Mono::now().as_ticks();
            let called_us = now_us.saturating_sub(u64::from(count / CORE_MHZ));
            let last = LastPeriod {
                number: AVERAGES.now(),
                ended_us: called_us + u64::from(AFTER_CALL_US),
            };
            (last, NVIC::is_pending(Interrupt::PWM_IRQ_WRAP))
        })
    };
    match read() {
        (last, false) => last,
        // A period ended during the first read; the second read counts it. No other ends so soon.
        (_, true) => read().0,
    }
}

/// Gives access to the drive with the interrupt masked for about a microsecond: for a report or a small
/// order.
pub fn with_drive<T>(work: impl FnOnce(&mut Drive) -> T) -> Option<T> {
    masked_for(SHORT, work)
}

/// Applies an order of any kind.
pub fn apply(order: &Order) {
    masked_for(LONG, |drive| drive.apply(order));
}

/// Gives access to the drive with the interrupt masked for up to `cycles`. Starts when the interrupt is
/// not due within this time.
fn masked_for<T>(cycles: u32, work: impl FnOnce(&mut Drive) -> T) -> Option<T> {
    if !IS_STARTED.load(Ordering::Acquire) {
        return None;
    }
    // No other task runs meanwhile, so none unmasks the interrupt during the work.
    critical_section::with(|_| {
        let latest = CYCLES - cycles;
        // One of the attempts succeeds within a period: the interrupt runs for less than a period minus
        // `cycles`.
        let _ = (0..TRIES).any(|_| mask_before(latest));
        // Masks in any case: an interrupt that writes its level late is better than an order that is
        // never applied.
        NVIC::mask(Interrupt::PWM_IRQ_WRAP);
        cortex_m::asm::dsb();
        // SAFETY: see `ControlCell`.
        let control = unsafe { (*CONTROL.0.get()).assume_init_mut() };
        if !control.awake && has_lost_results() {
            begin_anew();
        }
        let done = work(&mut control.drive);
        // All changes must be in memory before the interrupt can see them.
        compiler_fence(Ordering::SeqCst);
        // SAFETY: the interrupt was enabled before: `vectors` enables it at start-up.
        unsafe { NVIC::unmask(Interrupt::PWM_IRQ_WRAP) };
        Some(done)
    })
}

/// Masks the interrupt unless it is pending or its slice has counted to `latest`. Returns whether it is
/// masked.
fn mask_before(latest: u32) -> bool {
    NVIC::mask(Interrupt::PWM_IRQ_WRAP);
    cortex_m::asm::dsb();
    let is_early = count() < latest && !NVIC::is_pending(Interrupt::PWM_IRQ_WRAP);
    if !is_early {
        // SAFETY: as in `masked_for`.
        unsafe { NVIC::unmask(Interrupt::PWM_IRQ_WRAP) };
    }
    is_early
}

/// Returns the count of the control slice: cycles since it triggered the interrupt.
#[inline(always)]
fn count() -> u32 {
    // SAFETY: a register is read.
    unsafe { (*PWM::ptr()).ch(CONTROL_SLICE).ctr().read().bits() }
}

#[inline]
fn result(index: usize) -> u16 {
    // SAFETY: within the ring; DMA writes whole half-words.
    unsafe {
        RESULTS_RING
            .0
            .get()
            .cast::<u16>()
            .add(index % RING)
            .read_volatile()
    }
}

/// Returns the last results of thermistor and supply.
pub fn slow_readings() -> SlowReadings {
    SlowReadings {
        thermistor: result(THERMISTOR),
        supply: result(SUPPLY),
    }
}

/// Control interrupt: runs once per period.
pub unsafe extern "C" fn on_period() {
    precedence::begin();
    // SAFETY: clears the flag of the slice that called.
    unsafe {
        (*PWM::ptr()).intr().write(|w| w.bits(1 << CONTROL_SLICE));
    }
    let faulty = !pins::is_high(pins::BRIDGE_FAULT);
    // SAFETY: see `ControlCell`: tasks mask this interrupt, and `run` has enabled it.
    let control = unsafe { (*CONTROL.0.get()).assume_init_mut() };
    let output = control.drive.tick(faulty, || {
        let _ = (0..LOOKS).any(|_| count() >= CONVERTED);
        let [first, second] = CURRENT;
        let samples = [result(first), result(second)];
        (!has_lost_results()).then_some(samples)
    });
    control.apply(output);
    precedence::end();
    if control.drive.account(&AVERAGES) {
        control.apply(Output::OFF);
    }
    TRACE.push(control.drive.measured());
}

fn set_levels(levels: u32) {
    // SAFETY: the slice belongs to the coil; two half-words.
    unsafe {
        (*PWM::ptr())
            .ch(pins::COIL_SLICE)
            .cc()
            .write(|w| w.bits(levels));
    }
}

impl Control {
    #[inline(always)]
    fn apply(&mut self, output: Output) {
        if output.awake {
            let levels = output.levels;
            set_levels(u32::from(levels.in2) << 16 | u32::from(levels.in1));
        }
        let drives = output.awake && !output.limit_low;
        if !(drives && self.drives) {
            self.turn(output);
        }
    }

    #[inline(never)]
    fn turn(&mut self, output: Output) {
        if output.awake && !self.awake {
            pins::set_function(pins::IN1, Function::Pwm);
            pins::set_function(pins::IN2, Function::Pwm);
            pins::set(pins::BRIDGE_ENABLE, true);
        } else if self.awake && !output.awake {
            safe::bridge_off();
            set_levels(0);
            SUPPLY_AT_OFF.store(result(SUPPLY).into(), Ordering::Relaxed);
        }
        self.awake = output.awake;
        self.drives = output.awake && !output.limit_low;
        if output.limit_low != self.limit_low {
            self.limit_low = output.limit_low;
            pins::open_drain(pins::BRIDGE_LIMIT, output.limit_low);
        }
    }
}
