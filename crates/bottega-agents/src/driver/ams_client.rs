//! Requests to the AMS of a platform by a process with access to its pages: answered in this process, without sockets.

use std::{io, sync::mpsc, time::Duration};

use super::{
    asker::Asker,
    fitted::{Fitted, NodeMachine},
    local::LocalPlatform,
};
use crate::{
    AgentId,
    entry_store::EntryStore,
    gateway::PlainContent,
    platform::{Ams, AmsConfig, Function, ManagementContent, Service},
};

/// Timeout for the store.
const WAIT: Duration = Duration::from_secs(10);

/// Has an AMS over these pages execute a function in the name of the platform, which may change all entries. The AMS of
/// an agent's process then sends the agent the requests in its entry. `None`: the store does not answer.
///
/// # Errors
/// A thread cannot be started.
pub fn ask_ams(
    pages: Box<dyn EntryStore<String, usize> + Send>,
    platform: &str,
    function: Function,
) -> io::Result<Option<ManagementContent>> {
    let id = |local: &str| AgentId::new(format!("{local}@{platform}"));
    let [ams, me] = ["ams", "asker"].map(id);
    let white = Ams::new(AmsConfig {
        id: ams.clone(),
        platform: platform.to_owned(),
        services: ["ams", "df", "start", "acc"].map(id).to_vec(),
        administrators: vec![me.clone()],
        addresses: Vec::new(),
        enters_residents: false,
        unlisted: vec![me.clone()],
    });
    let (heard, hear) = mpsc::channel();
    let content = ManagementContent::Action(function);
    let asker = Asker { me: me.clone(), to: ams.clone(), content, heard, until: None, wait: WAIT, conversation: 1 };
    let platform = LocalPlatform::<NodeMachine>::with_store(1, pages)?;
    let all: [(&AgentId, NodeMachine); 2] =
        [(&ams, Box::new(Service::new(ams.clone(), white))), (&me, Box::new(Fitted(asker)))];
    for (id, machine) in all {
        platform.add(id, machine, Box::new(|_, _| {})).expect("the only agents of a platform have names of their own");
    }
    // The asker has its own timeout
    let answer = hear.recv_timeout(2 * WAIT).ok();
    platform.stop();
    Ok(answer.and_then(|(_, content)| match content {
        PlainContent::Management(content) => Some(content),
        PlainContent::Foreign(_) => None,
    }))
}
