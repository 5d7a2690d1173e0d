//! The USB controller, by the HAL's driver, and around it what that and `usb-device` leave open.
//!
//! Both take the bus to be quick and the host to keep all rules. The interrupt of USB, though, may wait
//! for milliseconds, and a host may do anything. What is added is at [`Bus`].
//!
//! Its voltage detection is overridden: a Pico has no pin for it (Raspberry Pi Pico datasheet, 4.1). A
//! cable that is pulled is then seen as a bus that rests.

#![allow(unsafe_code)]

use core::cell::Cell;

use cortex_m::peripheral::NVIC;
use critical_section::Mutex;
use palpate_node::link::UsbFrames;
use rp2040_hal::clocks::ClocksManager;
use rp2040_hal::usb::UsbBus;
use rp2040_pac::usbctrl_regs::RegisterBlock;
use rp2040_pac::{CLOCKS, Interrupt, RESETS, TIMER, USBCTRL_DPRAM, USBCTRL_REGS};
use usb_device::bus::{PollResult, UsbBus as UsbBusTrait, UsbBusAllocator};
use usb_device::endpoint::{EndpointAddress, EndpointType};
use usb_device::{Result, UsbDirection, UsbError};

use super::wait;

const INTERRUPT: Interrupt = Interrupt::USBCTRL_IRQ;

/// Starts the controller, whose clock runs already. Nothing if it does not come out of its reset.
pub fn set_up(
    registers: USBCTRL_REGS,
    memory: USBCTRL_DPRAM,
    clocks: CLOCKS,
    resets: &mut RESETS,
) -> Option<UsbBusAllocator<Bus>> {
    resets.reset().modify(|_, w| w.usbctrl().set_bit());
    resets.reset().modify(|_, w| w.usbctrl().clear_bit());
    // The HAL waits for this as well, without a bound: it is done then.
    if !wait(|| resets.reset_done().read().usbctrl().bit_is_set()) {
        return None;
    }
    // Only for the proof that there is a clock; nothing of it is changed.
    let clock = ClocksManager::new(clocks).usb_clock;
    let bus = UsbBus::new(registers, memory, clock, true, resets);
    Some(UsbBusAllocator::new(Bus::new(bus)))
}

/// Frames wait: the interrupt is to look after them.
pub fn call() {
    NVIC::pend(INTERRUPT);
}

/// Packets that have come wait for room, and do not call the interrupt meanwhile. The start of a frame does:
/// without it the end of a frame would not be known, and everything else would wait as well.
pub fn hold_back() {
    interrupts().modify(|_, w| w.buff_status().clear_bit());
}

/// Packets call the interrupt again.
pub fn let_through() {
    interrupts().modify(|_, w| w.buff_status().set_bit());
}

/// What calls the interrupt.
fn interrupts() -> &'static rp2040_pac::usbctrl_regs::INTE {
    // SAFETY: only the interrupt of USB and tasks of its priority change this register after the start.
    unsafe { (*USBCTRL_REGS::ptr()).inte() }
}

/// The longest data stage that `usb-device` takes from a host (its `CONTROL_BUF_LEN`).
const LONGEST_DATA: u16 = 128;
/// A setup packet of a type that there is not (USB 2.0 table 9-2): refused by everybody.
const REFUSED: [u8; 8] = [0x60, 0, 0, 0, 0, 0, 0, 0];
/// The first two bytes of requests after which packets begin with DATA0 (USB 2.0 9.1.1.5).
const SET_CONFIGURATION: [u8; 2] = [0x00, 9];
const SET_INTERFACE: [u8; 2] = [0x01, 11];
const SET_ADDRESS: [u8; 2] = [0x00, 5];
/// From the rest of a buffer's word to AVAILABLE, cycles: a period of 48 MHz is five of 200 MHz, and the
/// datasheet rounds up (RP2040 datasheet 4.1.2.5.1).
const SETTLING: u32 = 12;
/// The longest transaction of endpoint 0, in cycles: token, 64 bytes with their stuffed bits, handshake
/// and the gaps between are 710 bits of 12 Mbit/s (USB 2.0 7.1.9, 7.1.18.1, 8.4), 59.2 us of 200 MHz.
const LONGEST_TRANSACTION: u32 = 12_000;

