//! The routes of tokens: listing, making and revoking, for clients that may steer.

use axum::{
    Extension,
    extract::{Request, State},
    http::StatusCode,
    response::IntoResponse,
    routing::{delete, get, post},
};
use bottega_cluster::{web_secrets::TokenRole, web_tokens::WebToken};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{
    limits::ANSWER_TIME,
    redact::redacted_json,
    route::{AtDoor, Param, Route, RouteAnswer, RouteBody, RouteResult, json, json_body, json_text, schema},
    source::ShownFarm,
    tokens::TokenBearer,
};

/// A token to be made.
#[derive(Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct NewToken {
    /// Name of the token, for lists and logs: letters, digits, `-`, `_` and `.`, 32 at most.
    name: String,
    /// The role that the token gives its holder.
    role: TokenRole,
}

/// A new token.
#[derive(Debug, Serialize, JsonSchema)]
struct MadeToken {
    /// Name of the token.
    name: String,
    /// The role that the token gives its holder.
    role: TokenRole,
    /// The token itself, shown only once: `Authorization: Bearer TOKEN`, or `/?token=TOKEN` in a browser.
    token: String,
}

pub(super) fn routes() -> Vec<Route> {
    vec![
        Route::action(
            "get",
            "/api/tokens",
            "The names and roles of the tokens, without their secrets.",
            RouteBody::Nothing,
            RouteAnswer::Json(schema::<Vec<WebToken>>),
            get(list),
        ),
        Route::action(
            "post",
            "/api/tokens",
            "Make a named token for one person or program. It is shown only once.",
            RouteBody::Json(schema::<NewToken>),
            RouteAnswer::Json(schema::<MadeToken>),
            post(make),
        )
        .with_status(StatusCode::CREATED),
        Route::action(
            "delete",
            "/api/tokens/{name}",
            "Revoke a token: no server of the farm accepts it any more. `see` and `steer` are replaced at once; `bottega tokens show` prints the new ones.",
            RouteBody::Nothing,
            RouteAnswer::Nothing,
            delete(revoke),
        ),
    ]
}

async fn list(State(door): AtDoor) -> RouteResult {
    Ok(json(&door.ask(ANSWER_TIME, ShownFarm::tokens).await?))
}

async fn make(State(door): AtDoor, Extension(bearer): Extension<TokenBearer>, request: Request) -> RouteResult {
    let NewToken { name, role } = json_body(request).await?;
    let (wanted, by) = (name.clone(), bearer.said());
    let token = door.ask(ANSWER_TIME, move |farm| farm.make_token(&wanted, role, &by)).await?;
    Ok(json_text(StatusCode::CREATED, redacted_json(&MadeToken { name, role, token })))
}

async fn revoke(
    State(door): AtDoor,
    Extension(bearer): Extension<TokenBearer>,
    Param(name): Param<String>,
) -> RouteResult {
    door.ask(ANSWER_TIME, move |farm| farm.revoke_token(&name, &bearer.said())).await?;
    Ok(StatusCode::NO_CONTENT.into_response())
}
