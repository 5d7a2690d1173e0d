//! Self-contained HTML pages.

use maud::{DOCTYPE, Markup, PreEscaped, html};

/// Style sheet of a page: readable on a screen and on A4, two charts side by side, no page break
/// within a load.
const STYLE: &str = "
:root { color-scheme: light; background: #fff }
body { font: 15px/1.4 sans-serif; max-width: 1100px; margin: 1.5em auto; padding: 0 1em; color: #111 }
h1 { font-size: 1.5em } h2 { font-size: 1.15em; margin: 1.6em 0 .3em }
table { border-collapse: collapse; margin: 1em 0 } th, td { padding: .2em .9em; text-align: right }
th { border-bottom: 1px solid #111 } th:first-child, td:first-child { text-align: left }
tr.missed td { color: #b00; font-weight: bold }
section { break-inside: avoid } .charts { display: grid; grid-template-columns: 1fr 1fr; gap: .6em }
svg { width: 100%; height: auto } .wide { max-width: 760px }
@media print { body { max-width: none; margin: 0; font-size: 11px } }
";

/// Builds a self-contained page.
pub fn document(title: &str, body: &Markup) -> String {
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width";
                title { (title) }
                style { (PreEscaped(STYLE)) }
            }
            body { (body) }
        }
    };
    page.into_string()
}
