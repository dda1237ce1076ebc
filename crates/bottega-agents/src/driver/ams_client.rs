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

/// Executes a function of a platform's AMS on its pages, with the right to change all entries. Returns the answer;
/// `None`: there was none within 10 seconds, for example because the store does not answer. Blocks meanwhile.
///
/// A request to an agent, such as to quit, is written into its entry; the AMS of the agent's process then sends it.
///
/// - `pages`: the store with the entries of the platform.
/// - `platform`: the name of the platform.
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
