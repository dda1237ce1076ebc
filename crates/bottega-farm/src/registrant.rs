//! Registration of an agent at the directories of its platform: finds them through the Start Service, registers itself
//! and its services, and searches for the Master of its work.

use std::time::Duration;

use bottega_agents::{
    AgentId, Performative, Time,
    platform::{
        AmsAgentDescription, CarriesManagement, DfAgentDescription, Function, LifeCycleRequest, LifeCycleState,
        ManagementContent, Outcome, Page, PageAsk, SearchConstraints, directory_request,
    },
};

use crate::{
    FarmAction, FarmMessage,
    contents::answer,
    directory::{FIPA_AMS, FIPA_DF, JOB_OWNERSHIP, RENDER_SERVICES, RegistrationConfig},
};

/// Interval of requests to the Start Service until it replies.
const ROOT_AGAIN: Duration = Duration::from_secs(1);
/// Intervals of searches for the Master at the DF: short at first, because it may be about to register, then doubled up
/// to the maximum.
const SEARCH_AGAIN: Duration = Duration::from_millis(1);
const SEARCH_AGAIN_MAX: Duration = Duration::from_millis(100);
/// Time without a reply after which the DF is queried again.
const ANSWERS_WITHIN: Duration = Duration::from_millis(500);
/// Interval of checks that the entries still exist: the directories may have removed those of an agent that seemed to
/// be gone.
const LOOK_EVERY: Duration = Duration::from_secs(5);

/// The way in which a Render Agent finds its Master.
#[derive(Clone, Debug, PartialEq)]
pub enum MasterSource {
    /// The Master is given.
    Known(AgentId),
    /// The agent registers at the directories of its platform, and searches there for the Master of its work.
    Directory(RegistrationConfig),
}

impl MasterSource {
    /// Returns the Master if it is given, else a registrant that searches for it.
    pub(crate) fn of(&self, agent: &AgentId) -> (Option<AgentId>, Option<Box<Registrant>>) {
        match self {
            Self::Known(master) => (Some(master.clone()), None),
            Self::Directory(config) => {
                (None, Some(Box::new(Registrant::new(agent.clone(), config.clone(), &RENDER_SERVICES))))
            }
        }
    }
}

/// An event from the directories for an agent.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum DirectoryEvent {
    /// The DF lists the Master of the work.
    Master(AgentId),
    /// The AMS requests this from the agent.
    LifeCycle(LifeCycleRequest),
    /// The state of the agent in the white pages.
    State(LifeCycleState),
}

/// A query to a directory: the time at which to send it, or its number and timeout.
#[derive(Clone, Copy, Debug, PartialEq)]
enum DirectoryQuery {
    Due(Time),
    Sent { number: u64, until: Time },
}

impl DirectoryQuery {
    fn at(self) -> Time {
        match self {
            Self::Due(at) => at,
            Self::Sent { until, .. } => until,
        }
    }

    fn is_answered_by(self, message: &FarmMessage) -> bool {
        matches!(self, Self::Sent { number, .. } if number == message.in_reply_to)
    }
}

/// The part of an agent that communicates with the directories.
#[derive(Clone, Debug)]
pub(crate) struct Registrant {
    me: AgentId,
    config: RegistrationConfig,
    /// The next request to the Start Service.
    root_at: Time,
    /// The ids of AMS and DF, once known.
    directories: Option<[AgentId; 2]>,
    white: Page<()>,
    yellow: Page<DfAgentDescription>,
    /// The search for the Master; `None`: not searching.
    search: Option<DirectoryQuery>,
    /// The current interval of the search.
    pause: Duration,
    /// The checks of this agent's entries in the white and the yellow pages.
    looks: [DirectoryQuery; 2],
    last_number: u64,
}

impl Registrant {
    /// Makes a registrant that has not registered yet.
    ///
    /// - `services`: the types of the agent's services, with the protocols of each.
    pub(crate) fn new(me: AgentId, config: RegistrationConfig, services: &[(&str, &[&str])]) -> Self {
        let (mut white, mut yellow) = (Page::absent(), Page::absent());
        white.want(Some(()));
        yellow.want(Some(config.offer(&me, services)));
        Self {
            me,
            config,
            root_at: Time::ZERO,
            directories: None,
            white,
            yellow,
            search: None,
            pause: SEARCH_AGAIN,
            looks: [DirectoryQuery::Due(Time::ZERO); 2],
            last_number: 0,
        }
    }

    /// Searches for the Master from now on, until it is found.
    pub(crate) fn seek_master(&mut self, now: Time) {
        if self.search.is_none() {
            (self.search, self.pause) = (Some(DirectoryQuery::Due(now)), SEARCH_AGAIN);
        }
    }

    fn number(&mut self) -> u64 {
        self.last_number += 1;
        self.last_number
    }

