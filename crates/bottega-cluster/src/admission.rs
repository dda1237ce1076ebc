//! Admission of machines to the farm of `bottega up`: they become members, and the server is told of them.

use std::sync::{Mutex, MutexGuard, PoisonError};

use bottega_agents::driver::nats::NatsOptions;

use crate::error::Error;
use crate::{
    address::Group,
    link::EnrolmentAnswer,
    members::Members,
    server::{Setup, reload},
};

/// Lets in those who know a word. Several may come at once: the server reads its configuration once for all who wait.
pub(crate) struct Admission {
    members: Mutex<Members>,
    /// How many members the server was told of. Locked while it is told.
    told: Mutex<usize>,
    setup: Setup,
    /// How the server is reached by a user of its own account.
    system: NatsOptions,
}

impl Admission {
    /// - `members`: those that the configuration of the server names.
    pub(crate) fn new(members: Members, setup: Setup, system: NatsOptions) -> Self {
        let told = Mutex::new(members.count());
        Self { members: Mutex::new(members), told, setup, system }
    }

    /// Answers one who wants to be let in. `None`: it names no group of ours.
    pub(crate) fn answer(&self, group: &str, request: &[u8]) -> Option<Vec<u8>> {
        let group = Group::ALL.into_iter().find(|known| known.word() == group)?;
        let (mut answer, count) = {
            let mut members = lock(&self.members);
            (members.answer(group, request), members.count())
        };
        if answer.member.is_some()
            && let Err(error) = self.tell_server(count)
        {
            let reason = format!("its server cannot be told of it: {}", error.error_chain());
            answer = EnrolmentAnswer { member: None, refused: Some(reason) };
        }
        if let Some(member) = &answer.member {
            tracing::info!(member, group = group.word(), "let in");
        }
        serde_json::to_vec(&answer).ok()
    }

    /// Has the server know the first `count` members, unless somebody has told it of them meanwhile.
    fn tell_server(&self, count: usize) -> Result<(), Error> {
        let mut told = lock(&self.told);
        if *told < count {
            let all = {
                let members = lock(&self.members);
                self.setup.write(&members)?;
                members.count()
            };
            reload(&self.setup, &self.system)?;
            *told = all;
        }
        Ok(())
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
