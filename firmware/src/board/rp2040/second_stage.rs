//! Second-stage boot loader for the flash of a Raspberry Pi Pico: reads flash at a quarter of the
//! processor's clock. The boot ROM checks its CRC and runs it.

#![allow(unsafe_code)]

#[unsafe(link_section = ".boot2")]
#[used]
static BOOT2: [u8; 256] = rp2040_boot2::BOOT_LOADER_W25Q080;
