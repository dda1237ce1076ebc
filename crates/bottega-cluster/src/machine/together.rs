//! Shared preparation of a picture: the machines of a job trace photons and place lighting agents together, once.
//!
//! - `cast/WORK/STAGE/PART`: who has claimed a part, and whether it is done; changed by compare-and-set.
//! - blob `job-WORK/cast/STAGE/PART`: the result of the part. All machines read it, and join the parts by number.
//!
//! A notice is a claim, not a lock. Its holder may hang, so a claim has a deadline, after which an idle machine computes
//! the part too. A machine that cannot write claims computes the parts without. A part that is computed twice has the same
//! result, and a late result is harmless.

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

use crate::{
    job::{
        presence::PresenceState,
        shared_parts::{part_blob, part_name},
    },
    machine::member::Member,
};

/// The largest result of a part, in bytes.
const PART_BYTES_MAX: usize = 1 << 28;
/// The least time that another machine has for a part.
const PATIENCE: Duration = Duration::from_secs(1);
/// Interval between checks of what others have done.
const LOOK_EVERY: Duration = Duration::from_millis(10);
/// Time without progress after which a machine computes the remaining parts without claiming them.
const IN_VAIN_MAX: Duration = Duration::from_secs(5);

/// The machines that work on a job, as seen by this process.
pub(crate) struct JobPeers<'a> {
    member: &'a Member,
    number: u32,
    work: u64,
    /// Requested when this process must stop.
    stop: &'a StopSwitch,
    /// Number of all parts, and of those computed here.
    parts: AtomicU32,
    done_here: AtomicU32,
}

/// The claim of a part.
#[derive(Serialize, Deserialize)]
struct PartNotice {
    by: String,
    is_done: bool,
}

/// The progress of a stage, to detect that it is stuck.
struct Advance {
    /// The holder of each part, and whether it is done, when last checked.
    seen: Vec<(Option<String>, bool)>,
    /// The last time that this changed, or that a part was computed here.
    moved: Instant,
}

impl Advance {
    fn begin() -> Self {
        Self { seen: Vec::new(), moved: Instant::now() }
    }

    fn see(&mut self, parts: &[SharedPart]) {
        let now: Vec<_> = parts.iter().map(|part| (part.taken_by.clone(), part.is_done)).collect();
        if self.seen != now {
            (self.seen, self.moved) = (now, Instant::now());
        }
    }

    fn is_in_vain(&self) -> bool {
        self.moved.elapsed() > IN_VAIN_MAX
    }
}

impl<'a> JobPeers<'a> {
    /// Returns the peers of this process.
    ///
    /// - `number`, `work`: the numbers of the job and of its painting.
    pub(crate) fn new(member: &'a Member, number: u32, work: u64, stop: &'a StopSwitch) -> Self {
        Self { member, number, work, stop, parts: AtomicU32::new(0), done_here: AtomicU32::new(0) }
    }

    /// Returns the number of parts computed here, and of all parts.
    pub(crate) fn shares(&self) -> [u32; 2] {
        [&self.done_here, &self.parts].map(|count| count.load(Ordering::Relaxed))
    }

    /// Returns true if another machine could take part.
    fn has_others(&self) -> bool {
        let Member { board, name, .. } = self.member;
        board.presences().iter().any(|machine| machine.name != *name && machine.standing == PresenceState::Active)
    }

    /// Returns the machines that work on the job now: only they hold parts.
    fn present(&self) -> BTreeSet<String> {
        let presences = self.member.board.presences().into_iter();
        let at_work =
            presences.filter(|machine| machine.job == Some(self.number) && machine.standing == PresenceState::Active);
        at_work.map(|machine| machine.name).collect()
    }

    fn parts_of(&self, stage: u32, count: u32) -> Vec<SharedPart> {
        let part = |number| {
            let Some(notice) = self.member.board.uplink.notices().get(&part_name(self.work, stage, number)) else {
                return SharedPart::default();
            };
            match serde_json::from_slice::<PartNotice>(&notice.text) {
                Ok(PartNotice { by, is_done }) => SharedPart { taken_by: Some(by), since: notice.unchanged, is_done },
                Err(_) => SharedPart::default(),
            }
        };
        (0..count).map(part).collect()
    }

    fn notice(&self, is_done: bool) -> Vec<u8> {
        let notice = PartNotice { by: self.member.name.clone(), is_done };
        serde_json::to_vec(&notice).expect("a structure of text can be written")
    }

    /// Claims a part for a while. `false`: another process was first.
    fn claim(&self, stage: u32, number: u32) -> Result<bool, BlobError> {
        let (notices, name) = (self.member.board.uplink.notices(), part_name(self.work, stage, number));
        let revision = notices.get(&name).map_or(0, |notice| notice.revision);
        Ok(notices.update(&name, &self.notice(false), revision)?.is_some())
    }

    /// Computes a part and publishes its result.
    fn perform(
        &self,
        stage: u32,
        number: u32,
        perform: &mut dyn FnMut(u32) -> Result<Vec<u8>, RenderError>,
    ) -> Result<Result<Vec<u8>, RenderError>, BlobError> {
        let bytes = match perform(number) {
            Ok(bytes) => bytes,
            Err(error) => return Ok(Err(error)),
        };
        self.done_here.fetch_add(1, Ordering::Relaxed);
        self.member.activity.moved();
        let uplink = &self.member.board.uplink;
        uplink.blobs().put(&part_blob(self.work, stage, number), &bytes)?;
        uplink.notices().put(&part_name(self.work, stage, number), &self.notice(true))?;
        Ok(Ok(bytes))
    }

