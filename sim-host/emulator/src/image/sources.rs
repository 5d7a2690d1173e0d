//! Maps addresses of an image to functions and source files, by its debug information.

use std::fmt;
use std::ops::Range;
use std::path::Path;

use addr2line::Loader;
use object::read::elf::ElfFile32;
use object::{Endianness, Object, ObjectSymbol, SymbolKind};

/// A function, and the file with its code at an address.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Function {
    /// Demangled name.
    pub name: String,
    /// Source file.
    pub file: String,
}

/// The functions of an image.
pub struct Sources {
    loader: Loader,
    functions: Vec<(Range<u32>, String)>,
}

/// Error of reading an image's debug information.
#[derive(Debug)]
pub struct SourcesError(String);

impl fmt::Display for SourcesError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "the image's debug information cannot be used: {}",
            self.0
        )
    }
}

impl std::error::Error for SourcesError {}

impl Sources {
    /// Reads an ELF file.
    ///
    /// # Errors
    /// [`SourcesError`].
    pub fn load(path: &Path) -> Result<Self, SourcesError> {
        let wrong = |error: &dyn fmt::Display| SourcesError(error.to_string());
        let bytes = std::fs::read(path).map_err(|error| wrong(&error))?;
        let elf = ElfFile32::<Endianness>::parse(&*bytes).map_err(|error| wrong(&error))?;
        let of_code = |symbol: &object::read::elf::ElfSymbol32<'_, '_>| {
            let begin = symbol.address() as u32 & !1;
            let name = addr2line::demangle_auto(symbol.name().ok()?.into(), None).into_owned();
            let end = begin + symbol.size() as u32;
            (symbol.kind() == SymbolKind::Text).then_some((begin..end, name))
        };
        let mut functions: Vec<_> = elf
            .symbols()
            .filter_map(|symbol| of_code(&symbol))
            .collect();
        functions.sort_by_key(|(range, _)| range.start);
        // Functions in assembly often have no size: they end where the next one starts.
        let starts: Vec<u32> = functions.iter().map(|(range, _)| range.start).collect();
        for (range, _) in &mut functions {
            if range.start == range.end {
                let next = starts.iter().find(|&&start| start > range.start);
                range.end = next.map_or(range.start + 2, |&start| start);
            }
        }
        let loader = Loader::new(path).map_err(|error| wrong(&error))?;
        Ok(Self { loader, functions })
    }

    /// Functions as linked, with their addresses and names, in order of address.
    #[must_use]
    pub fn functions(&self) -> &[(Range<u32>, String)] {
        &self.functions
    }

    /// Functions at an address, the innermost inlined one first; empty where there is no debug
    /// information, as for assembly.
    #[must_use]
    pub fn at(&self, address: u32) -> Vec<Function> {
        let mut found = Vec::new();
        let Ok(mut frames) = self.loader.find_frames(address.into()) else {
            return found;
        };
        while let Ok(Some(frame)) = frames.next() {
            let name = frame.function.as_ref();
            let name = name.and_then(|name| name.demangle().ok());
            let file = frame.location.and_then(|location| location.file);
            found.push(Function {
                name: name.unwrap_or_default().into_owned(),
                file: file.unwrap_or_default().to_owned(),
            });
        }
        found
    }
}
