//! Blobs in an object store: scenes, orders and pictures.

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

/// A blob lies in messages of so many bytes.
const PART_BYTES: usize = 128 << 10;
/// A server that sends nothing more of what was asked for is not waited for any longer: parts that somebody has let go meanwhile never
/// come.
const SILENT: Duration = Duration::from_secs(10);

/// A blob that could not be kept or had.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the blob `{name}`: {reason}")]
pub struct BlobError {
    /// Its name.
    pub name: String,
    /// What is wrong.
    pub reason: String,
    /// Whether it will be so whenever it is tried again; not of a server that is away or has no room.
    pub is_lasting: bool,
    /// Whether the server says that it has no room.
    pub is_full: bool,
}

impl BlobError {
    pub(super) fn passing(name: &str, error: &(impl std::error::Error + 'static)) -> Self {
        Self { name: name.to_owned(), reason: error.to_string(), is_lasting: false, is_full: says_full(error) }
    }

    /// The server has sent a part of it and then no more.
    fn silent(name: &str) -> Self {
        let reason = format!("the server has sent nothing of it for {} s", SILENT.as_secs());
        Self { name: name.to_owned(), reason, is_lasting: false, is_full: false }
    }

    pub(super) fn lasting(name: &str, reason: String) -> Self {
        Self { name: name.to_owned(), reason, is_lasting: true, is_full: false }
    }
}

/// Whether an error, or what it is due to, is the server's that it has no room.
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

/// A blob as it is listed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Blob {
    /// Its name.
    pub name: String,
    /// What is in it.
    pub bytes: u64,
    /// How long ago it was put there.
    pub age: Duration,
}

/// Opens a bucket of a farm, or makes it. What the server then says of it is compared with what was asked.
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
            reason: format!("its stream OBJ_{bucket} has another {other} than was asked for"),
            is_lasting: true,
        }),
    }
}

/// The blobs of a farm. Its methods block: they are for threads that work.
#[derive(Clone)]
pub struct NatsBlobs {
    context: Context,
    store: ObjectStore,
    /// In which the bucket lies.
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

    /// Keeps a blob. Nothing of one is left that was not taken as a whole.
    ///
    /// It is done here and not by the library, which leaves the parts that a full server took: nobody knows them, and they
    /// take room for ever.
    ///
    /// # Errors
    /// The server does not take it.
    pub fn put(&self, name: &str, bytes: &[u8]) -> Result<(), BlobError> {
        self.handle.block_on(async {
            let before = self.store.info(name).await.ok();
            // The last word of an inbox is a number that no other has.
            let inbox = self.context.client().new_inbox();
            let number = inbox.rsplit('.').next().unwrap_or(&inbox).to_owned();
            let parts = self.parts_of(&number);
            let kept = self.send(name, &number, &parts, bytes).await;
            let stale = match &kept {
                Ok(()) => before.map(|before| self.parts_of(&before.nuid)),
                Err(_) => Some(parts),
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

    /// The subject of the parts of a blob.
    fn parts_of(&self, number: &str) -> String {
        format!("$O.{}.C.{number}", self.bucket)
    }

    /// The subject of what is said of a blob.
    fn description_of(&self, name: &str) -> String {
        format!("$O.{}.M.{}", self.bucket, URL_SAFE.encode(name))
    }

    /// Lets messages go. It takes no room, as every other way of removing something does: so it works on a full server, too.
    async fn purge(&self, subject: String) {
        if let Err(error) = self.stream.purge().filter(&subject).await {
            tracing::debug!(%error, subject, "messages were not let go");
        }
    }

    /// Whether there is a blob of this name.
    ///
    /// # Errors
    /// The server does not say.
    pub fn has(&self, name: &str) -> Result<bool, BlobError> {
        self.age(name).map(|age| age.is_some())
    }

    /// Reads a blob; `None`: there is none of this name.
    ///
    /// - `bytes_max`: larger ones are refused.
    ///
    /// # Errors
    /// The server does not give it, or it is not what was put in.
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

    /// Lets a blob go.
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

    /// All blobs.
    pub fn list(&self) -> Vec<Blob> {
        let infos = self.handle.block_on(self.infos());
        let blob = |info: ObjectInfo| Blob { age: age_of(&info), bytes: info.size as u64, name: info.name };
        infos.into_iter().map(blob).collect()
    }

    async fn infos(&self) -> Vec<ObjectInfo> {
        let Ok(mut list) = self.store.list().await else { return Vec::new() };
        let mut infos = Vec::new();
        // What was let go while it is listed may never be told.
        while let Ok(Some(Ok(info))) = tokio::time::timeout(SILENT, list.next()).await {
            infos.push(info);
        }
        infos
    }

    /// Lets parts go that belong to no blob: of one whose sender died amid it.
    ///
    /// - `after`: the last of them came at least so long ago.
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
            let known: BTreeSet<String> = self.infos().await.iter().map(|info| self.parts_of(&info.nuid)).collect();
            for subject in subjects.into_iter().filter(|subject| !known.contains(subject)) {
                let last = self.stream.get_last_raw_message_by_subject(&subject).await;
                if last.is_ok_and(|last| since(last.time.into()) > after) {
                    self.purge(subject).await;
                }
            }
        });
    }

    /// How long ago a blob was put there, by the clock of the machine that did it and of this one; `None`: there is none of
    /// this name.
    ///
    /// # Errors
    /// The server does not say.
    pub fn age(&self, name: &str) -> Result<Option<Duration>, BlobError> {
        match self.handle.block_on(self.store.info(name)) {
            Ok(info) => Ok((!info.deleted).then(|| age_of(&info))),
            Err(error) if error.kind() == InfoErrorKind::NotFound => Ok(None),
            Err(error) => Err(BlobError::passing(name, &error)),
        }
    }

    /// Lets all blobs go of whose names and ages it is true.
    pub fn forget_all(&self, mut is_dead: impl FnMut(&str, Duration) -> bool) {
        self.handle.block_on(async {
            for info in self.infos().await {
                if is_dead(&info.name, age_of(&info)) {
                    self.let_go(&info).await;
                }
            }
        });
    }
}

/// One of the future, or of no time, is new.
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
