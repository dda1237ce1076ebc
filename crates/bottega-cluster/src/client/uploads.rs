//! Uploads from browsers and scripts that are not machines of the farm: in pieces, each verified, each sent once,
//! resumable; and jobs submitted with them.
//!
//! Pieces are stored as chunks, like those of scenes. The blob `upload/DIGEST` lists the pieces of a file for a day: any
//! process of the farm may receive the next piece, or the job.

use std::{
    collections::BTreeMap,
    path::{Component, Path, PathBuf},
    sync::{Arc, Mutex, PoisonError},
};

use bottega::{
    Request, Session, StopSwitch,
    request::{EnvironmentLight, FrameOptions},
    session::Reporter,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{
    client::{
        animation::frame_jobs,
        submit::{new_job, order},
    },
    error::Error,
    files::{
        cache::Cache,
        chunks::{CHUNK_BYTES, ChunkStore, Contents, blob_name, hash_of, is_hash, several},
        sent_files::SentFiles,
    },
    job::{
        board::JobBoard,
        record::{Job, JobSpec, for_others},
    },
    server::{
        room::{MAKE_ROOM, bytes_said},
        upkeep::UPLOAD_PREFIX,
    },
};

/// The size of a piece in bytes; the last piece of a file may be smaller.
pub const PIECE_BYTES: usize = CHUNK_BYTES;
/// The largest file that can be uploaded, in bytes.
pub const FILE_BYTES_MAX: u64 = 4 << 30;
/// The most frames of an animation that is submitted with uploaded files.
pub const FRAMES_MAX: usize = 1000;
/// The most files of a job that is submitted with uploaded files.
pub const FILES_MAX: usize = 4096;
/// The longest file name, in bytes.
const NAME_MAX: usize = 512;
/// The largest list of pieces that is read, in bytes.
const LIST_BYTES_MAX: usize = 1 << 20;

/// The description of a file to upload.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct UploadOffer {
    /// The name of the file, for display.
    pub name: String,
    /// The size of the file in bytes, at most 4 GiB.
    pub size: u64,
    /// The BLAKE3 hash of the file, 64 hexadecimal digits.
    pub digest: String,
    /// The BLAKE3 hashes of the file's pieces of 4 MiB, in order.
    pub chunks: Vec<String>,
}

/// The state of an upload at the farm.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, JsonSchema)]
pub struct UploadState {
    /// The digest by which a job names the file.
    pub digest: String,
    /// The digests of the pieces still to send. Empty: the file is complete.
    pub missing: Vec<String>,
    /// The size of each piece but the last, in bytes.
    pub chunk_bytes: usize,
}

/// A picture to render with uploaded files, or with those of another job.
#[derive(Clone, Debug, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Submission {
    /// The request, of the schema `/api/schema/request`. It names files as `files` does, or those of the job `files_of_job`.
    pub request: serde_json::Value,
    /// The digests of uploads, by the names that the request and its scene use: relative, with `/` between folders.
    #[serde(default)]
    pub files: BTreeMap<String, String>,
    /// The number of a job whose files are used, in place of `files`; `null`: the files are those of `files`.
    #[serde(default)]
    pub files_of_job: Option<u32>,
}

impl JobBoard {
    /// Registers a file to upload. Returns its state: the pieces that the farm lacks.
    ///
    /// # Errors
    /// The offer is inconsistent or too large, the farm has no room for it or does not answer, or this machine is a guest.
    pub fn offer_upload(&self, offer: &UploadOffer) -> Result<UploadState, Error> {
        self.refuse_guests()?;
        check_offer(offer)?;
        let store: &dyn ChunkStore = self.uplink.blobs();
        let lacking = Mutex::new(Vec::new());
        several(offer.chunks.len(), &|i| {
            if !store.has(&blob_name(&offer.chunks[i])).map_err(Error::Blob)? {
                lacking.lock().unwrap_or_else(PoisonError::into_inner).push(i);
            }
            Ok(())
        })?;
        let mut lacking = lacking.into_inner().unwrap_or_else(PoisonError::into_inner);
        lacking.sort_unstable();
        let bytes = (lacking.len() as u64 * CHUNK_BYTES as u64).min(offer.size);
        if let Some(room) = self.room().filter(|room| room.free() < bytes + bytes / 64 + (1 << 20)) {
            let free = bytes_said(room.free());
            let problem = format!("the farm's server has no room for `{}`: {free} are free", offer.name);
            return Err(Error::failed(problem, MAKE_ROOM));
        }
        let list = Contents::new(offer.digest.clone(), offer.chunks.clone());
        let list = serde_json::to_vec(&list).expect("texts can be written");
        self.uplink.blobs().put(&list_name(&offer.digest), &list).map_err(Error::Blob)?;
        let mut missing: Vec<String> = Vec::new();
        for i in lacking {
            if !missing.contains(&offer.chunks[i]) {
                missing.push(offer.chunks[i].clone());
            }
        }
        Ok(UploadState { digest: offer.digest.clone(), missing, chunk_bytes: CHUNK_BYTES })
    }

