//! Shards: files with the results of parts of a run, each computed by a process of its own, and
//! merged into the results of one run.
//!
//! A shard is text. Its first line has the run and the numbers (seeds, points) of the results, then
//! comes a line for each result, and at last a checksum of all lines before.

pub mod number;
#[cfg(test)]
mod tests;

use std::env;
use std::fs::{self, File, TryLockError};
use std::io;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

use palpate_cli::failure::Failure;
use palpate_cli::notice::say;
use palpate_cli::output::OutputFile;
use palpate_cli::text::bytes_of_file;
use palpate_wire::crc32;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

/// A computation whose results can be split into shards.
pub struct Run {
    /// Name of the number of a result: seed or point.
    unit: &'static str,
    /// Arguments that compute the results of these numbers only.
    arguments: fn(&RangeInclusive<u64>) -> String,
    head: Head,
}

/// First line of a shard.
#[derive(Clone, PartialEq, Serialize, Deserialize)]
struct Head {
    shard_of: String,
    /// Version of the program, and checksum of its file: another build may give other digits.
    program: String,
    settings: Map<String, Value>,
    /// Numbers of the first and the last result.
    first: u64,
    last: u64,
}

/// A shard to be computed. No other process computes it meanwhile.
pub struct Shard {
    output: OutputFile,
    head: Head,
    lock: Option<(PathBuf, File)>,
}

/// A shard that was read.
struct Content {
    file: PathBuf,
    head: Head,
    /// The lines of the results; `None` if the file is cut or changed.
    lines: Option<Vec<String>>,
}

impl Run {
    /// Creates a run of a kind, with its settings: all that its results depend on.
    ///
    /// # Errors
    /// If the program cannot read its own file.
    pub fn new(
        kind: &str,
        unit: &'static str,
        settings: Map<String, Value>,
        arguments: fn(&RangeInclusive<u64>) -> String,
    ) -> Result<Self, Failure> {
        let head = Head {
            shard_of: kind.to_owned(),
            program: program()?,
            settings,
            first: 0,
            last: 0,
        };
        Ok(Self {
            unit,
            arguments,
            head,
        })
    }

    /// Returns the shard with these numbers, or `None` if its file is complete. Waits while another
    /// process computes it.
    ///
    /// # Errors
    /// If the file cannot be written, or is anything but a shard of this run with these numbers.
    pub fn shard(
        &self,
        file: &Path,
        numbers: &RangeInclusive<u64>,
    ) -> Result<Option<Shard>, Failure> {
        let head = Head {
            first: *numbers.start(),
            last: *numbers.end(),
            ..self.head.clone()
        };
        let output = OutputFile::new("--shard", file)?;
        if output.is_special() {
            return Ok(Some(Shard {
                output,
                head,
                lock: None,
            }));
        }
        if self.is_complete(file, &head)? {
            return Ok(None);
        }
        let lock = locked(file)?;
        let shard = Shard { output, head, lock };
        if self.is_complete(file, &shard.head)? {
            shard.unlock();
            return Ok(None);
        }
        Ok(Some(shard))
    }

    /// Whether a file is the complete shard with this head.
    fn is_complete(&self, file: &Path, head: &Head) -> Result<bool, Failure> {
        // A system that lost power may leave an empty file.
        if fs::metadata(file).map_or(0, |data| data.len()) == 0 {
            return Ok(false);
        }
        let content = Content::read(file)?;
        let other = if content.head.numbers() == head.numbers() {
            self.difference(&content.head)
        } else {
            Some(format!(
                "it has the {} and not the {}",
                self.named(&content.head.numbers()),
                self.named(&head.numbers())
            ))
        };
        match other {
            None => Ok(content.lines.is_some()),
            Some(difference) => Err(Failure::Argument(format!(
                "--shard {}: {difference}. Name another file, or remove this one.",
                file.display()
            ))),
        }
    }

