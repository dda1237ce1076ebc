//! Blobs in an object store: the input of jobs, their orders and their results.

use std::{
    collections::{BTreeSet, HashMap},
    time::{Duration, SystemTime},
};

use async_nats::{
    HeaderMap,
    jetstream::{
        self, Context, ErrorCode,
        object_store::{self, GetErrorKind, InfoErrorKind, ObjectInfo, ObjectOptions, ObjectStore},
        stream::{StorageType, Stream},
    },
};
use base64::{Engine, engine::general_purpose::URL_SAFE};
use ring::digest::{Context as Digest, SHA256};
use tokio::{io::AsyncReadExt, runtime::Handle};
use tokio_stream::StreamExt;

use super::error::NatsError;

/// Size of the messages of a blob, in bytes.
const PART_BYTES: usize = 128 << 10;
/// Time without further data after which a server's answer counts as incomplete: parts that were deleted meanwhile
/// never arrive.
const SILENT: Duration = Duration::from_secs(10);

/// An error in storing or reading a blob, a payload or a notice.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the blob `{name}`: {reason}")]
pub struct BlobError {
    /// The name of the blob, payload or notice.
    pub name: String,
    /// The reason, as text for the user.
    pub reason: String,
    /// `true`: retrying is useless; `false`: it may help, for example if the server is unreachable or has no room.
    pub is_lasting: bool,
    /// True if the server has no room.
    pub is_full: bool,
}

impl BlobError {
    pub(super) fn passing(name: &str, error: &(impl std::error::Error + 'static)) -> Self {
        Self { name: name.to_owned(), reason: error.to_string(), is_lasting: false, is_full: says_full(error) }
    }

    /// Makes the error that the server stopped sending in the middle of the blob.
    fn silent(name: &str) -> Self {
        let reason = format!("the server has sent nothing for {} s", SILENT.as_secs());
        Self { name: name.to_owned(), reason, is_lasting: false, is_full: false }
    }

    pub(super) fn lasting(name: &str, reason: String) -> Self {
        Self { name: name.to_owned(), reason, is_lasting: true, is_full: false }
    }
}

/// Returns true if an error, or one of its causes, is the server's lack of room.
fn says_full(error: &(dyn std::error::Error + 'static)) -> bool {
    let mut next = Some(error);
    while let Some(error) = next {
        if let Some(error) = error.downcast_ref::<jetstream::Error>() {
            let words = error.to_string();
            return match error.error_code() {
                ErrorCode::ACCOUNT_RESOURCES_EXCEEDED
                | ErrorCode::INSUFFICIENT_RESOURCES
                | ErrorCode::STORAGE_RESOURCES_EXCEEDED => true,
                ErrorCode::STREAM_STORE_FAILED => ["space", "resource", "bytes"].iter().any(|it| words.contains(it)),
                _ => false,
            };
        }
        next = error.source();
    }
    false
}

/// A blob in a listing of the object store.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StoredBlob {
    /// The name of the blob.
    pub name: String,
    /// The size of the blob, in bytes.
    pub bytes: u64,
    /// Time since the blob was stored, by the clocks of the machine that stored it and of this one.
    pub age: Duration,
}

/// Opens a bucket of a farm, or creates it. Compares the server's description of it with the request.
pub(super) async fn open(
    context: &Context,
    bucket: String,
    what: &'static str,
    may_make: bool,
) -> Result<(ObjectStore, Stream), NatsError> {
    let keep = |reason: String| NatsError::Keep { what, reason, is_lasting: false };
    let store = match context.get_object_store(&bucket).await {
        Ok(store) => store,
        Err(error) if !may_make => return Err(keep(error.to_string())),
        Err(_) => {
            let description = Some(what.to_owned());
            let bucket = bucket.clone();
            let storage = StorageType::File;
            let config = object_store::Config {
                bucket,
                description,
                storage,
                num_replicas: 1,
                ..object_store::Config::default()
            };
            context.create_object_store(config).await.map_err(|error| keep(error.to_string()))?
        }
    };
    let stream = context.get_stream(format!("OBJ_{bucket}")).await.map_err(|error| keep(error.to_string()))?;
    let got = &stream.cached_info().config;
    let same = [
        ("subjects", got.subjects == [format!("$O.{bucket}.C.>"), format!("$O.{bucket}.M.>")]),
        ("storage", got.storage == StorageType::File),
        ("purges", got.allow_rollup),
        ("direct reads", got.allow_direct),
        ("age", got.max_age.is_zero() && got.max_bytes <= 0 && got.max_messages <= 0),
    ];
    match same.iter().find(|(_, same)| !same) {
        None => Ok((store, stream)),
        Some((other, _)) => Err(NatsError::Keep {
            what,
            reason: format!("the {other} of its stream OBJ_{bucket} differs from the requested one"),
            is_lasting: true,
        }),
    }
}

/// The blobs of a farm. Its methods block, so call them from worker threads; on a thread that runs asynchronous code
/// they panic.
#[derive(Clone)]
pub struct NatsBlobs {
    context: Context,
    store: ObjectStore,
    /// The stream of the bucket.
    stream: Stream,
    bucket: String,
    handle: Handle,
}

impl NatsBlobs {
    pub(super) fn new(
        context: Context,
        (store, stream): (ObjectStore, Stream),
        bucket: String,
        handle: Handle,
    ) -> Self {
        Self { context, store, stream, bucket, handle }
    }

