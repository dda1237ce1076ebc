//! The agents of the farm as one type, for drivers.

use bottega_agents::{StateMachine, Time};

use crate::{
    Analyst, DirectoryService, FarmAction, FarmCompletion, FarmContent, FarmEffect, FarmEvent, FarmValue, Master,
    RenderAgent,
};

/// One of the farm's agents. All share one vocabulary, so one driver can run them.
#[derive(Clone, Debug)]
pub enum FarmAgent {
    /// The Analyst, which cuts the picture into zones.
    Analyst(Box<Analyst>),
    /// The Master, which awards zones and composes the picture.
    Master(Box<Master>),
    /// A Render Agent, which bids for zones and has them painted.
    Render(Box<RenderAgent>),
    /// A service of the platform: Start Service, AMS or DF.
    Directory(Box<DirectoryService>),
}

impl From<DirectoryService> for FarmAgent {
    fn from(service: DirectoryService) -> Self {
        Self::Directory(Box::new(service))
    }
}

impl From<Analyst> for FarmAgent {
    fn from(analyst: Analyst) -> Self {
        Self::Analyst(Box::new(analyst))
    }
}

impl From<Master> for FarmAgent {
    fn from(master: Master) -> Self {
        Self::Master(Box::new(master))
    }
}

impl From<RenderAgent> for FarmAgent {
    fn from(agent: RenderAgent) -> Self {
        Self::Render(Box::new(agent))
    }
}

impl StateMachine for FarmAgent {
    type Content = FarmContent;
    type Value = FarmValue;
    type Effect = FarmEffect;
    type Completion = FarmCompletion;

    fn handle(&mut self, now: Time, event: FarmEvent, actions: &mut Vec<FarmAction>) {
        match self {
            Self::Analyst(analyst) => analyst.handle(now, event, actions),
            Self::Master(master) => master.handle(now, event, actions),
            Self::Render(agent) => agent.handle(now, event, actions),
            Self::Directory(service) => service.handle(now, event, actions),
        }
    }

    fn next_deadline(&self) -> Option<Time> {
        match self {
            Self::Analyst(analyst) => analyst.next_deadline(),
            Self::Master(master) => master.next_deadline(),
            Self::Render(agent) => agent.next_deadline(),
            Self::Directory(service) => service.next_deadline(),
        }
    }
}
