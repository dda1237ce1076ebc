//! Agents of other platforms that paint zones of a picture, with any engine, by an open ontology.
//!
//! A thread watches the jobs. For each job that admits such agents, it registers the Master in the directories (a
//! [door](door)), and offers the files of the scene for download. Messages of an agent go through the door to a [`Visitor`]
//! in the farm, which takes part like our own agents.

mod desk;
mod door;
mod messages;
mod ontology;
#[cfg(test)]
mod tests;

use std::{
    collections::BTreeMap,
    path::Path,
    sync::{
        Arc, Mutex, PoisonError,
        atomic::{AtomicBool, Ordering},
    },
    thread::{self, JoinHandle},
    time::Duration,
};

use bottega::request::WordChoice;
use bottega_agents::{
    AgentId, LocalPlatform, Mailbox,
    driver::{
        nats::NatsUplink,
        node::{Node, Reports},
    },
    machine_of,
};
use bottega_farm::{Expert, FarmCodec, Link, Timing, Visitor, VisitorConfig, VisitorReport, WorkId};

use self::{
    desk::{Desk, ExpectedDelivery},
    door::{DoorConfig, DoorEffect, DoorReport, MasterDoor},
    ontology::{Applicant, Model, ModelFile},
};
use crate::{
    error::Error,
    files::cache::Cache,
    job::{
        board::JobBoard,
        record::{Job, JobSpec, JobState},
        transport::job_link,
    },
    names::fresh_number,
};

/// Interval between checks of the jobs.
const LOOK_EVERY: Duration = Duration::from_millis(250);

/// Admits agents of other platforms to the jobs of a farm, until it is dropped.
pub(super) struct Strangers {
    over: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

/// The farm and the platform whose jobs admit agents.
pub(super) struct StrangersConfig {
    pub(super) node: Arc<Node>,
    pub(super) board: JobBoard,
    /// The name of the platform.
    pub(super) platform: String,
    /// The scene cache of this machine.
    pub(super) cache: Cache,
}

impl Strangers {
    /// Starts watching the jobs.
    ///
    /// # Errors
    /// There is no free port, or a thread cannot be started.
    pub(super) fn begin(around: StrangersConfig) -> Result<Self, Error> {
        let address = around.node.address();
        let host = address.trim_start_matches("http://").split('/').next().unwrap_or_default();
        let host = host.rsplit_once(':').map_or(host, |(host, _)| host);
        let desk = Desk::open(around.node.local_address(), host).map_err(|error| {
            Error::failed(format!("strangers have nowhere to deliver: {error}"), "let fewer programs run at once")
        })?;
        let over = Arc::new(AtomicBool::new(false));
        let (watch, ends) = (JobWatch { around, desk, doors: BTreeMap::new() }, Arc::clone(&over));
        let thread = thread::Builder::new().name("strangers".to_owned()).spawn(move || watch.run(&ends));
        let thread = thread.map_err(|error| {
            Error::failed(format!("cannot start a thread: {error}"), "let fewer programs run at once")
        })?;
        Ok(Self { over, thread: Some(thread) })
    }
}

impl Drop for Strangers {
    fn drop(&mut self) {
        self.over.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            // The thread has reported a panic itself.
            _ = thread.join();
        }
    }
}

/// The door of a job.
struct OpenDoor {
    reports: Reports<DoorReport>,
    /// The name under which its scene is offered.
    model: String,
}

struct JobWatch {
    around: StrangersConfig,
    desk: Desk,
    /// The doors by work; `None`: the job admits no agents of other platforms, or its scene cannot be fetched.
    doors: BTreeMap<u64, Option<OpenDoor>>,
}

impl JobWatch {
    fn run(mut self, over: &AtomicBool) {
        while !over.load(Ordering::Relaxed) {
            self.look();
            thread::sleep(LOOK_EVERY);
        }
        for door in std::mem::take(&mut self.doors).into_values().flatten() {
            self.close(&door, Some("the platform ends"));
        }
    }

