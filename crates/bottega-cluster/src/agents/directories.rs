//! The white and yellow pages of a farm: the registered agents of jobs, commands to them through the AMS, and removal of
//! those whose process or job is gone.
//!
//! Agents register and deregister themselves; those of a killed process cannot deregister.

use std::{
    collections::{BTreeMap, BTreeSet},
    time::Duration,
};

use bottega_agents::{
    AgentId,
    driver::{
        ams_client::ask_ams,
        nats::{AgentPage, NoticePages},
    },
    platform::{
        AmsAgentDescription, DfAgentDescription, FailureReason, Function, LifeCycleState, ManagementContent,
        read_white_page, read_yellow_page,
    },
    sl::Term,
};
use bottega_farm::JOB_OWNERSHIP;
use serde::Serialize;

use crate::{
    agents::platform::NAME,
    error::Error,
    job::{
        board::{JobBoard, PRESENCE_SILENT_AFTER},
        record::JobState,
    },
};

/// The time for which a deregistered entry stays, so that others can see that it is gone.
const EMPTY_KEPT: Duration = Duration::from_secs(60);
/// Prefix of the pages of all platforms.
const PAGES: &str = "page/";

/// An agent of a job, as registered in the directories of the farm.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct JobAgent {
    /// The name of the agent.
    pub agent: String,
    /// The agent's life cycle state, in FIPA's words; `unknown` if the white pages do not name the agent.
    pub state: &'static str,
    /// The types of the agent's services, in FIPA's sense.
    pub services: Vec<String>,
    /// The agent's transport addresses.
    pub addresses: Vec<String>,
}

/// A life cycle command to an agent that paints.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AgentOrder {
    /// The agent must return its zones and wait.
    Suspend,
    /// The agent must continue to paint.
    Resume,
    /// The agent must finish and deregister.
    Quit,
}

impl JobBoard {
    /// Returns the registered agents of a job, with their services; none if the job has none.
    ///
    /// - `number`: the number of the job.
    pub fn job_agents(&self, number: u32) -> Vec<JobAgent> {
        let mut white: BTreeMap<String, AmsAgentDescription> = BTreeMap::new();
        let mut yellow: Vec<(String, DfAgentDescription)> = Vec::new();
        for page in AgentPage::all(self.uplink.notices(), NAME) {
            let text = std::str::from_utf8(&page.notice.text).unwrap_or_default();
            if let Some(offer) = read_yellow_page(text) {
                yellow.push((page.agent, offer));
            } else if let Some(agent) = read_white_page(text) {
                white.insert(page.agent, agent);
            }
        }
        let job = Term::Bare(number.to_string());
        let is_of_job = |offer: &DfAgentDescription| {
            let is_job = offer.services.iter().any(|service| service.property("job") == Some(&job));
            is_job && offer.services.iter().any(|service| service.ownership.as_deref() == Some(JOB_OWNERSHIP))
        };
        let agents = yellow.into_iter().filter(|(_, offer)| is_of_job(offer)).map(|(index, offer)| {
            let state = white.get(&index).and_then(|agent| agent.state);
            let name = offer.name.unwrap_or_else(|| AgentId::new(index));
            JobAgent {
                agent: name.to_string(),
                state: state.map_or("unknown", LifeCycleState::word),
                services: offer.services.into_iter().filter_map(|service| service.service_type).collect(),
                addresses: name.addresses.to_vec(),
            }
        });
        agents.collect()
    }

