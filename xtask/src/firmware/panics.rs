//! Which parts of the panic machinery the image holds: exactly those of a list, each for a reason.
//!
//! The positive control is the image with a planted panic: it has to hold one more.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use anyhow::{Context, Result, bail};
use object::{Object, ObjectSymbol};

use super::{build, planted};
use crate::process::Workspace;

/// What the image may hold, as the end of a path, and why.
const ALLOWED: &[(&str, &str)] = &[
    (
        "panicking::panic",
        "rtt-target: channels that are set up twice, which they are once, at the start",
    ),
    (
        "panicking::panic_fmt",
        "what the others call; rtic-time: a wait before the timers are set up, which they are \
         before any task runs",
    ),
    (
        "panic_const::panic_const_rem_by_zero",
        "heapless: the length of a queue's buffer, a constant",
    ),
];

/// What may stand under its own name or be folded into another, whose code is the same: the
/// compiler's check of a future that is polled after its end, which neither an await nor RTIC's
/// executor does.
const FOLDED: &str = "panic_const::panic_const_async_fn_resumed";

/// The check of the step `panic-image`.
pub(crate) fn check(workspace: &Workspace) -> Result<String> {
    let allowed: BTreeSet<String> = ALLOWED.iter().map(|(name, _)| (*name).to_owned()).collect();
    let found = machinery(&build(workspace)?)?;
    let more = found.difference(&allowed).filter(|name| *name != FOLDED);
    let more: Vec<_> = more.cloned().collect();
    if !more.is_empty() {
        bail!("the image can panic by {}", more.join(", "));
    }
    let gone: Vec<_> = allowed.difference(&found).cloned().collect();
    if !gone.is_empty() {
        bail!(
            "the image no longer holds {}: take it from the list in xtask/src/firmware/panics.rs",
            gone.join(", ")
        );
    }
    let with_panic = machinery(&planted::image(workspace, "panic")?)?;
    let is_known = |name: &String| allowed.contains(name) || name == FOLDED;
    if with_panic.iter().all(is_known) {
        bail!("the planted panic was not found, so that finding none shows nothing");
    }
    Ok(format!(
        "the image holds {} parts of the panic machinery, all on the list; a planted one is found",
        found.len()
    ))
}

/// The functions of the panic machinery in an image's table of symbols.
fn machinery(image: &Path) -> Result<BTreeSet<String>> {
    let bytes = fs::read(image).with_context(|| format!("{} cannot be read", image.display()))?;
    let elf = object::File::parse(&*bytes).context("the image is no ELF file")?;
    Ok(elf
        .symbols()
        .filter_map(|symbol| path(symbol.name().ok()?))
        .collect())
}

/// The last two parts of the path of a function that panics; nothing for any other.
fn path(symbol: &str) -> Option<String> {
    // The alternate form leaves the hash out.
    let name = format!("{:#}", rustc_demangle::demangle(symbol));
    let within = name.strip_prefix("core::")?;
    let parts: Vec<_> = within.split("::").collect();
    let panics = parts.contains(&"panicking") || within.ends_with("_failed");
    let last_two = parts
        .len()
        .checked_sub(2)
        .and_then(|from| parts.get(from..));
    last_two.filter(|_| panics).map(|parts| parts.join("::"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn functions_that_panic_are_known_by_their_paths() {
        let bounds = "_ZN4core9panicking18panic_bounds_check17h0123456789abcdefE";
        assert_eq!(path(bounds).unwrap(), "panicking::panic_bounds_check");
        let zero = "_ZN4core9panicking11panic_const23panic_const_rem_by_zero17h0123456789abcdefE";
        assert_eq!(path(zero).unwrap(), "panic_const::panic_const_rem_by_zero");
        let expect = "_RNvNtCseold96UKqg_4core6option13expect_failed";
        assert_eq!(path(expect).unwrap(), "option::expect_failed");
        assert_eq!(path("_ZN4core3fmt5write17h0123456789abcdefE"), None);
        assert_eq!(path("main"), None);
    }
}
