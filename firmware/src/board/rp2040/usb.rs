//! USB controller: the HAL's driver, and a wrapper for the cases that the driver and `usb-device` do not
//! handle.
//!
//! Both assume prompt interrupt service and a host that follows all rules. Here the USB interrupt may
//! wait for milliseconds, and a host may do anything. [`Bus`] lists what the wrapper adds.
//!
//! VBUS detection is overridden: a Pico has no pin for it (Raspberry Pi Pico datasheet, 4.1). An
//! unplugged cable therefore looks like a suspended bus.

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

/// Starts the controller; its clock must run. Returns `None` if it does not come out of reset.
pub fn set_up(
    registers: USBCTRL_REGS,
    memory: USBCTRL_DPRAM,
    clocks: CLOCKS,
    resets: &mut RESETS,
) -> Option<UsbBusAllocator<Bus>> {
    resets.reset().modify(|_, w| w.usbctrl().set_bit());
    resets.reset().modify(|_, w| w.usbctrl().clear_bit());
    // Waits here first, since the HAL waits for the end of this reset without a time limit.
    if !wait(|| resets.reset_done().read().usbctrl().bit_is_set()) {
        return None;
    }
    // Proves to the HAL that the clock exists; does not change the clock.
    let clock = ClocksManager::new(clocks).usb_clock;
    let bus = UsbBus::new(registers, memory, clock, true, resets);
    Some(UsbBusAllocator::new(Bus::new(bus)))
}

/// Triggers the USB interrupt to send waiting frames.
pub fn call() {
    NVIC::pend(INTERRUPT);
}

/// Keeps packets from triggering the USB interrupt while received packets wait for space. The start of a
/// frame still triggers it. Without that, the end of a frame would be unknown, and all other work of the
/// interrupt would wait as well.
pub fn mask_packet_interrupt() {
    interrupts().modify(|_, w| w.buff_status().clear_bit());
}

/// Lets packets trigger the interrupt again.
pub fn unmask_packet_interrupt() {
    interrupts().modify(|_, w| w.buff_status().set_bit());
}

/// Returns the interrupt enable register of USB.
fn interrupts() -> &'static rp2040_pac::usbctrl_regs::INTE {
    // SAFETY: only the interrupt of USB and tasks of its priority change this register after the start.
    unsafe { (*USBCTRL_REGS::ptr()).inte() }
}

/// Longest data stage that `usb-device` accepts from a host (its `CONTROL_BUF_LEN`).
const LONGEST_DATA: u16 = 128;
/// Setup packet of an undefined type (USB 2.0 table 9-2), which every class refuses.
const REFUSED: [u8; 8] = [0x60, 0, 0, 0, 0, 0, 0, 0];
/// First two bytes of a request after which packets start with DATA0 (USB 2.0 9.1.1.5).
const SET_CONFIGURATION: [u8; 2] = [0x00, 9];
/// First two bytes of the request for an interface's setting, after which packets start with DATA0 too.
const SET_INTERFACE: [u8; 2] = [0x01, 11];
/// First two bytes of the request that sets the device's address.
const SET_ADDRESS: [u8; 2] = [0x00, 5];
/// Cycles to wait from writing a buffer's control word to setting its bit AVAILABLE: a period of the 48
/// MHz clock is five cycles at 200 MHz, which the datasheet rounds up (RP2040 datasheet 4.1.2.5.1).
const SETTLING: u32 = 12;
/// Cycles that the longest transaction of endpoint 0 takes: token, 64 bytes with bit stuffing, handshake
/// and the gaps between are 710 bits at 12 Mbit/s (USB 2.0 7.1.9, 7.1.18.1, 8.4), 59.2 us.
const LONGEST_TRANSACTION: u32 = 12_000;

/// Time in microseconds within which a frame starts, if the host sends frames.
const LONGEST_WAIT_US: u32 = 1_000;

/// Returns the lower word of the timer, in microseconds.
fn now_us() -> u32 {
    // SAFETY: reading this register has no effect on it.
    unsafe { (*TIMER::ptr()).timerawl().read().bits() }
}