    /// Sends all requests that are due.
    pub(crate) fn tick(&mut self, now: Time, actions: &mut Vec<FarmAction>) {
        let Some([ams, df]) = self.directories.clone() else {
            if self.root_at <= now {
                self.root_at = now + ROOT_AGAIN;
                self.looks = [DirectoryQuery::Due(now + LOOK_EVERY); 2];
                let start = self.config.start.clone();
                self.ask(&start, Function::GetServiceRoot, actions);
            }
            return;
        };
        let number = self.last_number + 1;
        // Register, modify or deregister in the white pages
        if let Some(ask) = self.white.next(now, number) {
            let function = match ask {
                PageAsk::Enter(()) => Function::RegisterAgent(self.described(Some(LifeCycleState::Active))),
                // The AMS keeps the state in the life cycle
                PageAsk::Change(()) => Function::ModifyAgent(self.described(None)),
                PageAsk::TakeOut => Function::DeregisterAgent(self.described(None)),
            };
            self.ask(&ams, function, actions);
        }
        // The same in the yellow pages
        let number = self.last_number + 1;
        if let Some(ask) = self.yellow.next(now, number) {
            let function = match ask {
                PageAsk::Enter(offer) => Function::Register(offer),
                PageAsk::Change(offer) => Function::Modify(offer),
                PageAsk::TakeOut => Function::Deregister(self.named()),
            };
            self.ask(&df, function, actions);
        }
        // Search for the Master
        if self.search.is_some_and(|search| search.at() <= now) {
            let all = SearchConstraints { max_results: Some(-1), ..SearchConstraints::default() };
            let function = Function::Search(self.config.master_template(), all);
            let number = self.ask(&df, function, actions);
            self.search = Some(DirectoryQuery::Sent { number, until: now + ANSWERS_WITHIN });
        }
        // Check that the own entries still exist
        let own = AmsAgentDescription { name: Some(self.me.clone()), ..AmsAgentDescription::default() };
        let own = [
            (ams, Function::SearchAgents(own, SearchConstraints::default())),
            (df, Function::Search(self.named(), SearchConstraints::default())),
        ];
        for (which, (directory, function)) in own.into_iter().enumerate() {
            if self.looks[which].at() <= now {
                let number = self.ask(&directory, function, actions);
                self.looks[which] = DirectoryQuery::Sent { number, until: now + LOOK_EVERY };
            }
        }
    }

    fn ask(&mut self, to: &AgentId, function: Function, actions: &mut Vec<FarmAction>) -> u64 {
        let number = self.number();
        actions.push(FarmAction::Send(directory_request(number, &self.me, to, function)));
        number
    }

    fn described(&self, state: Option<LifeCycleState>) -> AmsAgentDescription {
        AmsAgentDescription { name: Some(self.me.clone()), ownership: Some(JOB_OWNERSHIP.to_owned()), state }
    }

    fn named(&self) -> DfAgentDescription {
        DfAgentDescription { name: Some(self.me.clone()), ..DfAgentDescription::default() }
    }

    /// Processes a message of a platform service.
    pub(crate) fn hear(&mut self, now: Time, message: &FarmMessage) -> Option<DirectoryEvent> {
        let content = message.content.management()?;
        if let ManagementContent::LifeCycle(request) = content {
            let is_ams = self.directories.as_ref().is_none_or(|[ams, _]| message.sender == *ams);
            return (is_ams && message.performative == Performative::Request)
                .then_some(DirectoryEvent::LifeCycle(*request));
        }
        self.white.hear(now, message);
        self.yellow.hear(now, message);
        match content {
            ManagementContent::Done(Function::GetServiceRoot, Outcome::ServiceRoot(services)) => {
                let find = |kind: &str| {
                    let entry = services.iter().find(|entry| entry.service_type == kind)?;
                    Some(AgentId::new(entry.id.as_str()))
                };
                self.directories = find(FIPA_AMS).zip(find(FIPA_DF)).map(|(ams, df)| [ams, df]);
            }
            ManagementContent::Done(_, Outcome::Agents(agents)) if self.looks[0].is_answered_by(message) => {
                self.looks[0] = DirectoryQuery::Due(now + LOOK_EVERY);
                match agents.first() {
                    Some(agent) => return agent.state.map(DirectoryEvent::State),
                    None => self.white.changed(false),
                }
            }
            ManagementContent::Done(_, Outcome::Offers(offers)) if self.looks[1].is_answered_by(message) => {
                self.looks[1] = DirectoryQuery::Due(now + LOOK_EVERY);
                if offers.is_empty() {
                    self.yellow.changed(false);
                }
            }
            ManagementContent::Done(_, Outcome::Offers(offers))
                if self.search.is_some_and(|search| search.is_answered_by(message)) =>
            {
                self.search = Some(DirectoryQuery::Due(now + self.pause));
                self.pause = SEARCH_AGAIN_MAX.min(2 * self.pause);
                let mut masters = offers.iter().filter_map(|offer| offer.name.clone());
                let master = masters.find(|master| self.config.may_be_master(master))?;
                self.search = None;
                return Some(DirectoryEvent::Master(master));
            }
            _ => {}
        }
        None
    }

    /// Confirms to the AMS that a request is done.
    pub(crate) fn obeyed(&self, message: &FarmMessage, request: LifeCycleRequest, actions: &mut Vec<FarmAction>) {
        let done = ManagementContent::LifeCycleDone(request).into();
        actions.push(FarmAction::Send(answer(message, &self.me, Performative::Inform, done)));
    }

    /// Removes the agent from the directories, when it ends.
    pub(crate) fn leave(&mut self, actions: &mut Vec<FarmAction>) {
        let Some([ams, df]) = self.directories.clone() else { return };
        self.ask(&ams, Function::DeregisterAgent(self.described(None)), actions);
        self.ask(&df, Function::Deregister(self.named()), actions);
    }

    /// Returns the time at which [`Self::tick`] must be called next.
    pub(crate) fn next_deadline(&self) -> Option<Time> {
        if self.directories.is_none() {
            return Some(self.root_at);
        }
        let searches = self.search.map(DirectoryQuery::at);
        let looks = self.looks.map(|look| Some(look.at()));
        [self.white.next_deadline(), self.yellow.next_deadline(), searches].into_iter().chain(looks).flatten().min()
    }
}
