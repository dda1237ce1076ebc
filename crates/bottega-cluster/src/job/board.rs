//! The jobs of a farm, stored as notices, and the leader of each.
//!
//! - `job/N`: the job, changed by compare-and-set, so that no change is lost.
//! - `lead/N`: its leader and progress. The leader renews it; if it does not, the first process that claims the lead gets it.
//! - `page/PLATFORM/…`: the white and yellow pages: see [`directories`](crate::agents::directories).
//! - `presence/MEMBER/NAME`: the presence of a process of a machine, and its current job.
//! - `order/NAME`: the last command to it: see [`machines`](crate::job::machines).

use std::{collections::BTreeMap, sync::Arc, thread, time::Duration};

use bottega_agents::driver::nats::{BlobError, NatsUplink, Notice};
use bottega_agents::machine_of;
use bottega_farm::{FarmCodec, WorkId};
use serde::{Deserialize, Serialize, de::DeserializeOwned};

use crate::{
    error::Error,
    job::{
        presence::Presence,
        record::{Job, JobSpec, JobState},
        transport::job_link,
    },
};

/// Interval at which leaders and machines renew their notices.
pub(crate) const RENEW_EVERY: Duration = Duration::from_millis(500);
/// Time without a renewal after which a leader counts as gone.
const LEADER_SILENT: Duration = Duration::from_millis(2500);
/// Time without a renewal after which a machine counts as gone.
pub(crate) const PRESENCE_SILENT_AFTER: Duration = Duration::from_secs(3);
/// The most processes of one machine that count.
const PROCESSES_MAX: usize = 64;
/// The largest specification of a job, in bytes.
const ORDER_BYTES_MAX: usize = 1 << 28;
/// The largest picture of a job, in bytes.
const PICTURE_BYTES_MAX: usize = 1 << 32;
/// The largest data that an engine may share about a picture, in bytes.
const LEARNT_BYTES_MAX: usize = 1 << 28;
/// The most attempts at a change that conflicts with the changes of others.
const TRIES_MAX: u32 = 100;
const BETWEEN_TRIES: Duration = Duration::from_millis(20);

/// The leader of a job, and its progress.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Lead {
    /// The name of the process that leads; `None`: the leader has stepped down, or has not renewed its lead for 2.5 s.
    pub leader: Option<String>,
    /// The number of the painting that the progress is about, as in [`Job::work`].
    #[serde(default)]
    pub work: u64,
    /// Share of the predicted cost of the picture that is done, in 0..=1.
    pub done: f64,
    /// Number of zones painted.
    pub zones_done: usize,
    /// Number of all zones.
    pub zones: usize,
    /// Predicted remaining time in seconds, if known.
    #[serde(default)]
    pub seconds_left: Option<f64>,
    /// True if a preview of the picture exists.
    #[serde(default)]
    pub seen: bool,
    /// True if zones wait for more machines, so that their results can be compared.
    #[serde(default)]
    pub lacks_machines: bool,
}

impl Lead {
    /// Merges with the record before: a leader that does not know its zones yet keeps the progress of the one before.
    fn or_as_before(self, before: Option<Self>) -> Self {
        match before {
            Some(before) if self.zones == 0 && self.work == before.work => {
                Self { leader: self.leader, seen: self.seen || before.seen, ..before }
            }
            _ => self,
        }
    }

    /// Returns the progress of the painting `work`: none if the record is about another painting.
    pub(crate) fn of(self, work: u64) -> Self {
        if self.work == work { self } else { Self { leader: self.leader, work, ..Self::default() } }
    }
}

/// The right to lead a job; one process has it at a time.
#[derive(Debug)]
pub struct Lease {
    number: u32,
    revision: u64,
}

/// The job records of a farm.
#[derive(Clone)]
pub struct JobBoard {
    /// The link to the farm.
    pub uplink: Arc<NatsUplink<FarmCodec>>,
}

