//! Blobs in an object store: scenes, orders and pictures.

use std::time::{Duration, SystemTime};

use async_nats::jetstream::{
    Context,
    object_store::{self, GetErrorKind, InfoErrorKind, ObjectInfo, ObjectStore},
    stream::StorageType,
};
use tokio::{io::AsyncReadExt, runtime::Handle};
use tokio_stream::StreamExt;

use super::NatsError;

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
}

impl BlobError {
    pub(super) fn passing(name: &str, error: &impl std::fmt::Display) -> Self {
        Self { name: name.to_owned(), reason: error.to_string(), is_lasting: false }
    }
}

/// Opens a bucket of a farm, or makes it. What the server then says of it is compared with what was asked.
pub(super) async fn open(
    context: &Context,
    bucket: String,
    what: &'static str,
    may_make: bool,
) -> Result<ObjectStore, NatsError> {
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
        None => Ok(store),
        Some((other, _)) => Err(NatsError::Keep { what, reason: format!("its stream OBJ_{bucket} has another {other} than was asked for"), is_lasting: true }),
    }
}

/// The blobs of a farm. Its methods block: they are for threads that work.
#[derive(Clone)]
pub struct NatsBlobs {
    store: ObjectStore,
    handle: Handle,
}

impl NatsBlobs {
    pub(super) fn new(store: ObjectStore, handle: Handle) -> Self {
        Self { store, handle }
    }

    /// Keeps a blob.
    ///
    /// # Errors
    /// The server does not take it.
    pub fn put(&self, name: &str, bytes: &[u8]) -> Result<(), BlobError> {
        let mut bytes = bytes;
        let kept = self.handle.block_on(self.store.put(name, &mut bytes));
        kept.map(|_| ()).map_err(|error| BlobError::passing(name, &error))
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
                return Err(BlobError { name: name.to_owned(), reason, is_lasting: true });
            }
            let mut bytes = Vec::with_capacity(object.info().size);
            object.read_to_end(&mut bytes).await.map_err(|error| BlobError::passing(name, &error))?;
            Ok(Some(bytes))
        })
    }

    /// Lets a blob go.
    pub fn forget(&self, name: &str) {
        if let Err(error) = self.handle.block_on(self.store.delete(name)) {
            tracing::debug!(%error, name, "a blob was not let go");
        }
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
            let Ok(mut list) = self.store.list().await else { return };
            let mut names = Vec::new();
            while let Some(Ok(info)) = list.next().await {
                if is_dead(&info.name, age_of(&info)) {
                    names.push(info.name);
                }
            }
            for name in names {
                if let Err(error) = self.store.delete(&name).await {
                    tracing::debug!(%error, name, "a blob was not let go");
                }
            }
        });
    }
}

/// One of the future, or of no time, is new.
#[allow(clippy::disallowed_methods, reason = "ages are for the driver's users, no machine sees them")]
fn age_of(info: &ObjectInfo) -> Duration {
    let put = info.modified.map(SystemTime::from);
    put.and_then(|put| SystemTime::now().duration_since(put).ok()).unwrap_or_default()
}