    /// Stores a blob, completely or not at all. It replaces an earlier blob of the same name.
    ///
    /// Done here and not by the library, which leaves the parts that a full server accepted: nothing refers to them,
    /// and they occupy room forever.
    ///
    /// # Errors
    /// The server does not confirm it: it is unreachable or has no room.
    pub fn put(&self, name: &str, bytes: &[u8]) -> Result<(), BlobError> {
        self.handle.block_on(async {
            let before = self.store.info(name).await.ok();
            // The last token of an inbox is unique
            let inbox = self.context.client().new_inbox();
            let number = inbox.rsplit('.').next().unwrap_or(&inbox).to_owned();
            let parts = self.parts_of(&number);
            let sent = self.send(name, &number, &parts, bytes).await;
            let (kept, stale) = match sent {
                Ok(()) => (Ok(()), before.map(|before| self.parts_of(&before.nuid))),
                // Perhaps only the last confirmation was lost
                Err(error) => match self.store.info(name).await {
                    Ok(info) if info.nuid == number => (Ok(()), before.map(|before| self.parts_of(&before.nuid))),
                    Ok(_) => (Err(error), Some(parts)),
                    Err(missing) if missing.kind() == InfoErrorKind::NotFound => (Err(error), Some(parts)),
                    // Parts of an unknown state are deleted later if nothing refers to them
                    Err(_) => (Err(error), None),
                },
            };
            if let Some(stale) = stale {
                self.purge(stale).await;
            }
            kept
        })
    }

    async fn send(&self, name: &str, number: &str, parts: &str, bytes: &[u8]) -> Result<(), BlobError> {
        let mut digest = Digest::new(&SHA256);
        for part in bytes.chunks(PART_BYTES) {
            digest.update(part);
            let sent = self.context.publish(parts.to_owned(), part.to_vec().into()).await;
            let kept = sent.map_err(|error| BlobError::passing(name, &error))?.await;
            kept.map_err(|error| BlobError::passing(name, &error))?;
        }
        let info = ObjectInfo {
            name: name.to_owned(),
            description: None,
            metadata: HashMap::new(),
            headers: None,
            options: Some(ObjectOptions { max_chunk_size: Some(PART_BYTES), link: None }),
            bucket: self.bucket.clone(),
            nuid: number.to_owned(),
            size: bytes.len(),
            chunks: bytes.len().div_ceil(PART_BYTES),
            modified: Some(now().into()),
            digest: Some(format!("SHA-256={}", URL_SAFE.encode(digest.finish()))),
            deleted: false,
        };
        let text = serde_json::to_vec(&info)
            .map_err(|error| BlobError::lasting(name, format!("it cannot be described: {error}")))?;
        let mut headers = HeaderMap::new();
        headers.insert("Nats-Rollup", "sub");
        let sent = self.context.publish_with_headers(self.description_of(name), headers, text.into()).await;
        let kept = sent.map_err(|error| BlobError::passing(name, &error))?.await;
        kept.map(drop).map_err(|error| BlobError::passing(name, &error))
    }

    /// Returns the subject of a blob's parts.
    fn parts_of(&self, number: &str) -> String {
        format!("$O.{}.C.{number}", self.bucket)
    }

    /// Returns the subject of a blob's description.
    fn description_of(&self, name: &str) -> String {
        format!("$O.{}.M.{}", self.bucket, URL_SAFE.encode(name))
    }

    /// Deletes messages. Unlike other ways of deletion this needs no room, so it works on a full server.
    async fn purge(&self, subject: String) {
        if let Err(error) = self.stream.purge().filter(&subject).await {
            tracing::debug!(%error, subject, "cannot delete messages");
        }
    }

    /// Returns true if a blob of this name exists.
    ///
    /// # Errors
    /// The server does not answer.
    pub fn has(&self, name: &str) -> Result<bool, BlobError> {
        self.age(name).map(|age| age.is_some())
    }