impl JobBoard {
    /// Stores a job. Returns its number, which no other job of the farm has or had.
    ///
    /// - `order`: the specification of the job.
    ///
    /// # Errors
    /// The farm does not answer or does not store the job, or too many other processes submit jobs at the same time.
    pub fn submit(&self, job: &Job, order: &JobSpec) -> Result<u32, Error> {
        self.uplink.blobs().put(&order_blob(job.origin), &text(order)).map_err(Error::Blob)?;
        let first = self.first_unused()?;
        for number in first..first.saturating_add(TRIES_MAX) {
            let put = self.uplink.notices().put_first(&job_name(number), &text(job)).map_err(Error::Blob)?;
            if put.is_some() {
                return Ok(number);
            }
        }
        Err(too_busy())
    }

    /// Returns the first job number never used, beyond those of removed jobs.
    fn first_unused(&self) -> Result<u32, Error> {
        let was_used = |number: u32| self.uplink.notices().was_ever(&job_name(number)).map_err(Error::Blob);
        let mut used = self.all().last().map_or(0, |(number, _)| *number);
        let mut step = 1;
        while was_used(used.saturating_add(step))? {
            used = used.saturating_add(step);
            step = step.saturating_mul(2);
        }
        let mut unused = used.saturating_add(step);
        while unused - used > 1 {
            let middle = used.midpoint(unused);
            if was_used(middle)? { used = middle } else { unused = middle }
        }
        Ok(unused)
    }

    /// Deletes the rows and pixels of a job's zones.
    pub(crate) fn forget_zones(&self, work: u64) {
        job_link(Arc::clone(&self.uplink), WorkId(work), None, String::new()).forget();
    }

    /// Returns all jobs with their numbers, in the order of these; without those whose record cannot be read.
    pub fn all(&self) -> Vec<(u32, Job)> {
        let notices = self.uplink.notices().all("job/");
        let read = notices.iter().filter_map(|notice| Some((number_of(&notice.name)?, read(notice)?)));
        let mut all: Vec<(u32, Job)> = read.collect();
        all.sort_by_key(|(number, _)| *number);
        all
    }

    /// Returns a job; `None`: no job has that number, or its record cannot be read.
    pub fn get(&self, number: u32) -> Option<Job> {
        self.uplink.notices().get(&job_name(number)).and_then(|notice| read(&notice))
    }

    /// Changes a job atomically, with retries if another process changes it at the same time. Leaves it as it is if
    /// `change` returns `false`. Returns the job as stored.
    ///
    /// # Errors
    /// There is no such job, its record cannot be read, this machine is a guest, the farm does not store the change, or other
    /// processes changed the job at every attempt.
    pub fn change(&self, number: u32, change: impl Fn(&mut Job) -> bool) -> Result<Job, Error> {
        let notices = self.uplink.notices();
        self.refuse_guests()?;
        for _ in 0..TRIES_MAX {
            let notice = notices.get(&job_name(number)).ok_or_else(|| no_such(number))?;
            let mut job: Job = read(&notice).ok_or_else(|| no_such(number))?;
            if !change(&mut job) {
                return Ok(job);
            }
            let put = notices.update(&notice.name, &text(&job), notice.revision).map_err(Error::Blob)?;
            if put.is_some() {
                return Ok(job);
            }
            // Wait for the other process's change to arrive.
            thread::sleep(BETWEEN_TRIES);
        }
        Err(too_busy())
    }

    /// Returns an error if this machine is a guest, which may only render.
    pub(crate) fn refuse_guests(&self) -> Result<(), Error> {
        if !self.uplink.is_guest() {
            return Ok(());
        }
        Err(Error::failed(
            "this machine is a guest: it may paint for the farm, but not steer it",
            "join by the other line that `bottega up` printed",
        ))
    }

    /// Writes a line into a job's log; on a guest, does nothing. Failures are only logged.
    pub fn log(&self, number: u32, line: &str) {
        if self.uplink.is_guest() {
            return;
        }
        let logged = self.change(number, |job| {
            job.say(line);
            true
        });
        if let Err(error) = logged {
            tracing::warn!(%error, line, "cannot write the log of the job");
        }
    }

