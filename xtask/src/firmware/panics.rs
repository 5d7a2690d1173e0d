//! Parts of the image that can reach a panic: exactly those of a list, each with a reason.
//!
//! The panic machinery is in `core`. Its callers are found by the branches in the image's code
//! (ARMv6-M architecture). The positive control is the image with a planted panic: it must contain
//! one more such part.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

use anyhow::{Context, Result, bail};
use object::{Object, ObjectSection, ObjectSymbol, SymbolKind};

use super::image::build;
use super::planted;
use crate::process::Workspace;

/// Parts that may reach a panic: a crate, or an interrupt into which crates were inlined; each with
/// its reason. All but the last are libraries, whose checks hold by construction.
const ALLOWED: &[(&str, &str)] = &[
    (
        "SW0_IRQ",
        "rtic-time: a wait before the timers are set up, which they are before any task runs",
    ),
    ("SW1_IRQ", "the same, and what its tasks inline"),
    (
        "USBCTRL_IRQ",
        "usb-device and the bus of rp2040-hal, inlined: see there",
    ),
    (
        "usb_device",
        "indices into its own control buffer, which it has limited before; an endpoint that was never \
         allocated; a device that is resumed without having been suspended",
    ),
    (
        "usbd_serial",
        "a slice of seven bytes of a request whose length it has compared with seven",
    ),
    (
        "rp2040_hal",
        "indices of endpoints, which the controller's registers limit to 16; the bus's own lock, which \
         interrupts take one at a time",
    ),
    (
        "sequential_storage",
        "slices of a buffer within lengths that it has read from flash under a CRC and compared with the \
         buffer's; a page state that it has just looked up",
    ),
    (
        "palpate_firmware",
        "rtt-target and the HAL at the start: channels and endpoints that are set up once; heapless: the \
         length of a queue's buffer, a constant; rtic-time as above",
    ),
];

/// The compiler's check of a future that is polled after its end, which neither an await nor RTIC's
/// executor does. It may be folded into another function with identical code.
const OF_FUTURES: &str = "panic_const_async_fn_resumed";
const FOLDED_INTO: &str = "panic_for_nonpositive_argument";

/// Runs the check of the step `image-panics`.
pub(crate) fn check(workspace: &Workspace) -> Result<String> {
    let found = panicking(&build(workspace)?)?;
    let allowed: BTreeSet<&str> = ALLOWED.iter().map(|(name, _)| *name).collect();
    let more = found
        .iter()
        .filter(|(name, _)| !allowed.contains(name.as_str()));
    let more: Vec<_> = more
        .map(|(name, calls)| {
            format!(
                "{name} ({})",
                calls.keys().cloned().collect::<Vec<_>>().join(", ")
            )
        })
        .collect();
    if !more.is_empty() {
        bail!("the image can panic in {}", more.join("; "));
    }
    let gone: Vec<_> = allowed
        .iter()
        .filter(|name| !found.contains_key(**name))
        .copied()
        .collect();
    if !gone.is_empty() {
        bail!(
            "{} cannot panic any more: take it from the list in xtask/src/firmware/panics.rs",
            gone.join(", ")
        );
    }
    let with_panic = panicking(&planted::image(workspace, "panic")?)?;
    // If the planted panic is inlined into a known function, that function has one more call.
    let is_known = |(part, functions): (&String, &Calls)| {
        let known = found.get(part);
        functions
            .iter()
            .all(|(name, calls)| known.and_then(|of| of.get(name)) >= Some(calls))
    };
    if with_panic.iter().all(is_known) {
        bail!("the planted panic was not found, so that finding none shows nothing");
    }
    Ok(format!(
        "{} parts of the image can reach a panic, all on the list; a planted one is found",
        found.len()
    ))
}

/// Functions, with the number of calls of the panic machinery in each.
type Calls = BTreeMap<String, usize>;

/// Parts of an image that call the panic machinery, each with its calling functions.
fn panicking(image: &Path) -> Result<BTreeMap<String, Calls>> {
    let bytes = fs::read(image).with_context(|| format!("{} cannot be read", image.display()))?;
    let elf = object::File::parse(&*bytes).context("the image is no ELF file")?;
    let functions = functions(&elf);
    let machinery: BTreeSet<u64> = functions
        .iter()
        .filter(|(_, (name, _))| is_machinery(name))
        .map(|(address, _)| *address)
        .collect();
    let mut found: BTreeMap<String, Calls> = BTreeMap::new();
    for section in elf.sections() {
        let code = section.data().unwrap_or_default();
        for (at, target) in branches(section.address(), code) {
            let caller = functions.range(..=at).next_back();
            if let Some((start, (name, size))) = caller
                && machinery.contains(&target)
                && at < start + size
                && !is_of_core(name)
            {
                let calls = found.entry(part(name)).or_default();
                *calls.entry(name.clone()).or_default() += 1;
            }
        }
    }
    Ok(found)
}