    fn look(&mut self) {
        let jobs = self.around.board.all();
        let state = |work: u64| jobs.iter().find(|(_, job)| job.work == work).map(|(_, job)| &job.state);
        // Agents of a paused job wait until it is resumed.
        let is_over = |work: u64| state(work).is_none_or(JobState::is_over);
        let over: Vec<u64> = self.doors.keys().copied().filter(|&work| is_over(work)).collect();
        for work in over {
            if let Some(door) = self.doors.remove(&work).flatten() {
                let is_painted = state(work) == Some(&JobState::Done);
                self.close(&door, (!is_painted).then(|| state(work).map_or("removed", JobState::word)));
            }
        }
        for (number, job) in jobs.iter().filter(|(_, job)| job.state == JobState::Active) {
            if self.doors.contains_key(&job.work) {
                continue;
            }
            match self.open(*number, job) {
                Ok(door) => _ = self.doors.insert(job.work, door),
                // The server may be down for a while.
                Err(error) if error.may_pass() => {}
                Err(error) => {
                    self.around.board.log(*number, &format!("strangers cannot be admitted: {}", error.error_chain()));
                    self.doors.insert(job.work, None);
                }
            }
        }
    }

    /// Closes a door.
    ///
    /// - `why`: the reason if the picture is not finished.
    fn close(&self, door: &OpenDoor, why: Option<&'static str>) {
        door.reports.tell(DoorReport::Over { why });
        self.desk.take_away(&door.model);
    }

    /// Opens the door of a job, if it admits agents of other platforms.
    fn open(&self, number: u32, job: &Job) -> Result<Option<OpenDoor>, Error> {
        let StrangersConfig { node, board, platform, cache } = &self.around;
        let spec = board.spec(job)?;
        if !spec.request.farm.strangers {
            return Ok(None);
        }
        let name = format!("{:016x}{:016x}", fresh_number(), fresh_number());
        let files = self.put_out(&spec, &name, cache)?;
        let request = &spec.request;
        let filter = request.film.filter.map(|filter| filter.word().to_owned());
        let model = Model { number, seed: request.seed, camera: request.view.camera.clone(), filter, files };
        let id = AgentId::new(format!("master-{number}@{platform}"));
        let id = AgentId { addresses: Arc::new([node.address().to_owned()]), ..id };
        let secret = fresh_number();
        let door = MasterDoor::new(DoorConfig {
            id: id.clone(),
            df: node.df().clone(),
            model,
            deliver: self.desk.results(),
            secret,
        });
        let bridge = Arc::new(Bridge::begin(&board.uplink, WorkId(job.work), number, self.desk.clone())?);
        let performer = Arc::clone(&bridge);
        let reports = node.add_worldly(&id, door, move |effect| performer.perform(effect));
        let reports =
            reports.map_err(|taken| Error::failed(taken.to_string(), "restart the farm's platform: `bottega up`"))?;
        bridge.tells(reports.clone());
        board.log(number, &format!("agents of other platforms may take part: {id} at {}", node.address()));
        Ok(Some(OpenDoor { reports, model: name }))
    }

    /// Offers the files of a scene for download.
    fn put_out(&self, spec: &JobSpec, name: &str, cache: &Cache) -> Result<Vec<ModelFile>, Error> {
        let (scene, _) = spec.files.fetch(cache, self.around.board.uplink.blobs())?;
        let folder = scene.parent().unwrap_or(Path::new("."));
        let files: Vec<_> = spec.files.names().map(|name| (name.to_owned(), folder.join(name))).collect();
        let urls = self.desk.put_out(name, files.iter().map(|(_, path)| path.clone()).collect());
        let file = |((name, path), at): ((String, std::path::PathBuf), String)| {
            let bytes = std::fs::metadata(&path).map_err(|source| Error::read(path, source))?.len();
            Ok(ModelFile { name, bytes, at })
        };
        files.into_iter().zip(urls).map(file).collect()
    }
}