    /// Returns the specification of a job.
    ///
    /// # Errors
    /// The farm does not answer, or has no readable specification of the job.
    pub fn spec(&self, job: &Job) -> Result<JobSpec, Error> {
        let bytes = self.uplink.blobs().get(&order_blob(job.origin), ORDER_BYTES_MAX).map_err(Error::Blob)?;
        bytes.and_then(|bytes| serde_json::from_slice(&bytes).ok()).ok_or_else(|| {
            Error::failed("the farm has lost the request of the job", "cancel the job, and submit it again")
        })
    }

    /// Returns the data that an engine shared about a job's picture, if any.
    pub(crate) fn learnt(&self, work: u64) -> Result<Option<Vec<u8>>, Error> {
        self.uplink.blobs().get(&learnt_blob(work), LEARNT_BYTES_MAX).map_err(Error::Blob)
    }

    /// Shares the data that an engine has learnt of a picture with the engines of other machines. Failures only cost time, so
    /// they are only logged.
    pub(crate) fn teach(&self, work: u64, bytes: &[u8]) {
        let name = learnt_blob(work);
        let is_stored = self.uplink.blobs().has(&name);
        let stored =
            is_stored.and_then(|is_stored| if is_stored { Ok(()) } else { self.uplink.blobs().put(&name, bytes) });
        if let Err(error) = stored {
            tracing::debug!(%error, "cannot share the data of the engine; other machines compute it themselves");
        }
    }

    /// Returns the importance map of a job's picture, as the bytes of a PNG file; `None`: its leader has not stored it.
    ///
    /// # Errors
    /// The farm does not answer, or the stored map is damaged.
    pub fn importance(&self, job: &Job) -> Result<Option<Vec<u8>>, Error> {
        self.uplink.blobs().get(&importance_blob(job.work), LEARNT_BYTES_MAX).map_err(Error::Blob)
    }

    /// Stores the importance map for observers. Failures are only logged.
    pub(crate) fn keep_importance(&self, work: u64, png: &[u8]) {
        if let Err(error) = self.uplink.blobs().put(&importance_blob(work), png) {
            tracing::debug!(%error, "cannot publish the importance map");
        }
    }

    /// Deletes the shared engine data of a finished picture.
    pub(crate) fn forget_learnt(&self, work: u64) {
        self.uplink.blobs().forget(&learnt_blob(work));
    }

    /// Stores the picture of a job: the bytes of the output file.
    ///
    /// # Errors
    /// The farm does not store the picture.
    pub fn keep_picture(&self, job: &Job, bytes: &[u8]) -> Result<(), Error> {
        self.uplink.blobs().put(&picture_blob(job.origin), bytes).map_err(Error::Blob)
    }

    /// Returns the picture of a job, as the bytes of its file; while the job is rendered again, that of the previous painting.
    /// `None`: the farm does not have it.
    ///
    /// # Errors
    /// The farm does not answer, or the stored picture is damaged or larger than 4 GiB.
    pub fn picture(&self, job: &Job) -> Result<Option<Vec<u8>>, Error> {
        self.uplink.blobs().get(&picture_blob(job.origin), PICTURE_BYTES_MAX).map_err(Error::Blob)
    }

    /// Returns true if a blob belongs to a job as a whole, not to one painting of it.
    pub(crate) fn is_of_all_paintings(job: &Job, name: &str) -> bool {
        name == order_blob(job.origin) || name == picture_blob(job.origin)
    }

    /// Returns the leader and progress of a job; its `leader` is `None` if no process leads it now. `None`: no process has
    /// led it yet, or its record cannot be read.
    pub fn lead(&self, number: u32) -> Option<Lead> {
        let notice = self.uplink.notices().get(&lead_name(number))?;
        let lead: Lead = read(&notice)?;
        let leader = lead.leader.filter(|_| notice.unchanged < LEADER_SILENT);
        Some(Lead { leader, ..lead })
    }