    /// Stores a piece of a file, if it matches its digest.
    ///
    /// - `digest`: the BLAKE3 hash of the piece, 64 hexadecimal digits.
    ///
    /// # Errors
    /// The piece is larger than [`PIECE_BYTES`] or does not match its digest, the farm does not answer or cannot store it, or
    /// this machine is a guest.
    pub fn put_piece(&self, digest: &str, bytes: &[u8]) -> Result<(), Error> {
        self.refuse_guests()?;
        if !is_hash(digest) || bytes.len() > CHUNK_BYTES || hash_of(bytes) != digest {
            return Err(Error::usage(
                format!("a piece of {} bytes does not have the digest `{digest}`", bytes.len()),
                "send it again: pieces have 4 MiB, the last one of a file less, and their digests are BLAKE3 in hexadecimal",
            ));
        }
        let store: &dyn ChunkStore = self.uplink.blobs();
        if !store.has(&blob_name(digest)).map_err(Error::Blob)? {
            store.put(&blob_name(digest), bytes).map_err(Error::Blob)?;
        }
        Ok(())
    }

    /// Submits a picture, or the frames of an animation, with files that the farm has. Returns the job numbers, one per picture.
    ///
    /// - `from`: the name of the submitting machine, for display.
    /// - `by`: the name of the user, for the job's log.
    /// - `cache`: where the scene is assembled, to check that it can be rendered.
    ///
    /// # Errors
    /// The request or a name is invalid, a file was not uploaded, the scene cannot be rendered, this machine is a guest, the
    /// cache cannot be written, or the farm does not answer or has no room.
    pub fn submit_uploaded(
        &self,
        submission: Submission,
        from: &str,
        by: &str,
        cache: &Cache,
    ) -> Result<Vec<u32>, Error> {
        let (spec, local) = self.local_spec(submission, cache)?;
        // Examine the first frame before any is submitted.
        let local = match local.missing_frames(false)?.first() {
            Some(first) => local.at_frame(*first)?,
            None => local,
        };
        let files = Session::examine_for_elsewhere(&local)?;
        let (stop, reporter) = (StopSwitch::new(), Reporter::new(Arc::new(())));
        // Use the request as sent: local paths of this machine do not belong into the job.
        let (order, sent) = order(self, from, &local, &files, &stop, &reporter)?;
        let lacking = self.lacks_tagged(&spec.request.farm.require);
        let new_job = |request: &Request| {
            let mut job = new_job(request, &files, from);
            job.say(format!("submitted over HTTP, by {by}"));
            files.warnings.iter().chain(&lacking).for_each(|warning| job.say(warning.clone()));
            job
        };
        let mut jobs = Vec::new();
        if spec.request.frames.is_none() {
            jobs.push((new_job(&spec.request), for_others(&spec.request, &files.rules)));
        }
        let frames = spec.request.missing_frames(false)?;
        for (_, request, job) in frame_jobs(&spec.request, &frames, new_job)? {
            jobs.push((job, for_others(&request, &files.rules)));
        }
        let submit =
            |(job, request): &(Job, Request)| self.submit(job, &JobSpec { request: request.clone(), ..order.clone() });
        let numbers = jobs.iter().map(submit).collect::<Result<Vec<u32>, Error>>()?;
        sent.keep();
        Ok(numbers)
    }

    /// Returns a request whose files are fetched into `cache`, with their paths there, to inspect its scene before submitting.
    ///
    /// # Errors
    /// As for [`Self::submit_uploaded`], except that the scene is not read.
    pub fn uploaded_here(&self, submission: Submission, cache: &Cache) -> Result<Request, Error> {
        self.local_spec(submission, cache).map(|(_, local)| local)
    }

    /// Returns the job's specification, and the request with its files on this machine.
    fn local_spec(&self, submission: Submission, cache: &Cache) -> Result<(JobSpec, Request), Error> {
        self.refuse_guests()?;
        let Submission { request, files, files_of_job } = submission;
        let origin = "what was sent".to_owned();
        let request = Request::from_value(request).map_err(|source| bottega::Error::Request { origin, source })?;
        let mut request = request.by_engine_of_scene();
        let is_too_long = |frames: &FrameOptions| frames.list.iter().nth(FRAMES_MAX).is_some();
        if request.frames.as_ref().is_some_and(is_too_long) {
            let problem = format!("`frames.list` has more than {FRAMES_MAX} frames");
            return Err(Error::usage(problem, "request them in parts"));
        }
        let output = request.output.file.get_or_insert_with(|| PathBuf::from(super::PICTURE)).clone();
        check_output(&output.to_string_lossy())?;
        if request.frames.is_some() {
            request.validate().map_err(bottega::Error::from)?;
        }
        let files = match (files_of_job, files.is_empty()) {
            (Some(number), true) => self.files_of(number, &request)?,
            (None, false) => self.uploaded(&request, &files)?,
            _ => {
                return Err(Error::usage(
                    "a job needs either `files` or `files_of_job`",
                    "upload the files of the scene first, and name them by their digests",
                ));
            }
        };
        let (scene, environment) = files.fetch(cache, self.uplink.blobs())?;
        let spec = JobSpec { request, files, engine: None, journal: None };
        let local = spec.on_this_machine(&scene, environment)?;
        Ok((spec, local))
    }

