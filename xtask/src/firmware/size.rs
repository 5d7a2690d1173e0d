//! Flash and memory of the image, against their budget.

use std::fs;

use anyhow::{Context, Result, bail};
use object::{Object, ObjectSection, ObjectSymbol};

use super::image::build;
use crate::process::Workspace;

const BUDGET: &str = "firmware/size-budget.toml";

/// Bytes used by the image, in the order of the budget's file.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Taken {
    flash: u64,
    static_memory: u64,
    code_in_memory: u64,
    stack: u64,
}

impl Taken {
    fn of(bytes: &[u8]) -> Result<Self> {
        let elf = object::File::parse(bytes).context("the image is no ELF file")?;
        let size = |name: &str| {
            elf.section_by_name(name)
                .map_or(0, |section| section.size())
        };
        let code_in_memory = size(".hot");
        let loaded = [".boot2", ".vector_table", ".cold", ".text", ".rodata"];
        let flash: u64 = loaded.iter().map(|name| size(name)).sum();
        let symbol = |name: &str| {
            elf.symbols()
                .find(|symbol| symbol.name() == Ok(name))
                .map(|symbol| symbol.address())
                .with_context(|| format!("the image has no symbol {name}"))
        };
        Ok(Self {
            flash: flash + code_in_memory + size(".data"),
            static_memory: size(".data") + size(".bss") + size(".uninit"),
            code_in_memory,
            stack: symbol("_stack_start")? - symbol("_stack_end")?,
        })
    }

    fn rows(&self) -> [(&'static str, u64); 4] {
        [
            ("flash", self.flash),
            ("static_memory", self.static_memory),
            ("code_in_memory", self.code_in_memory),
            ("stack", self.stack),
        ]
    }
}

/// Builds the image and checks it against its budget; returns a table.
pub(crate) fn check(workspace: &Workspace) -> Result<String> {
    let image = build(workspace)?;
    let bytes = fs::read(&image).with_context(|| format!("{} cannot be read", image.display()))?;
    let budget = fs::read_to_string(workspace.root().join(BUDGET))
        .with_context(|| format!("{BUDGET} cannot be read"))?;
    compare(&Taken::of(&bytes)?, &budget)
}

fn compare(taken: &Taken, budget: &str) -> Result<String> {
    let budget: toml::Table = budget
        .parse()
        .with_context(|| format!("{BUDGET} is not as TOML should be"))?;
    let number = |name: &str, key: &str| {
        let entry = budget.get(name).and_then(|entry| entry.get(key));
        entry.and_then(toml::Value::as_integer)
    };
    let mut lines = vec![format!(
        "{:<16}{:>9}{:>9}{:>9}",
        "bytes", "taken", "budget", "target"
    )];
    let mut over = Vec::new();
    for (name, taken) in taken.rows() {
        let allowed =
            number(name, "budget").with_context(|| format!("{BUDGET} has no budget of {name}"))?;
        let target = number(name, "target").map_or(String::new(), |target| target.to_string());
        lines.push(format!("{name:<16}{taken:>9}{allowed:>9}{target:>9}"));
        if i64::try_from(taken).is_ok_and(|taken| taken > allowed) {
            over.push(format!("{name}: {taken} bytes of {allowed}"));
        }
    }
    let table = lines.join("\n    ");
    if over.is_empty() {
        Ok(table)
    } else {
        bail!(
            "the image is larger than {BUDGET} allows: {}",
            over.join("; ")
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TAKEN: Taken = Taken {
        flash: 100,
        static_memory: 20,
        code_in_memory: 10,
        stack: 5,
    };

    fn budget(flash: u64) -> String {
        format!(
            "[flash]\nbudget = {flash}\ntarget = 90\n[static_memory]\nbudget = 20\n\
             [code_in_memory]\nbudget = 10\n[stack]\nbudget = 5\n"
        )
    }

    #[test]
    fn an_image_within_its_budget_passes_and_a_larger_one_does_not() {
        assert!(compare(&TAKEN, &budget(100)).unwrap().contains("flash"));
        let error = compare(&TAKEN, &budget(99)).unwrap_err().to_string();
        assert!(error.contains("flash: 100 bytes of 99"), "{error}");
    }

    #[test]
    fn a_budget_that_lacks_an_entry_is_an_error() {
        let error = compare(&TAKEN, "[flash]\nbudget = 1000\n").unwrap_err();
        assert!(error.to_string().contains("static_memory"), "{error}");
    }
}