    /// Reads the results with these numbers from files, in the order of their numbers.
    ///
    /// # Errors
    /// If a file is no complete shard of this run, and unless each number is there exactly once.
    pub fn merged<T: DeserializeOwned>(
        &self,
        files: &[PathBuf],
        numbers: &RangeInclusive<u64>,
    ) -> Result<Vec<T>, Failure> {
        let contents = files.iter().map(|file| Content::read(file));
        let mut contents: Vec<Content> = contents.collect::<Result<_, _>>()?;
        for content in &contents {
            self.require_own(content)?;
        }
        contents.sort_by_key(|content| (content.head.first, content.head.last));
        self.require_once(&contents, numbers)?;
        contents
            .iter()
            .flat_map(Content::results)
            .collect::<Result<_, _>>()
    }

    /// Fails unless a file is a complete shard of this run.
    fn require_own(&self, content: &Content) -> Result<(), Failure> {
        let file = content.file.display();
        if let Some(difference) = self.difference(&content.head) {
            return Err(Failure::Argument(format!(
                "--merge {file}: {difference}. Leave it out, or merge with the program and the arguments that wrote it."
            )));
        }
        if content.lines.is_none() {
            return Err(Failure::Argument(format!(
                "--merge {file}: the file is cut or changed, its checksum is not that of its lines. Run the same command with {} --shard {file} in place of --merge.",
                (self.arguments)(&content.head.numbers())
            )));
        }
        Ok(())
    }

    /// Fails unless the sorted shards have each number exactly once.
    fn require_once(
        &self,
        contents: &[Content],
        numbers: &RangeInclusive<u64>,
    ) -> Result<(), Failure> {
        let mut missing = Vec::new();
        let mut next = Some(*numbers.start());
        let mut before: Option<&Content> = None;
        for content in contents {
            let (of_file, file) = (content.head.numbers(), content.file.display());
            if of_file.start() < numbers.start() || of_file.end() > numbers.end() {
                return Err(Failure::Argument(format!(
                    "--merge {file}: it has the {}, and the run the {}. Leave it out, or give the run all its numbers.",
                    self.named(&of_file),
                    self.named(numbers)
                )));
            }
            match before {
                Some(before) if *of_file.start() <= before.head.last => {
                    let both = *of_file.start()..=before.head.last.min(*of_file.end());
                    return Err(Failure::Argument(format!(
                        "--merge {file}: {} has the {} too. Name one of the two files.",
                        before.file.display(),
                        self.named(&both)
                    )));
                }
                _ => {}
            }
            if let Some(next) = next.filter(|next| next < of_file.start()) {
                missing.push(next..=of_file.start() - 1);
            }
            next = of_file.end().checked_add(1);
            before = Some(content);
        }
        missing.extend(
            next.map(|next| next..=*numbers.end())
                .filter(|rest| !rest.is_empty()),
        );
        let Some(first) = missing.first() else {
            return Ok(());
        };
        let all: Vec<String> = missing.iter().map(|numbers| self.named(numbers)).collect();
        Err(Failure::Argument(format!(
            "--merge: no file has the {}. Run the same command with {} --shard FILE in place of --merge.",
            all.join(", the "),
            (self.arguments)(first)
        )))
    }

    /// Difference between a shard's run and this one; `None` if they are the same run.
    fn difference(&self, other: &Head) -> Option<String> {
        let own = &self.head;
        if other.shard_of != own.shard_of {
            return Some(format!(
                "it is a shard of a {}, and this is a {}",
                other.shard_of, own.shard_of
            ));
        }
        if other.program != own.program {
            return Some(format!(
                "it was written by the program {}, and this is {}",
                other.program, own.program
            ));
        }
        let names = own.settings.keys().chain(other.settings.keys());
        let mut names = names.filter(|name| own.settings.get(*name) != other.settings.get(*name));
        let name = names.next()?;
        let value = |of: &Head| {
            of.settings
                .get(name)
                .map_or("none".to_owned(), Value::to_string)
        };
        Some(format!(
            "its {name} is {}, and here it is {}",
            value(other),
            value(own)
        ))
    }

    /// These numbers in words.
    fn named(&self, numbers: &RangeInclusive<u64>) -> String {
        let (unit, first, last) = (self.unit, numbers.start(), numbers.end());
        if first == last {
            format!("{unit} {first}")
        } else {
            format!("{unit}s {first} to {last}")
        }
    }
}

impl Head {
    fn numbers(&self) -> RangeInclusive<u64> {
        self.first..=self.last
    }
}