    /// Returns the files of an existing job, for another picture of its scene. Folders in the request's names are ignored:
    /// they depend on the submitter.
    fn files_of(&self, number: u32, request: &Request) -> Result<SentFiles, Error> {
        let job = crate::client::jobs::known(self, number)?;
        let files = self.spec(&job)?.files;
        let scene = files.scene_name().to_owned();
        if request.scene.file.file_name() != Path::new(&scene).file_name() {
            let problem = format!("`scene.file` is `{}`", request.scene.file.display());
            return Err(Error::usage(problem, format!("the scene of job {number} is `{scene}`")));
        }
        let light = match &request.environment.light {
            Some(EnvironmentLight::File(path)) => Some(&**path),
            _ => None,
        };
        files.lit_by(light).ok_or_else(|| {
            let light = light.unwrap_or(Path::new("")).display();
            Error::usage(
                format!("`environment.light` is `{light}`, which is not among the files of job {number}"),
                "leave it out, name the picture of that job, or upload all files of the scene",
            )
        })
    }

    /// Returns the uploaded files of a request.
    fn uploaded(&self, request: &Request, files: &BTreeMap<String, String>) -> Result<SentFiles, Error> {
        if files.len() > FILES_MAX {
            return Err(Error::usage(format!("{} files", files.len()), format!("at most {FILES_MAX} are allowed")));
        }
        let mut known = BTreeMap::new();
        for (name, digest) in files {
            known.insert(plain_name("files", name)?, self.list(name, digest)?);
        }
        let named = |field: &str, path: &Path| {
            let name = plain_name(field, &path.to_string_lossy())?;
            let contents = known.get(&name).cloned();
            contents.map(|contents| (name, contents)).ok_or_else(|| {
                Error::usage(format!("`{field}` is `{}`", path.display()), "only files that `files` names can be used")
            })
        };
        let (scene, contents) = named("scene.file", &request.scene.file)?;
        let environment = match &request.environment.light {
            Some(EnvironmentLight::File(path)) => {
                let (name, contents) = named("environment.light", path)?;
                Some((last(&name), contents))
            }
            _ => None,
        };
        let folder = scene.parent().unwrap_or(Path::new(""));
        let others = known.iter().filter(|(name, _)| **name != scene);
        let others = others.map(|(name, contents)| (relative(name, folder), contents.clone()));
        Ok(SentFiles::at_farm([(last(&scene), contents)].into_iter().chain(others).collect(), environment))
    }

    /// Returns the pieces of an uploaded file.
    fn list(&self, name: &str, digest: &str) -> Result<Contents, Error> {
        let unknown = || {
            Error::usage(
                format!("`{name}`: no file with the digest `{digest}` was uploaded"),
                "offer it by /api/uploads, and send the missing pieces",
            )
        };
        if !is_hash(digest) {
            return Err(unknown());
        }
        let list = self.uplink.blobs().get(&list_name(digest), LIST_BYTES_MAX).map_err(Error::Blob)?;
        list.and_then(|list| serde_json::from_slice(&list).ok()).ok_or_else(unknown)
    }
}

fn list_name(digest: &str) -> String {
    format!("{UPLOAD_PREFIX}{digest}")
}

fn check_offer(offer: &UploadOffer) -> Result<(), Error> {
    let UploadOffer { name, size, digest, chunks } = offer;
    plain_name("name", name)?;
    let refuse = |problem: String, allowed: &str| Err(Error::usage(problem, allowed));
    if *size > FILE_BYTES_MAX {
        return refuse(format!("`size` is {size}"), "files of up to 4 GiB are taken");
    }
    let pieces = size.div_ceil(CHUNK_BYTES as u64);
    if chunks.len() as u64 != pieces {
        let problem = format!("`chunks` has {} digests, and {size} bytes are {pieces} pieces", chunks.len());
        return refuse(problem, "pieces have 4 MiB, the last one less");
    }
    match std::iter::once(digest).chain(chunks).find(|hash| !is_hash(hash)) {
        Some(wrong) => refuse(format!("`{wrong}` is not a digest"), "a BLAKE3 digest has 64 hexadecimal digits"),
        None => Ok(()),
    }
}

