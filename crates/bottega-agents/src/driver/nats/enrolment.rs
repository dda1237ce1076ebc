//! Enrolment: a machine that knows a farm's token becomes a member with its own key.

use std::{sync::Arc, time::Duration};

use async_nats::Request;
use tokio::{runtime::Builder, sync::Semaphore};
use tokio_stream::StreamExt;

use super::{Login, NatsError, NatsOptions, NatsUplink, names, options::ANSWER_TIME, rights::NEWCOMER};
use crate::codec::Codec;

/// Maximum length of a request, in bytes.
const REQUEST_BYTES_MAX: usize = 1 << 12;
/// Timeout of an answer: many machines may enrol at once, and the server reloads its configuration for each.
const ENROL_TIME: Duration = Duration::from_secs(10);
/// Maximum number of requests of a group answered concurrently.
const AT_ONCE: usize = 16;

/// The key pair with which a member of a farm logs in.
pub struct MemberKey(nkeys::KeyPair);

impl MemberKey {
    /// Generates a key pair.
    pub fn new() -> Self {
        Self(nkeys::KeyPair::new_user())
    }

    /// Returns the public key as text, which starts with `U`.
    pub fn public(&self) -> String {
        self.0.public_key()
    }

    /// Returns the secret seed, to be stored. `None`: there is no secret part; a key of [`Self::new`] has one.
    pub fn seed(&self) -> Option<String> {
        self.0.seed().ok()
    }
}

impl Default for MemberKey {
    fn default() -> Self {
        Self::new()
    }
}

/// Returns true if the text is a public key as [`MemberKey::public`] returns it. Nothing else may be written into a
/// server's configuration.
pub fn is_public_key(text: &str) -> bool {
    nkeys::KeyPair::from_public_key(text).is_ok() && text.starts_with('U')
}

/// Sends a request for enrolment to a farm, and returns the bytes of the answer. Blocks meanwhile, at most 10 s after
/// the connection.
///
/// - `options`: the servers, and the login of a [`newcomer`]; the name of the member is not used.
/// - `group`: the group to join.
/// - `request`: the bytes for the process that admits members, at most 4096: longer requests get no answer.
///
/// # Errors
/// The server is unreachable or rejects the login; an address, the name of the farm or the credentials are invalid; no
/// process of the farm answers; or the runtime cannot be started.
pub fn enrol(options: &NatsOptions, group: &str, request: &[u8]) -> Result<Vec<u8>, NatsError> {
    let runtime = Builder::new_current_thread().enable_all().build()?;
    runtime.block_on(async {
        let options = NatsOptions { member: NEWCOMER.to_owned(), ..options.clone() };
        let client = super::connect(&options).await?;
        let request = Request::new().payload(request.to_vec().into()).timeout(Some(ENROL_TIME));
        let answer = client.send_request(names::enrolment(group), request).await;
        let answer = answer.map_err(|error| NatsError::NobodyAnswers { reason: error.to_string() })?;
        Ok(answer.payload.to_vec())
    })
}

impl<K: Codec> NatsUplink<K> {
    /// Answers enrolment requests, several concurrently, as long as the thread of this link runs. Requests longer than
    /// 4096 bytes are ignored. Returns when the farm's server knows of it, at the latest after 2 s.
    ///
    /// - `groups`: the groups whose requests are answered.
    /// - `answer`: gets the group and the request; may block. `None`: no answer.
    pub fn answer_newcomers(
        &self,
        groups: &[&str],
        answer: impl Fn(&str, &[u8]) -> Option<Vec<u8>> + Send + Sync + 'static,
    ) {
        let answer = Arc::new(answer);
        for group in groups {
            let (client, answer, group) = (self.client.clone(), Arc::clone(&answer), (*group).to_owned());
            self.handle.spawn(async move {
                let Ok(mut requests) = client.subscribe(names::enrolment(&group)).await else { return };
                let places = Arc::new(Semaphore::new(AT_ONCE));
                while let Some(request) = requests.next().await {
                    let Some(reply) = request.reply else { continue };
                    if request.payload.len() > REQUEST_BYTES_MAX {
                        continue;
                    }
                    // It is never closed
                    let Ok(place) = Arc::clone(&places).acquire_owned().await else { return };
                    let (client, answer, group) = (client.clone(), Arc::clone(&answer), group.clone());
                    tokio::spawn(async move {
                        let answered = tokio::task::spawn_blocking(move || answer(&group, &request.payload)).await;
                        if let Ok(Some(bytes)) = answered {
                            _ = client.publish(reply, bytes.into()).await;
                        }
                        drop(place);
                    });
                }
            });
        }
        // The subscription is active when this returns
        _ = self.handle.block_on(async { tokio::time::timeout(ANSWER_TIME, self.client.flush()).await });
    }
}

/// Returns the login of a machine that has the token of a group but no key.
///
/// - `group`: the group of the token.
/// - `word`: the token.
pub fn newcomer(group: &str, word: &str) -> Login {
    Login::User(group.to_owned(), word.to_owned())
}
