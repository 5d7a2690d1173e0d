//! Connection to the board: requests to the image `bring_up`, and its answers.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::time::Duration;

use ldc161x_sim::{ChipFault, FaultEvent, Lost};
use palpate_cli::failure::Failure;
use palpate_cli::notice;
use palpate_emulator::{EmulatedBoard, Still, Time};

/// Channel of the probe, in both directions.
const CHANNEL: u32 = 0;
/// Longest wait for an answer, s: a request for 200 edges takes 0.7 s, and a probe may be slow.
const PATIENCE_S: u64 = 30;
/// Poll interval of an emulated board.
const POLL: Time = Time::from_us(20);

/// Outcome of a request, by the image's numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum RequestOutcome {
    Done,
    NotUnderstood,
    NotAcknowledged,
    TimedOut,
    NoEdge,
}

impl RequestOutcome {
    const fn of(number: u8) -> Option<Self> {
        Some(match number {
            0 => Self::Done,
            1 => Self::NotUnderstood,
            2 => Self::NotAcknowledged,
            3 => Self::TimedOut,
            4 => Self::NoEdge,
            _ => return None,
        })
    }
}

/// A board that runs the image.
pub(super) enum Link {
    /// A board behind a debug probe; the probe's server offers the channel at a port.
    Probe(TcpStream),
    /// The emulated board.
    Emulated(Box<EmulatedBoard<Still>>),
}

impl Link {
    /// Connects to a debug probe's server.
    pub(super) fn connect(address: &str) -> Result<Self, Failure> {
        let unreachable = |error: std::io::Error| {
            Failure::Refused(format!(
                "{address}: {error}. Start a server for channel 0 of the board's RTT there, as \
                 docs/bring-up.md says."
            ))
        };
        let stream = TcpStream::connect(address).map_err(unreachable)?;
        let patience = Some(Duration::from_secs(PATIENCE_S));
        stream.set_read_timeout(patience).map_err(unreachable)?;
        Ok(Self::Probe(stream))
    }

    /// Interrupts the converter's supply. On a real board it asks the user to do so and to confirm.
    pub(super) fn dip(&mut self) -> Result<(), Failure> {
        match self {
            Self::Probe(_) => {
                notice::say("Interrupt the converter's supply for a moment, then press Enter.");
                std::io::stdin().read_line(&mut String::new())?;
            }
            Self::Emulated(board) => {
                let dip = ChipFault::BrownOut(Lost::Everything);
                let event = FaultEvent::at(board.now(), dip, Time::ZERO);
                let scheduled = board.chip_mut().schedule(event);
                scheduled.map_err(|full| Failure::Refused(full.to_string()))?;
            }
        }
        Ok(())
    }

    /// Whether the supply is interrupted without the user, as on the emulated board.
    pub(super) const fn dips_itself(&self) -> bool {
        matches!(self, Self::Emulated(_))
    }

    /// Sends a request and waits for the answer.
    pub(super) fn ask(
        &mut self,
        kind: u8,
        rest: &[u8],
    ) -> Result<(RequestOutcome, Vec<u8>), Failure> {
        let mut request = vec![rest.len() as u8 + 1, kind];
        request.extend(rest);
        let answer = match self {
            Self::Probe(stream) => over_probe(stream, &request).map_err(|error| {
                Failure::Refused(format!(
                    "the board does not answer ({error}). Is the image bring_up running, and is the \
                     probe's server at channel 0?"
                ))
            })?,
            Self::Emulated(board) => over_emulation(board, &request)?,
        };
        let outcome = answer
            .first()
            .and_then(|&number| RequestOutcome::of(number));
        let outcome = outcome.ok_or_else(|| {
            Failure::Refused("the answer is not from the image bring_up".to_owned())
        })?;
        Ok((outcome, answer.get(1..).unwrap_or_default().to_vec()))
    }
}

fn over_probe(stream: &mut TcpStream, request: &[u8]) -> std::io::Result<Vec<u8>> {
    stream.write_all(request)?;
    let mut length = [0];
    stream.read_exact(&mut length)?;
    let mut answer = vec![0; length[0].into()];
    stream.read_exact(&mut answer)?;
    Ok(answer)
}

fn over_emulation(board: &mut EmulatedBoard<Still>, request: &[u8]) -> Result<Vec<u8>, Failure> {
    let end = board.now() + Time::from_ms(1_000 * PATIENCE_S);
    let stopped = |stop: palpate_emulator::Stop| Failure::Refused(format!("the image: {stop}"));
    let mut left = request;
    let mut answer = Vec::new();
    while board.now() < end {
        let taken = board.write_channel(CHANNEL, left);
        left = left.get(taken..).unwrap_or_default();
        board.run_for(POLL).map_err(stopped)?;
        answer.extend(board.read_channel(CHANNEL));
        if let [length, rest @ ..] = answer.as_slice()
            && rest.len() == usize::from(*length)
        {
            return Ok(rest.to_vec());
        }
    }
    Err(Failure::Refused(
        "the image on the emulated board does not answer".to_owned(),
    ))
}
