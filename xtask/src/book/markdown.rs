//! A minimal Markdown parser for links, code and headings.

use std::collections::BTreeSet;

use super::commands::{self, Command};

/// Links, code and link targets of a page.
#[derive(Debug, Default)]
pub(super) struct Page {
    /// Targets of links, with their lines.
    pub(super) links: Vec<(usize, String)>,
    /// Inline code, with its lines.
    pub(super) code: Vec<(usize, String)>,
    /// Commands, in code blocks and in sentences.
    pub(super) commands: Vec<Command>,
    /// Anchors of the page's headings.
    pub(super) anchors: BTreeSet<String>,
}

impl Page {
    /// Parses a page. Code blocks contribute only commands.
    pub(super) fn parse(text: &str) -> Self {
        let mut page = Self {
            commands: commands::of_page(text),
            ..Self::default()
        };
        let mut in_block = false;
        for (index, line) in text.lines().enumerate() {
            if line.trim_start().starts_with("```") {
                in_block = !in_block;
            } else if !in_block {
                page.read_line(index + 1, line);
            }
        }
        page
    }

    fn read_line(&mut self, number: usize, line: &str) {
        if let Some(title) = heading(line) {
            let name = anchor(title);
            let repeated = (1..).map(|n| format!("{name}-{n}"));
            let free = std::iter::once(name.clone())
                .chain(repeated)
                .find(|name| !self.anchors.contains(name));
            self.anchors.extend(free);
        }
        // Every second piece is code; a link's text may be code, its target never is.
        let mut prose = String::new();
        for (index, piece) in line.split('`').enumerate() {
            if index % 2 == 1 {
                self.code.push((number, piece.to_owned()));
            } else {
                prose.push_str(piece);
            }
        }
        let targets = prose.split("](").skip(1);
        let targets = targets.filter_map(|rest| rest.split_once(')'));
        self.links
            .extend(targets.map(|(target, _)| (number, target.to_owned())));
    }
}

/// The title of a heading.
fn heading(line: &str) -> Option<&str> {
    let title = line.trim_start_matches('#');
    (line.len() > title.len())
        .then(|| title.strip_prefix(' '))
        .flatten()
}

/// Anchor that mdbook and repository pages give to a heading.
fn anchor(title: &str) -> String {
    title
        .trim()
        .to_lowercase()
        .chars()
        .filter(|c| c.is_alphanumeric() || " _-".contains(*c))
        .map(|c| if c == ' ' { '-' } else { c })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn links_and_code_are_found_with_their_lines() {
        let page = Page::parse("a [b](c.md)\n\n![`d`](e.svg) and `f/g.rs`");
        assert_eq!(page.links, [(1, "c.md".into()), (3, "e.svg".into())]);
        assert_eq!(page.code, [(3, "d".into()), (3, "f/g.rs".into())]);
    }

    #[test]
    fn blocks_and_pieces_of_code_have_no_links() {
        let page = Page::parse("```\n[a](b.md)\n# C\n```\n`x[i](y)`");
        assert!(page.links.is_empty() && page.anchors.is_empty());
    }

    #[test]
    fn headings_have_the_names_that_links_use() {
        let page = Page::parse("# The Coil, *its* `R`\n## Limits\n## Limits\n#no");
        let names: Vec<_> = page.anchors.iter().map(String::as_str).collect();
        assert_eq!(names, ["limits", "limits-1", "the-coil-its-r"]);
    }
}
