//! The rows of a job as a page reports them, such as the page of `bottega render --dashboard`: a process without a farm.

use std::time::Duration;

use bottega::events::Event;
use http_body_util::{BodyExt, Empty};
use hyper::{
    Request, Response, StatusCode, Uri,
    body::{Bytes, Incoming},
    header,
};
use hyper_util::rt::TokioIo;
use serde_json::Value;
use tokio::{net::TcpStream, runtime::Runtime};

use crate::error::CliError;

/// The time in which a page must answer.
const PATIENCE: Duration = Duration::from_secs(10);
/// The interval at which a caller may look whether to stop.
const LOOK_EVERY: Duration = Duration::from_millis(300);
/// The largest report that is read, in bytes.
const BYTES_MAX: usize = 1 << 28;
/// The remedy for an address that does not lead to a page.
const REMEDY: &str = "copy the whole address that `bottega render --dashboard` prints, with its token";

/// A report of a page.
#[derive(Debug, Default, PartialEq)]
pub(super) struct PageNews {
    /// New or changed rows: [`Event::Zone`] and [`Event::Agent`].
    pub(super) rows: Vec<Event>,
    /// `true`: the job is over.
    pub(super) is_over: bool,
}

impl PageNews {
    /// Reads the data of a server-sent event: a JSON array of events. Unknown ones are left out.
    fn of(data: &str) -> Self {
        let events: Vec<Value> = serde_json::from_str(data).unwrap_or_default();
        let is_over = |event: &Value| {
            let is_end = ["done", "cancelled", "failed"].iter().any(|state| event["state"] == *state);
            event["event"] == "job" && is_end
        };
        let is_over = events.iter().any(is_over);
        let rows = events.into_iter().filter_map(|event| serde_json::from_value(event).ok());
        Self { rows: rows.filter(|row| matches!(row, Event::Zone(_) | Event::Agent(_))).collect(), is_over }
    }
}

/// The stream of a job's events from a page.
pub(super) struct PageStream {
    runtime: Runtime,
    body: Incoming,
    /// The bytes received after the last complete event.
    rest: Vec<u8>,
}

impl PageStream {
    /// Connects to a page.
    ///
    /// - `page`: its address, with the token as the query `token`.
    ///
    /// # Errors
    /// The address is not one of a page, nothing answers there, or the page refuses the token or has no such job.
    pub(super) fn open(page: &Uri, job: u32) -> Result<Self, CliError> {
        let (Some("http"), Some(host)) = (page.scheme_str(), page.host()) else {
            return Err(CliError::usage(format!("`{page}` is not the http address of a page"), REMEDY));
        };
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build();
        let runtime = runtime.map_err(|error| {
            CliError::failed(format!("cannot connect to a page: {error}"), "this is unexpected; report it")
        })?;
        let token = page.query().unwrap_or_default().split('&').find_map(|part| part.strip_prefix("token="));
        let request = Request::get(format!("/api/jobs/{job}/events"))
            .header(header::HOST, page.authority().map_or(host, |authority| authority.as_str()))
            .header(header::AUTHORIZATION, format!("Bearer {}", token.unwrap_or_default()))
            .body(Empty::new());
        let request = request.map_err(|_| CliError::usage(format!("`{page}` has an invalid token"), REMEDY))?;
        let bare = host.trim_start_matches('[').trim_end_matches(']');
        let answer = runtime.block_on(async {
            tokio::time::timeout(PATIENCE, ask((bare, page.port_u16().unwrap_or(80)), request)).await
        });
        let unreached = |why: String| CliError::failed(format!("the page at {host} does not answer: {why}"), REMEDY);
        let response = answer
            .map_err(|_| unreached(format!("nothing in {} s", PATIENCE.as_secs())))?
            .map_err(|error| unreached(error.to_string()))?;
        match response.status() {
            StatusCode::OK => Ok(Self { runtime, body: response.into_body(), rest: Vec::new() }),
            StatusCode::NOT_FOUND => Err(CliError::usage(format!("the page has no job {job}"), "leave out the number")),
            status => Err(CliError::failed(format!("the page at {host} answers {status}"), REMEDY)),
        }
    }

    /// Waits for the next report. `None`: the page has ended.
    ///
    /// - `is_stopped`: asked several times a second; ends the stream.
    ///
    /// # Errors
    /// The page sends something else than events.
    pub(super) fn next(&mut self, is_stopped: &dyn Fn() -> bool) -> Result<Option<PageNews>, CliError> {
        loop {
            if let Some(news) = self.complete_event() {
                return Ok(Some(news));
            }
            if self.rest.len() > BYTES_MAX {
                return Err(CliError::failed("the page sends no events", REMEDY));
            }
            let frame = self.runtime.block_on(async { tokio::time::timeout(LOOK_EVERY, self.body.frame()).await });
            match frame {
                Err(_) if is_stopped() => return Ok(None),
                Err(_) => {}
                // A process that has written its picture ends, and its page with it.
                Ok(None | Some(Err(_))) => return Ok(None),
                Ok(Some(Ok(frame))) => self.rest.extend(frame.into_data().unwrap_or_default()),
            }
        }
    }

    /// Takes the first complete event with data from the received bytes.
    fn complete_event(&mut self) -> Option<PageNews> {
        while let Some(end) = self.rest.windows(2).position(|pair| pair == b"\n\n") {
            let event = String::from_utf8_lossy(&self.rest[..end]).into_owned();
            self.rest.drain(..end + 2);
            if let Some(data) = event.lines().find_map(|line| line.strip_prefix("data: ")) {
                return Some(PageNews::of(data));
            }
        }
        None
    }
}

/// Sends a request, and reads the head of the answer.
async fn ask(
    address: (&str, u16),
    request: Request<Empty<Bytes>>,
) -> Result<Response<Incoming>, Box<dyn std::error::Error + Send + Sync>> {
    let stream = TcpStream::connect(address).await?;
    let (mut sender, connection) = hyper::client::conn::http1::handshake(TokioIo::new(stream)).await?;
    tokio::spawn(connection);
    Ok(sender.send_request(request).await?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_and_the_end_are_read_and_everything_else_is_left_out() {
        let zone = r#"{"event":"agent","agent":"a","power":1.0,"lanes":2,"credit":0.5,"failures":0,"reliability":1.0}"#;
        let news = PageNews::of(&format!(r#"[{zone},{{"event":"preview"}},{{"event":"unknown"}},7]"#));
        assert_eq!((news.rows.len(), news.is_over), (1, false), "{news:?}");
        assert!(PageNews::of(r#"[{"event":"job","state":"done"}]"#).is_over);
        assert_eq!(PageNews::of("nonsense"), PageNews::default());
    }

    #[test]
    fn addresses_that_are_not_of_pages_are_refused() {
        for page in ["https://127.0.0.1:1/", "/api", "http://127.0.0.1:1/?token=1"] {
            assert!(PageStream::open(&page.parse().unwrap(), 1).is_err(), "{page}");
        }
    }
}