/// A frame has begun by then, us, if there are any.
const LONGEST_WAIT_US: u32 = 1_000;

/// The timer's lower word, us.
fn now_us() -> u32 {
    // SAFETY: reading this register has no effect on it.
    unsafe { (*TIMER::ptr()).timerawl().read().bits() }
}

/// The bus that USB's classes are written for: the HAL's driver, with this around it.
///
/// - A packet of endpoint 0 that finds no room or that nothing waits for is thrown away. Where it was
///   left, its interrupt came again at once, without end.
/// - A request with more data than `usb-device` takes is refused. It was left without an answer.
/// - Nothing stays armed on endpoint 0 when a transfer is over: a packet of it would be taken for one of
///   the next transfer, whose setup packet waits for the processor. Nor is that refused for the former.
/// - A setup packet from before a reset of the bus is not answered after it.
/// - Data beyond those that a request announced are refused. The status that waits is taken back before:
///   the next transfer would get it.
/// - A request is refused if its data may have gone where the transfer before it waited for some, which
///   the host gave up. It was left waiting.
/// - Packets begin with DATA0 again where USB wants it.
/// - A setup packet that comes while the one before is copied is not lost, and what was an answer to that one
///   is not made available after it.
/// - An address counts only if the request for it has come to its end.
/// - A packet of endpoint 0 that the host takes while the driver clears the marks of others is not
///   missed.
/// - Which packets the host has taken is known, even when the bus is reset after that.
/// - The end of a frame is known, in which no bulk packet may be made available.
pub struct Bus {
    hal: UsbBus,
    frames: Mutex<Cell<UsbFrames>>,
    control: Mutex<Cell<Control>>,
    /// The bus was reset: IN endpoints whose packet was taken before, a bit each.
    reset: Mutex<Cell<Option<u16>>>,
}

/// What became of the packet that an IN endpoint had.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sent {
    /// It waits for the host.
    Not,
    /// The host has taken it, or there was none.
    Taken,
    /// The bus was reset before the host took it.
    Lost,
}

/// The control transfer under way.
#[derive(Clone, Copy, Default)]
struct Control {
    setup: [u8; 8],
    /// The setup packet has come, and was not read yet.
    is_new: bool,
    /// A packet waits for the host, or that it was taken was not reported yet.
    is_waiting: bool,
    /// When the setup packet came there were data whose request is not known.
    has_data_before: bool,
}

impl Control {
    const fn is_in(&self) -> bool {
        let [kind, ..] = self.setup;
        kind & 0x80 != 0
    }

    /// wLength.
    const fn length(&self) -> u16 {
        let [.., low, high] = self.setup;
        u16::from_le_bytes([low, high])
    }

    /// Whether its data are more than `usb-device` takes, or may be gone.
    const fn is_refused(&self) -> bool {
        let announces = !self.is_in() && self.length() > 0;
        announces && (self.length() > LONGEST_DATA || self.has_data_before)
    }

    /// bmRequestType and bRequest.
    const fn request(&self) -> [u8; 2] {
        let [kind, request, ..] = self.setup;
        [kind, request]
    }
}

impl Bus {
    const fn new(hal: UsbBus) -> Self {
        let control = Control {
            setup: REFUSED,
            is_new: false,
            is_waiting: false,
            has_data_before: false,
        };
        Self {
            hal,
            frames: Mutex::new(Cell::new(UsbFrames::new())),
            control: Mutex::new(Cell::new(control)),
            reset: Mutex::new(Cell::new(None)),
        }
    }

    /// What became of the packet of an IN endpoint. For one endpoint: a reset is reported once.
    pub fn sent(&self, endpoint: EndpointAddress) -> Sent {
        let before = critical_section::with(|section| self.reset.borrow(section).take());
        match before {
            Some(taken) if taken >> endpoint.index() & 1 == 0 => Sent::Lost,
            Some(_) => Sent::Taken,
            None if is_armed(word(endpoint.index(), true)) => Sent::Not,
            None => Sent::Taken,
        }
    }