/// The connection between the door of a job and its visitors in the farm.
struct Bridge {
    platform: LocalPlatform<Visitor>,
    visitors: Mutex<BTreeMap<String, Mailbox<Visitor>>>,
    reports: Arc<Mutex<Option<Reports<DoorReport>>>>,
    link: Link,
    desk: Desk,
}

impl Bridge {
    fn begin(uplink: &Arc<NatsUplink<FarmCodec>>, work: WorkId, job: u32, desk: Desk) -> Result<Self, Error> {
        let platform = LocalPlatform::linked(1, Some(Arc::clone(uplink) as _)).map_err(|error| {
            Error::failed(format!("cannot start a thread: {error}"), "let fewer programs run at once")
        })?;
        let link = job_link(Arc::clone(uplink), work, Some(job), String::new());
        Ok(Self { platform, visitors: Mutex::default(), reports: Arc::default(), link, desk })
    }

    /// Sets where the door receives its reports.
    fn tells(&self, reports: Reports<DoorReport>) {
        *self.reports.lock().unwrap_or_else(PoisonError::into_inner) = Some(reports);
    }

    fn perform(&self, effect: DoorEffect) {
        match effect {
            DoorEffect::Admit { agent, applicant } => self.admit(&agent, applicant),
            DoorEffect::Tell { agent, report } => self.tell(&agent, report),
            DoorEffect::Expect { key, order } => {
                let reports = self.reports.lock().unwrap_or_else(PoisonError::into_inner).clone();
                let (Some(reports), name) = (reports, key.clone()) else { return };
                let on_stored = move |result| reports.tell(DoorReport::Delivered { key: name.clone(), result });
                self.desk
                    .expect(key, ExpectedDelivery { order, link: self.link.clone(), on_stored: Arc::new(on_stored) });
            }
            DoorEffect::Forget { key } => self.desk.forget(&key),
        }
    }

    fn tell(&self, agent: &str, report: VisitorReport) {
        let visitors = self.visitors.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(mailbox) = visitors.get(agent) {
            mailbox.complete(report);
        }
    }

    /// Lets an agent take part: a returning one is the same agent to the Master.
    fn admit(&self, agent: &str, applicant: Applicant) {
        let mut visitors = self.visitors.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(mailbox) = visitors.get(agent) {
            return mailbox.complete(VisitorReport::Returns);
        }
        let id = AgentId::new(visitor_name(agent));
        let visitor = Visitor::new(VisitorConfig {
            id: id.clone(),
            master: self.link.master(),
            power: applicant.power,
            lanes: applicant.lanes,
            adaptation: Default::default(),
            expert: Expert::path_tracing(),
            timing: Timing::AMONG_MACHINES,
        });
        let (name, reports) = (agent.to_owned(), Arc::clone(&self.reports));
        let performer = move |effect, _: &Mailbox<Visitor>| {
            let reports = reports.lock().unwrap_or_else(PoisonError::into_inner);
            if let Some(reports) = &*reports {
                reports.tell(DoorReport::Visitor { agent: name.clone(), effect });
            }
        };
        match self.platform.add(&id, visitor, Box::new(performer)) {
            Ok(mailbox) => _ = visitors.insert(agent.to_owned(), mailbox),
            Err(error) => tracing::warn!(%error, "a stranger was not admitted"),
        }
    }
}

/// Returns the name of an agent in the farm: its platform counts as its machine, which cannot be one of ours.
fn visitor_name(agent: &str) -> String {
    let (local, platform) = agent.rsplit_once('@').unwrap_or((agent, "nowhere"));
    let plain = |text: &str| -> String {
        text.chars()
            .map(|letter| if letter.is_ascii_alphanumeric() || "-_".contains(letter) { letter } else { '-' })
            .take(64)
            .collect()
    };
    let name = format!("{}@stranger-{}", plain(local), plain(platform));
    debug_assert!(machine_of(&name).starts_with("stranger-"));
    name
}
