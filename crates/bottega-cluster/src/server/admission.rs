//! Admission of machines to the farm of `bottega up`: they become members in the server's configuration.

use std::sync::{Mutex, MutexGuard, PoisonError};

use bottega_agents::driver::nats::NatsOptions;

use crate::{
    error::Error,
    server::{
        address::Group,
        link::EnrolmentAnswer,
        members::Members,
        process::{Setup, reload},
    },
};

/// Admits machines that know a word. Several can be admitted at once: the server reloads its configuration once for all of
/// them.
pub(crate) struct Admission {
    members: Mutex<Members>,
    /// The number of members in the server's configuration. Locked during a reload.
    loaded: Mutex<usize>,
    setup: Setup,
    /// The connection options of the server's system account.
    system: NatsOptions,
}

impl Admission {
    /// Makes the admission of a farm.
    ///
    /// - `members`: the members that the server's configuration names.
    pub(crate) fn new(members: Members, setup: Setup, system: NatsOptions) -> Self {
        let loaded = Mutex::new(members.count());
        Self { members: Mutex::new(members), loaded, setup, system }
    }

    /// Answers an [`EnrolmentRequest`](crate::server::link::EnrolmentRequest). `None`: `group` is unknown.
    pub(crate) fn answer(&self, group: &str, request: &[u8]) -> Option<Vec<u8>> {
        let group = Group::ALL.into_iter().find(|known| known.word() == group)?;
        let (mut answer, count) = {
            let mut members = lock(&self.members);
            (members.answer(group, request), members.count())
        };
        if answer.member.is_some()
            && let Err(error) = self.load_members(count)
        {
            let reason = format!("the NATS server cannot load the new member: {}", error.error_chain());
            answer = EnrolmentAnswer { member: None, refused: Some(reason) };
        }
        if let Some(member) = &answer.member {
            tracing::info!(member, group = group.word(), "admitted");
        }
        serde_json::to_vec(&answer).ok()
    }

    /// Makes the server load the first `count` members, unless another thread has done so.
    fn load_members(&self, count: usize) -> Result<(), Error> {
        let mut loaded = lock(&self.loaded);
        if *loaded < count {
            let count = {
                let members = lock(&self.members);
                self.setup.write(&members)?;
                members.count()
            };
            reload(&self.setup, &self.system)?;
            *loaded = count;
        }
        Ok(())
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
