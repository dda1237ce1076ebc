//! Reloading of the server's configuration, requested by a user of its system account.

use async_nats::Request;
use serde::Deserialize;
use tokio::runtime::Builder;

use super::{
    error::NatsError,
    options::{ANSWER_TIME, NatsOptions},
};

/// The server's answer.
#[derive(Deserialize)]
struct ReloadAnswer {
    error: Option<ReloadError>,
}

#[derive(Deserialize)]
struct ReloadError {
    description: Option<String>,
}

/// Makes the server reload its configuration, and waits until it has, at most 2 s.
///
/// - `options`: those of a user of the system account.
///
/// # Errors
/// The server is unreachable or rejects the login; an address, the name of the farm or the credentials are invalid; the
/// server does not confirm the request in time, or does not support it (2.10 is the first that does); it rejects its
/// configuration; or the runtime cannot be started.
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
