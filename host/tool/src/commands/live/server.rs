//! Server of the page: its files, and the socket for its updates.

use std::net::TcpListener;
use std::sync::Arc;
use std::thread;
use std::time::Duration;

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
use axum::serve::Listener;
use hyper::server::conn::http1;
use hyper_util::rt::TokioIo;
use hyper_util::service::TowerToHyperService;
use palpate_cli::failure::Failure;
use tokio::runtime::Runtime;
use tokio::sync::broadcast::error::RecvError;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::time::timeout;

use super::access::Access;
use super::assets::asset;
use super::feed::{self, Desk};
use crate::interrupt::Interrupt;

/// Maximum numbers of concurrent requests and of updated pages: with them the tool needs fewer file
/// handles than any system allows (256). Further requests wait; further pages are refused.
const REQUESTS: usize = 64;
const PAGES: usize = 16;
/// Time limit of a request with its answer: the longest file takes 0.5 s at 1 Mbit/s.
const REQUEST_TIME: Duration = Duration::from_secs(10);
/// Time without any reading after which a page counts as gone; a live page opens its socket again.
const PAGE_TIME: Duration = Duration::from_secs(30);
/// Longest head of a request, bytes.
const LONGEST_HEAD: usize = 16 * 1024;
/// Longest message from a page, bytes: such a message is a word or two.
const LONGEST: usize = 1024;
/// Maximum number of bytes that wait for a page: four times the longest message to a page, which is
/// the list of measurements.
const WAITING: usize = 1024 * 1024;