/// Parses a relative name that stays below its folder.
fn plain_name(field: &str, name: &str) -> Result<PathBuf, Error> {
    let path = Path::new(name);
    let is_plain = !name.is_empty()
        && name.len() <= NAME_MAX
        && !name.contains(['\\', '\0', ':'])
        && !name.chars().any(char::is_control)
        && path.components().all(|part| matches!(part, Component::Normal(_)));
    if is_plain {
        return Ok(path.components().collect());
    }
    let said: String = name.chars().take(80).collect();
    Err(Error::usage(
        format!("`{field}`: `{}` is not a plain name", said.escape_debug()),
        "a relative name without `..` is needed, such as textures/wood.png",
    ))
}

/// Checks that the output is a plain file name: the folder is chosen at the download.
fn check_output(name: &str) -> Result<(), Error> {
    match plain_name("output.file", name) {
        Ok(path) if path.components().count() == 1 => Ok(()),
        _ => {
            let said: String = name.chars().take(80).collect();
            Err(Error::usage(
                format!("`output.file` is `{}`", said.escape_debug()),
                "the name of a file without folders is needed, such as picture.exr: the farm keeps the picture",
            ))
        }
    }
}

/// Returns the last part of a name.
fn last(name: &Path) -> String {
    name.file_name().unwrap_or_default().to_string_lossy().into_owned()
}

/// Returns a name relative to `folder`.
fn relative(name: &Path, folder: &Path) -> String {
    let shared = name.components().zip(folder.components()).take_while(|(a, b)| a == b).count();
    let up = folder.components().skip(shared).map(|_| "..".to_owned());
    let down = name.components().skip(shared).map(|part| part.as_os_str().to_string_lossy().into_owned());
    up.chain(down).collect::<Vec<_>>().join("/")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_that_lead_elsewhere_are_refused() {
        for wrong in ["", "/etc/passwd", "../a", "a/../../b", "a/..", "C:\\x", "c:x", "a\\..\\b", "./a", "a\0b", "a\nb"]
        {
            let error = plain_name("files", wrong).unwrap_err();
            assert!(error.is_usage() && error.to_string().contains("`files`"), "{wrong:?}: {error}");
        }
        assert!(plain_name("files", &"a".repeat(NAME_MAX + 1)).is_err());
        assert_eq!(plain_name("files", "a//b.png").unwrap(), Path::new("a/b.png"));
    }

    #[test]
    fn a_picture_has_a_name_without_folders() {
        for plain in ["picture.exr", "frame ####.png", "né.exr"] {
            assert!(check_output(plain).is_ok(), "{plain}");
        }
        for wrong in ["out/picture.exr", "/tmp/picture.exr", "../picture.exr", "./picture.exr", "a\\b.exr", ""] {
            let error = check_output(wrong).unwrap_err();
            assert!(error.is_usage() && error.to_string().contains("`output.file`"), "{wrong:?}: {error}");
        }
    }

    #[test]
    fn file_names_are_relative_to_the_folder_of_the_scene() {
        for (name, folder, expected) in [
            ("a.png", "", "a.png"),
            ("textures/a.png", "", "textures/a.png"),
            ("textures/a.png", "scenes", "../textures/a.png"),
            ("scenes/t/a.png", "scenes", "t/a.png"),
            ("x/a.png", "s/t", "../../x/a.png"),
        ] {
            assert_eq!(relative(Path::new(name), Path::new(folder)), expected);
        }
    }

    #[test]
    fn an_offer_that_contradicts_itself_is_refused() {
        let hash = "a".repeat(64);
        let offer = |size, digest: &str, chunks: &[&str]| UploadOffer {
            name: "a.glb".to_owned(),
            size,
            digest: digest.to_owned(),
            chunks: chunks.iter().map(|&chunk| chunk.to_owned()).collect(),
        };
        assert!(check_offer(&offer(CHUNK_BYTES as u64 + 1, &hash, &[&hash, &hash])).is_ok());
        assert!(check_offer(&offer(0, &hash, &[])).is_ok());
        for (wrong, word) in [
            (offer(FILE_BYTES_MAX + 1, &hash, &[]), "size"),
            (offer(5, &hash, &[]), "chunks"),
            (offer(5, &hash, &[&hash, &hash]), "chunks"),
            (offer(5, "../x", &[&hash]), "digest"),
            (offer(5, &hash, &["A"]), "digest"),
            (UploadOffer { name: "../a".to_owned(), ..offer(5, &hash, &[&hash]) }, "name"),
        ] {
            let error = check_offer(&wrong).unwrap_err();
            assert!(error.is_usage() && error.to_string().contains(word), "{error}");
        }
    }
}
