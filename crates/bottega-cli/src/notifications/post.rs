//! Notifications by HTTP: a signed POST of JSON, in up to three attempts.

use std::{io, sync::Arc, time::Duration};

use http_body_util::Full;
use hyper::{
    Request, Response, StatusCode, Uri,
    body::{Bytes, Incoming},
    header,
};
use hyper_util::rt::TokioIo;
use ring::hmac;
use rustls::{CertificateError, ClientConfig, RootCertStore, pki_types::ServerName};
use tokio::{
    io::{AsyncRead, AsyncWrite},
    net::TcpStream,
    runtime::Runtime,
};
use tokio_rustls::TlsConnector;

use super::message::{Notification, hex};
use crate::error::CliError;

/// The timeout of an attempt.
const PATIENCE: Duration = Duration::from_secs(10);
/// The delays before the second and the third attempt.
const BACK_OFF: [Duration; 2] = [Duration::from_secs(1), Duration::from_secs(4)];
/// The maximum number of redirects, all to the same server.
const REDIRECTS_MAX: usize = 3;
/// The header with the signature.
const SIGNATURE: &str = "bottega-signature";

/// The secret shared with the receiver.
pub(super) struct Secret(hmac::Key);

impl Secret {
    pub(super) fn new(bytes: &[u8]) -> Self {
        Self(hmac::Key::new(hmac::HMAC_SHA256, bytes))
    }

    /// Returns the signature of a body, as sent in the header.
    fn signature(&self, body: &[u8]) -> String {
        format!("sha256={}", hex(hmac::sign(&self.0, body).as_ref()))
    }
}

/// The failure of an attempt.
struct FailedTry {
    why: String,
    /// `true`: another attempt may succeed.
    may_pass: bool,
}

/// The answer of a server.
enum PostAnswer {
    Taken,
    /// A redirect to another path of the same server.
    Elsewhere(Uri),
}

/// A sender of notifications by HTTP.
pub(super) struct Poster {
    runtime: Runtime,
    tls: TlsConnector,
    secret: Option<Secret>,
}

impl Poster {
    pub(super) fn new(secret: Option<Secret>) -> Result<Self, CliError> {
        let unexpected = |error: &dyn std::fmt::Display| {
            CliError::failed(format!("cannot send notifications: {error}"), "this is unexpected; report it")
        };
        let runtime =
            tokio::runtime::Builder::new_current_thread().enable_all().build().map_err(|error| unexpected(&error))?;
        let mut roots = RootCertStore::empty();
        // Unreadable certificates are ignored; if a server needs one, the error names the server.
        roots.add_parsable_certificates(rustls_native_certs::load_native_certs().certs);
        let provider = Arc::new(rustls::crypto::ring::default_provider());
        let config = ClientConfig::builder_with_provider(provider)
            .with_safe_default_protocol_versions()
            .map_err(|error| unexpected(&error))?
            .with_root_certificates(roots)
            .with_no_client_auth();
        Ok(Self { runtime, tls: TlsConnector::from(Arc::new(config)), secret })
    }

    /// Sends a notification; retries failures that may be temporary.
    pub(super) fn post(&self, url: &Uri, notification: &Notification) -> Result<(), String> {
        let body = notification.to_json();
        let mut pauses = BACK_OFF.iter();
        let mut tries = 1;
        loop {
            let FailedTry { why, may_pass } =
                match self.runtime.block_on(self.send_with_patience(url, notification, &body)) {
                    Ok(()) => return Ok(()),
                    Err(failed) => failed,
                };
            match pauses.next().filter(|_| may_pass) {
                Some(pause) => std::thread::sleep(*pause),
                None if tries == 1 => return Err(why),
                None => return Err(format!("{why} ({tries} tries)")),
            }
            tries += 1;
        }
    }

    async fn send_with_patience(&self, url: &Uri, notification: &Notification, body: &str) -> Result<(), FailedTry> {
        let sent = tokio::time::timeout(PATIENCE, self.send(url, notification, body)).await;
        sent.unwrap_or_else(|_| {
            Err(FailedTry { why: format!("no answer in {} s", PATIENCE.as_secs()), may_pass: true })
        })
    }

    async fn send(&self, url: &Uri, notification: &Notification, body: &str) -> Result<(), FailedTry> {
        let mut url = url.clone();
        for _ in 0..=REDIRECTS_MAX {
            match self.send_once(&url, notification, body).await? {
                PostAnswer::Taken => return Ok(()),
                PostAnswer::Elsewhere(other) => url = other,
            }
        }
        Err(FailedTry { why: format!("more than {REDIRECTS_MAX} redirects"), may_pass: false })
    }

    async fn send_once(&self, url: &Uri, notification: &Notification, body: &str) -> Result<PostAnswer, FailedTry> {
        let host = url.host().unwrap_or_default();
        let is_secure = is_https(url);
        let port = port(url);
        let unreached = |error: io::Error| FailedTry { why: format!("cannot connect: {error}"), may_pass: true };
        let bare = host.trim_start_matches('[').trim_end_matches(']');
        let stream = TcpStream::connect((bare, port)).await.map_err(unreached)?;
        let request = self.request(url, notification, body)?;
        let response = if is_secure {
            let name = ServerName::try_from(bare.to_owned())
                .map_err(|error| FailedTry { why: format!("`{host}` has no certificate: {error}"), may_pass: false })?;
            exchange(self.tls.connect(name, stream).await.map_err(|error| insecure(&error))?, request).await
        } else {
            exchange(stream, request).await
        };
        let lost = |error: hyper::Error| FailedTry { why: format!("no answer: {error}"), may_pass: true };
        judge(url, &response.map_err(lost)?)
    }

