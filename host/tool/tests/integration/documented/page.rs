//! Pages with their commands.

use std::fs;
use std::path::{Path, PathBuf};
use std::process;

use super::commands::{self, Command};
use super::desk::Start;

/// Placeholders of the documents with their replacements. Where the tool expects a number or a
/// verb, the replacement is one.
const PLACEHOLDERS: [(&str, &str); 11] = [
    ("FILE", "FILE"),
    ("FOLDER", "FOLDER"),
    ("HOST", "HOST"),
    ("IMAGE", "IMAGE"),
    ("N", "1"),
    ("NAME", "NAME"),
    ("REPOSITORY", "REPOSITORY"),
    ("SECONDS", "1"),
    ("STACK", "STACK"),
    ("SUBCOMMAND", "measure"),
    ("VERB", "measure"),
];

/// A page with commands of the tool.
pub(super) struct Page {
    /// Path, or the command that prints it.
    name: String,
    pub(super) commands: Vec<Command>,
}

/// Folder of the workspace.
pub(super) fn root() -> PathBuf {
    let package = Path::new(env!("CARGO_MANIFEST_DIR"))
        .canonicalize()
        .unwrap();
    package.ancestors().nth(2).unwrap().to_owned()
}

/// All Markdown pages except the changelog, whose commands are of their time, and all help texts.
pub(super) fn pages() -> Vec<Page> {
    let mut git = process::Command::new("git");
    let list = git
        .args(["ls-files", "*.md"])
        .current_dir(root())
        .output()
        .unwrap();
    let names = String::from_utf8(list.stdout).unwrap();
    let names = names.lines().filter(|name| *name != "CHANGELOG.md");
    let page = |name: &str| Page {
        name: name.to_owned(),
        commands: commands::of_page(&fs::read_to_string(root().join(name)).unwrap()),
    };
    let mut pages: Vec<_> = names.map(page).collect();
    add_help(&[], &mut pages);
    for page in &mut pages {
        page.commands
            .retain(|command| tool_arguments(&command.text).is_some());
    }
    let total: usize = pages.iter().map(|page| page.commands.len()).sum();
    assert!(
        pages.len() > 100 && total > 300,
        "{total} commands on {} pages",
        pages.len()
    );
    pages
}

/// Adds the help text of a verb and of its subcommands.
fn add_help(verb: &[&str], pages: &mut Vec<Page>) {
    let mut tool = process::Command::new(env!("CARGO_BIN_EXE_palpate"));
    let help = tool.arg("help").args(verb).output().unwrap();
    let text = String::from_utf8(help.stdout).unwrap();
    pages.push(Page {
        name: format!("palpate help {}", verb.join(" ")),
        commands: of_help(&text),
    });
    let list = text.lines().skip_while(|line| *line != "Commands:").skip(1);
    for line in list.take_while(|line| !line.is_empty()) {
        // A line with a larger indent continues the previous one.
        let name = line
            .split(' ')
            .nth(2)
            .filter(|name| !["", "help"].contains(name));
        if let Some(name) = name {
            add_help(&[verb, &[name]].concat(), pages);
        }
    }
}

/// Commands of a help text: examples, which are indented by two spaces, and commands in backticks.
fn of_help(text: &str) -> Vec<Command> {
    let mut continues = false;
    commands::commands(text, |line| {
        let is_example = line.starts_with("  ") && !line.starts_with("   ");
        let is_code = is_example || continues;
        continues = is_code && line.ends_with('\\');
        is_code
    })
}

/// Arguments of the tool in a command, called directly or through cargo.
pub(super) fn tool_arguments(text: &str) -> Option<&str> {
    let text = text.split(" #").next()?;
    let calls = text.split(" | ").flat_map(|part| part.split(" && "));
    calls.into_iter().find_map(|call| {
        let (program, arguments) = call.trim().split_once(' ')?;
        match program {
            "palpate" => Some(arguments.trim()),
            "cargo" if arguments.starts_with("run --release -p palpate --") => {
                Some(arguments.split_once(" -- ")?.1)
            }
            _ => None,
        }
    })
}

fn placeholder(word: &str) -> Option<&'static str> {
    let mut all = PLACEHOLDERS.iter();
    all.find_map(|(name, value)| (*name == word).then_some(*value))
}

/// Whether a command is incomplete: it contains a placeholder in capitals, or leaves something out.
fn is_form(text: &str) -> bool {
    let mut words = text.split(|c: char| !c.is_ascii_alphabetic());
    words.any(|word| placeholder(word).is_some()) || text.contains("...")
}

/// Error of the tool for the arguments of a command.
pub(super) fn refusal_of(text: &str) -> Option<String> {
    let words = tool_arguments(text)?.split(' ');
    let words = words.take_while(|word| ![">", "<", "&"].contains(word));
    let words = words.filter(|word| *word != "...");
    let words = words.map(|word| placeholder(word).unwrap_or(word));
    let mut words: Vec<_> = words.collect();
    // With `--help` the tool parses the arguments before it and does nothing.
    if words[0] != "help" {
        words.push("--help");
    }
    let mut shell = process::Command::new("sh");
    shell.args(["-c", &format!("exec \"$TOOL\" {}", words.join(" "))]);
    let output = shell
        .env("TOOL", env!("CARGO_BIN_EXE_palpate"))
        .output()
        .unwrap();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    // A sentence may name an option without its value.
    let lacks_value = said.contains("but none was supplied");
    (!output.status.success() && !lacks_value).then_some(said)
}

impl Page {
    /// Location of a command, with its text.
    pub(super) fn place(&self, command: &Command) -> String {
        format!("{}:{}: `{}`", self.name, command.line, command.text)
    }

    /// Runs commands of this page in its own folder. Returns their errors.
    pub(super) fn run(&self, start: &Start, is_chosen: impl Fn(&str) -> bool) -> Vec<String> {
        let commands = self.commands.iter().filter(|command| !command.is_inline);
        let commands = commands.filter(|c| !c.text.starts_with("cargo "));
        let commands = commands.filter(|c| !c.text.contains("# needs a ") && !is_form(&c.text));
        let commands: Vec<_> = commands.filter(|c| is_chosen(&c.text)).collect();
        if commands.is_empty() {
            return Vec::new();
        }
        let texts = commands.iter().map(|command| command.text.as_str());
        let mut desk = start.desk(&texts.collect::<Vec<_>>());
        let faults = commands.iter().filter_map(|command| {
            let fault = desk.run(&command.text).err()?;
            Some(format!("{}: {fault}", self.place(command)))
        });
        faults.collect()
    }
}

#[test]
fn examples_of_a_help_text_are_indented() {
    let help = "Reads `palpate decode`.\n\nOptions:\n      --of <X>\n          palpate checkout\n\n\
                Example:\n  palpate coil \\\n      --to 6";
    let found = of_help(help).into_iter().map(|c| (c.line, c.text));
    let expected = [(1, "palpate decode"), (8, "palpate coil --to 6")];
    assert!(found.eq(expected.map(|(line, text)| (line, text.to_owned()))));
}
