//! The rows of a job on the Blackboard, as agents of other platforms read them.

use std::collections::BTreeMap;

use bottega::events::{AgentEvent, ZoneEvent};
use bottega_agents::sl::Term;

use super::ontology::row_term;

/// The rows of a job's zones and agents.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct JobRows {
    pub(super) zones: Vec<ZoneEvent>,
    pub(super) agents: Vec<AgentEvent>,
}

/// Returns rows as objects, by zone.
///
/// - `zone`: the only zone, if not all.
pub(super) fn row_terms(rows: &JobRows, zone: Option<u32>) -> BTreeMap<u32, Term> {
    let agents: BTreeMap<&str, &AgentEvent> = rows.agents.iter().map(|agent| (&*agent.agent, agent)).collect();
    let wanted = rows.zones.iter().filter(|row| zone.is_none_or(|zone| row.id == zone));
    let agent = |row: &ZoneEvent| agents.get(row.agent.as_deref()?).copied();
    wanted.map(|row| (row.id, row_term(row, agent(row)))).collect()
}
