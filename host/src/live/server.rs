//! The page's server: its files, and the socket over which it is kept current.

use std::net::TcpListener;
use std::thread::{self, JoinHandle};

use axum::Router;
use axum::extract::ws::{Message, Utf8Bytes, WebSocket, WebSocketUpgrade};
use axum::extract::{Path, Request, State};
use axum::http::StatusCode;
use axum::http::header::{
    CACHE_CONTROL, CONTENT_SECURITY_POLICY, CONTENT_TYPE, HeaderName, HeaderValue, REFERRER_POLICY,
    X_CONTENT_TYPE_OPTIONS,
};
use axum::middleware::{self, Next};
use axum::response::{IntoResponse, Response};
use axum::routing::{any, get};
use tokio::sync::broadcast::error::RecvError;

use super::access::Access;
use super::assets::asset;
use super::feed::{self, Desk};
use crate::failure::Failure;

/// The longest request of a page, bytes: they are a word or two.
const LONGEST: usize = 1024;

/// What a browser may do with the page: nothing leaves this computer, and no other page shows it. The
/// address has the token, so it is passed on to no one.
const HEADERS: [(HeaderName, &str); 4] = [
    (
        CONTENT_SECURITY_POLICY,
        "default-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    ),
    (REFERRER_POLICY, "no-referrer"),
    (X_CONTENT_TYPE_OPTIONS, "nosniff"),
    (CACHE_CONTROL, "no-store"),
];

/// Serves in a thread of its own until the program ends.
///
/// # Errors
/// If the system has no thread for it.
pub(super) fn start(
    listener: TcpListener,
    access: Access,
    desk: Desk,
) -> Result<JoinHandle<std::io::Result<()>>, Failure> {
    let server = thread::Builder::new().name("page".to_owned());
    Ok(server.spawn(move || {
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_io()
            .build()?;
        runtime.block_on(async {
            listener.set_nonblocking(true)?;
            let listener = tokio::net::TcpListener::from_std(listener)?;
            axum::serve(listener, router(access, desk)).await
        })
    })?)
}

fn router(access: Access, desk: Desk) -> Router {
    Router::new()
        .route("/{token}/", get(|| async { file("") }))
        .route("/{token}/socket", any(socket))
        .route(
            "/{token}/{name}",
            get(|Path((_, name)): Path<(String, String)>| async move { file(&name) }),
        )
        .with_state(desk)
        .layer(middleware::from_fn_with_state(access, guard))
}

/// Refuses a request that shows no right, and says to the browser what it may do with an answer.
async fn guard(State(access): State<Access>, request: Request, next: Next) -> Response {
    let mut response = if access.allows(request.uri().path(), request.headers()) {
        next.run(request).await
    } else {
        let text = "Open the address that `palpate live` prints: it has a token.\n";
        (StatusCode::FORBIDDEN, text).into_response()
    };
    for (name, value) in HEADERS {
        response
            .headers_mut()
            .insert(name, HeaderValue::from_static(value));
    }
    response
}

fn file(name: &str) -> Response {
    match asset(name) {
        Some(asset) => ([(CONTENT_TYPE, asset.media)], asset.text).into_response(),
        None => StatusCode::NOT_FOUND.into_response(),
    }
}

async fn socket(State(desk): State<Desk>, upgrade: WebSocketUpgrade) -> Response {
    upgrade
        .max_message_size(LONGEST)
        .on_upgrade(|socket| converse(socket, desk))
}

/// Keeps a page current until it goes. A page that takes nothing holds up nothing but itself: states
/// replace each other, and samples that are too many are left out.
async fn converse(mut socket: WebSocket, mut desk: Desk) {
    let mut samples = desk.samples.subscribe();
    desk.state.mark_changed();
    desk.line.mark_changed();
    loop {
        let message: Utf8Bytes = tokio::select! {
            received = socket.recv() => match received {
                Some(Ok(Message::Text(text))) => {
                    desk.ask(&text);
                    continue;
                }
                Some(Ok(Message::Binary(_) | Message::Ping(_) | Message::Pong(_))) => continue,
                Some(Ok(Message::Close(_)) | Err(_)) | None => return,
            },
            Ok(()) = desk.state.changed() => desk.state.borrow_and_update().clone(),
            Ok(()) = desk.line.changed() => desk.line.borrow_and_update().clone(),
            batch = samples.recv() => match batch {
                Ok(batch) => batch,
                Err(RecvError::Lagged(count)) => match feed::Message::Skipped(count).text() {
                    Ok(text) => text,
                    Err(_) => return,
                },
                Err(RecvError::Closed) => return,
            },
            else => return,
        };
        // Before the first state or line there is none.
        if !message.is_empty() && socket.send(Message::Text(message)).await.is_err() {
            return;
        }
    }
}

#[cfg(test)]
mod tests {
    use std::io::{Read, Write};
    use std::net::{SocketAddr, TcpStream};
    use std::time::{Duration, Instant};

    use palpate_wire::record::Sample;

    use super::*;
    use crate::live::envelope::Envelope;
    use crate::live::feed::Feed;

    /// A server with a token.
    fn served() -> (Feed, SocketAddr) {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap();
        let (feed, desk) = feed::between();
        start(listener, Access::new(address, "secret".to_owned()), desk).unwrap();
        (feed, address)
    }

    /// Asks for a path, and reads the first line of the answer.
    fn asked(address: SocketAddr, path: &str, headers: &str) -> (TcpStream, String) {
        let mut stream = TcpStream::connect(address).unwrap();
        stream
            .set_read_timeout(Some(Duration::from_secs(10)))
            .unwrap();
        write!(stream, "GET {path} HTTP/1.1\r\n{headers}\r\n\r\n").unwrap();
        let mut line = [0; 12];
        stream.read_exact(&mut line).unwrap();
        (stream, String::from_utf8_lossy(&line).into_owned())
    }

    const UPGRADE: &str = "Connection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\n\
        Sec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==";

    #[test]
    fn only_the_token_and_the_own_host_are_answered() {
        let (_feed, address) = served();
        let own = format!("Host: {address}");
        let status = |path, headers: &str| asked(address, path, headers).1;
        for path in ["/secret/", "/secret/page.js"] {
            assert!(status(path, &own).ends_with("200"), "{path}");
        }
        assert!(status("/secret/other", &own).ends_with("404"));
        for path in ["/", "/page.js", "/socket", "/secre/", "/other/page.js"] {
            assert!(status(path, &own).ends_with("403"), "{path}");
        }
        let socket = |headers: &str| status("/secret/socket", &format!("{headers}\r\n{UPGRADE}"));
        assert!(socket(&own).ends_with("101"));
        for other in [
            "Host: example.org".to_owned(),
            format!("{own}\r\nOrigin: http://example.org"),
        ] {
            assert!(socket(&other).ends_with("403"), "{other}");
        }
    }

    #[test]
    fn a_page_that_reads_nothing_holds_up_nothing() {
        let (feed, address) = served();
        let headers = format!("Host: {address}\r\n{UPGRADE}");
        let (_unread, answer) = asked(address, "/secret/socket", &headers);
        assert!(answer.ends_with("101"), "{answer}");
        let mut envelope = Envelope::default();
        let sample = Sample {
            sensor: 0,
            missed: 0,
            gap: false,
            channels: [].into_iter().collect(),
            contact: palpate_wire::code::Contact::Clear,
            force_n: Some(1.0),
            force_sigma_n: None,
            current_a: Some(1.0),
            ripple_a: None,
        };
        (0..5_000).for_each(|ms| envelope.add(f64::from(ms) * 1e-3, &sample));
        let batch = envelope.take().unwrap();
        // 20 MB and more: a system holds some MB of them for a reader at most.
        let began = Instant::now();
        for _ in 0..1_000 {
            feed.add(&batch).unwrap();
        }
        assert!(
            began.elapsed() < Duration::from_secs(10),
            "{:?}",
            began.elapsed()
        );
        assert!(feed.waiting() <= feed::WAITING);
    }
}