/// USB bus for the device's classes: the HAL's driver with these additions:
///
/// - A packet of endpoint 0 without space or without a receiver is discarded. If it stayed, its
///   interrupt would repeat at once, endlessly.
/// - A request with more data than `usb-device` accepts is refused instead of left without an answer.
/// - No buffer of endpoint 0 stays armed after a transfer: its packet would count as one of the next
///   transfer, whose setup packet waits for the processor. The next transfer is not refused because of
///   such a packet.
/// - A setup packet from before a bus reset is not answered after it.
/// - Data beyond the announced length are refused. The waiting status is withdrawn first, or the next
///   transfer would receive it.
/// - A request is refused, instead of left waiting, if its data may have gone to the buffer of the
///   previous transfer, which the host abandoned.
/// - No buffer of endpoint 0 is withdrawn, or made available to discard a packet, while the data of the
///   next transfer may be arriving in it: the device would wait for data that were acknowledged.
/// - Packets start with DATA0 again where USB requires it.
/// - The control word of a buffer that stays available is not written: that could undo a change by the
///   controller.
/// - A setup packet that arrives while the previous one is copied is not lost, and an answer to the
///   previous one is not sent after it.
/// - A new address takes effect only when its request has completed.
/// - A packet of endpoint 0 that the host takes while the driver clears the flags of others is not
///   missed.
/// - The packets that the host has taken are known even after a following bus reset.
/// - The end of a frame, in which no bulk packet may be made available, is known.
pub struct Bus {
    hal: UsbBus,
    frames: Mutex<Cell<UsbFrames>>,
    control: Mutex<Cell<Control>>,
    /// After a bus reset: IN endpoints whose packet was taken before it, one bit each.
    reset: Mutex<Cell<Option<u16>>>,
}

/// Result of an IN endpoint's packet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sent {
    /// The packet waits for the host.
    Not,
    /// The host has taken the packet, or there was none.
    Taken,
    /// The bus was reset before the host took the packet.
    Lost,
}

/// Control transfer in progress.
#[derive(Clone, Copy, Default)]
struct Control {
    setup: [u8; 8],
    /// The setup packet was received and not read yet.
    is_new: bool,
    /// A packet waits for the host, or its completion was not reported yet.
    is_waiting: bool,
    /// Data of an unknown request were present when the setup packet arrived.
    has_data_before: bool,
}

impl Control {
    const fn is_in(&self) -> bool {
        let [kind, ..] = self.setup;
        kind & 0x80 != 0
    }

    /// Returns the setup packet's field wLength.
    const fn length(&self) -> u16 {
        let [.., low, high] = self.setup;
        u16::from_le_bytes([low, high])
    }

    /// Returns whether the request's data are longer than `usb-device` accepts, or may be lost.
    const fn is_refused(&self) -> bool {
        let announces = !self.is_in() && self.length() > 0;
        announces && (self.length() > LONGEST_DATA || self.has_data_before)
    }

    /// Returns bmRequestType and bRequest.
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

    /// Returns the result of an IN endpoint's packet. Only one endpoint may use it: a reset is reported
    /// once.
    pub fn sent(&self, endpoint: EndpointAddress) -> Sent {
        let before = critical_section::with(|section| self.reset.borrow(section).take());
        match before {
            Some(taken) if taken >> endpoint.index() & 1 == 0 => Sent::Lost,
            Some(_) => Sent::Taken,
            None if is_armed(word(endpoint.index(), true)) => Sent::Not,
            None => Sent::Taken,
        }
    }

    /// Makes a bulk packet available if that is allowed at this time. Only the interrupts that no
    /// critical section masks can run between check and action. If it is not allowed, the start of the
    /// next frame triggers the interrupt.
    pub fn before_end_of_frame<T>(&self, make_available: impl FnOnce() -> T) -> Option<T> {
        critical_section::with(|section| {
            self.follow_frames();
            let frames = self.frames.borrow(section).get();
            (!frames.is_at_end(now_us())).then(make_available)
        })
    }

