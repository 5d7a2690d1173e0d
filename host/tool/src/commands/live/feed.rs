//! Channels between the board's thread and the pages. Neither waits for the other.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};

use axum::extract::ws::Utf8Bytes;
use palpate_cli::failure::Failure;
use palpate_wire::code::FaultCode;
use serde::{Deserialize, Serialize};
use tokio::sync::{broadcast, watch};

use super::envelope::Batch;
use super::measurements::Measurements;
use super::state::State;
use palpate_cli::train_line::TrainLine;

/// Maximum number of sample batches that wait for a page: two seconds, longer than a browser's own
/// pauses.
pub(super) const WAITING: usize = 64;
/// Maximum number of requests that wait for the board's thread, which may itself wait 5 s for an
/// answer.
const REQUESTS: usize = 16;

/// A message to a page.
#[derive(Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Message<'a> {
    State(&'a State<'a>),
    Samples(&'a Batch),
    Line(&'a TrainLine),
    Measurements(&'a Measurements),
    /// Number of sample batches that the page did not take in time and that were dropped.
    Skipped(u64),
}

impl Message<'_> {
    /// Formats the message as JSON.
    pub(super) fn text(&self) -> Result<Utf8Bytes, Failure> {
        Ok(serde_json::to_string(self)?.into())
    }
}

/// Request of a page.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Request {
    Arm,
    Disarm,
    /// Ends a measurement and switches the bridge off.
    Abort,
    ClearFault(FaultCode),
    /// Restarts the board.
    Restart,
    /// Starts a calibration.
    Calibrate,
    /// Ends a calibration; the configuration in force stays.
    AbortCalibration,
    /// Puts the result of a calibration in force and stores it.
    KeepCalibration,
    /// Discards the result of a calibration.
    CloseCalibration,
}

/// End of the channels for the board's thread.
pub(super) struct Feed {
    samples: broadcast::Sender<Utf8Bytes>,
    state: watch::Sender<Utf8Bytes>,
    line: watch::Sender<Utf8Bytes>,
    measurements: watch::Sender<Utf8Bytes>,
    requests: Receiver<Request>,
}

/// End of the channels for the pages.
#[derive(Clone)]
pub(super) struct Desk {
    pub(super) samples: broadcast::Sender<Utf8Bytes>,
    pub(super) state: watch::Receiver<Utf8Bytes>,
    pub(super) line: watch::Receiver<Utf8Bytes>,
    pub(super) measurements: watch::Receiver<Utf8Bytes>,
    requests: Arc<SyncSender<Request>>,
}

/// Creates both ends of the channels between the board's thread and the pages.
pub(super) fn between() -> (Feed, Desk) {
    let (samples, _) = broadcast::channel(WAITING);
    let (state, states) = watch::channel(Utf8Bytes::default());
    let (line, lines) = watch::channel(Utf8Bytes::default());
    let (measurements, listed) = watch::channel(Utf8Bytes::default());
    let (sender, requests) = sync_channel(REQUESTS);
    let desk = Desk {
        samples: samples.clone(),
        state: states,
        line: lines,
        measurements: listed,
        requests: Arc::new(sender),
    };
    let feed = Feed {
        samples,
        state,
        line,
        measurements,
        requests,
    };
    (feed, desk)
}

impl Feed {
    /// Replaces the shown state.
    pub(super) fn show(&self, state: &State<'_>) -> Result<(), Failure> {
        self.state.send_replace(Message::State(state).text()?);
        Ok(())
    }

    /// Shows the line of the last train.
    pub(super) fn show_line(&self, line: &TrainLine) -> Result<(), Failure> {
        self.line.send_replace(Message::Line(line).text()?);
        Ok(())
    }

    /// Shows the list of measurements.
    pub(super) fn show_measurements(&self, list: &Measurements) -> Result<(), Failure> {
        let text = Message::Measurements(list).text()?;
        self.measurements.send_replace(text);
        Ok(())
    }

    /// Sends samples to the connected pages. A page with too many waiting batches misses the
    /// oldest.
    pub(super) fn add(&self, batch: &Batch) -> Result<(), Failure> {
        if self.samples.receiver_count() > 0 {
            let _ = self.samples.send(Message::Samples(batch).text()?);
        }
        Ok(())
    }

    /// Whether the page server is still running.
    pub(super) fn is_served(&self) -> bool {
        !self.state.is_closed()
    }

    /// Number of batches that a page has not taken.
    #[cfg(test)]
    pub(super) fn waiting(&self) -> usize {
        self.samples.len()
    }

    /// Returns the next request, if any.
    pub(super) fn request(&self) -> Option<Request> {
        self.requests.try_recv().ok()
    }
}

impl Desk {
    /// Passes a request on. Drops it if too many wait; the page then shows an unchanged state.
    pub(super) fn ask(&self, text: &str) {
        if let Ok(request) = serde_json::from_str(text) {
            match self.requests.try_send(request) {
                Ok(()) | Err(TrySendError::Full(_) | TrySendError::Disconnected(_)) => {}
            }
        }
    }
}
