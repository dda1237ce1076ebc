//! Removal of old data of a farm: jobs that are over, scene chunks without a job, presences of killed machines.

use std::{
    collections::{BTreeMap, BTreeSet},
    thread,
    time::Duration,
};

use bottega_agents::driver::nats::StoredBlob;
use serde::{Deserialize, Serialize};

use crate::{
    error::Error,
    files::chunks,
    job::{
        board::{JobBoard, job_name, lead_name, no_such},
        record::{Job, JobState},
        shared_parts,
    },
};

/// The time to watch for other processes that send a scene; they announce it once a second.
const LOOK_FOR: Duration = Duration::from_millis(2500);
/// Age from which stray data is deleted: by then it is not part of a transfer in progress.
const STRAY_AFTER: Duration = Duration::from_secs(600);
/// Time without a renewal after which a presence is deleted.
const PRESENCE_EXPIRES_AFTER: Duration = Duration::from_secs(15);

/// Prefix of the lists of pieces of uploads.
pub(crate) const UPLOAD_PREFIX: &str = "upload/";
/// The time for which a list of pieces is kept.
pub(crate) const UPLOAD_KEPT: Duration = Duration::from_secs(24 * 3600);

/// The announcement that a process is sending a scene.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Announcement {
    /// Bytes to send in total.
    pub bytes: u64,
    /// Bytes sent so far.
    pub sent: u64,
}

/// The storage that a job uses at the farm, in bytes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct JobStorage {
    /// Chunks of the job's scene, which other jobs may share.
    pub scene: u64,
    /// The job's picture, specification and rendered zones.
    pub own: u64,
}

impl JobStorage {
    /// Returns the sum, in bytes.
    pub fn all(self) -> u64 {
        self.scene + self.own
    }
}

impl JobBoard {
    /// Deletes data that no job needs any more: zones of jobs that are over, and after a day their scenes.
    pub fn sweep(&self) {
        self.sweep_zones();
        // If the specification of a live job cannot be read, its chunks are unknown: keep all.
        let Some(needed) = self.needed() else { return };
        let is_old_list = |name: &str, age| name.starts_with(UPLOAD_PREFIX) && age > UPLOAD_KEPT;
        self.uplink.blobs().forget_all(|name, age| chunks::is_unused(name, age, &needed) || is_old_list(name, age));
        self.uplink.blobs().forget_strays(STRAY_AFTER);
    }

    fn sweep_zones(&self) {
        let jobs = self.all();
        let is_live = |work: u64| jobs.iter().any(|(_, job)| job.work == work && !job.state.is_over());
        let work = |folder: &str| folder.strip_prefix("work-")?.parse().ok();
        for folder in self.uplink.payloads().folders() {
            if work(&folder).is_some_and(|work| !is_live(work)) {
                self.uplink.payloads().forget(&folder);
            }
        }
        for (_, job) in jobs.iter().filter(|(_, job)| job.state == JobState::Cancelled) {
            self.forget_zones(job.work);
            self.forget_learnt(job.work);
        }
        shared_parts::works(self)
            .into_iter()
            .filter(|&work| !is_live(work))
            .for_each(|work| shared_parts::forget(self, work));
    }

    /// Frees space: deletes everything that no job needs, whatever its age.
    ///
    /// - `me`: the name of this process.
    /// - `is_wanted`: selects chunks that it is about to need.
    pub(crate) fn make_room(&self, me: &str, is_wanted: impl Fn(&str) -> bool) {
        self.sweep_zones();
        self.forget_pieces(me, |name| !is_wanted(name));
        self.uplink.blobs().forget_strays(STRAY_AFTER);
    }

    /// Deletes chunks that no job needs; none while another process sends a scene, which may rely on them.
    ///
    /// - `me`: the name of this process.
    pub(crate) fn forget_pieces(&self, me: &str, which: impl Fn(&str) -> bool) {
        if self.others_send(me) {
            return;
        }
        let Some(needed) = self.needed() else { return };
        self.uplink
            .blobs()
            .forget_all(|name, _| name.starts_with(chunks::PREFIX) && which(name) && !needed.contains(name));
    }

    /// Deletes a job and all its data, including its scene unless a job that is not over needs it or another process is sending a
    /// scene.
    ///
    /// # Errors
    /// There is no such job, this machine is a guest, or the farm does not confirm the deletion.
    pub fn remove_with_scene(&self, number: u32) -> Result<(), Error> {
        let order = self.get(number).and_then(|job| self.spec(&job).ok());
        let pieces: BTreeSet<String> = order.map(|order| order.files.blobs().collect()).unwrap_or_default();
        // Delete large data first: a full server cannot record that the job is gone. No process has an empty name.
        self.refuse_guests()?;
        self.forget_pieces("", |name| pieces.contains(name));
        self.remove(number)
    }