    /// Claims the lead of a job. Returns the lease; `None`: another process has the lead, or this machine is a guest.
    ///
    /// - `work`: the number of the job's painting.
    /// - `me`: the name of this process.
    ///
    /// # Errors
    /// The farm does not answer; whether it stored the claim is then unknown.
    pub fn claim(&self, number: u32, work: u64, me: &str) -> Result<Option<Lease>, Error> {
        if self.uplink.is_guest() {
            return Ok(None);
        }
        let notice = self.uplink.notices().get(&lead_name(number));
        let before: Lead = notice.as_ref().and_then(read).unwrap_or_default();
        let is_led = before.leader.as_ref().is_some_and(|leader| leader != me)
            && notice.as_ref().is_some_and(|notice| notice.unchanged < LEADER_SILENT);
        if is_led {
            return Ok(None);
        }
        let lead = Lead { leader: Some(me.to_owned()), ..before.of(work) };
        let revision = notice.map_or(0, |notice| notice.revision);
        let taken = self.uplink.notices().update(&lead_name(number), &text(&lead), revision).map_err(Error::Blob)?;
        Ok(taken.map(|revision| Lease { number, revision }))
    }

    /// Renews a lease, and publishes the progress `lead`. Returns false if another process has the lease now. While `lead` has no
    /// zones yet, the progress that the previous leader reported stays.
    ///
    /// # Errors
    /// The server does not confirm the renewal; whether it stored it is then unknown.
    pub fn renew(&self, lease: &mut Lease, lead: &Lead) -> Result<bool, BlobError> {
        let before = self.uplink.notices().get(&lead_name(lease.number));
        let lead = &lead.clone().or_as_before(before.as_ref().and_then(read));
        let put = self.uplink.notices().update(&lead_name(lease.number), &text(lead), lease.revision)?;
        match put {
            Some(revision) => lease.revision = revision,
            None => {
                // The write succeeded, but its confirmation was lost.
                let notice = self.uplink.notices().get(&lead_name(lease.number));
                let now: Option<Lead> = notice.as_ref().and_then(read);
                match (notice, now) {
                    (Some(notice), Some(now)) if now.leader == lead.leader => lease.revision = notice.revision,
                    _ => return Ok(false),
                }
            }
        }
        Ok(true)
    }

    /// Returns the processes that are present: those that have renewed their presence within 3 s, at most 64 of each machine.
    /// For 3 s after a connection, they include processes that stopped earlier: see [`Self::present`].
    pub fn presences(&self) -> Vec<Presence> {
        self.presences_with_revision().into_iter().map(|(presence, _)| presence).collect()
    }

    /// Returns the processes that are present, with the revision of each one's notice: see [`Self::presences`].
    pub(crate) fn presences_with_revision(&self) -> Vec<(Presence, u64)> {
        let notices = self.uplink.notices().all("presence/");
        let current = notices.iter().filter(|notice| notice.unchanged < PRESENCE_SILENT_AFTER);
        let read = current.filter_map(|notice| Some((read::<Presence>(notice)?, notice)));
        let mut processes_of: BTreeMap<String, usize> = BTreeMap::new();
        let own = read.filter(|(presence, notice)| {
            let of_member = processes_of.entry(machine_of(&presence.name).to_owned()).or_default();
            *of_member += 1;
            // A process may only announce itself, and a machine only so many processes.
            presence_name(&presence.name) == notice.name && *of_member <= PROCESSES_MAX
        });
        own.map(|(presence, notice)| (presence, notice.revision)).collect()
    }

    /// Announces that a process is present, or renews its presence. A failure is only logged.
    pub fn attend(&self, presence: &Presence) {
        if let Err(error) = self.uplink.notices().put(&presence_name(&presence.name), &text(presence)) {
            tracing::debug!(%error, "the farm does not answer");
        }
    }

    /// Removes the presence of a process and the command to it. A failure is only logged.
    ///
    /// - `name`: the name of the process.
    pub fn leave(&self, name: &str) {
        let order = order_name(name);
        let has_order = !self.uplink.is_guest() && self.uplink.notices().get(&order).is_some();
        for notice in has_order.then_some(order).into_iter().chain([presence_name(name)]) {
            if let Err(error) = self.uplink.notices().remove(&notice) {
                tracing::debug!(%error, "the farm does not answer");
            }
        }
    }

