//! The jobs of a farm as its notices have them, and who leads each.
//!
//! - `job/N`: the job; changed by compare-and-set, so that no change is lost.
//! - `lead/N`: who leads it, and how far its painting is. The leader renews it; if it does not, the first process that asks takes the lead.
//! - `page/PLATFORM/…`: the white and yellow pages: see [`directories`](crate::directories).
//! - `seat/MEMBER/NAME`: a machine that is there, and what it paints; what it is told: see [`machine`](crate::machine).

use std::{collections::BTreeMap, sync::Arc, thread, time::Duration};

use bottega_agents::driver::nats::{BlobError, NatsUplink, Notice};
use bottega_agents::machine_of;
use bottega_farm::{FarmCodec, WorkId};
use serde::{Deserialize, Serialize, de::DeserializeOwned};

pub use crate::presence::Presence;
use crate::{
    error::Error,
    job::{Job, JobSpec, JobState},
    transport::job_link,
};

/// How often those who hold something say so.
pub(crate) const RENEW_EVERY: Duration = Duration::from_millis(500);
/// Who has not led for so long has gone.
const LEADER_SILENT: Duration = Duration::from_millis(2500);
/// Who has not sat for so long has gone.
pub(crate) const SEAT_EMPTY: Duration = Duration::from_secs(3);
/// Processes of one machine at most.
const SEATS_MAX: usize = 64;
/// The largest list of files, and the largest picture.
const ORDER_BYTES_MAX: usize = 1 << 28;
const PICTURE_BYTES_MAX: usize = 1 << 32;
/// The most that an engine learns of a picture.
const LEARNT_BYTES_MAX: usize = 1 << 28;
/// How often a change is tried that others keep coming before.
const TRIES_MAX: u32 = 100;
const BETWEEN_TRIES: Duration = Duration::from_millis(20);

/// The leader of a job, and its progress.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Lead {
    /// The process; `None`: it has laid it down.
    pub leader: Option<String>,
    /// The number of the painting of which it says how far it is.
    #[serde(default)]
    pub work: u64,
    /// Predicted share of all cost that is done, 0..=1.
    pub done: f64,
    /// Zones painted.
    pub zones_done: usize,
    /// All zones.
    pub zones: usize,
    /// Seconds that are left, as far as that is known.
    #[serde(default)]
    pub seconds_left: Option<f64>,
    /// Whether there is something to see of it.
    #[serde(default)]
    pub seen: bool,
    /// Whether its zones wait for more machines than there are, to compare what these paint.
    #[serde(default)]
    pub lacks_machines: bool,
}

impl Lead {
    /// How far the painting is, by the one who leads it; one who has no zones yet cannot tell.
    fn or_as_before(self, before: Option<Self>) -> Self {
        match before {
            Some(before) if self.zones == 0 && self.work == before.work => {
                Self { leader: self.leader, seen: self.seen || before.seen, ..before }
            }
            _ => self,
        }
    }

    /// How far this painting of a job is: nothing is known of it where somebody leads, or led, another one.
    pub(crate) fn of(self, work: u64) -> Self {
        if self.work == work { self } else { Self { leader: self.leader, work, ..Self::default() } }
    }
}

/// The right to lead a job: one process has it.
#[derive(Debug)]
pub struct Lease {
    number: u32,
    revision: u64,
}

/// The jobs of a farm.
#[derive(Clone)]
pub struct JobBoard {
    /// The link to the farm.
    pub uplink: Arc<NatsUplink<FarmCodec>>,
}

impl JobBoard {
    /// Keeps a job. Returns its number.
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

    /// The first number that no job has or had: the last ones may have been removed.
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

    /// Lets go of the rows and pixels of a job's zones.
    pub(crate) fn forget_zones(&self, work: u64) {
        job_link(Arc::clone(&self.uplink), WorkId(work), None, String::new()).forget();
    }

    /// All jobs, by number.
    pub fn all(&self) -> Vec<(u32, Job)> {
        let notices = self.uplink.notices().all("job/");
        let read = notices.iter().filter_map(|notice| Some((number_of(&notice.name)?, read(notice)?)));
        let mut all: Vec<(u32, Job)> = read.collect();
        all.sort_by_key(|(number, _)| *number);
        all
    }

    /// A job; `None`: there is none of that number.
    pub fn get(&self, number: u32) -> Option<Job> {
        self.uplink.notices().get(&job_name(number)).and_then(|notice| read(&notice))
    }

