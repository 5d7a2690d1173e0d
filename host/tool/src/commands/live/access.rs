//! Who may see the page: a browser of this computer that knows the token.
//!
//! The token is the first part of every path, so that no address works without it. A page of another
//! origin, or one that reached this port by a name of its own (DNS rebinding), shows itself by the
//! headers Origin and Host.

use std::fs::{self, OpenOptions};
use std::io::{self, ErrorKind, Write};
use std::net::{IpAddr, SocketAddr};
use std::path::{Path, PathBuf};

use axum::http::header::{HOST, ORIGIN};
use axum::http::uri::Authority;
use axum::http::{HeaderMap, HeaderName};
use palpate_cli::failure::Failure;

use crate::board::emulated::state_folder;

/// Random bytes of a token: too many to guess (OWASP asks for 128 bits where the number alone protects).
const BYTES: usize = 16;
/// Its file in the user's folder: a page that is open stays valid when the tool is started again.
const FILE: &str = "live-token";
/// A page beside it that leads to the address.
const SHORTCUT: &str = "live.html";

/// What a request has to show.
#[derive(Clone, Debug)]
pub(super) struct Access {
    token: String,
    address: SocketAddr,
}

impl Access {
    /// To a port of this computer, with the user's token.
    ///
    /// # Errors
    /// If the token can be neither read nor made.
    pub(super) fn to(address: SocketAddr) -> Result<Self, Failure> {
        let file = state_folder().join(FILE);
        check_private(&file)?;
        let token = kept(&file).map_err(|reason| Failure::Unwritable {
            file,
            argument: "the page's token",
            reason,
        })?;
        Ok(Self::new(address, token))
    }

    /// With a token.
    pub(super) const fn new(address: SocketAddr, token: String) -> Self {
        Self { token, address }
    }

    /// Where the page is.
    pub(super) fn url(&self) -> String {
        format!("http://{}/{}/", self.address, self.token)
    }

    /// Writes a file that leads a browser to the page, and that no other user can read: the arguments of a
    /// program are shown to all of them.
    ///
    /// # Errors
    /// If it cannot be written.
    pub(super) fn write_shortcut(&self) -> Result<PathBuf, Failure> {
        let (file, url) = (state_folder().join(SHORTCUT), self.url());
        let text = format!(
            "<!doctype html><meta charset=\"utf-8\"><meta http-equiv=\"refresh\" content=\"0; url={url}\">\
             <title>palpate live</title><a href=\"{url}\">palpate live</a>\n"
        );
        match replace(&file, &text) {
            Ok(()) => Ok(file),
            Err(reason) => Err(Failure::Unwritable {
                file,
                argument: "--open",
                reason,
            }),
        }
    }

    /// Whether a request may be answered.
    pub(super) fn allows(&self, path: &str, headers: &HeaderMap) -> bool {
        let text = |name: HeaderName| headers.get(name).map(|value| value.to_str().unwrap_or(""));
        let Some(host) = text(HOST).filter(|host| is_no_name(host)) else {
            return false;
        };
        let is_own = text(ORIGIN).is_none_or(|origin| origin == format!("http://{host}"));
        let token = path.trim_start_matches('/').split('/').next();
        is_own && token.is_some_and(|token| is_same(token, &self.token))
    }
}

/// Whether a host is this computer or an address of one, which no other site can have pointed here. Its port may
/// be one that is forwarded here.
fn is_no_name(host: &str) -> bool {
    let Ok(authority) = host.parse::<Authority>() else {
        return false;
    };
    let name = authority.host();
    let address = name.trim_start_matches('[').trim_end_matches(']');
    !host.contains('@')
        && (name.eq_ignore_ascii_case("localhost") || address.parse::<IpAddr>().is_ok())
}

/// Whether two texts are the same, in a time that does not say how much of them is.
fn is_same(left: &str, right: &str) -> bool {
    let pairs = left.bytes().zip(right.bytes());
    left.len() == right.len() && pairs.fold(0, |differs, (a, b)| differs | (a ^ b)) == 0
}

/// The token in a file, which is made if it is not there.
fn kept(file: &Path) -> io::Result<String> {
    match fs::read_to_string(file) {
        Ok(token) if is_token(&token) => return Ok(token),
        Ok(_) => {}
        Err(error) if error.kind() == ErrorKind::NotFound => {}
        Err(error) => return Err(error),
    }
    let mut bytes = [0; BYTES];
    getrandom::fill(&mut bytes).map_err(io::Error::other)?;
    let token: String = bytes.iter().map(|byte| format!("{byte:02x}")).collect();
    replace(file, &token)?;
    Ok(token)
}

