//! Names of agents.

use std::{fmt, sync::Arc};

/// A FIPA agent identifier: a globally unique name, and where its owner can be reached.
///
/// Two identifiers are the same agent when their names are equal (FIPA00023, 3.1).
#[derive(Clone, Debug)]
pub struct AgentId {
    /// `local@platform`.
    pub name: Arc<str>,
    /// Transport addresses in order of preference; empty within one platform.
    pub addresses: Arc<[String]>,
}

impl AgentId {
    /// An agent of this platform.
    pub fn new(name: impl Into<Arc<str>>) -> Self {
        Self { name: name.into(), addresses: Arc::new([]) }
    }

    /// The platform that it was born on: what stands behind the last `@` of its name. All of it where there is none.
    pub fn home(&self) -> &str {
        self.name.rsplit('@').next().unwrap_or(&self.name)
    }
}

/// The machine of a process or of an agent, by its name: what stands behind the last `@`, up to the first full stop.
pub fn machine_of(name: &str) -> &str {
    let process = name.rsplit_once('@').map_or(name, |(_, process)| process);
    process.split_once('.').map_or(process, |(machine, _)| machine)
}

impl PartialEq for AgentId {
    fn eq(&self, other: &Self) -> bool {
        // Mostly copies of one name meet.
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
