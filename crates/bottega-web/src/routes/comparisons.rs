//! The routes for comparing pictures: figures, and a map of visible differences.

use std::sync::Arc;

use axum::{
    extract::{Request, State},
    http::{HeaderMap, StatusCode},
    routing::{get, post},
};
use bottega::difference::Difference;
use schemars::JsonSchema;
use serde::Serialize;

use super::pictures::tagged;
use crate::{
    comparisons::ComparedPictures,
    limits::{COMPARISON_TIME, PIECE_TIME, SENT_PICTURE_BYTES_MAX},
    problem::Problem,
    redact::redacted_json,
    route::{AtDoor, Param, Route, RouteAnswer, RouteBody, RouteResult, body, json, json_text, schema},
    state::DoorState,
};

/// A picture that was sent for comparison.
#[derive(Debug, Serialize, JsonSchema)]
struct SentPicture {
    /// Number of the picture.
    picture: u32,
    /// Width in pixels.
    width: u32,
    /// Height in pixels.
    height: u32,
}

pub(super) fn routes() -> Vec<Route> {
    vec![
        Route::action(
            "post",
            "/api/pictures",
            "Send a picture to be compared: PNG, OpenEXR or Radiance. The server keeps the latest ones for a while.",
            RouteBody::Bytes,
            RouteAnswer::Json(schema::<SentPicture>),
            post(keep),
        )
        .with_status(StatusCode::CREATED),
        Route::query(
            "/api/pictures/{picture}/shown.png",
            "A picture that was sent, as a display shows it.",
            RouteAnswer::Media("image/png"),
            get(shown),
        ),
        Route::query(
            "/api/jobs/{id}/difference/{other}",
            "How the picture of the job differs from another one, in figures: that of `job-2`, or `picture-1` which was sent. Linear \
             light is compared.",
            RouteAnswer::Json(schema::<Difference>),
            get(difference),
        ),
        Route::query(
            "/api/jobs/{id}/difference/{other}/flip.png",
            "Where they differ to the eye: FLIP of each pixel, from black, none, to light yellow.",
            RouteAnswer::Media("image/png"),
            get(flip),
        ),
    ]
}

async fn keep(State(door): AtDoor, request: Request) -> RouteResult {
    let bytes = body(request, SENT_PICTURE_BYTES_MAX, PIECE_TIME).await?;
    let comparisons = Arc::clone(&door.comparisons);
    let (picture, (width, height)) = door.ask(COMPARISON_TIME, move |_| comparisons.keep(bytes)).await?;
    Ok(json_text(StatusCode::CREATED, redacted_json(&SentPicture { picture, width, height })))
}

async fn shown(State(door): AtDoor, Param(number): Param<u32>, headers: HeaderMap) -> RouteResult {
    let comparisons = Arc::clone(&door.comparisons);
    let png = door.ask(COMPARISON_TIME, move |_| comparisons.shown(number)).await?;
    Ok(tagged(png, "image/png", &headers))
}

async fn difference(State(door): AtDoor, Param((id, other)): Param<(u32, String)>) -> RouteResult {
    Ok(json(&compared(&door, id, other).await?.difference))
}

async fn flip(State(door): AtDoor, Param((id, other)): Param<(u32, String)>, headers: HeaderMap) -> RouteResult {
    let compared = compared(&door, id, other).await?;
    let png = door.ask(COMPARISON_TIME, move |_| compared.flip_map()).await?;
    Ok(tagged(png, "image/png", &headers))
}

/// Compares two pictures. Comparisons run one at a time; others wait.
async fn compared(door: &DoorState, id: u32, other: String) -> Result<Arc<ComparedPictures>, Problem> {
    let comparisons = Arc::clone(&door.comparisons);
    let permit = Arc::clone(&comparisons.alone).acquire_owned().await;
    let compared = door.ask(COMPARISON_TIME, move |farm| {
        let _permit = permit;
        comparisons.compare(farm, id, &other)
    });
    compared.await
}
