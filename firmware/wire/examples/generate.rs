//! Regenerates everything that is made from the code: the fixture, and the tables and the worked example
//! in docs/protocol.md. The tests fail while either is out of date.
//!
//! ```text
//! cargo run -p palpate-wire --example generate
//! ```

use std::fs;

#[path = "../tests/integration/support/mod.rs"]
mod support;

fn main() -> std::io::Result<()> {
    for (name, content) in support::fixture::files() {
        fs::write(support::fixture::path(&name), &content)?;
        println!("{name}: {} bytes", content.len());
    }
    let path = support::document::path();
    let text = fs::read_to_string(&path)?;
    let renewed = support::document::renewed(&text);
    println!(
        "protocol.md: {}",
        if renewed == text {
            "as it was"
        } else {
            "renewed"
        }
    );
    fs::write(path, renewed)
}