    /// Reads a blob and returns its bytes. `None`: there is none of this name.
    ///
    /// - `bytes_max`: maximum size, in bytes.
    ///
    /// # Errors
    /// The server does not return the blob, or sends nothing for 10 s in the middle of it; or the blob is damaged or
    /// too large.
    pub fn get(&self, name: &str, bytes_max: usize) -> Result<Option<Vec<u8>>, BlobError> {
        self.handle.block_on(async {
            let mut object = match self.store.get(name).await {
                Ok(object) => object,
                Err(error) if error.kind() == GetErrorKind::NotFound => return Ok(None),
                Err(error) => return Err(BlobError::passing(name, &error)),
            };
            if object.info().size > bytes_max {
                let reason = format!("it has {} bytes, more than {bytes_max}", object.info().size);
                return Err(BlobError::lasting(name, reason));
            }
            let mut bytes = Vec::with_capacity(object.info().size);
            loop {
                let read = tokio::time::timeout(SILENT, object.read_buf(&mut bytes)).await;
                match read.map_err(|_| BlobError::silent(name))? {
                    Ok(0) => return Ok(Some(bytes)),
                    Ok(_) => {}
                    Err(error) => return Err(BlobError::passing(name, &error)),
                }
            }
        })
    }

    /// Deletes a blob by its name; does nothing if there is none, or if the server does not answer.
    pub fn forget(&self, name: &str) {
        self.handle.block_on(async {
            if let Ok(info) = self.store.info(name).await {
                self.let_go(&info).await;
            }
        });
    }

    async fn let_go(&self, info: &ObjectInfo) {
        self.purge(self.description_of(&info.name)).await;
        self.purge(self.parts_of(&info.nuid)).await;
    }

    /// Returns all blobs of the farm, with their sizes and ages. Some or all are missing if the server does not answer.
    pub fn list(&self) -> Vec<StoredBlob> {
        let (infos, _) = self.handle.block_on(self.infos());
        let blob = |info: ObjectInfo| StoredBlob { age: age_of(&info), bytes: info.size as u64, name: info.name };
        infos.into_iter().map(blob).collect()
    }

    /// Returns the descriptions of all blobs, and `true` if none can be missing.
    async fn infos(&self) -> (Vec<ObjectInfo>, bool) {
        let Ok(mut list) = self.store.list().await else { return (Vec::new(), false) };
        let mut infos = Vec::new();
        loop {
            // A blob deleted during the listing may never be reported
            match tokio::time::timeout(SILENT, list.next()).await {
                Ok(Some(Ok(info))) => infos.push(info),
                Ok(None) => return (infos, true),
                Ok(Some(Err(_))) | Err(_) => return (infos, false),
            }
        }
    }

    /// Deletes parts that belong to no blob, because their sender failed in the middle, as far as the server answers.
    ///
    /// - `after`: minimum age of the last part.
    pub fn forget_strays(&self, after: Duration) {
        self.handle.block_on(async {
            let subjects = match self.stream.info_with_subjects(self.parts_of("*")).await {
                Ok(mut all) => {
                    let mut subjects = Vec::new();
                    while let Some(Ok((subject, _))) = all.next().await {
                        subjects.push(subject);
                    }
                    subjects
                }
                Err(error) => return tracing::debug!(%error, "parts of blobs cannot be listed"),
            };
            let (infos, is_whole) = self.infos().await;
            if !is_whole {
                return tracing::debug!("blobs cannot be listed, so none of their parts is known to be stray");
            }
            let known: BTreeSet<String> = infos.iter().map(|info| self.parts_of(&info.nuid)).collect();
            for subject in subjects.into_iter().filter(|subject| !known.contains(subject)) {
                let last = self.stream.get_last_raw_message_by_subject(&subject).await;
                if last.is_ok_and(|last| since(last.time.into()) > after) {
                    self.purge(subject).await;
                }
            }
        });
    }

    /// Returns the time since a blob was stored, by the clocks of the machine that stored it and of this one; `None`:
    /// there is none of this name.
    ///
    /// # Errors
    /// The server does not answer.
    pub fn age(&self, name: &str) -> Result<Option<Duration>, BlobError> {
        match self.handle.block_on(self.store.info(name)) {
            Ok(info) => Ok((!info.deleted).then(|| age_of(&info))),
            Err(error) if error.kind() == InfoErrorKind::NotFound => Ok(None),
            Err(error) => Err(BlobError::passing(name, &error)),
        }
    }

    /// Deletes blobs, as far as the server answers.
    ///
    /// - `is_dead`: returns true if a blob with this name, stored this long ago, must be deleted.
    pub fn forget_all(&self, mut is_dead: impl FnMut(&str, Duration) -> bool) {
        self.handle.block_on(async {
            for info in self.infos().await.0 {
                if is_dead(&info.name, age_of(&info)) {
                    self.let_go(&info).await;
                }
            }
        });
    }
}

/// Returns the age of a blob; zero if its time is in the future or missing.
fn age_of(info: &ObjectInfo) -> Duration {
    info.modified.map(|put| since(put.into())).unwrap_or_default()
}

fn since(at: SystemTime) -> Duration {
    now().duration_since(at).unwrap_or_default()
}

#[allow(clippy::disallowed_methods, reason = "ages are for the driver's users, no machine sees them")]
fn now() -> SystemTime {
    SystemTime::now()
}