    /// Changes a job, whoever else does so at the same time; not at all where `change` says `false`. Returns it as it is
    /// then.
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
            // The other's change is on its way.
            thread::sleep(BETWEEN_TRIES);
        }
        Err(too_busy())
    }

    /// Who may only paint may not do anything else.
    pub(crate) fn refuse_guests(&self) -> Result<(), Error> {
        if !self.uplink.is_guest() {
            return Ok(());
        }
        Err(Error::failed(
            "this machine may paint for the farm, and not steer it",
            "join by the other line that `bottega up` printed",
        ))
    }

    /// Writes a line into a job's log. That it could not be written stops nobody.
    pub fn log(&self, number: u32, line: &str) {
        if self.uplink.is_guest() {
            return;
        }
        let said = self.change(number, |job| {
            job.say(line);
            true
        });
        if let Err(error) = said {
            tracing::warn!(%error, line, "the log of the job was not written");
        }
    }

    /// What a job asks for.
    pub fn spec(&self, job: &Job) -> Result<JobSpec, Error> {
        let bytes = self.uplink.blobs().get(&order_blob(job.origin), ORDER_BYTES_MAX).map_err(Error::Blob)?;
        bytes
            .and_then(|bytes| serde_json::from_slice(&bytes).ok())
            .ok_or_else(|| Error::failed("the farm does not know what the job asks for", "call it off, and ask again"))
    }

    /// What an engine has learnt of a job's picture, if one has told.
    pub(crate) fn learnt(&self, work: u64) -> Result<Option<Vec<u8>>, Error> {
        self.uplink.blobs().get(&learnt_blob(work), LEARNT_BYTES_MAX).map_err(Error::Blob)
    }

    /// Tells other engines. That it could not be told costs time and nothing else.
    pub(crate) fn teach(&self, work: u64, bytes: &[u8]) {
        let name = learnt_blob(work);
        let is_told = self.uplink.blobs().has(&name);
        let told = is_told.and_then(|is_told| if is_told { Ok(()) } else { self.uplink.blobs().put(&name, bytes) });
        if let Err(error) = told {
            tracing::debug!(%error, "others will learn themselves");
        }
    }

    /// The importance map of a job's picture as a PNG file, if its leader has told.
    ///
    /// # Errors
    /// The farm does not answer.
    pub fn importance(&self, job: &Job) -> Result<Option<Vec<u8>>, Error> {
        self.uplink.blobs().get(&importance_blob(job.work), LEARNT_BYTES_MAX).map_err(Error::Blob)
    }

    /// Keeps the importance map for those who look on. That it could not be kept spoils no picture.
    pub(crate) fn keep_importance(&self, work: u64, png: &[u8]) {
        if let Err(error) = self.uplink.blobs().put(&importance_blob(work), png) {
            tracing::debug!(%error, "nobody sees the importance map");
        }
    }

    /// The picture is painted: nobody need learn anything of it any more.
    pub(crate) fn forget_learnt(&self, work: u64) {
        self.uplink.blobs().forget(&learnt_blob(work));
    }

    /// Keeps the picture of a job: the bytes of the file that was asked for.
    pub fn keep_picture(&self, job: &Job, bytes: &[u8]) -> Result<(), Error> {
        self.uplink.blobs().put(&picture_blob(job.origin), bytes).map_err(Error::Blob)
    }

    /// The picture of a job, if the farm has it: while it is painted again, that of the painting before.
    pub fn picture(&self, job: &Job) -> Result<Option<Vec<u8>>, Error> {
        self.uplink.blobs().get(&picture_blob(job.origin), PICTURE_BYTES_MAX).map_err(Error::Blob)
    }

    /// Whether a blob is kept for a job and not for one painting of it.
    pub(crate) fn is_of_all_paintings(job: &Job, name: &str) -> bool {
        name == order_blob(job.origin) || name == picture_blob(job.origin)
    }

    /// Who leads a job now, and how far it is.
    pub fn lead(&self, number: u32) -> Option<Lead> {
        let notice = self.uplink.notices().get(&lead_name(number))?;
        let lead: Lead = read(&notice)?;
        let leader = lead.leader.filter(|_| notice.unchanged < LEADER_SILENT);
        Some(Lead { leader, ..lead })
    }

    /// Takes the lead of a job, if nobody has it. `None`: somebody has.
    ///
    /// - `work`: the number of its painting.
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

    /// Renews a lease. `false`: somebody else has it now. Who does not know yet how far the job is leaves what the one before
    /// has told.
    ///
    /// # Errors
    /// The server does not say.
    pub fn renew(&self, lease: &mut Lease, lead: &Lead) -> Result<bool, BlobError> {
        let before = self.uplink.notices().get(&lead_name(lease.number));
        let lead = &lead.clone().or_as_before(before.as_ref().and_then(read));
        let put = self.uplink.notices().update(&lead_name(lease.number), &text(lead), lease.revision)?;
        match put {
            Some(revision) => lease.revision = revision,
            None => {
                // It was ours, and the word that it was written got lost.
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

    /// Machines that are there.
    pub fn presences(&self) -> Vec<Presence> {
        self.seated().into_iter().map(|(seat, _)| seat).collect()
    }

    /// The same, with the number of each seat's last writing.
    pub(crate) fn seated(&self) -> Vec<(Presence, u64)> {
        let notices = self.uplink.notices().all("seat/");
        let sat_on = notices.iter().filter(|notice| notice.unchanged < SEAT_EMPTY);
        let read = sat_on.filter_map(|notice| Some((read::<Presence>(notice)?, notice)));
        let mut seats_of: BTreeMap<String, usize> = BTreeMap::new();
        let own = read.filter(|(seat, notice)| {
            let of_member = seats_of.entry(machine_of(&seat.name).to_owned()).or_default();
            *of_member += 1;
            // Nobody sits on the seat of another, or on too many.
            seat_name(&seat.name) == notice.name && *of_member <= SEATS_MAX
        });
        own.map(|(seat, notice)| (seat, notice.revision)).collect()
    }

    /// Says that a machine is there.
    pub fn attend(&self, seat: &Presence) {
        if let Err(error) = self.uplink.notices().put(&seat_name(&seat.name), &text(seat)) {
            tracing::debug!(%error, "the farm does not answer");
        }
    }

    /// Says that it has gone.
    pub fn leave(&self, name: &str) {
        let order = order_name(name);
        let is_told = !self.uplink.is_guest() && self.uplink.notices().get(&order).is_some();
        for notice in is_told.then_some(order).into_iter().chain([seat_name(name)]) {
            if let Err(error) = self.uplink.notices().remove(&notice) {
                tracing::debug!(%error, "the farm does not answer");
            }
        }
    }

    /// What a notice says, if there is one.
    pub(crate) fn read_notice<T: DeserializeOwned>(&self, name: &str) -> Option<T> {
        self.uplink.notices().get(name).and_then(|notice| read(&notice))
    }

    pub(crate) fn put_notice(&self, name: &str, what: &impl Serialize) -> Result<(), Error> {
        self.uplink.notices().put(name, &text(what)).map(drop).map_err(Error::Blob)
    }
}

/// How it ends where somebody called a job off, or it cannot be painted.
pub fn ended_badly(number: u32, state: &JobState) -> Option<Error> {
    let remedy = format!("see `bottega jobs log {number}`");
    match state {
        JobState::Failed { reason } => Some(Error::failed(format!("job {number} failed: {reason}"), remedy)),
        JobState::Cancelled => Some(Error::failed(format!("job {number} was called off"), remedy)),
        JobState::Active | JobState::Paused | JobState::Done => None,
    }
}

fn read<T: DeserializeOwned>(notice: &Notice) -> Option<T> {
    serde_json::from_slice(&notice.text)
        .inspect_err(|error| tracing::warn!(%error, name = notice.name, "a notice that cannot be read"))
        .ok()
}

fn text(what: &impl Serialize) -> Vec<u8> {
    serde_json::to_vec(what).expect("structures of numbers and text can be written")
}

pub(crate) fn job_name(number: u32) -> String {
    format!("job/{number}")
}

pub(crate) fn lead_name(number: u32) -> String {
    format!("lead/{number}")
}

/// A machine may say of itself alone that it is there.
fn seat_name(process: &str) -> String {
    format!("seat/{}/{process}", machine_of(process))
}

/// The notice of what a machine is told.
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

pub(crate) fn no_such(number: u32) -> Error {
    Error::failed(format!("the farm has no job {number}"), "`bottega jobs list` shows those that it has")
}

fn too_busy() -> Error {
    Error::failed("too many change the jobs of the farm at once", "try again")
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
    fn a_painting_that_begins_anew_is_not_as_far_as_the_one_before() {
        let before =
            Lead { leader: Some("a".to_owned()), work: 7, done: 1.0, zones_done: 24, zones: 24, ..Lead::default() };
        let anew = Lead { leader: Some("b".to_owned()), work: 8, ..Lead::default() };
        assert_eq!(anew.clone().or_as_before(Some(before.clone())), anew);
        assert_eq!(before.clone().of(7), before);
        assert_eq!(before.of(8), Lead { leader: Some("a".to_owned()), work: 8, ..Lead::default() });
    }
}
