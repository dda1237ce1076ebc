//! Payloads of results: small blobs, each written once and read once or twice, thousands per second.
//!
//! A payload is stored in a stream, in parts of some hundred kilobytes; most have one. So a payload costs one message to
//! write and one to read, where an object in the object store costs three and a consumer. The first part, which gives
//! the size, is written last: an existing payload is complete. Readers verify its digest.

use std::collections::BTreeMap;

use async_nats::jetstream::{
    Context,
    context::PublishAckFuture,
    stream::{self, DirectGetErrorKind, DiscardPolicy, StorageType, Stream},
};
use bytes::Bytes;
use tokio::runtime::Handle;
use tokio_stream::StreamExt;

use super::{blobs::BlobError, error::NatsError, names};
use crate::Key;

/// Maximum size of a part in bytes, which fits into a message of any server.
const PART_BYTES: usize = 256 << 10;
/// Length of the first part's header in bytes: the size of the payload.
const HEAD_BYTES: usize = 8;
/// Maximum number of parts being sent at a time.
const UNDER_WAY_MAX: usize = 16;

/// The payloads of a farm. Its methods block, so call them from worker threads; on a thread that runs asynchronous code
/// they panic.
#[derive(Clone)]
pub struct NatsPayloads {
    context: Context,
    stream: Stream,
    /// Prefix of the subjects.
    prefix: String,
    handle: Handle,
}

/// Opens the stream of a farm, or creates it. Compares the server's description of it with the request.
pub(super) async fn open(context: &Context, farm: &str, may_make: bool) -> Result<Stream, NatsError> {
    let keep = |reason: String| NatsError::Keep { what: "payloads", reason, is_lasting: false };
    let name = names::payloads(farm);
    let wanted = stream::Config {
        name: name.clone(),
        description: Some("payloads".to_owned()),
        subjects: vec![format!("{}>", names::payloads_prefix(farm))],
        max_messages_per_subject: 1,
        storage: StorageType::File,
        discard: DiscardPolicy::New,
        // Existing payloads are never overwritten
        discard_new_per_subject: true,
        num_replicas: 1,
        deny_delete: true,
        allow_direct: true,
        ..stream::Config::default()
    };
    let stream = match context.get_stream(&name).await {
        Ok(stream) => stream,
        Err(error) if !may_make => return Err(keep(error.to_string())),
        Err(_) => {
            context.create_stream(wanted.clone()).await.map_err(|error| keep(error.to_string()))?;
            context.get_stream(&name).await.map_err(|error| keep(error.to_string()))?
        }
    };
    let got = &stream.cached_info().config;
    let same = [
        ("subjects", got.subjects == wanted.subjects),
        ("history", got.max_messages_per_subject == wanted.max_messages_per_subject),
        ("rule for what is there", got.discard == wanted.discard && got.discard_new_per_subject),
        ("storage", got.storage == wanted.storage),
        ("direct reads", got.allow_direct),
        ("age", got.max_age.is_zero() && got.max_bytes <= 0 && got.max_messages <= 0),
    ];
    match same.iter().find(|(_, same)| !same) {
        None => Ok(stream),
        Some((other, _)) => Err(NatsError::Keep {
            what: "payloads",
            reason: format!("the {other} of its stream {name} differs from the requested one"),
            is_lasting: true,
        }),
    }
}

impl NatsPayloads {
    pub(super) fn new(context: Context, stream: Stream, farm: &str, handle: Handle) -> Self {
        Self { context, stream, prefix: names::payloads_prefix(farm), handle }
    }

    fn subject(&self, name: &str, part: usize) -> String {
        format!("{}{}.{part}", self.prefix, names::key(&Key::from(name.to_owned())))
    }

    /// Stores a payload. An existing one is never replaced.
    ///
    /// # Errors
    /// The server does not confirm it, or there is a different one with this name.
    pub fn put(&self, name: &str, bytes: &[u8]) -> Result<(), BlobError> {
        let (first, rest) = bytes.split_at(bytes.len().min(PART_BYTES - HEAD_BYTES));
        let head = [&(bytes.len() as u64).to_le_bytes()[..], first].concat();
        self.handle.block_on(async {
            let rest: Vec<(usize, &[u8])> = (1..).zip(rest.chunks(PART_BYTES)).collect();
            for parts in rest.chunks(UNDER_WAY_MAX) {
                let mut under_way = Vec::new();
                for (part, bytes) in parts {
                    under_way.push((*part, *bytes, self.publish(name, *part, bytes.to_vec()).await?));
                }
                for (part, bytes, written) in under_way {
                    self.kept(name, part, bytes, written).await?;
                }
            }
            let written = self.publish(name, 0, head.clone()).await?;
            self.kept(name, 0, &head, written).await
        })
    }

