//! Creation of the agents of a job.

use std::{
    hash::{BuildHasher, Hasher, RandomState},
    sync::Arc,
    thread,
};

use bottega_agents::{AgentId, LocalPlatform, driver::Performer};

use super::{
    job_agent::JobAgent,
    link::Link,
    settings::{JobError, JobSettings},
    shared::{End, FarmMailbox, Shared},
};
use crate::{
    Analyst, AnalystConfig, FarmAgent, GoalRules, Master, MasterConfig, MasterSource, PartitionSettings,
    RegistrationConfig, RenderAgent, RenderAgentConfig, Timing, WorkId, WorkRow, WorkSettings, ZoneRow,
    directory_services,
};

const WORK: WorkId = WorkId(1);
/// The number of agents for which a picture is divided if others may join.
const AGENTS_EXPECTED: usize = 8;

/// Creates all agents. Returns the Master's mailbox.
pub(super) fn populate(
    platform: &LocalPlatform<JobAgent>,
    settings: &JobSettings,
    work: WorkSettings,
    kept: Option<(WorkRow, Vec<ZoneRow>)>,
    shared: &Arc<Shared>,
) -> Result<FarmMailbox, JobError> {
    let add = |id: &AgentId, agent: FarmAgent| {
        let seen = JobAgent::new(agent, Arc::clone(shared) as _);
        platform.add(id, seen, performer(id, shared)).map_err(|taken| JobError::Abandoned { reason: taken.to_string() })
    };
    add_directories(platform, shared)?;
    // Determine the names of Master and Analyst
    let link = shared.link.as_ref();
    let here = link.map_or("bottega", |link| &link.name);
    let number = link.map_or(WORK, |link| link.work);
    let master = link.map_or_else(|| AgentId::new("master@bottega"), Link::master);
    let place = link.map_or_else(|| Some(RegistrationConfig::new(number, None)), Link::registration);
    let source = place.clone().map_or_else(|| MasterSource::Known(master.clone()), MasterSource::Directory);
    let analyst = agent_of(link, format!("analyst@{here}"));
    let timing = link.map_or_else(Timing::default, |_| Timing::AMONG_MACHINES);
    let JobSettings { auction, prefetch, shares_tail, .. } = *settings;
    let master_config = MasterConfig {
        id: master.clone(),
        work: number,
        auction,
        prefetch,
        shares_tail: shares_tail && link.is_some(),
        verify: settings.verify,
        compares_by_look: settings.strangers || !shared.engine.describe().exact_by_pixel,
        secret: secret(),
        credits: Arc::clone(&settings.credits),
        goals: GoalRules::default(),
        timing,
        registration: place.clone(),
    };
    // Resume the Master, or create it with an Analyst
    let mailbox = match kept {
        Some((work, rows)) => {
            let config = MasterConfig { work: work.work, ..master_config };
            add(&master, Master::recover(config, work, rows).into())?
        }
        None => {
            // The number of agents that will join is unknown; and each leader must cut the same zones.
            let agents = link.map_or(settings.agents, |_| AGENTS_EXPECTED);
            let usual = PartitionSettings::for_agents(settings.level, agents, work.frame);
            let config = AnalystConfig {
                id: analyst.clone(),
                master: master.clone(),
                work: number,
                settings: work,
                importance: settings.importance,
                partition: usual.within(settings.zones, settings.zone_limits),
                registration: place,
                knowledge: shared.knowledge.clone(),
                trusts_forecasts: settings.trusts_forecasts(),
            };
            add(&analyst, Analyst::new(config).into())?;
            add(&master, Master::new(master_config).into())?
        }
    };
    // Create the Render Agents
    add_render_agents(settings, &source, here, shared, &add)?;
    Ok(mailbox)
}

/// Returns an agent of this process, with its address if there is a link.
fn agent_of(link: Option<&Link>, name: String) -> AgentId {
    match link {
        Some(link) => link.agent(name),
        None => AgentId::new(name),
    }
}

/// Creates the directory services, which new agents ask first.
pub(super) fn add_directories(platform: &LocalPlatform<JobAgent>, shared: &Arc<Shared>) -> Result<(), JobError> {
    for (id, service) in directory_services(platform.calendar(), secret()) {
        let seen = JobAgent::new(service.into(), Arc::clone(shared) as _);
        let added = platform.add(&id, seen, Box::new(|_, _| {}));
        added.map_err(|taken| JobError::Abandoned { reason: taken.to_string() })?;
    }
    Ok(())
}

/// Returns an unpredictable number.
fn secret() -> u64 {
    // Seeded with random bytes of the operating system.
    RandomState::new().build_hasher().finish()
}

/// Creates the Render Agents of this process.
pub(super) fn add_render_agents(
    settings: &JobSettings,
    source: &MasterSource,
    here: &str,
    shared: &Arc<Shared>,
    add: &dyn Fn(&AgentId, FarmAgent) -> Result<FarmMailbox, JobError>,
) -> Result<(), JobError> {
    let engine = shared.engine.describe();
    for (i, expert) in (0..settings.agents).zip(settings.experts.iter().cycle()) {
        let id = agent_of(shared.link.as_ref(), format!("render-{}@{here}", i + 1));
        let agent = RenderAgent::new(RenderAgentConfig {
            id: id.clone(),
            master: source.clone(),
            adaptation: settings.adaptation,
            prefetch: settings.prefetch,
            auction: settings.auction,
            heartbeat: shared.link.as_ref().map_or_else(Timing::default, |_| Timing::AMONG_MACHINES).heartbeat,
            expert: expert
                .clone()
                .for_engine(&engine)
                .choosing(settings.engine_choice.clone())
                .with_bands(settings.bands),
            knowledge: shared.knowledge.clone(),
        });
        add(&id, agent.into())?;
    }
    Ok(())
}

/// Returns the performer of an agent's effects. If an agent panics, or the Master ends before the job, the job is abandoned.
fn performer(id: &AgentId, shared: &Arc<Shared>) -> Performer<JobAgent> {
    struct Notice(Arc<Shared>, bool);
    impl Drop for Notice {
        fn drop(&mut self) {
            if self.1 || thread::panicking() {
                self.0.end(End::Abandoned("an agent of the farm ended before the work".to_owned()));
            }
        }
    }
    let notice = Notice(Arc::clone(shared), id.name.starts_with("master@"));
    Box::new(move |effect, mailbox| notice.0.perform(effect, mailbox))
}