    /// Makes a bulk packet available, if that is allowed now. Nothing but the interrupts that no critical
    /// section holds back comes between the question and what is done. Where it is not allowed, the start of
    /// the next frame calls the interrupt.
    pub fn before_end_of_frame<T>(&self, make_available: impl FnOnce() -> T) -> Option<T> {
        critical_section::with(|section| {
            self.follow_frames();
            let frames = self.frames.borrow(section).get();
            (!frames.is_at_end(now_us())).then(make_available)
        })
    }

    /// Looks whether a frame has begun: reading its number ends the interrupt.
    fn follow_frames(&self) {
        // SAFETY: only the interrupt of USB reads these registers.
        let registers = unsafe { &*USBCTRL_REGS::ptr() };
        critical_section::with(|section| {
            let frames = self.frames.borrow(section);
            let mut followed = frames.get();
            let looked_us = now_us();
            if registers.intr().read().dev_sof().bit_is_set() {
                followed.found_start(now_us());
                let _ = registers.sof_rd().read();
            } else {
                followed.found_none(looked_us);
            }
            frames.set(followed);
        });
    }

    /// The host may begin its frames anew.
    fn forget_frames(&self) {
        critical_section::with(|section| self.frames.borrow(section).set(UsbFrames::new()));
    }

    fn control(&self) -> Control {
        critical_section::with(|section| self.control.borrow(section).get())
    }

    fn set_control(&self, control: Control) {
        critical_section::with(|section| self.control.borrow(section).set(control));
    }

    /// Whether a packet of endpoint 0 was taken and its mark is gone: the driver reads the marks of
    /// all endpoints first, and clears them all later.
    fn has_missed_sent(&self, result: &PollResult) -> bool {
        let is_reported = match result {
            // A setup packet ends whatever waited.
            PollResult::Data {
                ep_in_complete,
                ep_setup,
                ..
            } => (ep_in_complete | ep_setup) & 1 == 1,
            PollResult::Reset => true,
            _ => false,
        };
        // SAFETY: reading this register has no effect on it.
        let registers = unsafe { &*USBCTRL_REGS::ptr() };
        let is_marked = registers.buff_status().read().bits() & 1 == 1;
        self.control().is_waiting && !is_reported && !is_marked && !is_armed(IN_0)
    }

    /// A setup packet has come: nothing of the transfer before it goes on. A transaction in whose midst a
    /// buffer is taken back comes to its end here.
    fn end_before_setup(control: &mut Control) {
        let was_armed = is_armed(OUT_0);
        let mut has_come = false;
        if control.is_waiting || was_armed {
            [IN_0, OUT_0].into_iter().for_each(disarm);
            cortex_m::asm::delay(LONGEST_TRANSACTION);
            // SAFETY: only the interrupt of USB writes this register; a bit that is set is cleared.
            let registers = unsafe { &*USBCTRL_REGS::ptr() };
            // A packet that came while its buffer was taken back has lost what the controller wrote into the buffer's
            // word, and keeps its mark here.
            has_come = registers.buff_status().read().ep0_out().bit_is_set();
            registers
                .buff_status()
                .write(|w| w.ep0_in().clear_bit_by_one());
        }
        control.is_waiting = false;
        // A buffer that waits for the other PID drops a packet and stays armed.
        let has_dropped = has_dropped_packet();
        control.has_data_before = has_data(OUT_0) || was_armed && (has_come || has_dropped);
    }

    /// The next packet of an endpoint has DATA0. One that waits for the host stays where it is.
    fn begin_with_data0(&self, word: usize) {
        // SAFETY: only the interrupt of USB writes the words of the buffers.
        let memory = unsafe { &*USBCTRL_DPRAM::ptr() };
        let control = memory.ep_buffer_control(word);
        let was_armed = is_armed(word);
        disarm(word);
        // The driver inverts it when it arms the buffer.
        control.modify(|_, w| w.pid_0().bit(!was_armed));
        if was_armed {
            cortex_m::asm::delay(SETTLING);
            let make_available = || control.modify(|_, w| w.available_0().set_bit());
            let since_us = now_us();
            while self.before_end_of_frame(make_available).is_none() {
                // Without frames the host does not ask for it.
                if now_us().wrapping_sub(since_us) > LONGEST_WAIT_US {
                    make_available();
                    break;
                }
            }
        }
    }

