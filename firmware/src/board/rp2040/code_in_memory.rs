//! Copies the code that runs from RAM, as the start-up code copies data. It runs before the start-up
//! code, without stack or variables.

#![allow(unsafe_code)]

core::arch::global_asm!(
    // This code is placed beside the start-up code that calls it, in flash, so that it needs no copy
    // itself.
    ".section .Reset, \"ax\", %progbits",
    ".global __pre_init",
    ".type __pre_init, %function",
    ".thumb_func",
    "__pre_init:",
    // Sets the ring oscillator, the processor's clock at reset, to 52 MHz (14 to 96) instead of 6.5 MHz:
    // divided by 2 (datasheet 2.17.8). The copy then takes 20 ms. `clocks` slows the ring down again.
    "ldr r0, =0x40060010",
    "ldr r1, =0xAA2",
    "str r1, [r0]",
    "ldr r0, =__hot_begin",
    "ldr r1, =__hot_end",
    "ldr r2, =__hot_load",
    "1: cmp r0, r1",
    "bhs 2f",
    "ldm r2!, {{r3, r4, r5, r6}}",
    "stm r0!, {{r3, r4, r5, r6}}",
    "b 1b",
    "2: bx lr",
    ".ltorg",
    ".text",
);
