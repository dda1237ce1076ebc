//! Credits of agents: how well they keep their promises to paint a zone in a time.

use std::{collections::VecDeque, sync::Arc};

use rustc_hash::FxHashSet;

use super::{
    roster::{Member, Roster},
    rows::Rows,
    worth::KeptPromise,
};
use crate::{FarmAction, FarmEffect, MemberId, ZoneRow};

/// Maximum number of agents whose credit is written per check.
const CREDITS_AT_ONCE: usize = 32;

/// The changed credits that are not on the Blackboard yet. A write after each zone would double the number of writes,
/// and little is lost with a Master.
#[derive(Clone, Debug, Default)]
pub(super) struct Credits {
    /// Agents whose credit has changed since it was written, in order of the change.
    due: VecDeque<MemberId>,
    /// The members of `due`; a hash set for speed, never iterated.
    is_due: FxHashSet<MemberId>,
}

impl Credits {
    /// Updates the credit of a finished zone's agent in proportion to T_est − T.
    pub(super) fn learn(
        &mut self,
        row: &ZoneRow,
        promise: Option<KeptPromise>,
        roster: &mut Roster,
        actions: &mut Vec<FarmAction>,
    ) {
        let (Some(estimated), Some(promise), Some(agent)) = (row.time_estimated, promise, &row.agent) else { return };
        let KeptPromise { taken, worth } = promise;
        let Some(id) = roster.find(agent) else { return };
        let Some(own) = roster.get(id).map(Member::promised_own) else { return };
        if let Some(row) = roster.update(id, |row| row.credit.learn(estimated, own, taken, worth)) {
            actions.push(FarmAction::Effect(FarmEffect::AgentChanged(Arc::new(row.clone()))));
            if self.is_due.insert(id) {
                self.due.push_back(id);
            }
        }
    }

    /// Writes the changed credits of some agents, those that have waited longest first.
    pub(super) fn write(&mut self, roster: &Roster, rows: &mut Rows, actions: &mut Vec<FarmAction>) {
        for _ in 0..CREDITS_AT_ONCE {
            let Some(id) = self.due.pop_front() else { return };
            self.is_due.remove(&id);
            if let Some(row) = roster.get(id).map(|member| member.row.clone()) {
                rows.put_agent(row, actions);
            }
        }
    }
}