    fn request(&self, url: &Uri, notification: &Notification, body: &str) -> Result<Request<Full<Bytes>>, FailedTry> {
        let target = url.path_and_query().map_or("/", |path| path.as_str());
        let authority = url.authority().map_or("", |authority| authority.as_str());
        let mut request = Request::post(target)
            .header(header::HOST, authority)
            .header(header::CONTENT_TYPE, "application/json")
            .header(header::USER_AGENT, concat!("bottega/", env!("CARGO_PKG_VERSION")))
            .header("bottega-event", notification.event)
            .header("bottega-id", &notification.id);
        if let Some(secret) = &self.secret {
            request = request.header(SIGNATURE, secret.signature(body.as_bytes()));
        }
        request
            .body(Full::new(Bytes::from(body.to_owned())))
            .map_err(|error| FailedTry { why: format!("not an HTTP address: {error}"), may_pass: false })
    }
}

/// Describes a failed TLS connection. Trust does not change within seconds, so certificate errors are not retried.
fn insecure(error: &io::Error) -> FailedTry {
    let tls_error = error.get_ref().and_then(|inner| inner.downcast_ref::<rustls::Error>());
    let (reason, may_pass) = match tls_error {
        Some(rustls::Error::InvalidCertificate(problem)) => {
            let reason = match problem {
                CertificateError::UnknownIssuer => {
                    "its certificate is not signed by an authority that this machine trusts"
                }
                CertificateError::NotValidForName | CertificateError::NotValidForNameContext { .. } => {
                    "its certificate is for another name"
                }
                CertificateError::Expired | CertificateError::ExpiredContext { .. } => "its certificate has expired",
                _ => "its certificate is not trusted",
            };
            (format!("{reason} ({error}); SSL_CERT_FILE names certificates to trust"), false)
        }
        Some(rustls::Error::InvalidMessage(_)) => {
            (format!("it does not speak TLS ({error}): use http:// if it serves plain HTTP"), false)
        }
        _ => (error.to_string(), true),
    };
    FailedTry { why: format!("no secure connection: {reason}"), may_pass }
}

fn is_https(url: &Uri) -> bool {
    url.scheme_str() == Some("https")
}

fn port(url: &Uri) -> u16 {
    url.port_u16().unwrap_or(if is_https(url) { 443 } else { 80 })
}

/// Sends a request, and reads the head of the answer.
async fn exchange(
    stream: impl AsyncRead + AsyncWrite + Unpin + Send + 'static,
    request: Request<Full<Bytes>>,
) -> Result<Response<Incoming>, hyper::Error> {
    let (mut sender, connection) = hyper::client::conn::http1::handshake(TokioIo::new(stream)).await?;
    let connection = tokio::spawn(connection);
    let response = sender.send_request(request).await;
    // The body is not read.
    connection.abort();
    response
}

/// Checks that an answer accepts the notification.
fn judge(url: &Uri, response: &Response<Incoming>) -> Result<PostAnswer, FailedTry> {
    let status = response.status();
    if status.is_success() {
        return Ok(PostAnswer::Taken);
    }
    let is_redirect = matches!(status, StatusCode::TEMPORARY_REDIRECT | StatusCode::PERMANENT_REDIRECT);
    if let Some(place) = response.headers().get(header::LOCATION).filter(|_| is_redirect) {
        let place = place.to_str().unwrap_or_default();
        return redirect(url, place).map(PostAnswer::Elsewhere);
    }
    let may_pass =
        status.is_server_error() || matches!(status, StatusCode::REQUEST_TIMEOUT | StatusCode::TOO_MANY_REQUESTS);
    Err(FailedTry { why: format!("it answered {status}"), may_pass })
}

/// Returns the target of a redirect; an error if it leads to another server.
fn redirect(from: &Uri, place: &str) -> Result<Uri, FailedTry> {
    let refused = |why: &str| FailedTry { why: why.to_owned(), may_pass: false };
    let to: Uri = if place.starts_with('/') && !place.starts_with("//") {
        let scheme = from.scheme_str().unwrap_or_default();
        let authority = from.authority().map_or("", |authority| authority.as_str());
        format!("{scheme}://{authority}{place}").parse().map_err(|_| refused("its redirect has no address"))?
    } else {
        place.parse().map_err(|_| refused("its redirect has no address"))?
    };
    let is_same = to.scheme_str() == from.scheme_str() && to.host() == from.host() && port(&to) == port(from);
    if is_same {
        Ok(to)
    } else {
        Err(refused("it redirects to another server, which is not followed: give that server in --on"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bodies_are_signed_as_the_standard_says() {
        // RFC 4231, test case 2.
        let secret = Secret::new(b"Jefe");
        assert_eq!(
            secret.signature(b"what do ya want for nothing?"),
            "sha256=5bdcc146bf60754e6a042426089575c75a003f089d2739839dec58b964ec3843"
        );
    }

    #[test]
    fn redirects_lead_to_the_same_server_or_nowhere() {
        let from: Uri = "https://example.org/a".parse().unwrap();
        for (place, to) in [
            ("/b?c", Some("https://example.org/b?c")),
            ("https://example.org:443/b", Some("https://example.org:443/b")),
            ("https://example.com/b", None),
            ("http://example.org/b", None),
            ("https://example.org:8443/b", None),
            ("//example.com/b", None),
            ("b", None),
        ] {
            let led = redirect(&from, place).ok().map(|uri| uri.to_string());
            assert_eq!(led.as_deref(), to, "{place}");
        }
    }
}