    /// Checks whether a frame has started; reading its number clears the interrupt.
    fn follow_frames(&self) {
        // SAFETY: only the interrupt of USB reads these registers.
        let registers = unsafe { &*USBCTRL_REGS::ptr() };
        critical_section::with(|section| {
            let frames = self.frames.borrow(section);
            let mut followed = frames.get();
            let polled_us = now_us();
            if registers.intr().read().dev_sof().bit_is_set() {
                followed.found_start(now_us());
                let _ = registers.sof_rd().read();
            } else {
                followed.found_none(polled_us);
            }
            frames.set(followed);
        });
    }

    /// Forgets the frame timing: the host may restart its frames.
    fn forget_frames(&self) {
        critical_section::with(|section| self.frames.borrow(section).set(UsbFrames::new()));
    }

    fn control(&self) -> Control {
        critical_section::with(|section| self.control.borrow(section).get())
    }

    fn set_control(&self, control: Control) {
        critical_section::with(|section| self.control.borrow(section).set(control));
    }

    /// Returns whether a packet of endpoint 0 was taken and its flag is lost: the driver first reads the
    /// flags of all endpoints and clears them all later.
    fn has_missed_sent(&self, result: &PollResult) -> bool {
        let is_reported = match result {
            // A setup packet ends every waiting packet.
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

    /// Ends the previous transfer when a setup packet arrives. Waits for the end of a transaction whose
    /// buffer is withdrawn in its middle.
    fn end_before_setup(control: &mut Control) {
        let was_armed = is_armed(OUT_0);
        let mut has_come = false;
        if control.is_waiting || was_armed {
            [IN_0, OUT_0].into_iter().for_each(disarm);
            cortex_m::asm::delay(LONGEST_TRANSACTION);
            // SAFETY: only the interrupt of USB writes this register; a bit that is set is cleared.
            let registers = unsafe { &*USBCTRL_REGS::ptr() };
            // If a packet arrived while its buffer was withdrawn, the controller's write to the buffer's
            // word is lost, but the flag here remains.
            has_come = registers.buff_status().read().ep0_out().bit_is_set();
            registers
                .buff_status()
                .write(|w| w.ep0_in().clear_bit_by_one());
        }
        control.is_waiting = false;
        // A buffer that waits for the other data PID (DATA0 or DATA1) drops a packet and stays armed.
        let has_dropped = has_dropped_packet();
        control.has_data_before = has_data(OUT_0) || was_armed && (has_come || has_dropped);
    }

    /// Makes the next packet of an endpoint DATA0, and stalls the endpoint or ends its stall. A packet
    /// that waits for the host stays available.
    fn begin_with_data0(&self, word: usize, stalled: bool) {
        // SAFETY: only the interrupt of USB writes the words of the buffers.
        let memory = unsafe { &*USBCTRL_DPRAM::ptr() };
        let control = memory.ep_buffer_control(word);
        let was_armed = is_armed(word);
        disarm(word);
        // For a buffer that is not armed the opposite PID is set, since the driver inverts the bit when
        // it arms the buffer.
        control.modify(|_, w| w.pid_0().bit(!was_armed).stall().bit(stalled));
        if was_armed {
            cortex_m::asm::delay(SETTLING);
            let make_available = || control.modify(|_, w| w.available_0().set_bit());
            let since_us = now_us();
            while self.before_end_of_frame(make_available).is_none() {
                // Without frames the host does not request the packet, so it may be made available at
                // any time.
                if now_us().wrapping_sub(since_us) > LONGEST_WAIT_US {
                    make_available();
                    break;
                }
            }
        }
    }

    /// Handles a setup packet that the driver has read.
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
        // The driver arms a buffer for data that will not come.
        if control.is_in() && control.length() == 0 {
            disarm_without_setup();
        }
        if [SET_CONFIGURATION, SET_INTERFACE].contains(&control.request()) {
            (1..16).for_each(|index| {
                self.begin_with_data0(2 * index, false);
                self.begin_with_data0(2 * index + 1, false);
            });
        }
    }
}

/// Index of the control word of endpoint 0's IN buffer.
const IN_0: usize = 0;
/// Index of the control word of endpoint 0's OUT buffer.
const OUT_0: usize = 1;

/// Returns the index of the control word of an endpoint's buffer.
const fn word(endpoint: usize, is_in: bool) -> usize {
    2 * endpoint + if is_in { IN_0 } else { OUT_0 }
}

/// Returns whether the controller owns the buffer.
fn is_armed(word: usize) -> bool {
    // SAFETY: reading a word of the buffers has no effect on it.
    let memory = unsafe { &*USBCTRL_DPRAM::ptr() };
    let control = memory.ep_buffer_control(word).read();
    control.available_0().bit_is_set()
}

/// Returns whether an OUT endpoint has received data that were not read.
fn has_data(word: usize) -> bool {
    // SAFETY: reading a word of the buffers has no effect on it.
    let memory = unsafe { &*USBCTRL_DPRAM::ptr() };
    let control = memory.ep_buffer_control(word).read();
    control.full_0().bit_is_set() && control.length_0().bits() > 0
}

/// Returns whether any endpoint acknowledged and dropped a packet with the wrong PID since the last call
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

/// Enables one interrupt on the next token of endpoint 0 that finds no buffer.
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

/// Returns whether data from the host found no buffer on endpoint 0 since [`watch_for_refusal`], and
/// ends the watch.
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

/// Withdraws an endpoint's buffer from the controller.
#[inline(never)]
fn disarm(word: usize) {
    // SAFETY: only the interrupt of USB writes the words of the buffers.
    let memory = unsafe { &*USBCTRL_DPRAM::ptr() };
    memory
        .ep_buffer_control(word)
        .modify(|_, w| w.available_0().clear_bit());
}

/// Withdraws the data buffer of endpoint 0, and returns whether it was available. Returns `None` and
/// leaves the buffer if a setup packet is waiting: the data of its transfer may be arriving there.
#[inline(never)]
fn disarm_without_setup() -> Option<bool> {
    // With interrupts off, since the token of those data may follow the setup packet within 3 us.
    cortex_m::interrupt::free(|_| {
        if setup_waits() {
            return None;
        }
        let was_armed = is_armed(OUT_0);
        disarm(OUT_0);
        Some(was_armed)
    })
}

/// Withdraws the data buffer of endpoint 0, which the driver makes available again after a full packet.
/// Returns whether it had received data; these are discarded. Leaves the buffer to the next transfer if
/// a setup packet is waiting.
fn withdraw_buffer() -> bool {
    match disarm_without_setup() {
        None => return false,
        Some(true) => cortex_m::asm::delay(LONGEST_TRANSACTION),
        Some(false) => {}
    }
    discard_packet()
}

/// Discards the packet in the data buffer of endpoint 0, and returns whether one has arrived. The buffer
/// must be withdrawn, and stays so.
#[inline(never)]
fn discard_packet() -> bool {
    // SAFETY: only the interrupt of USB writes this register and the words of the buffers; a bit of the
    // register that is set is cleared.
    let (registers, memory) = unsafe { (&*USBCTRL_REGS::ptr(), &*USBCTRL_DPRAM::ptr()) };
    // The flag in BUFF_STATUS decides: the controller's write to the control word is lost if it came
    // during the withdrawal.
    let has_come = registers.buff_status().read().ep0_out().bit_is_set();
    registers
        .buff_status()
        .write(|w| w.ep0_out().clear_bit_by_one());
    memory
        .ep_buffer_control(OUT_0)
        .modify(|_, w| w.full_0().clear_bit());
    has_come
}

/// Returns whether an unread setup packet is waiting.
fn setup_waits() -> bool {
    // SAFETY: reading this register has no effect on it.
    let registers = unsafe { &*USBCTRL_REGS::ptr() };
    registers.sie_status().read().setup_rec().bit_is_set()
}

/// Replaces a setup packet by a later one that arrived while the driver copied it: the later packet has
/// lost its flag, which the driver clears after the copy. Also prepares for the later packet's data.
fn take_later_setup(read: &mut [u8; 8]) {
    // SAFETY: only the interrupt of USB writes the words of the buffers; reading these has no effect.
    let memory = unsafe { &*USBCTRL_DPRAM::ptr() };
    let low = memory.setup_packet_low().read().bits();
    let high = memory.setup_packet_high().read().bits();
    let later = u64::from(high) << 32 | u64::from(low);
    // A setup packet that arrived after that copy has its flag, and is handled later.
    if u64::from_le_bytes(*read) == later || setup_waits() {
        return;
    }
    *read = later.to_le_bytes();
    let [kind, .., least, most] = *read;
    let expects_packet = kind & 0x80 != 0 || [least, most] != [0, 0];
    // Leaves a buffer that the controller owns: the controller may be about to change its word.
    if expects_packet && !is_armed(OUT_0) && !has_data(OUT_0) {
        let control = memory.ep_buffer_control(OUT_0);
        control.modify(|_, w| w.available_0().set_bit());
    }
}

/// Refuses the control transfer in progress, in both directions, since either ends it. If a setup packet
/// is waiting, the transfer is already over, and the next one must not be refused: the controller ends a
/// refusal only when a setup packet arrives (RP2040 datasheet 4.1.4, EP_STALL_ARM).
fn refuse_control() {
    // SAFETY: only the interrupt of USB writes these registers and the words of the buffers.
    let (registers, memory) = unsafe { (&*USBCTRL_REGS::ptr(), &*USBCTRL_DPRAM::ptr()) };
    let refuse = |word| {
        memory
            .ep_buffer_control(word)
            .modify(|_, w| w.available_0().clear_bit().stall().set_bit());
    };
    refuse(IN_0);
    // Runs with interrupts off, since the next token may follow a setup packet within a few
    // microseconds. Checks for an earlier setup packet first, since its token may be due, or its data
    // arriving in the buffer, and afterwards for one that arrived in between.
    cortex_m::interrupt::free(|_| {
        if setup_waits() {
            return;
        }
        refuse(OUT_0);
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
        // SAFETY: the driver has written this register, and does not write it again.
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
        // Nothing arrives within 10 ms of a reset, so this packet arrived before it (USB 2.0 7.1.7.5).
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
        // In a transfer from the host, the status is written when all data were received.
        if !control.is_in() {
            watch_for_refusal();
            if withdraw_buffer() {
                // More data than the request announced: no status is sent, so that the host does not
                // take the request as completed.
                refuse_control();
                return Ok(packet.len());
            }
        }
        // If a setup packet is waiting, this would answer an abandoned request, and the host would take
        // it as the answer to the next request.
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
                // The driver would make the buffer available again, and the data of the next transfer
                // would be lost there.
                discard_packet();
                // No receiver for the data: `usb-device` refuses the transfer.
                return if buffer.is_empty() { Ok(0) } else { found };
            }
            // The controller's write to the control word was lost in a withdrawal, only its flag remains.
            Err(UsbError::WouldBlock) => {
                discard_packet();
            }
            _ => {}
        }
        found
    }

    fn set_stalled(&self, address: EndpointAddress, stalled: bool) {
        if address.index() != 0 {
            self.begin_with_data0(word(address.index(), address.is_in()), stalled);
        } else if stalled {
            refuse_control();
            self.set_control(Control {
                is_waiting: false,
                ..self.control()
            });
        }
        // Only a setup packet ends a refusal of endpoint 0. `usb-device` asks for its end while the
        // buffer is available: clearing the bit STALL would then undo what the controller writes
        // between read and write, and the interrupt of a packet that came would repeat endlessly.
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
        // Read before the driver checks for a setup packet, since the refused data may belong to that
        // packet's transfer.
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
            // More data than the request announced: the host will not request the waiting status.
            refuse_control();
            control.is_waiting = false;
        }
        self.set_control(control);
        result
    }
}
