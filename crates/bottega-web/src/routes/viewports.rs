//! The routes of viewports: interactive views of a scene before its picture is submitted.

use std::{sync::Arc, time::Duration};

use axum::{
    extract::{Request, State},
    http::{HeaderMap, HeaderName, StatusCode, header},
    response::{IntoResponse, Response},
    routing::{delete, get, post, put},
};
use bottega::{
    Error,
    error::error_chain,
    request::ViewOptions,
    viewport::{Viewport, ViewportCamera, ViewportFrame},
};
use bottega_cluster::{client::ViewportMachine, uploads::Submission};
use schemars::JsonSchema;
use serde::Serialize;
use tokio::time::Instant;

use crate::{
    limits::{FRAME_TIME, SUBMISSION_TIME},
    problem::Problem,
    redact::redacted_json,
    route::{AtDoor, Param, Route, RouteAnswer, RouteBody, RouteResult, json, json_body, json_text, schema},
};

/// Header with the number of a frame's look.
const LOOK: HeaderName = HeaderName::from_static("bottega-look");
/// Header with the samples per pixel of a frame.
const SAMPLES: HeaderName = HeaderName::from_static("bottega-samples");
/// Header that is `true` if a frame is denoised.
const DENOISED: HeaderName = HeaderName::from_static("bottega-denoised");

/// Header with the number of machines that render the view.
const MACHINES: HeaderName = HeaderName::from_static("bottega-machines");
/// Header with the bytes per second that the other machines send.
const BYTES: HeaderName = HeaderName::from_static("bottega-bytes-per-second");

/// An opened viewport.
#[derive(Debug, Serialize, JsonSchema)]
struct OpenViewport {
    /// Number of the viewport.
    viewport: u32,
    /// Width in pixels.
    width: u32,
    /// Height in pixels.
    height: u32,
    /// Samples per pixel after which rendering stops.
    samples: u32,
    /// True if frames are denoised.
    denoises: bool,
    /// The cameras of the scene, in the order of their numbers in `view.camera`.
    cameras: Vec<ViewportCamera>,
    /// Seconds that loading the scene took.
    seconds: f64,
}

/// The number of a look, which its frames have in a header.
#[derive(Debug, Serialize, JsonSchema)]
struct LookNumber {
    /// Number of the look.
    look: u64,
}

pub(super) fn routes() -> Vec<Route> {
    vec![
        Route::action(
            "post",
            "/api/viewports",
            "Open a viewport: the scene is rendered progressively from any view. Free machines of a farm help.",
            RouteBody::Json(schema::<Submission>),
            RouteAnswer::Json(schema::<OpenViewport>),
            post(open),
        )
        .with_status(StatusCode::CREATED),
        Route::action(
            "put",
            "/api/viewports/{viewport}/view",
            "Look from elsewhere.",
            RouteBody::Json(schema::<ViewOptions>),
            RouteAnswer::Json(schema::<LookNumber>),
            put(look),
        ),
        Route::action(
            "get",
            "/api/viewports/{viewport}/frame.png",
            "The current frame. With If-None-Match it waits up to 5 s for a new one. `Bottega-Look` is the number of its look, `Bottega-Machines` the number of machines that render it.",
            RouteBody::Nothing,
            RouteAnswer::Media("image/png"),
            get(frame),
        ),
        Route::action(
            "delete",
            "/api/viewports/{viewport}",
            "Close it.",
            RouteBody::Nothing,
            RouteAnswer::Nothing,
            delete(close),
        ),
    ]
}