    /// The driver has read a setup packet.
    fn begin(&self, buffer: &mut [u8]) {
        let Some(setup) = buffer.first_chunk_mut() else {
            return;
        };
        take_later_setup(setup);
        let control = Control {
            setup: *setup,
            is_new: false,
            is_waiting: false,
            ..self.control()
        };
        self.set_control(control);
        if control.is_refused() {
            *setup = REFUSED;
        }
        // The driver waits for the end of data that do not come.
        if control.is_in() && control.length() == 0 {
            disarm(OUT_0);
        }
        if [SET_CONFIGURATION, SET_INTERFACE].contains(&control.request()) {
            (1..16).for_each(|index| {
                self.begin_with_data0(2 * index);
                self.begin_with_data0(2 * index + 1);
            });
        }
    }
}

/// Endpoint 0's words among those of the buffers.
const IN_0: usize = 0;
const OUT_0: usize = 1;

/// The word of an endpoint's buffer.
const fn word(endpoint: usize, is_in: bool) -> usize {
    2 * endpoint + if is_in { IN_0 } else { OUT_0 }
}

/// Whether the controller has an endpoint's buffer.
fn is_armed(word: usize) -> bool {
    // SAFETY: reading a word of the buffers has no effect on it.
    let memory = unsafe { &*USBCTRL_DPRAM::ptr() };
    let control = memory.ep_buffer_control(word).read();
    control.available_0().bit_is_set()
}

/// Whether data have come to an OUT endpoint that were not read.
fn has_data(word: usize) -> bool {
    // SAFETY: reading a word of the buffers has no effect on it.
    let memory = unsafe { &*USBCTRL_DPRAM::ptr() };
    let control = memory.ep_buffer_control(word).read();
    control.full_0().bit_is_set() && control.length_0().bits() > 0
}

/// Whether a packet with the wrong PID was acknowledged and dropped, at any endpoint, since this was asked
/// (RP2040 datasheet 4.1.4, DATA_SEQ_ERROR).
fn has_dropped_packet() -> bool {
    // SAFETY: only the interrupt of USB writes this register; a bit that is set is cleared.
    let registers = unsafe { &*USBCTRL_REGS::ptr() };
    let has_dropped = registers.sie_status().read().data_seq_error().bit_is_set();
    registers
        .sie_status()
        .write(|w| w.data_seq_error().clear_bit_by_one());
    has_dropped
}

/// From now on the first token of endpoint 0 for which there is no buffer calls the interrupt, once.
fn watch_for_refusal() {
    // SAFETY: only the interrupt of USB writes these registers; a bit that is set is cleared.
    let registers = unsafe { &*USBCTRL_REGS::ptr() };
    clear_refusals(registers);
    registers
        .sie_ctrl()
        .modify(|_, w| w.ep0_int_nak().set_bit());
}

fn clear_refusals(registers: &RegisterBlock) {
    registers
        .ep_status_stall_nak()
        .write(|w| w.ep0_in().clear_bit_by_one().ep0_out().clear_bit_by_one());
}

/// Whether data of the host found no buffer on endpoint 0 since that is watched for. Ends the watch.
fn has_refused_data() -> bool {
    // SAFETY: only the interrupt of USB writes these registers; a bit that is set is cleared.
    let registers = unsafe { &*USBCTRL_REGS::ptr() };
    let refused = registers.ep_status_stall_nak().read();
    if refused.bits() == 0 {
        return false;
    }
    registers
        .sie_ctrl()
        .modify(|_, w| w.ep0_int_nak().clear_bit());
    clear_refusals(registers);
    refused.ep0_out().bit_is_set()
}

/// Takes an endpoint's buffer back from the controller.
#[inline(never)]
fn disarm(word: usize) {
    // SAFETY: only the interrupt of USB writes the words of the buffers.
    let memory = unsafe { &*USBCTRL_DPRAM::ptr() };
    memory
        .ep_buffer_control(word)
        .modify(|_, w| w.available_0().clear_bit());
}

