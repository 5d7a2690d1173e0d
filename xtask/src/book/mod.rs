//! The book: every page is listed, every link and every path in the text leads to a file, every
//! cargo command names existing items, and mdbook builds it.
//!
//! A link stays within the unit in which its file is read: for a page of `docs` the book, for a
//! file of a package the package, for any other file the repository. The text names anything
//! outside by its path from the repository's root.

mod cargo;
mod commands;
mod markdown;

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::fs;

use anyhow::{Context, Result, bail};

use crate::process::{Invocation, Workspace};
use crate::repository;
use cargo::Cargo;
use markdown::Page;

/// Folder of the book, and its list of pages.
const BOOK: &str = "docs";
const SUMMARY: &str = "docs/SUMMARY.md";

/// Records of the past: they may name paths, and the first two also commands, that no longer exist.
const RECORDS: [&str; 3] = ["CHANGELOG.md", "docs/evidence/", "docs/decisions/"];

/// A fault in the text.
#[derive(Debug, PartialEq, Eq)]
struct Finding {
    file: String,
    line: usize,
    fault: String,
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}: {}", self.file, self.line, self.fault)
    }
}

/// Checks the text, then builds the book into `target/book`.
pub(crate) fn check_workspace(workspace: &Workspace) -> Result<String> {
    let text = Text::read(workspace)?;
    let mut findings = text.findings();
    findings.extend(commands_that_fail(workspace, &text)?);
    if !findings.is_empty() {
        let lines: Vec<_> = findings.iter().map(ToString::to_string).collect();
        bail!("{} findings:\n    {}", lines.len(), lines.join("\n    "));
    }
    workspace.run(&Invocation::new("mdbook", &["build"]))?;
    let links: usize = text.pages.values().map(|page| page.links.len()).sum();
    Ok(format!(
        "{} pages with {links} links; the book is target/book/index.html",
        text.pages.len()
    ))
}

/// Cargo commands that name something that does not exist.
fn commands_that_fail(workspace: &Workspace, text: &Text) -> Result<Vec<Finding>> {
    let cargo = Cargo::read(workspace)?;
    let mut findings = Vec::new();
    for (file, page) in text
        .pages
        .iter()
        .filter(|(file, _)| !RECORDS[..2].iter().any(|record| file.starts_with(record)))
    {
        for command in &page.commands {
            let fault = cargo.fault_of(&command.text);
            findings.extend(fault.map(|fault| Finding {
                file: file.clone(),
                line: command.line,
                fault: format!("`{}`: {fault}", command.text),
            }));
        }
    }
    Ok(findings)
}

/// Files and pages of the repository.
#[derive(Debug, Default)]
struct Text {
    /// Every file, by its path from the root.
    files: BTreeSet<String>,
    /// Markdown pages.
    pages: BTreeMap<String, Page>,
}

impl Text {
    fn read(workspace: &Workspace) -> Result<Self> {
        let mut text = Self::default();
        for name in repository::files(workspace)? {
            let path = workspace.root().join(&name);
            if name.ends_with(".md") && path.is_file() {
                let content = fs::read_to_string(&path)
                    .with_context(|| format!("{name} could not be read"))?;
                text.pages.insert(name.clone(), Page::parse(&content));
            }
            if path.exists() {
                text.files.insert(name);
            }
        }
        Ok(text)
    }

    /// All faults, in order of the files.
    fn findings(&self) -> Vec<Finding> {
        let mut findings = self.unlisted();
        for (file, page) in &self.pages {
            let finding = |line, fault| Finding {
                file: file.clone(),
                line,
                fault,
            };
            for (line, target) in &page.links {
                let fault = self.fault_of_link(file, target);
                findings.extend(fault.map(|fault| finding(*line, fault)));
            }
            for (line, path) in &page.code {
                let gone = self.is_gone(file, path);
                findings.extend(gone.then(|| finding(*line, format!("{path} does not exist"))));
            }
        }
        findings
    }

    /// Pages of the book that its list leaves out; mdbook does not build them.
    fn unlisted(&self) -> Vec<Finding> {
        let Some(summary) = self.pages.get(SUMMARY) else {
            return Vec::new();
        };
        let listed: BTreeSet<_> = summary
            .links
            .iter()
            .filter_map(|(_, target)| resolve(SUMMARY, target))
            .collect();
        self.pages
            .keys()
            .filter(|page| is_below(page, BOOK) && *page != SUMMARY && !listed.contains(*page))
            .map(|page| Finding {
                file: page.clone(),
                line: 1,
                fault: format!("{SUMMARY} does not list this page"),
            })
            .collect()
    }

    /// Description of a fault in a link; `None` if it is right.
    fn fault_of_link(&self, file: &str, link: &str) -> Option<String> {
        if link.contains("://") || link.starts_with("mailto:") {
            return None;
        }
        let (path, anchor) = link.split_once('#').unwrap_or((link, ""));
        let target = if path.is_empty() {
            file.to_owned()
        } else {
            let Some(target) = resolve(file, path) else {
                return Some(format!("the link {link} leaves the repository"));
            };
            target
        };
        if !self.exists(&target) {
            return Some(format!(
                "the link {link} leads to {target}, which does not exist"
            ));
        }
        let home = self.home(file);
        if home != self.home(&target) && !home.is_empty() {
            return Some(format!(
                "the link {link} leaves {home}: name {target} in the text instead"
            ));
        }
        let has_anchor = |page: &Page| anchor.is_empty() || page.anchors.contains(anchor);
        match self.pages.get(&target) {
            Some(page) if !has_anchor(page) => {
                Some(format!("the link {link} leads to no heading of {target}"))
            }
            _ => None,
        }
    }

