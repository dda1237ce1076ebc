//! Work before a picture that the machines of a job do together: photons are traced, lighting agents cast and sent out, once.
//!
//! - `cast/WORK/STAGE/PART`: who has taken a part, and whether it is done; changed by compare-and-set.
//! - blob `job-WORK/cast/STAGE/PART`: what came of it. All read it, and join the parts by their numbers.

use std::{
    collections::BTreeSet,
    sync::atomic::{AtomicU32, Ordering},
    thread,
    time::{Duration, Instant},
};

use bottega_agents::driver::nats::BlobError;
use bottega_engines::{RenderError, Sharing};
use bottega_farm::{NextPart, SharedPart, StopSwitch, next_part};
use serde::{Deserialize, Serialize};

use crate::{job_board::JobBoard, machine::PresenceState};

/// The most that comes of a part.
const PART_BYTES_MAX: usize = 1 << 28;
/// For so long at least another machine may have a part.
const PATIENCE: Duration = Duration::from_secs(1);
/// How often is looked what others have done.
const LOOK_EVERY: Duration = Duration::from_millis(10);

/// Those who paint a job with this process.
pub(crate) struct JobPeers<'a> {
    board: &'a JobBoard,
    me: &'a str,
    work: u64,
    /// Somebody wants something else.
    stop: &'a StopSwitch,
    /// Parts in all, and those that were done here.
    parts: AtomicU32,
    done_here: AtomicU32,
}

/// A notice of who does a part.
#[derive(Serialize, Deserialize)]
struct PartNotice {
    by: String,
    is_done: bool,
}

impl<'a> JobPeers<'a> {
    pub(crate) fn new(board: &'a JobBoard, me: &'a str, work: u64, stop: &'a StopSwitch) -> Self {
        Self { board, me, work, stop, parts: AtomicU32::new(0), done_here: AtomicU32::new(0) }
    }

    /// Parts that were done here, and those in all.
    pub(crate) fn shares(&self) -> [u32; 2] {
        [&self.done_here, &self.parts].map(|count| count.load(Ordering::Relaxed))
    }

    /// Whether there is another machine that may take part.
    fn has_others(&self) -> bool {
        self.board.presences().iter().any(|seat| seat.name != self.me && seat.standing == PresenceState::Active)
    }

    fn parts_of(&self, stage: u32, count: u32) -> Vec<SharedPart> {
        let part = |number| {
            let Some(notice) = self.board.uplink.notices().get(&part_name(self.work, stage, number)) else {
                return SharedPart::default();
            };
            match serde_json::from_slice::<PartNotice>(&notice.text) {
                Ok(PartNotice { by, is_done }) => SharedPart { taken_by: Some(by), since: notice.unchanged, is_done },
                Err(_) => SharedPart::default(),
            }
        };
        (0..count).map(part).collect()
    }

    /// Takes a part, does it and tells the others. `None`: somebody else was first.
    fn take(
        &self,
        stage: u32,
        number: u32,
        perform: &mut dyn FnMut(u32) -> Result<Vec<u8>, RenderError>,
    ) -> Result<Result<Option<Vec<u8>>, RenderError>, BlobError> {
        let (notices, name) = (self.board.uplink.notices(), part_name(self.work, stage, number));
        let says = |is_done| {
            serde_json::to_vec(&PartNotice { by: self.me.to_owned(), is_done })
                .expect("a structure of text can be written")
        };
        let revision = notices.get(&name).map_or(0, |notice| notice.revision);
        if notices.update(&name, &says(false), revision)?.is_none() {
            return Ok(Ok(None));
        }
        let bytes = match perform(number) {
            Ok(bytes) => bytes,
            Err(error) => return Ok(Err(error)),
        };
        self.done_here.fetch_add(1, Ordering::Relaxed);
        self.board.uplink.blobs().put(&part_blob(self.work, stage, number), &bytes)?;
        notices.put(&name, &says(true))?;
        Ok(Ok(Some(bytes)))
    }