impl Shard {
    /// Writes the results, in the order of their numbers.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn write<T: Serialize>(self, results: &[T]) -> Result<(), Failure> {
        let mut lines = vec![serde_json::to_string(&self.head)?];
        for result in results {
            lines.push(serde_json::to_string(result)?);
        }
        let body = lines.join("\n") + "\n";
        let end = end_of(body.as_bytes());
        self.output.write(body + &end)?;
        self.unlock();
        Ok(())
    }

    /// Removes the lock's file. Only done when the shard is complete: a process that waits for the
    /// lock of a removed file then finds the shard.
    fn unlock(self) {
        if let Some((path, _locked)) = self.lock {
            // A file that cannot be removed does no harm.
            let _ = fs::remove_file(path);
        }
    }
}

impl Content {
    fn read(file: &Path) -> Result<Self, Failure> {
        let bytes = bytes_of_file(file)?;
        let text = String::from_utf8_lossy(&bytes);
        let mut lines = text.split('\n').map(str::to_owned);
        let head = lines
            .next()
            .and_then(|line| serde_json::from_str(&line).ok());
        let head: Head = head.ok_or_else(|| Failure::Input {
            file: file.to_path_buf(),
            line: 1,
            problem: "this is no shard".to_owned(),
            allowed: "a file of --shard".to_owned(),
        })?;
        let count = (head.last.checked_sub(head.first)).and_then(|count| count.checked_add(1));
        let is_whole =
            |lines: &Vec<String>| Some(lines.len() as u64) == count && has_own_end(&bytes);
        // The last two lines are the checksum and, behind its line feed, an empty one.
        let mut lines: Vec<String> = lines.collect();
        lines.truncate(lines.len().saturating_sub(2));
        Ok(Self {
            file: file.to_path_buf(),
            head,
            lines: Some(lines).filter(is_whole),
        })
    }

    fn results<T: DeserializeOwned>(&self) -> impl Iterator<Item = Result<T, Failure>> {
        let lines = (2..).zip(self.lines.iter().flatten());
        lines.map(|(number, line)| {
            serde_json::from_str(line).map_err(|error| Failure::Input {
                file: self.file.clone(),
                line: number,
                problem: error.to_string(),
                allowed: "a result of this run".to_owned(),
            })
        })
    }
}

/// Locks a shard by a file beside it, and waits for another process that has the lock. `None` on a
/// file system without locks, where two processes may compute the same shard. The system unlocks
/// the file of a process that ends.
fn locked(shard: &Path) -> Result<Option<(PathBuf, File)>, Failure> {
    let mut name = shard.as_os_str().to_owned();
    name.push(".lock");
    let path = PathBuf::from(name);
    let unwritable = |reason: io::Error| Failure::Unwritable {
        file: path.clone(),
        argument: "--shard",
        reason,
    };
    let options = File::options()
        .write(true)
        .create(true)
        .truncate(false)
        .open(&path);
    let file = options.map_err(unwritable)?;
    match file.try_lock() {
        Ok(()) => {}
        Err(TryLockError::Error(_)) => {
            let _ = fs::remove_file(&path);
            return Ok(None);
        }
        Err(TryLockError::WouldBlock) => {
            say(format_args!(
                "{}: waits for another process, which computes this shard",
                shard.display()
            ));
            file.lock().map_err(unwritable)?;
        }
    }
    Ok(Some((path, file)))
}

/// Version and build of this program.
fn program() -> Result<String, Failure> {
    let own = env::current_exe().map_err(Failure::refused)?;
    let build = crc32(&bytes_of_file(&own)?);
    Ok(format!("{} ({build:08x})", env!("CARGO_PKG_VERSION")))
}

/// Last line of a shard with these lines.
fn end_of(body: &[u8]) -> String {
    format!("{{\"crc32c\":\"{:08x}\"}}\n", crc32(body))
}

/// Whether the last line is that of the lines before.
fn has_own_end(bytes: &[u8]) -> bool {
    let end = bytes.len().saturating_sub(end_of(&[]).len());
    let (body, end) = bytes.split_at(end);
    end == end_of(body).as_bytes()
}
