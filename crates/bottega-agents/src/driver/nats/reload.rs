//! The server reads its configuration again: asked by a user of its system account.

use async_nats::Request;
use serde::Deserialize;
use tokio::runtime::Builder;

use super::{
    error::NatsError,
    options::{ANSWER_TIME, NatsOptions},
};

/// What the server answers.
#[derive(Deserialize)]
struct ReloadAnswer {
    error: Option<ReloadError>,
}

#[derive(Deserialize)]
struct ReloadError {
    description: Option<String>,
}

/// Has the server read its configuration again, and waits until it has.
///
/// - `options`: of a user of the system account.
///
/// # Errors
/// The server is not there, knows no such request (2.10 is the first that does), or refuses its configuration.
pub fn reload_server(options: &NatsOptions) -> Result<(), NatsError> {
    let runtime = Builder::new_current_thread().enable_all().build()?;
    runtime.block_on(async {
        let client = super::connect(options).await?;
        let subject = format!("$SYS.REQ.SERVER.{}.RELOAD", client.server_info().server_id);
        let answer = client.send_request(subject, Request::new().timeout(Some(ANSWER_TIME))).await;
        let answer = answer.map_err(|error| NatsError::NoReload { reason: error.to_string() })?;
        match serde_json::from_slice::<ReloadAnswer>(&answer.payload) {
            Ok(ReloadAnswer { error: None }) => Ok(()),
            Ok(ReloadAnswer { error: Some(error) }) => {
                Err(NatsError::Configuration { reason: error.description.unwrap_or_default() })
            }
            Err(error) => Err(NatsError::NoReload { reason: error.to_string() }),
        }
    })
}
