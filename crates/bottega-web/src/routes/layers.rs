//! The routes of a finished picture's layers, each as a picture of its own.

use axum::{
    extract::State,
    http::HeaderMap,
    response::{IntoResponse, Response},
    routing::get,
};
use bottega_image::{FileLayer, ImageError, LayerKind, ToneMap};
use schemars::JsonSchema;
use serde::Serialize;

use super::pictures::tagged;
use crate::{
    limits::ANSWER_TIME,
    problem::Problem,
    route::{AtDoor, Param, Route, RouteAnswer, RouteResult, json, schema},
    source::PictureFile,
};

/// A layer of a picture.
#[derive(Debug, Serialize, JsonSchema)]
struct PictureLayer {
    /// Name of the layer.
    name: String,
    /// The kind of the layer's values: `color`, `direction`, `number` or `matte`.
    kind: &'static str,
}

pub(super) fn routes() -> Vec<Route> {
    vec![
        Route::query(
            "/api/jobs/{id}/layers",
            "The layers of the finished picture beside its color.",
            RouteAnswer::Json(schema::<Vec<PictureLayer>>),
            get(list),
        ),
        Route::query(
            "/api/jobs/{id}/layers/{layer}",
            "A layer of the finished picture: `albedo.exr` its values, `albedo.png` for display.",
            RouteAnswer::Media("image/png"),
            get(layer),
        ),
    ]
}

async fn list(State(door): AtDoor, Param(id): Param<u32>) -> RouteResult {
    let layers = door.ask(ANSWER_TIME, move |farm| {
        let PictureFile { name, bytes } = farm.picture(id)?;
        FileLayer::all(name, &bytes).map_err(|error| unread(&error))
    });
    let described = |FileLayer { name, kind, .. }| PictureLayer { name, kind: word(kind) };
    Ok(json(&layers.await?.into_iter().map(described).collect::<Vec<_>>()))
}

async fn layer(
    State(door): AtDoor,
    Param((id, wanted)): Param<(u32, String)>,
    headers: HeaderMap,
) -> Result<Response, Problem> {
    let (bytes, kind) = door.ask(ANSWER_TIME, move |farm| file_of(farm.picture(id)?, &wanted)).await?;
    Ok(tagged(bytes, kind, &headers).into_response())
}

/// Returns a layer as a file, and its media type.
///
/// - `wanted`: name of the layer, followed by `.png` or `.exr`.
fn file_of(PictureFile { name, bytes }: PictureFile, wanted: &str) -> Result<(Vec<u8>, &'static str), Problem> {
    let (wanted, format) = wanted.rsplit_once('.').unwrap_or((wanted, "png"));
    let layers = FileLayer::all(&name, &bytes).map_err(|error| unread(&error))?;
    let layer = layers.iter().find(|layer| layer.name == wanted).ok_or_else(|| {
        let known: Vec<&str> = layers.iter().map(|layer| &*layer.name).collect();
        let known = if known.is_empty() { "it has none".to_owned() } else { format!("it has {}", known.join(", ")) };
        Problem::unknown(format!("the picture has no layer `{wanted}`"), known)
    })?;
    let read = layer.read(&name, &bytes).map_err(|error| unread(&error))?;
    match format {
        "exr" => Ok((read.to_exr().map_err(|error| unread(&error))?, "image/x-exr")),
        "png" => Ok((read.canvas(ToneMap::Agx).to_png().map_err(|error| unread(&error))?, "image/png")),
        _ => Err(Problem::unknown(format!("`{format}` is not a format of layers"), "name it .png or .exr")),
    }
}

fn word(kind: LayerKind) -> &'static str {
    match kind {
        LayerKind::Color => "color",
        LayerKind::Direction => "direction",
        LayerKind::Vector => "vector",
        LayerKind::Number => "number",
        LayerKind::Matte => "matte",
    }
}

fn unread(error: &ImageError) -> Problem {
    Problem::conflict(format!("the picture cannot be read: {error}"), "fetch its file")
}