    /// Whether inline code names a path of the repository that does not exist.
    fn is_gone(&self, file: &str, code: &str) -> bool {
        let path = code.trim_end_matches('/');
        let top = path.split('/').next().unwrap_or_default();
        let plain = |c: char| c.is_ascii_alphanumeric() || "/._-".contains(c);
        let is_path = path.contains('/') && path.chars().all(plain) && self.exists(top);
        let records = RECORDS.iter().any(|record| file.starts_with(record));
        // A crate's page names its own files relative to its folder.
        let nearby = format!("{}/{path}", self.home(file));
        is_path && !records && !self.exists(path) && !self.exists(&nearby)
    }

    /// Whether a file or folder exists.
    fn exists(&self, path: &str) -> bool {
        let below = format!("{path}/");
        self.files.contains(path)
            || self
                .files
                .range(below.clone()..)
                .next()
                .is_some_and(|file| file.starts_with(&below))
    }

    /// Unit in which a file is read: the book, the innermost package, or the repository.
    fn home<'a>(&self, file: &'a str) -> &'a str {
        if is_below(file, BOOK) {
            return BOOK;
        }
        file.match_indices('/')
            .rev()
            .map(|(end, _)| &file[..end])
            .find(|folder| self.files.contains(&format!("{folder}/Cargo.toml")))
            .unwrap_or_default()
    }
}

/// Whether a file lies in a folder.
fn is_below(file: &str, folder: &str) -> bool {
    file.strip_prefix(folder)
        .is_some_and(|rest| rest.starts_with('/'))
}

/// Path from the root to a link's target, or `None` beyond the root.
fn resolve(file: &str, link: &str) -> Option<String> {
    let mut parts: Vec<&str> = file.split('/').collect();
    parts.pop();
    for part in link.split('/') {
        match part {
            "" | "." => {}
            ".." => {
                parts.pop()?;
            }
            name => parts.push(name),
        }
    }
    Some(parts.join("/"))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A repository of these files; files that end in `.md` have this text.
    fn text(files: &[(&str, &str)]) -> Text {
        let mut text = Text::default();
        for (name, content) in files {
            text.files.insert((*name).to_owned());
            if name.ends_with(".md") {
                text.pages.insert((*name).to_owned(), Page::parse(content));
            }
        }
        text
    }

    /// Faults of `docs/a.md` with this text.
    fn found(content: &str) -> Vec<String> {
        let files = [
            ("README.md", "# Top"),
            ("docs/SUMMARY.md", "[A](a.md) [B](b.md)"),
            ("docs/a.md", content),
            ("docs/b.md", "# Of b\n## Its end"),
            ("docs/images/c.svg", ""),
            ("model/Cargo.toml", ""),
            ("model/src/lib.rs", ""),
        ];
        let findings = text(&files).findings();
        findings.into_iter().map(|finding| finding.fault).collect()
    }

    #[test]
    fn the_docs_name_commands_that_exist() {
        let workspace = Workspace::find(None).unwrap();
        let text = Text::read(&workspace).unwrap();
        assert!(text.pages.len() > 30);
        assert_eq!(commands_that_fail(&workspace, &text).unwrap(), []);
    }

    #[test]
    fn links_within_the_book_pass() {
        let good =
            "[b](b.md#its-end) ![c](images/c.svg) [x](https://example.org/y.md) [d](#d)\n# D";
        assert_eq!(found(good), Vec::<String>::new());
    }

    #[test]
    fn a_link_to_nothing_is_found() {
        assert!(found("[b](e.md)")[0].contains("docs/e.md, which does not exist"));
        assert!(found("[b](b.md#start)")[0].contains("no heading of docs/b.md"));
        assert!(found("[b](../../x.md)")[0].contains("leaves the repository"));
    }

    #[test]
    fn a_link_out_of_the_book_is_found() {
        for link in ["[m](../model/src/lib.rs)", "[t](../README.md)"] {
            assert!(found(link)[0].contains("leaves docs"), "{link}");
        }
    }

    #[test]
    fn a_package_links_within_itself_and_the_root_anywhere() {
        let files = |package: &'static str| {
            [
                ("README.md", "[m](model/README.md)"),
                ("model/Cargo.toml", ""),
                ("model/README.md", package),
                ("model/SOURCES.md", ""),
                ("model/field/Cargo.toml", ""),
            ]
        };
        assert!(text(&files("[s](SOURCES.md)")).findings().is_empty());
        for link in ["[t](../README.md)", "[f](field/Cargo.toml)"] {
            assert!(
                text(&files(link)).findings()[0]
                    .fault
                    .contains("leaves model")
            );
        }
    }

    #[test]
    fn a_page_that_the_list_leaves_out_is_found() {
        let files = [("docs/SUMMARY.md", ""), ("docs/a.md", "")];
        assert!(text(&files).findings()[0].fault.contains("does not list"));
    }

    #[test]
    fn a_path_in_the_text_has_to_exist() {
        assert!(found("see `model/src/lib.rs`, `model/src/` and `a/b`").is_empty());
        assert_eq!(
            found("see `model/src/gone.rs`"),
            ["model/src/gone.rs does not exist"]
        );
    }
}