    /// What another machine has found; `None`: nothing that could be had.
    fn fetch(&self, stage: u32, number: u32) -> Option<Vec<u8>> {
        let blob = part_blob(self.work, stage, number);
        let fetched = self.board.uplink.blobs().get(&blob, PART_BYTES_MAX);
        fetched.inspect_err(|error| tracing::debug!(%error, "a part is done here")).ok().flatten()
    }

    /// Parts are done by all who have time, until there is none left. What was found so far, if the farm does not answer.
    fn share_out(
        &self,
        stage: u32,
        found: &mut [Option<Vec<u8>>],
        perform: &mut dyn FnMut(u32) -> Result<Vec<u8>, RenderError>,
    ) -> Result<Result<(), RenderError>, BlobError> {
        let mut longest = Duration::ZERO;
        loop {
            if self.stop.is_requested() {
                return Ok(Err(RenderError::Left));
            }
            let parts = self.parts_of(stage, found.len() as u32);
            let there: Vec<String> = self.board.presences().into_iter().map(|seat| seat.name).collect();
            let is_there = |name: &str| there.iter().any(|it| it == name);
            match next_part(&parts, self.me, is_there, PATIENCE.max(2 * longest)) {
                NextPart::Done => return Ok(Ok(())),
                NextPart::Take(number) => {
                    let begun = Instant::now();
                    match self.take(stage, number as u32, perform)? {
                        Ok(Some(bytes)) => found[number] = Some(bytes),
                        Ok(None) => thread::sleep(LOOK_EVERY),
                        Err(error) => return Ok(Err(error)),
                    }
                    longest = longest.max(begun.elapsed());
                }
                NextPart::Wait => {
                    let next = (0..found.len()).find(|&number| found[number].is_none() && parts[number].is_done);
                    match next.and_then(|number| Some((number, self.fetch(stage, number as u32)?))) {
                        Some((number, bytes)) => found[number] = Some(bytes),
                        None => thread::sleep(LOOK_EVERY),
                    }
                }
            }
        }
    }
}

impl Sharing for JobPeers<'_> {
    fn share(
        &self,
        stage: u32,
        parts: u32,
        perform: &mut dyn FnMut(u32) -> Result<Vec<u8>, RenderError>,
    ) -> Result<Vec<Vec<u8>>, RenderError> {
        self.parts.fetch_add(parts, Ordering::Relaxed);
        let mut found = vec![None; parts as usize];
        let is_shared = self.has_others();
        if is_shared {
            match self.share_out(stage, &mut found, perform) {
                Ok(done) => done?,
                Err(error) => tracing::warn!(%error, "the farm does not answer: what is left is done here"),
            }
        }
        let mut all = Vec::with_capacity(found.len());
        for (number, bytes) in (0..).zip(found) {
            if self.stop.is_requested() {
                return Err(RenderError::Left);
            }
            let bytes = bytes.or_else(|| is_shared.then(|| self.fetch(stage, number)).flatten());
            all.push(match bytes {
                Some(bytes) => bytes,
                None => {
                    self.done_here.fetch_add(1, Ordering::Relaxed);
                    perform(number)?
                }
            });
        }
        Ok(all)
    }
}

/// The works of which something is kept here. What a machine was at when the picture was done comes after its end.
pub(crate) fn works(board: &JobBoard) -> BTreeSet<u64> {
    let notices = board.uplink.notices().all("cast/");
    notices.iter().filter_map(|notice| notice.name.split('/').nth(1)?.parse().ok()).collect()
}

/// The picture is painted: what was done together goes.
pub(crate) fn forget(board: &JobBoard, work: u64) {
    let prefix = format!("cast/{work}/");
    for notice in board.uplink.notices().all(&prefix) {
        board.uplink.blobs().forget(&format!("job-{work}/{}", notice.name.replacen(&format!("/{work}/"), "/", 1)));
        if let Err(error) = board.uplink.notices().remove(&notice.name) {
            tracing::debug!(%error, "a notice was not taken down");
        }
    }
}

fn part_name(work: u64, stage: u32, part: u32) -> String {
    format!("cast/{work}/{stage}/{part}")
}

fn part_blob(work: u64, stage: u32, part: u32) -> String {
    format!("job-{work}/cast/{stage}/{part}")
}