    /// Sends a command to an agent through the AMS of the farm's platform. The process of the agent carries it out.
    ///
    /// - `agent`: the name of the agent.
    ///
    /// # Errors
    /// There is no such agent, its state does not allow the command, this machine is a guest, a thread cannot be started, or the
    /// farm does not store the command.
    pub fn steer_agent(&self, agent: &str, order: AgentOrder) -> Result<(), Error> {
        self.refuse_guests()?;
        let name = AgentId::new(agent);
        let state = |state| AmsAgentDescription { name: Some(name.clone()), ownership: None, state: Some(state) };
        let known = AgentPage::all(self.uplink.notices(), NAME)
            .into_iter()
            .filter(|page| page.agent == agent.to_lowercase())
            .find_map(|page| read_white_page(std::str::from_utf8(&page.notice.text).ok()?));
        // A modification replaces the whole entry: keep the ownership.
        let change =
            |to| AmsAgentDescription { ownership: known.clone().and_then(|agent| agent.ownership), ..state(to) };
        let function = match order {
            AgentOrder::Suspend => Function::ModifyAgent(change(LifeCycleState::Suspended)),
            AgentOrder::Resume => Function::ModifyAgent(change(LifeCycleState::Active)),
            AgentOrder::Quit => Function::TerminateAgent { agent: name.clone(), graceful: true },
        };
        let pages = Box::new(NoticePages::new(self.uplink.notices().clone(), NAME));
        let answer = ask_ams(pages, NAME, function).map_err(|error| {
            Error::failed(format!("cannot start a thread: {error}"), "let fewer programs run at once")
        })?;
        let see = "`bottega platform agents` lists the agents and their states";
        match answer {
            Some(ManagementContent::Done(..)) => Ok(()),
            Some(ManagementContent::Failed(_, FailureReason::NotRegistered)) => {
                Err(Error::failed(format!("there is no agent `{agent}` in the white pages"), see))
            }
            Some(ManagementContent::Refused(..)) => {
                let state = known.and_then(|agent| agent.state).map_or("unknown", LifeCycleState::word);
                Err(Error::failed(format!("`{agent}` is {state}: the command is impossible in this state"), see))
            }
            other => {
                tracing::debug!(?other, "the AMS");
                Err(Error::failed("the farm's server does not store it", "check whether it runs: bottega jobs list"))
            }
        }
    }

    /// Deregisters agents of jobs whose process or job is gone, and removes old deregistered entries of any platform.
    pub(crate) fn clear_pages(&self) {
        let taken_out = self.uplink.notices().all(PAGES).into_iter();
        for notice in taken_out.filter(|notice| notice.text.is_empty() && notice.unchanged > EMPTY_KEPT) {
            if let Err(error) = self.uplink.notices().remove(&notice.name) {
                tracing::debug!(%error, "cannot release a page");
            }
        }
        self.take_out_lost();
    }

    fn take_out_lost(&self) {
        let pages = AgentPage::all(self.uplink.notices(), NAME);
        if pages.is_empty() {
            return;
        }
        let present: BTreeSet<String> = self.presences().iter().map(|machine| machine.name.to_lowercase()).collect();
        let is_led = |number: u32| {
            let leader = self.lead(number).and_then(|lead| lead.leader);
            leader.is_some_and(|leader| present.contains(&leader.to_lowercase()))
        };
        let jobs = self.all().into_iter().filter(|(number, job)| job.state == JobState::Active && is_led(*number));
        let masters: BTreeSet<String> = jobs.map(|(_, job)| format!("work-{}", job.work)).collect();
        let is_lost = |page: &&AgentPage| {
            let place = page.agent.rsplit_once('@').map_or("", |(_, place)| place);
            let is_there = place == NAME || present.contains(place) || masters.contains(place);
            !page.is_empty() && page.notice.unchanged > PRESENCE_SILENT_AFTER && !is_there
        };
        // A command may have dropped the ownership from one of an agent's entries: one that still has it is enough.
        let lost: BTreeSet<&str> =
            pages.iter().filter(is_lost).filter(|page| is_of_job(page)).map(|page| &*page.agent).collect();
        let notices = self.uplink.notices();
        for page in pages.iter().filter(is_lost).filter(|page| lost.contains(&*page.agent)) {
            if let Err(error) = notices.update(&page.notice.name, b"", page.notice.revision) {
                tracing::debug!(%error, "cannot remove a page");
            }
        }
    }
}

/// Returns true if the entry belongs to an agent of a job, not to one of the platform or of another platform.
fn is_of_job(page: &AgentPage) -> bool {
    let text = std::str::from_utf8(&page.notice.text).unwrap_or_default();
    let is_ours = |ownership: Option<&str>| ownership == Some(JOB_OWNERSHIP);
    match read_yellow_page(text) {
        Some(offer) => offer.services.iter().any(|service| is_ours(service.ownership.as_deref())),
        None => read_white_page(text).is_some_and(|agent| is_ours(agent.ownership.as_deref())),
    }
}
