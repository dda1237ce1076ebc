//! Identifiers of agents.

use std::{fmt, sync::Arc};

/// A FIPA agent identifier: a globally unique name, and addresses.
///
/// Two identifiers denote the same agent if their names are equal (FIPA00023, 3.1).
#[derive(Clone, Debug)]
pub struct AgentId {
    /// The name: `local@platform`.
    pub name: Arc<str>,
    /// Transport addresses in order of preference; empty where the name suffices, as within one platform.
    pub addresses: Arc<[String]>,
}

impl AgentId {
    /// Makes an identifier without addresses from a full name, `local@platform`.
    pub fn new(name: impl Into<Arc<str>>) -> Self {
        Self { name: name.into(), addresses: Arc::new([]) }
    }

    /// Returns the platform in which the agent was created, that of its process: the part after the last `@` of its name; the
    /// whole name without one.
    pub fn home(&self) -> &str {
        self.name.rsplit('@').next().unwrap_or(&self.name)
    }
}

/// Returns the machine in the name of a process or agent: the part after the last `@` (without one, the whole name), up
/// to the first full stop, if it has one.
pub fn machine_of(name: &str) -> &str {
    let process = name.rsplit_once('@').map_or(name, |(_, process)| process);
    process.split_once('.').map_or(process, |(machine, _)| machine)
}

impl PartialEq for AgentId {
    fn eq(&self, other: &Self) -> bool {
        // Compared names are mostly copies of one string
        Arc::ptr_eq(&self.name, &other.name) || self.name == other.name
    }
}

impl Eq for AgentId {}

impl std::hash::Hash for AgentId {
    fn hash<H: std::hash::Hasher>(&self, state: &mut H) {
        self.name.hash(state);
    }
}

impl PartialOrd for AgentId {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for AgentId {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        if Arc::ptr_eq(&self.name, &other.name) { std::cmp::Ordering::Equal } else { self.name.cmp(&other.name) }
    }
}

impl fmt::Display for AgentId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.name)
    }
}
