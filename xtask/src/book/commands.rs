//! Finds the commands in a text: in code blocks, and within sentences.
//!
//! `host/tool/tests/integration/documented` also includes this file to read texts.

/// Programs whose commands are found.
const PROGRAMS: [&str; 2] = ["palpate", "cargo"];

/// A command in a text.
#[derive(Debug, PartialEq, Eq)]
pub(crate) struct Command {
    /// Line in the text, from 1.
    pub(crate) line: usize,
    /// The whole command on one line, with its comment.
    pub(crate) text: String,
    /// Whether the command is within a sentence.
    pub(crate) is_inline: bool,
}

/// Commands of a Markdown page: in fences, and between backticks.
pub(crate) fn of_page(markdown: &str) -> Vec<Command> {
    let mut in_fence = false;
    commands(markdown, |line| {
        let is_fence = line.trim_start().starts_with("```");
        in_fence ^= is_fence;
        in_fence || is_fence
    })
}

struct CommandLine<'t> {
    number: usize,
    text: &'t str,
    is_code: bool,
}

/// Commands of a text; `is_code` tells code lines from others.
pub(crate) fn commands(text: &str, mut is_code: impl FnMut(&str) -> bool) -> Vec<Command> {
    let lines = (1..).zip(text.lines()).map(|(number, text)| CommandLine {
        number,
        text,
        is_code: is_code(text),
    });
    let lines: Vec<_> = lines.collect();
    let parts = lines.chunk_by(|line, next| line.is_code == next.is_code);
    let found = parts.flat_map(|part| match part {
        [line, ..] if line.is_code => in_block(part),
        _ => in_sentences(part),
    });
    found
        .filter(|command| names_program(&command.text))
        .collect()
}

/// One command per line, or per several lines joined by backslashes.
fn in_block(lines: &[CommandLine<'_>]) -> Vec<Command> {
    let mut found = Vec::new();
    let mut begun: Option<Command> = None;
    for line in lines {
        let mut command = begun.take().unwrap_or(Command {
            line: line.number,
            text: String::new(),
            is_inline: false,
        });
        let text = line.text.trim();
        let beginning = text.strip_suffix('\\');
        command.text += beginning.unwrap_or(text);
        match beginning {
            Some(_) => begun = Some(command),
            None => found.push(command),
        }
    }
    found.extend(begun);
    found
}

/// Text between backticks, also across a line break.
fn in_sentences(lines: &[CommandLine<'_>]) -> Vec<Command> {
    let mut found = Vec::new();
    for paragraph in lines.split(|line| line.text.trim().is_empty()) {
        let Some(first) = paragraph.first() else {
            continue;
        };
        let texts: Vec<_> = paragraph.iter().map(|line| line.text).collect();
        let mut line = first.number;
        for (index, piece) in texts.join("\n").split('`').enumerate() {
            let words: Vec<_> = piece.split_whitespace().collect();
            found.extend((index % 2 == 1).then(|| Command {
                line,
                text: words.join(" "),
                is_inline: true,
            }));
            line += piece.matches('\n').count();
        }
    }
    found
}

/// Whether the text calls one of [`PROGRAMS`] with an argument.
fn names_program(text: &str) -> bool {
    let calls = text.split(" | ").flat_map(|part| part.split(" && "));
    calls.into_iter().any(|call| {
        let mut words = call.split_whitespace().skip_while(|word| is_setting(word));
        words.next().is_some_and(|word| PROGRAMS.contains(&word)) && words.next().is_some()
    })
}

/// Whether a word before a command sets an environment variable.
fn is_setting(word: &str) -> bool {
    let name = word.split_once('=').map(|(name, _)| name);
    name.is_some_and(|name| name.chars().all(|c| c.is_ascii_uppercase() || c == '_'))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lines(commands: Vec<Command>) -> Vec<(usize, String, bool)> {
        let parts = |command: Command| (command.line, command.text, command.is_inline);
        commands.into_iter().map(parts).collect()
    }

    #[test]
    fn commands_of_blocks_and_sentences_are_found_with_their_lines() {
        let page = "A `palpate\nlive` and `palpate`.\n\n```\npalpate coil \\\n    --to 6   # six\n\
                    echo 1 | palpate encode\nA=1 cargo test\npalpate: no\n```\n`cargo fmt`";
        let found = [
            (1, "palpate live", true),
            (5, "palpate coil --to 6   # six", false),
            (7, "echo 1 | palpate encode", false),
            (8, "A=1 cargo test", false),
            (11, "cargo fmt", true),
        ];
        assert_eq!(
            lines(of_page(page)),
            found.map(|(n, t, i)| (n, t.into(), i))
        );
    }
}
