//! USB interface through which `picotool` restarts a board without a button: no endpoints, two requests
//! (pico-sdk 2.1, `pico/usb_reset_interface.h`).
//!
//! The crate `usbd-picotool-reset` jumps into the boot ROM from within the request, even while the coil
//! is driven, and depends on another version of the HAL (docs/decisions/0069-usb.md). This interface
//! passes the request on, and the bridge is switched off first.

use core::sync::atomic::{AtomicU8, Ordering};

use palpate_wire::code::RebootTarget;
use usb_device::LangID;
use usb_device::class_prelude::*;
use usb_device::control::{Recipient, Request, RequestType};

const VENDOR_SPECIFIC: u8 = 0xFF;
const SUBCLASS: u8 = 0x00;
const PROTOCOL: u8 = 0x01;
/// USB request to start the boot loader. The options of the request, which drives to offer and which pin
/// to use as a light, are ignored: the boot loader offers all drives.
const TO_BOOT_LOADER: u8 = 0x01;
/// USB request to restart the firmware.
const TO_FIRMWARE: u8 = 0x02;

/// Number of the requested target; 0 for none.
static ASKED: AtomicU8 = AtomicU8::new(0);

/// Requests a restart.
pub fn ask(target: RebootTarget) {
    ASKED.store(target.number(), Ordering::Relaxed);
}

/// Takes the target requested since the last call. Only one task may call it.
pub fn take_asked() -> Option<RebootTarget> {
    match ASKED.load(Ordering::Relaxed) {
        0 => None,
        number => {
            ASKED.store(0, Ordering::Relaxed);
            Some(RebootTarget::from_number(number))
        }
    }
}

/// The reset interface.
pub struct ResetInterface {
    interface: InterfaceNumber,
    name: StringIndex,
}

impl ResetInterface {
    /// Creates the interface in the device that is being built.
    pub fn new<B: UsbBus>(bus: &UsbBusAllocator<B>) -> Self {
        Self {
            interface: bus.interface(),
            name: bus.string(),
        }
    }

    fn is_for_it(&self, request: &Request) -> bool {
        request.request_type == RequestType::Class
            && request.recipient == Recipient::Interface
            && request.index == u16::from(u8::from(self.interface))
    }
}

impl<B: UsbBus> UsbClass<B> for ResetInterface {
    fn get_configuration_descriptors(
        &self,
        writer: &mut DescriptorWriter<'_>,
    ) -> usb_device::Result<()> {
        let name = Some(self.name);
        writer.interface_alt(self.interface, 0, VENDOR_SPECIFIC, SUBCLASS, PROTOCOL, name)
    }

    fn get_string(&self, index: StringIndex, _: LangID) -> Option<&str> {
        (index == self.name).then_some("Reset")
    }

    fn control_out(&mut self, transfer: ControlOut<'_, '_, '_, B>) {
        if !self.is_for_it(transfer.request()) {
            return;
        }
        let target = match transfer.request().request {
            TO_BOOT_LOADER => RebootTarget::BootLoader,
            TO_FIRMWARE => RebootTarget::Firmware,
            _ => {
                let _ = transfer.reject();
                return;
            }
        };
        ask(target);
        let _ = transfer.accept();
    }

    fn control_in(&mut self, transfer: ControlIn<'_, '_, '_, B>) {
        if self.is_for_it(transfer.request()) {
            let _ = transfer.reject();
        }
    }
}
