//! The routes of uploads: a client offers a file with the digests of its pieces, then sends the missing pieces. Received pieces
//! are kept if an upload is interrupted.

use std::sync::Arc;

use axum::{
    extract::{Request, State},
    http::StatusCode,
    response::{IntoResponse, Response},
    routing::{post, put},
};
use bottega_cluster::uploads::{PIECE_BYTES, UploadOffer, UploadState};

use crate::{
    limits::{ANSWER_TIME, PIECE_TIME},
    problem::Problem,
    route::{Param, Route, RouteAnswer, RouteBody, body, json, json_body, schema},
    state::DoorState,
};

pub(super) fn routes() -> Vec<Route> {
    vec![
        Route::action(
            "post",
            "/api/uploads",
            "Offer a file: the answer names the missing pieces. Offer it again to continue an upload.",
            RouteBody::Json(schema::<UploadOffer>),
            RouteAnswer::Json(schema::<UploadState>),
            post(offer),
        ),
        Route::action(
            "put",
            "/api/uploads/chunks/{digest}",
            "Send a piece, of at most 4 MiB, whose BLAKE3 digest is the last part of the path.",
            RouteBody::Bytes,
            RouteAnswer::Nothing,
            put(piece),
        ),
    ]
}

async fn offer(State(door): State<Arc<DoorState>>, request: Request) -> Result<Response, Problem> {
    let offer: UploadOffer = json_body(request).await?;
    Ok(json(&door.ask(ANSWER_TIME, move |farm| farm.offer(&offer)).await?))
}

async fn piece(
    State(door): State<Arc<DoorState>>,
    Param(digest): Param<String>,
    request: Request,
) -> Result<Response, Problem> {
    let bytes = body(request, PIECE_BYTES, PIECE_TIME).await?;
    door.ask(ANSWER_TIME, move |farm| farm.put_piece(&digest, &bytes)).await?;
    Ok(StatusCode::NO_CONTENT.into_response())
}