    /// Deletes a job and its own data, but not its scene. Large data comes first: a full server can write nothing, and deleting a
    /// notice is a write.
    ///
    /// # Errors
    /// There is no such job, this machine is a guest, or the farm does not confirm the deletion.
    pub fn remove(&self, number: u32) -> Result<(), Error> {
        let job = self.get(number).ok_or_else(|| no_such(number))?;
        self.refuse_guests()?;
        self.forget_painting(&job);
        self.uplink.blobs().forget_all(|name, _| Self::is_of_all_paintings(&job, name));
        self.uplink.notices().remove(&job_name(number)).map_err(Error::Blob)?;
        self.uplink.notices().remove(&lead_name(number)).map_err(Error::Blob)?;
        self.forget_society(number);
        self.forget_requeues(number);
        self.forget_watch(number);
        Ok(())
    }

    /// Deletes the data of a job's current painting, but not its specification or picture.
    pub(crate) fn forget_painting(&self, job: &Job) {
        self.forget_zones(job.work);
        shared_parts::forget(self, job.work);
        let prefix = format!("job-{}/", job.work);
        self.uplink.blobs().forget_all(|name, _| name.starts_with(&prefix) && !Self::is_of_all_paintings(job, name));
    }

    /// Returns the chunks that live jobs need; `None`: unknown.
    fn needed(&self) -> Option<BTreeSet<String>> {
        let jobs = self.all();
        let live = jobs.iter().filter(|(_, job)| !job.state.is_over());
        let orders = live.map(|(_, job)| self.spec(job)).collect::<Result<Vec<_>, _>>().ok()?;
        Some(orders.iter().flat_map(|order| order.files.blobs()).collect())
    }

    /// Announces that a process sends a scene. Failures are only logged.
    pub(crate) fn announce(&self, me: &str, what: &Announcement) {
        if let Err(error) = self.put_notice(&transfer_name(me), what) {
            tracing::debug!(%error, "cannot announce that a scene is being sent");
        }
    }

    /// Removes the announcement that a process sends a scene.
    pub(crate) fn stop_announcing(&self, me: &str) {
        if let Err(error) = self.uplink.notices().remove(&transfer_name(me)) {
            tracing::debug!(%error, "cannot remove the announcement of a sent scene");
        }
    }

    /// Returns true if another process is sending a scene. Old announcements of killed processes do not count, and are
    /// deleted.
    fn others_send(&self, me: &str) -> bool {
        let look = || {
            let announcements = self.uplink.notices().all("transfer/").into_iter();
            let of_others = announcements.filter(|notice| notice.name != transfer_name(me));
            of_others.map(|notice| (notice.name, notice.revision)).collect::<BTreeMap<_, _>>()
        };
        let before = look();
        if before.is_empty() {
            return false;
        }
        thread::sleep(LOOK_FOR);
        let now = look();
        for (name, revision) in &before {
            if now.get(name) == Some(revision)
                && let Err(error) = self.uplink.notices().remove(name)
            {
                tracing::debug!(%error, "cannot remove a notice");
            }
        }
        now.iter().any(|(name, revision)| before.get(name) != Some(revision))
    }

    /// Returns the scenes that are being sent, each with the name of the sending process; also those of processes that were
    /// killed while they sent.
    pub fn transfers(&self) -> Vec<(String, Announcement)> {
        let announcements = self.uplink.notices().all("transfer/").into_iter();
        let transfers = announcements.filter_map(|notice| {
            let process = notice.name.strip_prefix("transfer/")?.to_owned();
            Some((process, serde_json::from_slice(&notice.text).ok()?))
        });
        transfers.collect()
    }

    /// Returns the storage that each of these jobs uses at the farm, by its number. It is too low, or 0, for a job whose
    /// specification cannot be read and while the server does not answer.
    pub fn held(&self, jobs: &[(u32, Job)]) -> BTreeMap<u32, JobStorage> {
        let blobs = self.uplink.blobs().list();
        let sizes: BTreeMap<&str, u64> = blobs.iter().map(|StoredBlob { name, bytes, .. }| (&**name, *bytes)).collect();
        let tiles = self.uplink.payloads().bytes_by_folder();
        let held = |job: &Job| {
            // If its specification cannot be read, its scene counts as empty.
            let pieces: BTreeSet<String> =
                self.spec(job).map(|order| order.files.blobs().collect()).unwrap_or_default();
            let scene = pieces.iter().filter_map(|name| sizes.get(&**name)).sum();
            let below = |number: u64| {
                let prefix = format!("job-{number}/");
                sizes.range(&*prefix..).take_while(|(name, _)| name.starts_with(&prefix)).map(|(_, it)| it).sum()
            };
            let own: u64 = below(job.work) + if job.origin == job.work { 0 } else { below(job.origin) };
            let painted = tiles.get(&format!("work-{}", job.work)).copied().unwrap_or_default();
            JobStorage { scene, own: own + painted }
        };
        jobs.iter().map(|(number, job)| (*number, held(job))).collect()
    }

    /// Deletes the presences of killed machines.
    pub(crate) fn clear_presences(&self) {
        let presences = self.uplink.notices().all("presence/").into_iter();
        for notice in presences.filter(|notice| notice.unchanged > PRESENCE_EXPIRES_AFTER) {
            if let Err(error) = self.uplink.notices().remove(&notice.name) {
                tracing::debug!(%error, "cannot remove a presence");
            }
        }
    }
}

fn transfer_name(process: &str) -> String {
    format!("transfer/{process}")
}