/// Takes the buffer for data on endpoint 0 back, which the driver makes available again after a full packet. Whether one
/// came into it; that is thrown away.
fn takes_back_with_data() -> bool {
    let was_armed = is_armed(OUT_0);
    disarm(OUT_0);
    if was_armed {
        cortex_m::asm::delay(LONGEST_TRANSACTION);
    }
    // SAFETY: only the interrupt of USB writes this register and the words of the buffers; a bit of the register
    // that is set is cleared.
    let (registers, memory) = unsafe { (&*USBCTRL_REGS::ptr(), &*USBCTRL_DPRAM::ptr()) };
    // The mark: what the controller wrote into the word meanwhile is lost.
    let has_come = registers.buff_status().read().ep0_out().bit_is_set();
    registers
        .buff_status()
        .write(|w| w.ep0_out().clear_bit_by_one());
    memory
        .ep_buffer_control(OUT_0)
        .modify(|_, w| w.full_0().clear_bit());
    has_come
}

/// Whether a setup packet has come that was not read.
fn setup_waits() -> bool {
    // SAFETY: reading this register has no effect on it.
    let registers = unsafe { &*USBCTRL_REGS::ptr() };
    registers.sie_status().read().setup_rec().bit_is_set()
}

/// A setup packet that came while the driver copied the one before has lost its mark: the driver clears it
/// afterwards. It takes the other's place, and what is to come of its data is allowed for.
fn take_later_setup(read: &mut [u8; 8]) {
    // SAFETY: only the interrupt of USB writes the words of the buffers; reading these has no effect.
    let memory = unsafe { &*USBCTRL_DPRAM::ptr() };
    let low = memory.setup_packet_low().read().bits();
    let high = memory.setup_packet_high().read().bits();
    let later = u64::from(high) << 32 | u64::from(low);
    // One that came after that has its mark, and its turn.
    if u64::from_le_bytes(*read) == later || setup_waits() {
        return;
    }
    *read = later.to_le_bytes();
    let [kind, .., least, most] = *read;
    let expects_packet = kind & 0x80 != 0 || [least, most] != [0, 0];
    // The controller may be about to change the word of a buffer that it has.
    if expects_packet && !is_armed(OUT_0) && !has_data(OUT_0) {
        let control = memory.ep_buffer_control(OUT_0);
        control.modify(|_, w| w.available_0().set_bit());
    }
}

/// Refuses the control transfer under way: in both directions at once, since either ends it. If a setup
/// packet waits that transfer is over, and the next one is not refused for it: the controller ends a
/// refusal when a setup packet comes, and not later (RP2040 datasheet 4.1.4, EP_STALL_ARM).
fn refuse_control() {
    // SAFETY: only the interrupt of USB writes these registers and the words of the buffers.
    let (registers, memory) = unsafe { (&*USBCTRL_REGS::ptr(), &*USBCTRL_DPRAM::ptr()) };
    for word in [IN_0, OUT_0] {
        memory
            .ep_buffer_control(word)
            .modify(|_, w| w.available_0().clear_bit().stall().set_bit());
    }
    // Not interrupted: the next token is a few microseconds after the setup packet. So one that comes in here
    // is seen in time, and one that came before is asked for first: its token may be now. The interrupts that
    // a critical section lets through may take longer.
    cortex_m::interrupt::free(|_| {
        if setup_waits() {
            return;
        }
        registers
            .ep_stall_arm()
            .write(|w| w.ep0_in().set_bit().ep0_out().set_bit());
        if setup_waits() {
            registers
                .ep_stall_arm()
                .write(|w| w.ep0_in().clear_bit().ep0_out().clear_bit());
        }
    });
}

impl UsbBusTrait for Bus {
    fn alloc_ep(
        &mut self,
        direction: UsbDirection,
        address: Option<EndpointAddress>,
        kind: EndpointType,
        largest_packet: u16,
        interval: u8,
    ) -> Result<EndpointAddress> {
        self.hal
            .alloc_ep(direction, address, kind, largest_packet, interval)
    }

    fn enable(&mut self) {
        self.hal.enable();
        // SAFETY: the driver has written this register, and does not again.
        let registers = unsafe { &*USBCTRL_REGS::ptr() };
        registers
            .inte()
            .modify(|_, w| w.ep_stall_nak().set_bit().dev_sof().set_bit());
    }

