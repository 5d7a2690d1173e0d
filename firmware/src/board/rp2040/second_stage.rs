//! The second stage of the boot loader, for the flash of a Raspberry Pi Pico: it reads the flash at a
//! quarter of the processor's clock. The boot ROM runs it, after a check of its CRC.

#![allow(unsafe_code)]

#[unsafe(link_section = ".boot2")]
#[used]
static BOOT2: [u8; 256] = rp2040_boot2::BOOT_LOADER_W25Q080;