/// Refuses a token that other users may know.
///
/// # Errors
/// If they can read or write its file.
#[cfg(unix)]
fn check_private(file: &Path) -> Result<(), Failure> {
    use std::os::unix::fs::PermissionsExt;
    let mode = fs::metadata(file).map_or(0, |data| data.permissions().mode());
    if mode & 0o077 == 0 {
        return Ok(());
    }
    Err(Failure::Refused(format!(
        "{}: other users can read or change the page's token: delete it, and the next start makes another one",
        file.display()
    )))
}

/// The user's folder is closed to other users.
#[cfg(not(unix))]
#[expect(clippy::unnecessary_wraps, reason = "elsewhere it may fail")]
fn check_private(_: &Path) -> Result<(), Failure> {
    Ok(())
}

/// Writes a file anew, which other users cannot read.
fn replace(file: &Path, text: &str) -> io::Result<()> {
    if let Some(folder) = file.parent() {
        fs::create_dir_all(folder)?;
    }
    match fs::remove_file(file) {
        Err(error) if error.kind() != ErrorKind::NotFound => Err(error),
        _ => private(file)?.write_all(text.as_bytes()),
    }
}

fn is_token(text: &str) -> bool {
    text.len() == 2 * BYTES && text.bytes().all(|byte| byte.is_ascii_hexdigit())
}

/// A new file that other users cannot read.
fn private(file: &Path) -> io::Result<fs::File> {
    let mut options = OpenOptions::new();
    options.write(true).create_new(true);
    #[cfg(unix)]
    std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
    options.open(file)
}

#[cfg(test)]
mod tests {
    use super::*;

    const TOKEN: &str = "0123456789abcdef0123456789abcdef";

    fn allows(path: &str, headers: &[(HeaderName, &str)]) -> bool {
        let access = Access::new("127.0.0.1:7162".parse().unwrap(), TOKEN.to_owned());
        let headers = headers.iter().cloned();
        let headers = headers.map(|(name, value)| (name, value.parse().unwrap()));
        access.allows(path, &headers.collect())
    }

    #[test]
    fn the_token_is_asked_for_in_every_path() {
        let host = [(HOST, "127.0.0.1:7162")];
        for path in [
            "/",
            "/socket",
            "//",
            "/0123/",
            "/0123456789abcdef0123456789abcdee/",
        ] {
            assert!(!allows(path, &host), "{path}");
        }
        assert!(allows(&format!("/{TOKEN}/"), &host));
        assert!(allows(&format!("/{TOKEN}/socket"), &host));
    }

    #[test]
    fn a_page_of_another_origin_and_a_name_that_leads_here_are_refused() {
        let path = format!("/{TOKEN}/socket");
        let with = |host, origin: &str| allows(&path, &[(HOST, host), (ORIGIN, origin)]);
        // Behind a forwarded port too, whose number is another one.
        for host in [
            "127.0.0.1:7162",
            "localhost:7162",
            "localhost:9000",
            "LOCALHOST:9000",
            "127.0.0.1",
            "[::1]:9000",
            "192.168.1.5:9000",
        ] {
            assert!(allows(&path, &[(HOST, host)]), "{host}");
            assert!(with(host, &format!("http://{host}")), "{host}");
        }
        for (host, origin) in [
            ("127.0.0.1:7162", "http://example.org"),
            ("127.0.0.1:7162", "null"),
            ("127.0.0.1:7162", "http://localhost:7162"),
            ("127.0.0.1:7162", "http://127.0.0.1:80"),
            ("127.0.0.1:7162", "https://127.0.0.1:7162"),
            ("example.org:7162", "http://example.org:7162"),
            ("localhost.example.org", "http://localhost.example.org"),
            ("127.0.0.1.example.org", "http://127.0.0.1.example.org"),
            ("user@127.0.0.1:7162", "http://user@127.0.0.1:7162"),
            ("", "http://"),
        ] {
            assert!(!with(host, origin), "{host} {origin}");
        }
        assert!(!allows(&path, &[]));
    }

    #[test]
    fn a_token_is_kept_and_no_other_user_reads_it() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("below").join("token");
        let token = kept(&file).unwrap();
        assert!(is_token(&token));
        assert_eq!(kept(&file).unwrap(), token);
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            let mode = fs::metadata(&file).unwrap().permissions().mode();
            assert_eq!(mode & 0o077, 0, "{mode:o}");
        }
        fs::write(&file, "short").unwrap();
        assert_ne!(kept(&file).unwrap(), token);
    }
}
