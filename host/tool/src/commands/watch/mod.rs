//! `palpate watch`: the state of a board on the terminal.

mod chart;
mod history;
pub(crate) mod known;
#[cfg(test)]
pub(crate) mod tests;
mod view;

use std::io::{self, IsTerminal, Write};
use std::time::Duration;

use clap::Args;
use console::Term;
use known::Known;
use palpate_cli::failure::Failure;
use palpate_cli::quantity;
use palpate_wire::Command;
use view::View;

use crate::board::configuration::declared_tip;
use crate::board::link::{Link, Watched};
use crate::interrupt::Interrupt;

/// Watch what a board says, on the terminal
///
/// Frequency, deformation, force, contact, current, temperature, the last stiffness with its interval,
/// losses and faults, ten times a second.
#[derive(Args)]
#[command(after_help = "\
Ctrl-C ends it, and disarms a board that it has armed. The tool waits for a board that is unplugged or \
restarts. Where standard output is no terminal, a view is printed every second; with --json, a line \
with what is known ten times a second.

Examples:
  palpate watch
  palpate watch --board emulated --load 1.5 --arm
  palpate watch --board press.mcap --speed 4")]
pub(crate) struct Arguments {
    #[command(flatten)]
    watched: Watched,
    /// End after so many seconds
    #[arg(long = "for", value_name = "SECONDS", value_parser = quantity::duration, allow_negative_numbers = true)]
    duration: Option<Duration>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// Interval of views on a terminal.
const PERIOD: Duration = Duration::from_millis(100);
/// Interval of views for other outputs.
const PRINTED: Duration = Duration::from_secs(1);
/// Default size, in lines and columns, if the terminal does not report its own.
const USUAL: (u16, u16) = (24, 80);

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let mut link = arguments.watched.open()?;
    let measures = arguments.watched.arm;
    let screen = Screen::of(arguments.json);
    let mut known = Known::of(link.name());
    let begin = link.now();
    let end = arguments.duration.map(|duration| begin + duration);
    let interrupt = Interrupt::catch()?;
    let mut is_there = true;
    let mut read_of = None;
    while !interrupt.is_asked() && end.is_none_or(|end| link.now() < end) {
        let turned = if is_there {
            watched(&mut link, &mut known, screen.period(), measures)
                .and_then(|()| read_tip(&mut link, &known, &mut read_of))
        } else {
            link.reconnect(&interrupt)
        };
        match turned {
            Ok(()) => is_there = true,
            _ if interrupt.is_asked() => break,
            Err(Failure::Lost(_)) if link.is_recording() => break,
            // An emulated board does not come back.
            Err(failure @ (Failure::Lost(_) | Failure::Unconnected(_)))
                if link.emulated().is_none() =>
            {
                is_there = false;
                known.lost(&failure.to_string());
            }
            Err(failure) => return Err(failure),
        }
        screen.show(&known)?;
    }
    Ok(())
}

/// Receives records for a time, and measures at every contact if requested.
fn watched(
    link: &mut Link,
    known: &mut Known,
    period: Duration,
    measures: bool,
) -> Result<(), Failure> {
    let until = link.now() + period;
    while link.now() < until {
        link.listen(until.saturating_sub(link.now()))?;
        for arrival in link.take() {
            if known.take(&arrival.frame) && measures {
                // The following records show the answer.
                link.send(&Command::Measure)?;
            }
        }
    }
    known.take_link(link);
    Ok(())
}

/// Reads the tip of a new boot; its records are processed with the next frames.
fn read_tip(link: &mut Link, known: &Known, read_of: &mut Option<u32>) -> Result<(), Failure> {
    if !link.is_recording() && *read_of != known.boot_id {
        *read_of = known.boot_id;
        declared_tip(link)?;
    }
    Ok(())
}

/// Output of the views.
enum Screen {
    Terminal(Term),
    Text,
    Json,
}

impl Screen {
    fn of(json: bool) -> Self {
        if json {
            Self::Json
        } else if io::stdout().is_terminal() {
            let terminal = Term::stdout();
            let _ = terminal.clear_screen();
            let _ = terminal.hide_cursor();
            Self::Terminal(terminal)
        } else {
            Self::Text
        }
    }

    const fn period(&self) -> Duration {
        match self {
            Self::Text => PRINTED,
            Self::Terminal(_) | Self::Json => PERIOD,
        }
    }

    fn show(&self, known: &Known) -> Result<(), Failure> {
        match self {
            Self::Terminal(terminal) => {
                let size = terminal.size_checked().unwrap_or(USUAL);
                terminal.move_cursor_to(0, 0)?;
                for line in View::new(size, console::colors_enabled()).lines(known) {
                    terminal.clear_line()?;
                    terminal.write_line(&line)?;
                }
                Ok(())
            }
            Self::Text => {
                let lines = View::new(USUAL, false).lines(known);
                let mut out = io::stdout().lock();
                Ok(writeln!(out, "{}\n", lines.join("\n"))?)
            }
            Self::Json => {
                let mut out = io::stdout().lock();
                Ok(writeln!(out, "{}", serde_json::to_string(known)?)?)
            }
        }
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        if let Self::Terminal(terminal) = self {
            let _ = terminal.show_cursor();
        }
    }
}
