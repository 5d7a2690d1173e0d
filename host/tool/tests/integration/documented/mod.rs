//! Commands in README, docs and help texts work as described.
//!
//! The tool parses every command. Those in code blocks and in the examples of a help text are run,
//! page by page and in order, except those that
//!
//! - state a requirement in a comment: `# needs a board`, a probe, a bench;
//! - contain a placeholder in capitals, as FILE, or leave something out by `...`.

mod desk;
mod page;

use std::sync::Mutex;
use std::thread::{available_parallelism, scope};

use desk::Start;
use page::{Page, pages, refusal_of, tool_arguments};

// The gate checks the cargo commands in the same texts.
#[path = "../../../../../xtask/src/book/commands.rs"]
mod commands;

#[test]
fn the_tool_has_every_verb_and_option_that_the_docs_name() {
    let pages = pages();
    let refusals = |page: &Page| {
        let commands = page.commands.iter();
        let refusals =
            commands.filter_map(|c| Some(format!("{}: {}", page.place(c), refusal_of(&c.text)?)));
        refusals.collect::<Vec<_>>()
    };
    let refused: Vec<_> = pages.iter().flat_map(refusals).collect();
    assert!(refused.is_empty(), "{}", refused.join("\n"));
}

/// Verbs that need no board and are fast.
const QUICK: [&str; 14] = [
    "--version",
    "chip",
    "completions",
    "decode",
    "devices",
    "encode",
    "faults",
    "field sensing",
    "field show",
    "help",
    "man",
    "plan-ldc",
    "plan",
    "words",
];

#[test]
fn commands_without_a_board_do_what_the_docs_say() {
    let start = Start::without_board();
    let is_quick = |text: &str| {
        let arguments = tool_arguments(text).unwrap_or_default();
        QUICK.iter().any(|verb| arguments.starts_with(verb))
    };
    run(&start, is_quick);
}

#[test]
#[ignore = "long: by hand, with DOCUMENTED_ALL=1"]
fn every_command_does_what_the_docs_say() {
    if std::env::var_os("DOCUMENTED_ALL").is_none() {
        println!("Skipped: the commands that need a board are run with DOCUMENTED_ALL=1.");
        return;
    }
    run(&Start::with_board(), |_| true);
}

/// Runs commands of every page, with as many pages in parallel as there are processors.
fn run(start: &Start, is_chosen: impl Fn(&str) -> bool + Sync) {
    let pages = pages();
    let next = Mutex::new(pages.iter());
    let faults = Mutex::new(Vec::new());
    let work = || {
        while let Some(page) = { next.lock().unwrap().next() } {
            let found = page.run(start, &is_chosen);
            faults.lock().unwrap().extend(found);
        }
    };
    scope(|scope| {
        for _ in 0..available_parallelism().unwrap().get() {
            scope.spawn(work);
        }
    });
    let faults = faults.into_inner().unwrap();
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}
