//! The HTTP server of one job. It runs on a thread of its own and never holds up the work.

use std::{
    convert::Infallible,
    net::{SocketAddr, TcpListener},
    sync::{Arc, Mutex, PoisonError},
    thread,
};

use axum::{
    Json, Router,
    body::Bytes,
    extract::State,
    http::{StatusCode, header},
    response::{Html, IntoResponse, Response, Sse, sse},
    routing::get,
};
use bottega::Event;
use tokio::sync::broadcast;
use tokio_stream::{Stream, StreamExt, wrappers::BroadcastStream};

/// Events that a slow listener may lag behind before it misses some; it then reads `/api/job` again.
const EVENTS_KEPT: usize = 4096;

/// Why the dashboard could not be served.
#[derive(Debug, thiserror::Error)]
pub enum ServeError {
    /// The address cannot be listened on.
    #[error("cannot listen on {address}")]
    Listen {
        /// The address.
        address: SocketAddr,
        /// Why.
        source: std::io::Error,
    },
}

/// Shows one job to whoever connects.
#[derive(Clone)]
pub struct Dashboard {
    shared: Arc<Shared>,
    address: SocketAddr,
}

struct Shared {
    /// The events that tell the present state to one who comes late: all but the outdated.
    state: Mutex<JobState>,
    /// What is painted, as a PNG file.
    preview: Mutex<Option<Bytes>>,
    live: broadcast::Sender<String>,
}

#[derive(Default)]
struct JobState {
    started: Option<Event>,
    analyzed: Option<Event>,
    zones: std::collections::BTreeMap<u32, Event>,
    agents: std::collections::BTreeMap<String, Event>,
    progress: Option<Event>,
    preview: Option<Event>,
    end: Option<Event>,
    notes: Vec<Event>,
}

impl JobState {
    /// Takes an event in. What it replaces is forgotten.
    fn take(&mut self, event: Event) {
        match event {
            Event::Started { .. } => *self = Self { started: Some(event), ..Self::default() },
            Event::Analyzed { .. } => self.analyzed = Some(event),
            Event::Zone(ref zone) => {
                self.zones.insert(zone.id, event);
            }
            Event::Agent(ref agent) => {
                self.agents.insert(agent.agent.clone(), event);
            }
            Event::Progress(_) | Event::Sending { .. } | Event::Step { .. } => self.progress = Some(event),
            Event::Preview { .. } => self.preview = Some(event),
            // Told as they end, and summed up at the end.
            Event::Round(_) => {}
            Event::Note { .. }
            | Event::Warning { .. }
            | Event::Asked { .. }
            | Event::LightingAgents(_)
            | Event::Auction(_)
            | Event::Mixed { .. }
            | Event::Recorded { .. }
            | Event::Resources { .. }
            | Event::Timeline { .. }
            | Event::Frame { .. }
            | Event::Denoised { .. } => self.notes.push(event),
            Event::Finished { .. } | Event::Interrupted { .. } | Event::Fetched { .. } => self.end = Some(event),
        }
    }

    fn events(&self) -> Vec<Event> {
        self.started
            .iter()
            .chain(&self.notes)
            .chain(&self.analyzed)
            .chain(self.zones.values())
            .chain(self.agents.values())
            .chain(&self.preview)
            .chain(&self.progress)
            .chain(&self.end)
            .cloned()
            .collect()
    }
}

impl Dashboard {
    /// Listens on `address` (port 0: any free one) and serves until the process ends.
    pub fn serve(address: SocketAddr) -> Result<Self, ServeError> {
        let listen = |source| ServeError::Listen { address, source };
        let listener = TcpListener::bind(address).map_err(listen)?;
        listener.set_nonblocking(true).map_err(listen)?;
        let bound = listener.local_addr().map_err(listen)?;
        let (live, _) = broadcast::channel(EVENTS_KEPT);
        let shared = Arc::new(Shared { state: Mutex::default(), preview: Mutex::default(), live });
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().map_err(listen)?;
        let routes = Router::new()
            .route("/", get(async || Html(include_str!("dashboard.html"))))
            .route("/api/job", get(job))
            .route("/api/events", get(events))
            .route("/api/preview.png", get(preview))
            .with_state(Arc::clone(&shared));
        thread::spawn(move || {
            runtime.block_on(async move {
                if let Ok(listener) = tokio::net::TcpListener::from_std(listener) {
                    // It ends with the process; a failed connection is its client's affair.
                    let _ = axum::serve(listener, routes).await;
                }
            });
        });
        Ok(Self { shared, address: bound })
    }

