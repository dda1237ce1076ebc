//! The HTTP server: accepts messages from other platforms.

use std::{
    net::{IpAddr, SocketAddr},
    sync::Arc,
    time::Duration,
};

use tokio::{
    io::{AsyncReadExt, AsyncWriteExt},
    net::{TcpListener, TcpStream},
    sync::{OwnedSemaphorePermit, Semaphore, broadcast},
    time::timeout,
};

use super::{
    BODY_BYTES_MAX, PATH,
    head::{Head, HttpError, parse_head},
    multipart,
};
use crate::acc::Letter;

/// Maximum number of open connections; further ones are closed at once.
pub const CONNECTIONS_MAX: usize = 256;
/// Maximum size of the bodies of all connections together, in KiB; further requests get 503.
const BODIES_KIB_MAX: usize = 1 << 18;
/// Time after which an idle connection is closed.
const IDLE_WAIT: Duration = Duration::from_secs(60);
/// Maximum time of a request, from its first byte.
const REQUEST_WAIT: Duration = Duration::from_secs(20);
/// Maximum time to send a response.
const ANSWER_WAIT: Duration = Duration::from_secs(20);

/// The path of the trace of passing messages; clients on other machines get status 404.
pub const TRACE_PATH: &str = "/trace";

/// The service behind the HTTP server: it accepts messages, describes the platform, and traces the messages.
pub struct HttpService {
    /// A function that accepts a message. It returns false if there is no room at the moment; the sender then gets
    /// status 503.
    pub take: Box<dyn Fn(Letter) -> bool + Send + Sync>,
    /// A function that returns the response to a GET of [`PATH`].
    pub about: Box<dyn Fn() -> String + Send + Sync>,
    /// The trace lines, without line ends.
    pub trace: broadcast::Sender<Arc<str>>,
}

/// Accepts connections of a listener until the future is dropped, and serves each in a task of its own, which the end
/// of the future does not stop.
pub async fn serve(listener: TcpListener, service: Arc<HttpService>) {
    let room = Arc::new(Semaphore::new(CONNECTIONS_MAX));
    let bodies = Arc::new(Semaphore::new(BODIES_KIB_MAX));
    loop {
        let Ok((stream, peer)) = listener.accept().await else {
            // For example out of file handles: wait for others to close
            tokio::time::sleep(Duration::from_millis(50)).await;
            continue;
        };
        let Ok(place) = Arc::clone(&room).try_acquire_owned() else {
            // The client tries another address, or again
            drop(stream);
            continue;
        };
        let (service, bodies) = (Arc::clone(&service), Arc::clone(&bodies));
        tokio::spawn(async move {
            // A failed connection cannot be reported to its peer
            _ = Connection { stream, peer, bytes: Vec::new(), service, bodies }.run().await;
            drop(place);
        });
    }
}

struct Connection {
    stream: TcpStream,
    peer: SocketAddr,
    /// Bytes read and not consumed.
    bytes: Vec<u8>,
    service: Arc<HttpService>,
    /// Free room for bodies, in KiB.
    bodies: Arc<Semaphore>,
}

/// The body of a request, with the room it takes.
struct Body {
    bytes: Vec<u8>,
    _room: OwnedSemaphorePermit,
}

impl Connection {
    async fn run(mut self) -> std::io::Result<()> {
        loop {
            if !self.wait_for_request().await? {
                return Ok(());
            }
            let request = match timeout(REQUEST_WAIT, self.request()).await {
                Ok(request) => request?,
                Err(_) => return Ok(()),
            };
            let (keep, answer) = match request {
                Ok(None) => return Ok(()),
                Ok(Some((head, _))) if head.method == "GET" && head.path == TRACE_PATH => {
                    return self.show_trace().await;
                }
                Ok(Some((head, body))) => (head.keep, self.answer(&head, &body.bytes)),
                // The start of a next request is unknown
                Err(error) => (false, Err(error)),
            };
            let (status, text) = match answer {
                Ok(text) => ("200 OK", text),
                Err(error) => (error.status(), String::new()),
            };
            self.write(status, &text, keep).await?;
            if !keep {
                // Read the rest of the request, so that a reset does not lose the response
                self.stream.shutdown().await?;
                _ = timeout(Duration::from_secs(1), self.read_away()).await;
                return Ok(());
            }
        }
    }

