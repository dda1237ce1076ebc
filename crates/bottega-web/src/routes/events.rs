//! The events of a job, as server-sent events: first the whole state, then changes. A client that reconnects, here or at
//! another process of the farm, gets the whole state again.

use std::{convert::Infallible, sync::Arc, time::Duration};

use axum::{
    body::{Body, Bytes},
    extract::State,
    http::{StatusCode, header},
    response::{IntoResponse, Response},
    routing::get,
};
use tokio::{sync::mpsc, time::Instant};
use tokio_stream::{StreamExt, wrappers::ReceiverStream};

use crate::{
    limits::{ANSWER_TIME, EVENT_STREAMS_MAX},
    live::{LiveJob, LiveUpdate},
    problem::Problem,
    route::{Param, Route, RouteAnswer},
    state::DoorState,
};

/// Interval between updates; changes within it are sent together.
const TELL_EVERY: Duration = Duration::from_millis(200);
/// Longest time to wait for the first state of a job.
const FIRST_WAITS: Duration = Duration::from_secs(2);
/// Interval between keep-alive comments.
const ALIVE_EVERY: Duration = Duration::from_secs(10);
/// Delay in milliseconds after which clients reconnect.
const RETRY: &str = "retry: 1000\n\n";

pub(super) fn route() -> Route {
    Route::query(
        "/api/jobs/{id}/events",
        "What happens to the job, as server-sent events. `event: state` comes first and has the whole state as a JSON array of events; `event: news` has what has changed since.",
        RouteAnswer::Media("text/event-stream"),
        get(events),
    )
}

async fn events(State(door): State<Arc<DoorState>>, Param(id): Param<u32>) -> Result<Response, Problem> {
    let permit = Arc::clone(&door.streams).try_acquire_owned().map_err(|_| {
        let detail = format!("{EVENT_STREAMS_MAX} streams of events are open, the maximum");
        Problem::new(StatusCode::SERVICE_UNAVAILABLE, detail, "close one, or poll the state")
    })?;
    let live = door.ask(ANSWER_TIME, move |farm| farm.live(id)).await?;
    // The channel holds one update, so a slow client holds up only itself.
    let (sender, taken) = mpsc::channel(1);
    tokio::spawn(async move {
        let _permit = permit;
        tell(&live, &sender).await;
    });
    let body = Body::from_stream(ReceiverStream::new(taken).map(Ok::<Bytes, Infallible>));
    let headers = [(header::CONTENT_TYPE, "text/event-stream"), (header::CACHE_CONTROL, "no-store")];
    Ok((headers, body).into_response())
}

/// Sends the updates of a job until the client disconnects.
async fn tell(live: &LiveJob, client: &mpsc::Sender<Bytes>) {
    let (mut cursor, mut last) = (None, Instant::now());
    if client.send(Bytes::from_static(RETRY.as_bytes())).await.is_err() {
        return;
    }
    let begun = Instant::now();
    while !client.is_closed() {
        // The state of a job that was not watched yet arrives in a moment.
        if cursor.is_none() && begun.elapsed() < FIRST_WAITS && live.is_empty() {
            tokio::time::sleep(TELL_EVERY).await;
            continue;
        }
        let text = live.since(cursor).map(|LiveUpdate { is_whole, text, cursor: now }| {
            cursor = Some(now);
            format!("event: {}\ndata: {text}\n\n", if is_whole { "state" } else { "news" })
        });
        let text = text.or_else(|| (last.elapsed() > ALIVE_EVERY).then(|| ":\n\n".to_owned()));
        if let Some(text) = text {
            last = Instant::now();
            if client.send(text.into()).await.is_err() {
                return;
            }
        }
        tokio::time::sleep(TELL_EVERY).await;
    }
}