    /// Waits until the server has a part. It rejects an existing one, for example after a lost answer.
    async fn kept(&self, name: &str, part: usize, bytes: &[u8], written: PublishAckFuture) -> Result<(), BlobError> {
        let Err(error) = written.await else { return Ok(()) };
        match self.part(name, part).await? {
            Some(there) if *there == *bytes => Ok(()),
            Some(_) => {
                let reason = "there is another payload of this name".to_owned();
                Err(BlobError::lasting(name, reason))
            }
            None => Err(BlobError::passing(name, &error)),
        }
    }

    async fn publish(&self, name: &str, part: usize, bytes: Vec<u8>) -> Result<PublishAckFuture, BlobError> {
        let written = self.context.publish(self.subject(name, part), bytes.into()).await;
        written.map_err(|error| BlobError::passing(name, &error))
    }

    /// Reads a payload and returns its bytes. `None`: there is none of this name.
    ///
    /// - `bytes_max`: maximum size, in bytes.
    ///
    /// # Errors
    /// The server does not return the payload, or it is incomplete, malformed or too large.
    pub fn get(&self, name: &str, bytes_max: usize) -> Result<Option<Vec<u8>>, BlobError> {
        let wrong = |reason: String| BlobError::lasting(name, reason);
        self.handle.block_on(async {
            let Some(first) = self.part(name, 0).await? else { return Ok(None) };
            let Some((head, first)) = first.split_first_chunk::<HEAD_BYTES>() else {
                return Err(wrong("it is not a payload".to_owned()));
            };
            let count = usize::try_from(u64::from_le_bytes(*head)).unwrap_or(usize::MAX);
            if count > bytes_max {
                return Err(wrong(format!("it has {count} bytes, more than {bytes_max}")));
            }
            // Allocate as data arrives, because the header is not trusted
            let mut bytes = first.to_vec();
            let last = count.saturating_sub(first.len()).div_ceil(PART_BYTES);
            for begin in (1..=last).step_by(UNDER_WAY_MAX) {
                let parts = begin..=last.min(begin + UNDER_WAY_MAX - 1);
                let fetches = parts.map(|part| {
                    let (payloads, name) = (self.clone(), name.to_owned());
                    tokio::spawn(async move { payloads.part(&name, part).await })
                });
                for part in fetches.collect::<Vec<_>>() {
                    let part = part.await.map_err(|error| BlobError::passing(name, &error))??;
                    bytes.extend_from_slice(&part.ok_or_else(|| wrong("a part of it is missing".to_owned()))?);
                }
            }
            if bytes.len() != count {
                return Err(wrong(format!("it has {} bytes instead of {count}", bytes.len())));
            }
            Ok(Some(bytes))
        })
    }

    async fn part(&self, name: &str, part: usize) -> Result<Option<Bytes>, BlobError> {
        match self.stream.direct_get_last_for_subject(self.subject(name, part)).await {
            Ok(message) => Ok(Some(message.payload)),
            Err(error) if error.kind() == DirectGetErrorKind::NotFound => Ok(None),
            Err(error) => Err(BlobError::passing(name, &error)),
        }
    }

    /// Returns the first parts, before the first `/`, of the names of all payloads, sorted. Some or all are missing if
    /// the server does not answer.
    pub fn folders(&self) -> Vec<String> {
        let mut folders = Vec::new();
        self.handle.block_on(async {
            let Ok(mut subjects) = self.stream.info_with_subjects(format!("{}>", self.prefix)).await else { return };
            while let Some(Ok((subject, _))) = subjects.next().await {
                let token = subject.strip_prefix(&self.prefix).and_then(|rest| rest.split('.').next());
                folders.extend(token.and_then(names::name));
            }
        });
        folders.sort_unstable();
        folders.dedup();
        folders
    }

    /// Returns the approximate number of bytes of payloads by the first part of their names, before the first `/`:
    /// servers count messages, not bytes. Some or all are missing if the server does not answer.
    pub fn bytes_by_folder(&self) -> BTreeMap<String, u64> {
        let mut counts: BTreeMap<String, u64> = BTreeMap::new();
        let all = self.handle.block_on(async {
            let mut subjects = self.stream.info_with_subjects(format!("{}>", self.prefix)).await.ok()?;
            while let Some(Ok((subject, count))) = subjects.next().await {
                let token = subject.strip_prefix(&self.prefix).and_then(|rest| rest.split('.').next());
                if let Some(folder) = token.and_then(names::name) {
                    *counts.entry(folder).or_default() += count as u64;
                }
            }
            self.stream.get_info().await.ok().map(|info| info.state)
        });
        let Some(all) = all else { return BTreeMap::new() };
        let bytes = |count: u64| (all.bytes as f64 * count as f64 / all.messages.max(1) as f64) as u64;
        counts.into_iter().map(|(folder, count)| (folder, bytes(count))).collect()
    }

    /// Deletes all payloads whose names start with `folder` and `/`. Failure is only logged.
    pub fn forget(&self, folder: &str) {
        let subjects = format!("{}{}.>", self.prefix, names::token(folder));
        let purged = self.handle.block_on(async { self.stream.purge().filter(subjects).await });
        if let Err(error) = purged {
            tracing::warn!(%error, folder, "cannot delete payloads");
        }
    }
}