    fn reset(&self) {
        let taken = (0..16)
            .filter(|&endpoint| !is_armed(word(endpoint, true)))
            .fold(0, |taken, endpoint| taken | 1 << endpoint);
        self.hal.reset();
        self.forget_frames();
        // Nothing comes within 10 ms of a reset: what is there came before it (USB 2.0 7.1.7.5).
        // SAFETY: only the interrupt of USB writes this register.
        let registers = unsafe { &*USBCTRL_REGS::ptr() };
        registers
            .sie_status()
            .write(|w| w.setup_rec().clear_bit_by_one());
        disarm(OUT_0);
        self.set_control(Control {
            is_waiting: false,
            ..self.control()
        });
        critical_section::with(|section| self.reset.borrow(section).set(Some(taken)));
    }

    fn set_device_address(&self, address: u8) {
        let control = self.control();
        let [_, _, asked, ..] = control.setup;
        if control.request() == SET_ADDRESS && asked == address {
            self.hal.set_device_address(address);
        }
    }

    fn write(&self, address: EndpointAddress, packet: &[u8]) -> Result<usize> {
        if address.index() != 0 {
            return self.hal.write(address, packet);
        }
        let control = self.control();
        // All data have come.
        if !control.is_in() {
            watch_for_refusal();
            if takes_back_with_data() {
                // More than the request announced: no status, so that the host does not take it for done.
                refuse_control();
                return Ok(packet.len());
            }
        }
        // Where a setup packet waits it answers a request that is given up, and would be taken for the answer to
        // the next one.
        let written = if setup_waits() {
            packet.len()
        } else {
            self.hal.write(address, packet)?
        };
        if setup_waits() {
            disarm(IN_0);
        }
        self.set_control(Control {
            is_waiting: true,
            ..control
        });
        Ok(written)
    }

    fn read(&self, address: EndpointAddress, buffer: &mut [u8]) -> Result<usize> {
        let found = self.hal.read(address, buffer);
        if address.index() != 0 {
            return found;
        }
        match found {
            Ok(8) if self.control().is_new => self.begin(buffer),
            Err(UsbError::BufferOverflow) => {
                let _ = self.hal.read(address, &mut [0; 64]);
                // Nothing waited for it: `usb-device` refuses the transfer.
                return if buffer.is_empty() { Ok(0) } else { found };
            }
            _ => {}
        }
        found
    }

    fn set_stalled(&self, address: EndpointAddress, stalled: bool) {
        if address.index() == 0 && stalled {
            refuse_control();
            self.set_control(Control {
                is_waiting: false,
                ..self.control()
            });
            return;
        }
        self.hal.set_stalled(address, stalled);
        if address.index() != 0 && !stalled {
            self.begin_with_data0(word(address.index(), address.is_in()));
        }
    }

    fn is_stalled(&self, address: EndpointAddress) -> bool {
        self.hal.is_stalled(address)
    }

    fn suspend(&self) {
        self.hal.suspend();
        self.forget_frames();
    }

    fn resume(&self) {
        self.hal.resume();
    }

    fn poll(&self) -> PollResult {
        self.follow_frames();
        // Before the driver sees whether a setup packet has come, of whose transfer they may be.
        let has_refused_data = has_refused_data();
        let mut result = self.hal.poll();
        let has_missed = self.has_missed_sent(&result);
        match &mut result {
            PollResult::Data { ep_in_complete, .. } => *ep_in_complete |= u16::from(has_missed),
            PollResult::None if has_missed => {
                result = PollResult::Data {
                    ep_out: 0,
                    ep_in_complete: 1,
                    ep_setup: 0,
                };
            }
            _ => {}
        }
        let mut control = self.control();
        if let PollResult::Data {
            ep_setup,
            ep_in_complete,
            ..
        } = result
        {
            control.is_new = ep_setup & 1 == 1;
            control.is_waiting &= ep_in_complete & 1 == 0;
        }
        if control.is_new {
            Self::end_before_setup(&mut control);
        } else if has_refused_data && control.is_waiting && !control.is_in() {
            // More than the request announced: the host will not ask for the status that waits.
            refuse_control();
            control.is_waiting = false;
        }
        self.set_control(control);
        result
    }
}
