//! The routes of a job's pictures: preview, importance map, finished file.

use axum::{
    Extension,
    extract::State,
    http::{HeaderMap, StatusCode, header},
    response::{IntoResponse, Response},
    routing::get,
};

use bottega_cluster::web_secrets::TokenRole;

use crate::{
    limits::ANSWER_TIME,
    problem::Problem,
    redact::is_absolute,
    route::{AtDoor, Param, Route, RouteAnswer, RouteResult},
    source::PictureFile,
    tokens::TokenBearer,
};

pub(super) fn routes() -> Vec<Route> {
    vec![
        Route::query(
            "/api/jobs/{id}/preview.png",
            "What is painted so far; 204: nothing yet. It has an ETag: send If-None-Match.",
            RouteAnswer::Media("image/png"),
            get(preview),
        ),
        Route::query(
            "/api/jobs/{id}/importance.png",
            "The importance map: the lighter, the more a pixel is predicted to cost.",
            RouteAnswer::Media("image/png"),
            get(importance),
        ),
        Route::query(
            "/api/jobs/{id}/picture",
            "The finished picture: the requested file.",
            RouteAnswer::Media("application/octet-stream"),
            get(picture),
        ),
    ]
}

async fn preview(State(door): AtDoor, Param(id): Param<u32>, headers: HeaderMap) -> RouteResult {
    let png = door.ask(ANSWER_TIME, move |farm| farm.preview(id)).await?;
    // An early request is not an error.
    Ok(png.map_or_else(|| StatusCode::NO_CONTENT.into_response(), |png| shown(png, &headers)))
}

async fn importance(State(door): AtDoor, Param(id): Param<u32>, headers: HeaderMap) -> RouteResult {
    let png = door.ask(ANSWER_TIME, move |farm| farm.importance(id)).await?;
    let lacking =
        || Problem::unknown(format!("the importance map of job {id} is not known"), "it is known while a farm paints");
    Ok(shown(png.ok_or_else(lacking)?, &headers))
}

/// Answers with a PNG file, or 304 if the client has it.
fn shown(png: Vec<u8>, headers: &HeaderMap) -> Response {
    tagged(png, "image/png", headers)
}

/// Answers with a file of a media type, or 304 if the client has it.
pub(super) fn tagged(bytes: Vec<u8>, kind: &'static str, headers: &HeaderMap) -> Response {
    let digest = blake3::hash(&bytes).to_hex();
    let tag = format!("\"{}\"", &digest[..32]);
    let known = headers.get(header::IF_NONE_MATCH).and_then(|known| known.to_str().ok());
    let is_known = known.is_some_and(|known| known.split(',').any(|known| known.trim() == tag));
    let caching = [(header::ETAG, tag), (header::CACHE_CONTROL, "no-cache".to_owned())];
    if is_known {
        return (StatusCode::NOT_MODIFIED, caching).into_response();
    }
    (caching, [(header::CONTENT_TYPE, kind)], bytes).into_response()
}

/// Answers with the picture file. It holds the request with its paths, so clients that only see get it only if these are
/// relative.
async fn picture(State(door): AtDoor, Extension(bearer): Extension<TokenBearer>, Param(id): Param<u32>) -> RouteResult {
    let picture = door.ask(ANSWER_TIME, move |farm| {
        let job = farm.job(id)?;
        if bearer.role() < TokenRole::Steer && (is_absolute(&job.scene) || is_absolute(&job.output)) {
            let detail = "the picture's file contains paths of files on the machine of its submitter";
            return Err(Problem::new(StatusCode::FORBIDDEN, detail, "only those who may steer get it"));
        }
        farm.picture(id)
    });
    let PictureFile { name, bytes } = picture.await?;
    let plain: String = name.chars().filter(|c| c.is_ascii_alphanumeric() || "._-".contains(*c)).collect();
    let name = if plain.is_empty() { "picture".to_owned() } else { plain };
    let kind = match name.rsplit('.').next() {
        Some("png") => "image/png",
        Some("exr") => "image/x-exr",
        _ => "application/octet-stream",
    };
    let headers = [
        (header::CONTENT_TYPE, kind.to_owned()),
        (header::CONTENT_DISPOSITION, format!("attachment; filename=\"{name}\"")),
        (header::CACHE_CONTROL, "no-store".to_owned()),
    ];
    Ok((headers, bytes).into_response())
}
