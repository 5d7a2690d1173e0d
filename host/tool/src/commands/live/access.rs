//! Access to the page, for browsers of this computer that know the token.
//!
//! The token is the first part of every path, so no address works without it. The headers Origin
//! and Host reveal a page of another origin, or one that reached this port under its own name (DNS
//! rebinding).

use std::fs::{self, OpenOptions};
use std::io::{self, ErrorKind, Write};
use std::net::{IpAddr, SocketAddr};
use std::path::{Path, PathBuf};

use axum::http::header::{HOST, ORIGIN};
use axum::http::uri::Authority;
use axum::http::{HeaderMap, HeaderName};
use palpate_cli::failure::Failure;

use crate::board::emulated::state_folder;

/// Number of random bytes of a token, too many to guess (OWASP asks for 128 bits where only the
/// token protects).
const BYTES: usize = 16;
/// File of the token in the user's folder: an open page stays valid when the tool is restarted.
const FILE: &str = "live-token";
/// Page in the same folder that redirects to the address.
const SHORTCUT: &str = "live.html";

/// Conditions for a request.
#[derive(Clone, Debug)]
pub(super) struct Access {
    token: String,
    address: SocketAddr,
}

impl Access {
    /// Creates the access to a port of this computer, with the user's token.
    ///
    /// # Errors
    /// If the token can be neither read nor created.
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

    /// Creates the access with a given token.
    pub(super) const fn new(address: SocketAddr, token: String) -> Self {
        Self { token, address }
    }

    /// Address of the page.
    pub(super) fn url(&self) -> String {
        format!("http://{}/{}/", self.address, self.token)
    }

    /// Writes a file that redirects a browser to the page, readable only by this user: program
    /// arguments are visible to all users.
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

    /// Whether to answer a request.
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

/// Whether a host is localhost or an IP address, which another site cannot redirect here. Its port
/// may be a forwarded one.
fn is_no_name(host: &str) -> bool {
    let Ok(authority) = host.parse::<Authority>() else {
        return false;
    };
    let name = authority.host();
    let address = name.trim_start_matches('[').trim_end_matches(']');
    !host.contains('@')
        && (name.eq_ignore_ascii_case("localhost") || address.parse::<IpAddr>().is_ok())
}

/// Compares two texts in constant time.
fn is_same(left: &str, right: &str) -> bool {
    let pairs = left.bytes().zip(right.bytes());
    left.len() == right.len() && pairs.fold(0, |differs, (a, b)| differs | (a ^ b)) == 0
}

/// Reads the token in a file, or creates one.
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
/// If other users can read or write its file.
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

/// Accepts the token, since on this system other users cannot read the user's folder.
#[cfg(not(unix))]
#[expect(clippy::unnecessary_wraps, reason = "elsewhere it may fail")]
fn check_private(_: &Path) -> Result<(), Failure> {
    Ok(())
}

/// Replaces a file with one that other users cannot read.
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

/// Creates a file that other users cannot read.
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
        // Also through a forwarded port with another number.
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