    /// Waits for the beginning of a request. Line ends between requests are ignored.
    async fn wait_for_request(&mut self) -> std::io::Result<bool> {
        loop {
            let blank = self.bytes.iter().take_while(|byte| matches!(byte, b'\r' | b'\n')).count();
            self.bytes.drain(..blank);
            if !self.bytes.is_empty() {
                return Ok(true);
            }
            let Ok(count) = timeout(IDLE_WAIT, self.stream.read_buf(&mut self.bytes)).await else { return Ok(false) };
            if count? == 0 {
                return Ok(false);
            }
        }
    }

    /// Reads a request. `None`: the client has closed the connection.
    async fn request(&mut self) -> std::io::Result<Result<Option<(Head, Body)>, HttpError>> {
        let head = loop {
            match parse_head(&self.bytes) {
                Ok(Some((head, taken))) => {
                    self.bytes.drain(..taken);
                    break head;
                }
                Ok(None) => {}
                Err(error) => return Ok(Err(error)),
            }
            if self.stream.read_buf(&mut self.bytes).await? == 0 {
                return Ok(Ok(None));
            }
        };
        if head.content_length > BODY_BYTES_MAX {
            return Ok(Err(HttpError::TooLarge));
        }
        let kib = u32::try_from(head.content_length.div_ceil(1 << 10)).unwrap_or(u32::MAX);
        let Ok(room) = Arc::clone(&self.bodies).try_acquire_many_owned(kib) else { return Ok(Err(HttpError::Busy)) };
        if head.expects_continue {
            self.stream.write_all(b"HTTP/1.1 100 Continue\r\n\r\n").await?;
        }
        while self.bytes.len() < head.content_length {
            if self.stream.read_buf(&mut self.bytes).await? == 0 {
                return Ok(Ok(None));
            }
        }
        let bytes = self.bytes.drain(..head.content_length).collect();
        Ok(Ok(Some((head, Body { bytes, _room: room }))))
    }

    fn answer(&self, head: &Head, body: &[u8]) -> Result<String, HttpError> {
        match (head.method.as_str(), head.path.as_str()) {
            ("POST", PATH) => {
                let letter = multipart::open(&head.content_type, body)?;
                if (self.service.take)(letter) { Ok(String::new()) } else { Err(HttpError::Busy) }
            }
            ("GET", PATH) => Ok((self.service.about)()),
            (_, PATH) => Err(HttpError::Method),
            _ => Err(HttpError::NotFound),
        }
    }

    /// JADE closes on any other spelling of the last field's value
    async fn write(&mut self, status: &str, text: &str, keep: bool) -> std::io::Result<()> {
        let connection = if keep { "Keep-Alive" } else { "close" };
        let answer = format!(
            "HTTP/1.1 {status}\r\nContent-Type: text/plain\r\nCache-Control: no-cache\r\nContent-Length: \
             {}\r\nConnection: {connection}\r\n\r\n{text}",
            text.len()
        );
        match timeout(ANSWER_WAIT, self.stream.write_all(answer.as_bytes())).await {
            Ok(written) => written,
            Err(_) => Err(std::io::ErrorKind::TimedOut.into()),
        }
    }

    async fn read_away(&mut self) -> std::io::Result<()> {
        let mut bytes = [0; 4096];
        while self.stream.read(&mut bytes).await? > 0 {}
        Ok(())
    }

    /// Sends the trace while the client reads it. Only for clients on this machine, because it shows the content of
    /// messages.
    async fn show_trace(mut self) -> std::io::Result<()> {
        if !is_local(self.peer.ip()) {
            return self.write(HttpError::NotFound.status(), "", false).await;
        }
        let mut lines = self.service.trace.subscribe();
        self.stream
            .write_all(b"HTTP/1.1 200 OK\r\nContent-Type: text/plain; charset=UTF-8\r\nConnection: close\r\n\r\n")
            .await?;
        let (mut reader, mut writer) = self.stream.split();
        let mut gone = [0; 64];
        loop {
            let line = tokio::select! {
                line = lines.recv() => line,
                read = reader.read(&mut gone) => match read {
                    Ok(0) | Err(_) => return Ok(()),
                    Ok(_) => continue,
                },
            };
            let text = match line {
                Ok(line) => format!("{line}\n"),
                Err(broadcast::error::RecvError::Lagged(count)) => {
                    format!("# {count} messages were skipped: too many at once\n")
                }
                Err(broadcast::error::RecvError::Closed) => return Ok(()),
            };
            match timeout(ANSWER_WAIT, writer.write_all(text.as_bytes())).await {
                Ok(written) => written?,
                Err(_) => return Ok(()),
            }
        }
    }
}

fn is_local(address: IpAddr) -> bool {
    address.to_canonical().is_loopback()
}