async fn open(State(door): AtDoor, request: Request) -> RouteResult {
    let submission: Submission = json_body(request).await?;
    let place = door.viewports.place()?;
    let busy = || {
        let detail = "another scene is being examined";
        Problem::new(StatusCode::SERVICE_UNAVAILABLE, detail, "try again in a moment")
    };
    let permit = Arc::clone(&door.submissions).try_acquire_owned().map_err(|_| busy())?;
    let opened = door.ask(SUBMISSION_TIME, move |farm| {
        let _permit = permit;
        let request = farm.uploaded_here(submission)?;
        let begun = std::time::Instant::now();
        let viewport = Arc::new(Viewport::open(&request).map_err(|error| refused(&error))?);
        let shared = farm.share(&viewport);
        Ok((viewport, shared, begun.elapsed()))
    });
    let (viewport, shared, took) = opened.await?;
    let (width, height) = viewport.size();
    let (samples, denoises, cameras) = (viewport.samples(), viewport.denoises(), viewport.cameras().to_vec());
    let viewport = place.fill(viewport, shared);
    let seconds = took.as_secs_f64();
    let opened = OpenViewport { viewport, width, height, samples, denoises, cameras, seconds };
    let mut response = json_text(StatusCode::CREATED, redacted_json(&opened));
    if let Ok(place) = format!("/api/viewports/{viewport}").parse() {
        response.headers_mut().insert(header::LOCATION, place);
    }
    Ok(response)
}

async fn look(State(door): AtDoor, Param(number): Param<u32>, request: Request) -> RouteResult {
    let view: ViewOptions = json_body(request).await?;
    let look = door.viewports.get(number)?.look(&view).map_err(|error| refused(&error))?;
    Ok(json(&LookNumber { look }))
}

async fn frame(State(door): AtDoor, Param(number): Param<u32>, headers: HeaderMap) -> RouteResult {
    let known = headers.get(header::IF_NONE_MATCH).and_then(|known| known.to_str().ok());
    // Without a tag of this viewport any frame is new
    let after = known.and_then(|known| known.trim_matches('"').strip_prefix(&format!("{number}-"))?.parse().ok());
    let after: u64 = after.unwrap_or(0);
    let begun = Instant::now();
    loop {
        let (viewport, mut frames) = door.viewports.watched(number)?;
        frames.borrow_and_update();
        let due = viewport.due(after);
        if due == Some(Duration::ZERO) {
            // Encoding the PNG file takes a while
            let shown = tokio::task::spawn_blocking(move || viewport.frame(after)).await;
            let shown = shown.map_err(|_| Problem::conflict("the viewport cannot be shown", "open it again"))?;
            if let Some(frame) = shown.map_err(|error| refused(&error))? {
                return Ok(shown_frame(number, frame, &door.viewports.machines(number)));
            }
            continue;
        }
        // Waiting requests must not keep a closed viewport alive
        drop(viewport);
        let left = FRAME_TIME.saturating_sub(begun.elapsed());
        if left.is_zero() {
            return Ok(StatusCode::NOT_MODIFIED.into_response());
        }
        // On timeout, closing or change the next iteration decides
        _ = tokio::time::timeout(due.unwrap_or(left).min(left), frames.changed()).await;
    }
}

fn shown_frame(viewport: u32, frame: ViewportFrame, machines: &[ViewportMachine]) -> Response {
    let ViewportFrame { number, look, samples, is_denoised, png } = frame;
    let helping = machines.iter().filter(|machine| machine.refused.is_none());
    let headers = [
        (header::CONTENT_TYPE, "image/png".to_owned()),
        (header::CACHE_CONTROL, "no-store".to_owned()),
        (header::ETAG, format!("\"{viewport}-{number}\"")),
        (LOOK, look.to_string()),
        (SAMPLES, samples.to_string()),
        (DENOISED, is_denoised.to_string()),
        // This process renders, too
        (MACHINES, (1 + helping.clone().count()).to_string()),
        (BYTES, helping.map(|machine| machine.bytes_per_second as u64).sum::<u64>().to_string()),
    ];
    (headers, png).into_response()
}

async fn close(State(door): AtDoor, Param(number): Param<u32>) -> RouteResult {
    door.viewports.get(number)?;
    let viewports = Arc::clone(&door.viewports);
    // The rendering thread ends within a moment; do not wait for it.
    tokio::task::spawn_blocking(move || viewports.close(number));
    Ok(StatusCode::NO_CONTENT.into_response())
}

/// Returns the problem of a scene that cannot be viewed.
fn refused(error: &Error) -> Problem {
    Problem::new(StatusCode::UNPROCESSABLE_ENTITY, error_chain(error), error.remedy().unwrap_or_default())
}