/// Restrictions for the browser: the page sends data only to this computer, no other page embeds
/// it, and its address, which contains the token, is not passed on.
const HEADERS: [(HeaderName, &str); 4] = [
    (
        CONTENT_SECURITY_POLICY,
        "default-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    ),
    (REFERRER_POLICY, "no-referrer"),
    (X_CONTENT_TYPE_OPTIONS, "nosniff"),
    (CACHE_CONTROL, "no-store"),
];

/// Starts a thread that serves until the program ends. If the thread ends earlier, it requests the
/// end of the program: without a page an armed board could not be stopped.
///
/// # Errors
/// If the system has no thread or no socket for it.
pub(super) fn start(
    listener: TcpListener,
    access: Access,
    desk: Desk,
    interrupt: Interrupt,
) -> Result<(), Failure> {
    listener.set_nonblocking(true)?;
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()?;
    let listener = {
        let _entered = runtime.enter();
        tokio::net::TcpListener::from_std(listener)?
    };
    let server = thread::Builder::new().name("page".to_owned());
    server.spawn(move || {
        let _at_end = AskAtEnd(interrupt);
        serve(runtime, listener, router(access, desk));
    })?;
    Ok(())
}

/// Requests the end of the program when dropped.
struct AskAtEnd(Interrupt);

impl Drop for AskAtEnd {
    fn drop(&mut self) {
        self.0.ask();
    }
}

/// Takes runtime and router by value, so that both are dropped before the thread requests the end
/// of the program.
#[expect(clippy::needless_pass_by_value, reason = "as said")]
fn serve(runtime: Runtime, listener: tokio::net::TcpListener, router: Router) {
    runtime.block_on(accept(listener, router));
}

/// Answers one request on each connection. Since connections are not kept, one time limit covers
/// everything that a program without the token can do.
async fn accept(mut listener: tokio::net::TcpListener, router: Router) {
    let requests = Arc::new(Semaphore::new(REQUESTS));
    let mut http = http1::Builder::new();
    http.keep_alive(false).max_buf_size(LONGEST_HEAD);
    while let Ok(permit) = Arc::clone(&requests).acquire_owned().await {
        // Waits if the system has no free file handle.
        let (stream, _) = Listener::accept(&mut listener).await;
        let answer = http
            .serve_connection(
                TokioIo::new(stream),
                TowerToHyperService::new(router.clone()),
            )
            .with_upgrades();
        tokio::spawn(async move {
            let _ = timeout(REQUEST_TIME, answer).await;
            drop(permit);
        });
    }
}

fn router(access: Access, desk: Desk) -> Router {
    Router::new()
        .route("/{token}/", get(|| async { file("") }))
        .route("/{token}/socket", any(socket))
        .route(
            "/{token}/{name}",
            get(|Path((_, name)): Path<(String, String)>| async move { file(&name) }),
        )
        .with_state(Pages {
            desk,
            free: Arc::new(Semaphore::new(PAGES)),
        })
        .layer(middleware::from_fn_with_state(access, guard))
}

/// Refuses an unauthorised request, and adds the browser's restrictions to an answer.
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

/// Source of the pages' updates, and the number of free pages.
#[derive(Clone)]
struct Pages {
    desk: Desk,
    free: Arc<Semaphore>,
}

async fn socket(State(pages): State<Pages>, upgrade: WebSocketUpgrade) -> Response {
    let Ok(permit) = pages.free.try_acquire_owned() else {
        let text = format!("{PAGES} pages are open: close one.\n");
        return (StatusCode::SERVICE_UNAVAILABLE, text).into_response();
    };
    upgrade
        .max_message_size(LONGEST)
        .max_frame_size(LONGEST)
        .write_buffer_size(0)
        .max_write_buffer_size(WAITING)
        .on_upgrade(|socket| converse(socket, pages.desk, permit))
}

/// Updates a page until it is gone. A page that reads nothing delays only itself: states replace
/// each other, and excess samples are dropped.
async fn converse(mut socket: WebSocket, mut desk: Desk, _permit: OwnedSemaphorePermit) {
    let mut samples = desk.samples.subscribe();
    desk.state.mark_changed();
    desk.line.mark_changed();
    desk.measurements.mark_changed();
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
            Ok(()) = desk.measurements.changed() => desk.measurements.borrow_and_update().clone(),
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
        // A message is empty before the first state, line or measurement.
        if message.is_empty() {
            continue;
        }
        let sent = timeout(PAGE_TIME, socket.send(Message::Text(message)));
        if !matches!(sent.await, Ok(Ok(()))) {
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
    use crate::commands::live::envelope::Envelope;
    use crate::commands::live::feed::Feed;

    /// A server with a token.
    fn served() -> (Feed, SocketAddr) {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap();
        let (feed, desk) = feed::between();
        let access = Access::new(address, "secret".to_owned());
        start(listener, access, desk, Interrupt::uncaught()).unwrap();
        (feed, address)
    }

    #[test]
    fn a_server_that_ends_asks_for_the_end_of_the_tool() {
        let interrupt = Interrupt::uncaught();
        let at_end = AskAtEnd(interrupt.clone());
        let (feed, desk) = feed::between();
        assert!(feed.is_served() && !interrupt.is_asked());
        let server = thread::spawn(move || {
            let _at_end = at_end;
            drop(desk);
            panic!("a planted defect");
        });
        assert!(server.join().is_err());
        assert!(!feed.is_served() && interrupt.is_asked());
    }

    /// Requests a path, and reads the first line of the answer.
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
        // 20 MB and more: a system buffers a few MB for a reader at most.
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

    /// Whether the server closes a connection within a time.
    fn is_closed(mut stream: TcpStream, within: Duration) -> bool {
        stream.set_read_timeout(Some(within)).unwrap();
        let mut bytes = [0; 4096];
        loop {
            match stream.read(&mut bytes) {
                Ok(0) => return true,
                Ok(_) => {}
                Err(error) => return error.kind() == std::io::ErrorKind::ConnectionReset,
            }
        }
    }

    #[test]
    fn a_connection_that_asks_for_nothing_is_closed() {
        let (_feed, address) = served();
        let silent = TcpStream::connect(address).unwrap();
        let mut slow = TcpStream::connect(address).unwrap();
        slow.write_all(b"GET / HTTP/1.1\r\nHost: ").unwrap();
        assert!(is_closed(silent, Duration::from_secs(30)));
        assert!(is_closed(slow, Duration::from_secs(30)));
    }

    #[test]
    fn a_frame_longer_than_any_request_closes_the_socket() {
        let (_feed, address) = served();
        let headers = format!("Host: {address}\r\n{UPGRADE}");
        let (mut socket, answer) = asked(address, "/secret/socket", &headers);
        assert!(answer.ends_with("101"), "{answer}");
        // Start of a text of 10 MB, which is below the usual limit of a frame.
        let mut frame = vec![0x81, 0x80 | 127];
        frame.extend(10_000_000u64.to_be_bytes());
        frame.extend([0; 4 + 100]);
        socket.write_all(&frame).unwrap();
        assert!(is_closed(socket, Duration::from_secs(5)));
    }

    #[test]
    fn pages_beyond_the_limit_are_refused() {
        let (_feed, address) = served();
        let headers = format!("Host: {address}\r\n{UPGRADE}");
        let open = || asked(address, "/secret/socket", &headers);
        let mut pages: Vec<_> = (0..16).map(|_| open()).collect();
        assert!(pages.iter().all(|(_, answer)| answer.ends_with("101")));
        assert!(open().1.ends_with("503"));
        // A closed page makes room.
        pages.pop();
        assert!((0..100).any(|_| {
            thread::sleep(Duration::from_millis(20));
            open().1.ends_with("101")
        }));
    }
}
