//! Render Agents of this process for a work whose Master runs elsewhere.

use std::{collections::BTreeMap, sync::Arc, thread};

use bottega_agents::{AgentId, Bus, LocalBus, LocalPlatform, Performative, driver::Performer};
use bottega_engines::RenderEngine;

use super::{
    composer::Composer,
    job_agent::JobAgent,
    link::Link,
    observer::Observer,
    populate::{add_directories, add_render_agents},
    settings::{JobError, JobSettings},
    shared::{End, Shared},
    stop::StopSwitch,
};
use crate::{FarmAgent, FarmContent, MasterSource, contents::message, protocol};

/// Renders for a work until its Master dismisses the agents of this process, or until `stop` is requested. Returns
/// `true` if the work has ended, `false` if it was stopped before.
///
/// - `settings`: those of the work, except for `agents`, `processors` and `experts`, which are this machine's.
///
/// # Errors
/// The settings are invalid, the engine cannot be prepared, the Master has excluded all agents of this process, an
/// agent of this process ends before the work, or a thread cannot be started.
pub fn assist(
    settings: &JobSettings,
    engine: Arc<dyn RenderEngine>,
    observer: Arc<dyn Observer>,
    stop: &StopSwitch,
    link: Link,
) -> Result<bool, JobError> {
    settings.work()?;
    let (here, master, place) = (link.name.clone(), link.master(), link.registration());
    let source = place.map_or_else(|| MasterSource::Known(master.clone()), MasterSource::Directory);
    let composer = Composer::new(settings, BTreeMap::new(), None);
    let shared = Arc::new(Shared::new(settings, composer, engine, observer, stop, Some(link)));
    let uplink = shared.uplink()?;
    let platform = LocalPlatform::linked(1, uplink.clone().map(|uplink| uplink as _))?;
    let bus = platform.bus();
    let add = |id: &AgentId, agent: FarmAgent| {
        let seen = JobAgent::new(agent, Arc::clone(&shared) as _);
        let performer = last_of(&shared);
        platform.add(id, seen, performer).map_err(|taken| JobError::Abandoned { reason: taken.to_string() })
    };
    add_directories(&platform, &shared)?;
    add_render_agents(settings, &source, &here, &shared, &add)?;
    let on_stop = Arc::downgrade(&shared);
    stop.when_requested(move || {
        if let Some(shared) = on_stop.upgrade() {
            shared.cancel_orders();
        }
    });
    let end = shared.wait(|| None);
    stop.forget();
    if stop.is_requested() {
        leave(bus, settings.agents, &here, &master);
    }
    platform.stop();
    if let Some(uplink) = uplink {
        uplink.close();
    }
    if let Some(link) = &shared.link {
        link.transport.flush();
    }
    match end {
        Some(End::Abandoned(reason)) if !stop.is_requested() => Err(JobError::Abandoned { reason }),
        Some(End::LeftOut(reason)) if !stop.is_requested() => Err(JobError::LeftOut { reason }),
        end => Ok(end.is_some()),
    }
}

/// Unsubscribes the agents, so that their zones are reassigned at once.
fn leave(mut bus: LocalBus<JobAgent>, agents: usize, here: &str, master: &AgentId) {
    for i in 0..agents {
        let id = AgentId::new(format!("render-{}@{here}", i + 1));
        let to = vec![master.clone()];
        bus.publish(message(Performative::Cancel, protocol::SUBSCRIBE, &id, to, FarmContent::Unsubscription));
    }
}

/// Returns the performer of an agent's effects. When all agents are gone, the work is over here.
fn last_of(shared: &Arc<Shared>) -> Performer<JobAgent> {
    struct Present(Arc<Shared>);
    impl Drop for Present {
        fn drop(&mut self) {
            let left = {
                let mut state = self.0.state();
                state.present -= 1;
                state.present
            };
            if thread::panicking() {
                self.0.end(End::Abandoned("an agent of the farm ended before the work".to_owned()));
            } else if left == 0 {
                self.0.end(End::Finished(Vec::new()));
            }
        }
    }
    shared.state().present += 1;
    let present = Present(Arc::clone(shared));
    Box::new(move |effect, mailbox| present.0.perform(effect, mailbox))
}
