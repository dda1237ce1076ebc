//! Enrolment: one who knows the farm's word becomes a member with a key of its own.

use std::{sync::Arc, time::Duration};

use async_nats::Request;
use tokio::{runtime::Builder, sync::Semaphore};
use tokio_stream::StreamExt;

use super::{Login, NatsError, NatsOptions, NatsUplink, names, options::ANSWER_TIME, rights::NEWCOMER};
use crate::codec::Codec;

/// The largest request.
const REQUEST_BYTES_MAX: usize = 1 << 12;
/// How long an answer may take: many may want to be let in at once, and a server reads its configuration for each.
const ENROL_TIME: Duration = Duration::from_secs(10);
/// Requests of a group that are answered at once.
const AT_ONCE: usize = 16;

/// A key by which a server knows somebody.
pub struct MemberKey(nkeys::KeyPair);

impl MemberKey {
    /// One that nobody has.
    pub fn new() -> Self {
        Self(nkeys::KeyPair::new_user())
    }

    /// What others may know of it.
    pub fn public(&self) -> String {
        self.0.public_key()
    }

    /// The secret, to be kept; `None`: it has none.
    pub fn seed(&self) -> Option<String> {
        self.0.seed().ok()
    }
}

impl Default for MemberKey {
    fn default() -> Self {
        Self::new()
    }
}

/// Whether this is the public key of somebody: nothing else may get into the configuration of a server.
pub fn is_public_key(text: &str) -> bool {
    nkeys::KeyPair::from_public_key(text).is_ok() && text.starts_with('U')
}

/// Asks to be let in. Returns what is answered.
///
/// - `group`: as whom.
///
/// # Errors
/// Nobody is there, or nobody answers.
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
    /// Answers those who want to be let in, for as long as this lives; several at once.
    ///
    /// - `answer`: gets the group and the request; blocks for as long as it needs. `None`: no answer.
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
                    // It is closed by nobody.
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
        // Whoever is told the word from now on is heard.
        _ = self.handle.block_on(async { tokio::time::timeout(ANSWER_TIME, self.client.flush()).await });
    }
}

/// Who knows a word and has no key yet.
pub fn newcomer(group: &str, word: &str) -> Login {
    Login::User(group.to_owned(), word.to_owned())
}