    /// Fetches the result of another machine; `None`: it is not available.
    fn fetch(&self, stage: u32, number: u32) -> Option<Vec<u8>> {
        let blob = part_blob(self.work, stage, number);
        let fetched = self.member.board.uplink.blobs().get(&blob, PART_BYTES_MAX);
        fetched.inspect_err(|error| tracing::debug!(%error, "a part is done here")).ok().flatten()
    }

    /// Computes parts together with the other machines until all are done, or until there is no progress. `found` holds the
    /// results so far, also on errors.
    fn share_out(
        &self,
        stage: u32,
        found: &mut [Option<Vec<u8>>],
        perform: &mut dyn FnMut(u32) -> Result<Vec<u8>, RenderError>,
    ) -> Result<Result<(), RenderError>, BlobError> {
        let mut longest = Duration::ZERO;
        let mut advance = Advance::begin();
        loop {
            if self.stop.is_requested() {
                return Ok(Err(RenderError::Left));
            }
            // Choose the next part from the claims of all machines
            let parts = self.parts_of(stage, found.len() as u32);
            advance.see(&parts);
            let present = self.present();
            let next = next_part(&parts, &self.member.name, |name| present.contains(name), PATIENCE.max(2 * longest));
            // Give up sharing if there is no progress
            if next != NextPart::Done && advance.is_in_vain() {
                let Member { board, name, .. } = self.member;
                let seconds = IN_VAIN_MAX.as_secs();
                board.log(
                    self.number,
                    &format!(
                        "{name} could not claim a part of the shared work for {seconds} s, and does the rest alone"
                    ),
                );
                return Ok(Ok(()));
            }
            match next {
                NextPart::Done => return Ok(Ok(())),
                // Compute a claimed part
                NextPart::Take(number) if self.claim(stage, number as u32)? => {
                    let begun = Instant::now();
                    self.member.activity.awaits_others(false);
                    match self.perform(stage, number as u32, perform)? {
                        Ok(bytes) => found[number] = Some(bytes),
                        Err(error) => return Ok(Err(error)),
                    }
                    longest = longest.max(begun.elapsed());
                    advance.moved = Instant::now();
                }
                NextPart::Take(_) => thread::sleep(LOOK_EVERY),
                // Fetch results while others compute the last parts
                NextPart::Wait => {
                    self.member.activity.awaits_others(true);
                    let next = (0..found.len()).find(|&number| found[number].is_none() && parts[number].is_done);
                    match next.and_then(|number| Some((number, self.fetch(stage, number as u32)?))) {
                        Some((number, bytes)) => {
                            found[number] = Some(bytes);
                            advance.moved = Instant::now();
                        }
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
            let shared = self.share_out(stage, &mut found, perform);
            self.member.activity.awaits_others(false);
            match shared {
                Ok(done) => done?,
                Err(error) => tracing::warn!(%error, "the farm does not answer: doing the rest here"),
            }
        }
        // Fetch or compute the parts that are still missing
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

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use bottega_agents::driver::nats::NatsThread;

    use super::*;
    use crate::{
        job::{board::JobBoard, presence::Presence, shared_parts::forget},
        server::own_server::OwnServer,
    };

    const WORK: u64 = 5;
    const PARTS: u32 = 16;

    /// A machine of a farm that works on job 1.
    fn member(server: &OwnServer, name: &str) -> Member {
        let uplink = server.entry.link(&NatsThread::start().unwrap(), name).unwrap();
        let board = JobBoard { uplink: Arc::new(uplink) };
        Member::new(board, name.to_owned(), (1, Vec::new()), &StopSwitch::new())
    }

    fn attend(member: &Member) {
        member.board.attend(&member.presence(Some(1)));
    }

    /// Lets a machine take part in a stage. Returns the time that it took, and the number of parts that it computed.
    fn share(member: &Member) -> (Duration, u32) {
        let stop = StopSwitch::new();
        let peers = JobPeers::new(member, 1, WORK, &stop);
        let begun = Instant::now();
        let all = peers.share(0, PARTS, &mut |part| Ok(vec![part as u8])).ok().unwrap();
        assert_eq!(all, (0..PARTS).map(|part| vec![part as u8]).collect::<Vec<_>>());
        (begun.elapsed(), peers.shares()[0])
    }

    #[test]
    fn parts_are_shared_once_more_when_a_picture_is_painted_again_and_a_claim_of_one_who_does_nothing_is_no_obstacle() {
        let folder = tempfile::tempdir().unwrap();
        let Ok(server) = OwnServer::start(None, folder.path()) else {
            return eprintln!("SKIPPED: there is no NATS server");
        };
        let (one, two) = (member(&server, "one"), member(&server, "two"));
        let (one, two) = (&one, &two);
        attend(two);
        attend(one);
        let begun = Instant::now();
        while !one.board.presences().iter().any(|machine: &Presence| machine.name == "two") {
            assert!(begun.elapsed() < Duration::from_secs(30), "the other machine does not appear");
            thread::sleep(LOOK_EVERY);
        }
        // Long before any claim expires.
        assert_eq!(share(one).1, PARTS);
        // The picture is finished and its parts are deleted; then the same work starts again.
        forget(&one.board, WORK);
        let (took, here) = share(one);
        assert!(here == PARTS && took < IN_VAIN_MAX, "{here} parts in {took:?}");
        // Another machine is present, has claimed a part, and hangs.
        forget(&one.board, WORK);
        let stop = StopSwitch::new();
        assert!(JobPeers::new(two, 1, WORK, &stop).claim(0, 3).unwrap());
        attend(two);
        assert_eq!(share(one).1, PARTS);
    }
}
