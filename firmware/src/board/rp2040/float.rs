//! `f32` routines that the compiler calls, since the processor has no FPU; faster than the compiler's
//! own (docs/decisions/0063-hal-and-own-registers.md).

#![allow(unsafe_code)]

/// Exports a routine under the name that the compiler calls (Run-time ABI for the Arm Architecture,
/// 5.1.2). Numbers are passed as bits in integer registers.
macro_rules! routines {
    ($($name:ident($($argument:ident: $type:ty),*) = $routine:expr;)*) => {$(
        // SAFETY: name, arguments and result are those of the ABI, and the only other symbol of
        // this name is the compiler's own routine, which is weak.
        #[unsafe(no_mangle)]
        extern "aapcs" fn $name($($argument: $type),*) -> u32 {
            $routine($($argument),*)
        }
    )*};
}

routines! {
    __aeabi_fadd(a: u32, b: u32) = palpate_float::add;
    __aeabi_fsub(a: u32, b: u32) = palpate_float::subtract;
    __aeabi_fmul(a: u32, b: u32) = palpate_float::multiply;
    __aeabi_fdiv(a: u32, b: u32) = palpate_float::divide;
    __aeabi_i2f(number: i32) = palpate_float::from_i32;
    __aeabi_ui2f(number: u32) = palpate_float::from_u32;
    __aeabi_ul2f(number: u64) = palpate_float::from_u64;
}