/// Functions with name and size, by address.
fn functions(elf: &object::File<'_>) -> BTreeMap<u64, (String, u64)> {
    elf.symbols()
        .filter(|symbol| symbol.kind() == SymbolKind::Text && symbol.size() > 0)
        .filter_map(|symbol| {
            let name = symbol.name().ok()?;
            // A thunk counts as its target.
            let name = name.strip_prefix("__Thumbv6MABSLongThunk_").unwrap_or(name);
            let name = format!("{:#}", rustc_demangle::demangle(name));
            // The lowest bit marks Thumb code.
            Some((symbol.address() & !1, (name, symbol.size())))
        })
        .collect()
}

/// Addresses and targets of the branches in code, with and without link (ARMv6-M architecture,
/// A6.7.10 and A6.7.13).
fn branches(start: u64, code: &[u8]) -> impl Iterator<Item = (u64, u64)> + '_ {
    let half = |at: usize| Some(u16::from_le_bytes([*code.get(at)?, *code.get(at + 1)?]));
    (0..code.len()).step_by(2).filter_map(move |at| {
        let first = half(at)?;
        let offset = match first >> 12 {
            0b1101 => i64::from(first as u8 as i8) << 1,
            0b1110 if first & 0x800 == 0 => i64::from((first << 5) as i16 >> 5) << 1,
            0b1111 if first & 0x800 == 0 => with_link(first, half(at + 2)?)?,
            _ => return None,
        };
        let place = start + at as u64;
        Some((place, place.wrapping_add_signed(4 + offset)))
    })
}

/// Offset of a branch with link; `None` if the two halfwords are no such branch.
fn with_link(first: u16, second: u16) -> Option<i64> {
    let bit = |of: u16, number: u16| i64::from(of >> number & 1);
    let sign = bit(first, 10);
    let upper = |number| 1 - (bit(second, number) ^ sign);
    let offset = -(sign << 24)
        | upper(13) << 23
        | upper(11) << 22
        | i64::from(first & 0x3FF) << 12
        | i64::from(second & 0x7FF) << 1;
    (second & 0xD000 == 0xD000).then_some(offset)
}

/// Whether a function of `core` ends in a panic; the check of futures does not count.
fn is_machinery(name: &str) -> bool {
    let last = name.rsplit("::").next().unwrap_or(name);
    let panics = name.contains("panicking::")
        || ["_failed", "_fail"].iter().any(|end| last.ends_with(end))
        || last.starts_with("panic_");
    is_of_core(name) && panics && ![OF_FUTURES, FOLDED_INTO].contains(&last)
}

fn is_of_core(name: &str) -> bool {
    name.starts_with("core::")
}

/// Crate of a function, from its path; for an implementation, the crate of the type. The handler of
/// an interrupt has no path: its name is returned.
fn part(name: &str) -> String {
    let path = name.trim_start_matches(['<', '&', '*']);
    let path = path
        .strip_prefix("core::ptr::drop_in_place<")
        .unwrap_or(path);
    let end = path.find([':', '<', ' ']).unwrap_or(path.len());
    path.get(..end).unwrap_or(path).to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn functions_that_panic_are_known_by_their_paths() {
        for name in [
            "core::panicking::panic_bounds_check",
            "core::panicking::panic_const::panic_const_rem_by_zero",
            "core::option::expect_failed",
            "core::slice::index::slice_index_fail",
            "core::cell::panic_already_borrowed",
        ] {
            assert!(is_machinery(name), "{name}");
        }
        for name in [
            "core::fmt::write",
            "main",
            "core::panicking::panic_const::panic_const_async_fn_resumed",
        ] {
            assert!(!is_machinery(name), "{name}");
        }
    }

    #[test]
    fn a_function_belongs_to_the_crate_of_its_path() {
        for (name, crate_name) in [
            ("usb_device::device::UsbDevice<B>::poll", "usb_device"),
            (
                "<rp2040_hal::usb::UsbBus as usb_device::bus::UsbBus>::read",
                "rp2040_hal",
            ),
            ("USBCTRL_IRQ", "USBCTRL_IRQ"),
        ] {
            assert_eq!(part(name), crate_name);
        }
    }

    /// Encodings from an assembler: `bl` forwards and backwards, `b`, `beq`, and a `nop`.
    #[test]
    fn branches_are_found_with_their_targets() {
        let code = [
            0x00, 0xBF, 0x00, 0xF0, 0x01, 0xF8, 0x00, 0xBF, 0xFF, 0xF7, 0xFA, 0xFF,
        ];
        let found: Vec<_> = branches(0x2000_0000, &code).collect();
        assert_eq!(
            found,
            [(0x2000_0002, 0x2000_0008), (0x2000_0008, 0x2000_0000)]
        );
    }
}