    /// Reads a notice, if it exists.
    pub(crate) fn read_notice<T: DeserializeOwned>(&self, name: &str) -> Option<T> {
        self.uplink.notices().get(name).and_then(|notice| read(&notice))
    }

    /// Writes a notice as JSON.
    pub(crate) fn put_notice(&self, name: &str, what: &impl Serialize) -> Result<(), Error> {
        self.uplink.notices().put(name, &text(what)).map(drop).map_err(Error::Blob)
    }
}

/// Returns the error of a job that failed or was cancelled; `None`: its state is another one.
pub(crate) fn ended_badly(number: u32, state: &JobState) -> Option<Error> {
    let remedy = format!("see `bottega jobs log {number}`");
    match state {
        JobState::Failed { reason } => Some(Error::failed(format!("job {number} failed: {reason}"), remedy)),
        JobState::Cancelled => Some(Error::failed(format!("job {number} was cancelled"), remedy)),
        JobState::Active | JobState::Paused | JobState::Done => None,
    }
}

fn read<T: DeserializeOwned>(notice: &Notice) -> Option<T> {
    serde_json::from_slice(&notice.text)
        .inspect_err(|error| tracing::warn!(%error, name = notice.name, "cannot read a notice"))
        .ok()
}

fn text(what: &impl Serialize) -> Vec<u8> {
    serde_json::to_vec(what).expect("structures of numbers and text can be written")
}

/// Returns the name of a job's notice.
pub(crate) fn job_name(number: u32) -> String {
    format!("job/{number}")
}

/// Returns the name of the notice of a job's lead.
pub(crate) fn lead_name(number: u32) -> String {
    format!("lead/{number}")
}

/// Returns the name of the notice of a process's presence; the server lets each member write only its own.
fn presence_name(process: &str) -> String {
    format!("presence/{}/{process}", machine_of(process))
}

/// Returns the name of the notice with the command to a machine.
pub(crate) fn order_name(machine: &str) -> String {
    format!("order/{machine}")
}

fn number_of(name: &str) -> Option<u32> {
    name.strip_prefix("job/")?.parse().ok()
}

fn order_blob(work: u64) -> String {
    format!("job-{work}/order")
}

fn learnt_blob(work: u64) -> String {
    format!("job-{work}/learnt")
}

fn importance_blob(work: u64) -> String {
    format!("job-{work}/importance")
}

fn picture_blob(work: u64) -> String {
    format!("job-{work}/picture")
}

/// Returns the error for a job number that does not exist.
pub(crate) fn no_such(number: u32) -> Error {
    Error::failed(format!("the farm has no job {number}"), "`bottega jobs list` lists its jobs")
}

fn too_busy() -> Error {
    Error::failed("too many changes of jobs at once", "try again")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_begins_to_lead_says_no_less_than_the_one_before() {
        let lead = |leader: &str, done, zones_done, zones| Lead {
            leader: Some(leader.to_owned()),
            work: 7,
            done,
            zones_done,
            zones,
            ..Lead::default()
        };
        let before = Some(lead("a", 0.5, 12, 24));
        assert_eq!(lead("b", 0.0, 0, 0).or_as_before(before.clone()), lead("b", 0.5, 12, 24));
        assert_eq!(lead("b", 0.4, 10, 25).or_as_before(before), lead("b", 0.4, 10, 25));
        assert_eq!(lead("b", 0.0, 0, 0).or_as_before(None), lead("b", 0.0, 0, 0));
    }

    #[test]
    fn a_restarted_painting_begins_without_progress() {
        let before =
            Lead { leader: Some("a".to_owned()), work: 7, done: 1.0, zones_done: 24, zones: 24, ..Lead::default() };
        let restarted = Lead { leader: Some("b".to_owned()), work: 8, ..Lead::default() };
        assert_eq!(restarted.clone().or_as_before(Some(before.clone())), restarted);
        assert_eq!(before.clone().of(7), before);
        assert_eq!(before.of(8), Lead { leader: Some("a".to_owned()), work: 8, ..Lead::default() });
    }
}