    /// Where it listens.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Shows an event to all who look, and to those who come later.
    pub fn publish(&self, event: Event) {
        // Nobody listening is no error.
        let _ = self.shared.live.send(event.to_json());
        self.shared.state.lock().unwrap_or_else(PoisonError::into_inner).take(event);
    }

    /// From now on `png`, a PNG file, is what is painted. Whoever looks is told by [`Event::Preview`].
    pub fn set_preview(&self, png: impl Into<Bytes>) {
        *self.shared.preview.lock().unwrap_or_else(PoisonError::into_inner) = Some(png.into());
    }
}

/// What is painted.
async fn preview(State(shared): State<Arc<Shared>>) -> Response {
    let png = shared.preview.lock().unwrap_or_else(PoisonError::into_inner).clone();
    match png {
        Some(png) => ([(header::CONTENT_TYPE, "image/png"), (header::CACHE_CONTROL, "no-store")], png).into_response(),
        None => StatusCode::NOT_FOUND.into_response(),
    }
}

/// The present state: the events that made it.
async fn job(State(shared): State<Arc<Shared>>) -> Json<Vec<Event>> {
    Json(shared.state.lock().unwrap_or_else(PoisonError::into_inner).events())
}

/// The events from now on, as server-sent events.
async fn events(State(shared): State<Arc<Shared>>) -> impl IntoResponse {
    let stream = BroadcastStream::new(shared.live.subscribe());
    ([(header::CACHE_CONTROL, "no-store")], Sse::new(as_sse(stream)).keep_alive(sse::KeepAlive::default()))
}

/// Who lags behind is told to read the state again.
fn as_sse(stream: BroadcastStream<String>) -> impl Stream<Item = Result<sse::Event, Infallible>> {
    stream.map(|line| {
        Ok(match line {
            Ok(line) => sse::Event::default().data(line),
            Err(_) => sse::Event::default().event("lagged").data(""),
        })
    })
}

#[cfg(test)]
mod tests {
    use std::{
        io::{Read, Write},
        net::TcpStream,
    };

    use super::*;
    use bottega::events::{Progress, ZoneEvent};

    fn get(address: SocketAddr, path: &str) -> String {
        let mut stream = TcpStream::connect(address).expect("the dashboard listens");
        write!(stream, "GET {path} HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n").expect("request is sent");
        let mut answer = String::new();
        stream.read_to_string(&mut answer).expect("an answer comes");
        answer
    }

    fn zone(id: u32, state: &str) -> Event {
        let state = state.to_owned();
        Event::Zone(Box::new(ZoneEvent { id, state, ..ZoneEvent::default() }))
    }

    #[test]
    fn one_who_comes_late_sees_the_present_state_and_nothing_outdated() {
        let dashboard = Dashboard::serve(([127, 0, 0, 1], 0).into()).expect("a free port");
        dashboard.publish(zone(3, "open"));
        dashboard.publish(zone(3, "done"));
        dashboard.publish(Event::Progress(Progress { zones_done: 1, ..Progress::default() }));
        let answer = get(dashboard.address(), "/api/job");
        assert!(answer.starts_with("HTTP/1.1 200"), "{answer}");
        assert!(answer.contains(r#""state":"done""#) && !answer.contains(r#""state":"open""#), "{answer}");
        assert!(answer.contains(r#""zones_done":1"#), "{answer}");
    }

    #[test]
    fn the_preview_is_there_when_there_is_one() {
        let dashboard = Dashboard::serve(([127, 0, 0, 1], 0).into()).expect("a free port");
        assert!(get(dashboard.address(), "/api/preview.png").starts_with("HTTP/1.1 404"));
        dashboard.set_preview("one");
        dashboard.set_preview("two");
        dashboard.publish(Event::Preview { number: 2, seconds: 0.5 });
        let answer = get(dashboard.address(), "/api/preview.png");
        assert!(answer.contains("image/png") && answer.ends_with("two"), "{answer}");
        assert!(get(dashboard.address(), "/api/job").contains(r#""number":2"#));
    }

    #[test]
    fn the_page_is_served_and_unknown_paths_are_not() {
        let dashboard = Dashboard::serve(([127, 0, 0, 1], 0).into()).expect("a free port");
        assert!(get(dashboard.address(), "/").contains("<title>Bottega</title>"));
        assert!(get(dashboard.address(), "/etc/passwd").starts_with("HTTP/1.1 404"));
    }

    #[test]
    fn a_taken_address_is_an_error() {
        let dashboard = Dashboard::serve(([127, 0, 0, 1], 0).into()).expect("a free port");
        assert!(matches!(Dashboard::serve(dashboard.address()), Err(ServeError::Listen { .. })));
    }
}
