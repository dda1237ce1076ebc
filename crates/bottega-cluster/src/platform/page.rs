//! The entry of an agent in a directory: kept as it is wanted, whatever happens to it.

use std::time::Duration;

use bottega_agents::{
    AclMessage, AgentId, Performative, Time,
    gateway::PlainContent,
    platform::{FailureReason, Function, ManagementContent, ONTOLOGY, Outcome},
};

use super::talk::Message;

/// When a directory is asked again that did not do what it was asked, or did not answer.
const AGAIN_AFTER: Duration = Duration::from_secs(1);

/// What a directory is asked.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Ask<T> {
    Enter(T),
    Change(T),
    TakeOut,
}

/// What is known of an entry.
#[derive(Clone, Debug, PartialEq)]
enum Known<T> {
    Absent,
    /// It is there, and what it says is not known.
    There,
    Says(T),
}

/// An entry as it is wanted, and as it is known to be.
#[derive(Clone, Debug)]
pub(super) struct Page<T> {
    wanted: Option<T>,
    known: Known<T>,
    /// The number of the request that is not answered yet.
    asked: Option<(u64, Ask<T>)>,
    /// Before that nothing is asked.
    again: Time,
    /// When the lease must be renewed.
    renew: Option<Time>,
}

impl<T: Clone + PartialEq> Page<T> {
    /// None is there yet.
    pub(super) fn absent() -> Self {
        Self { wanted: None, known: Known::Absent, asked: None, again: Time::ZERO, renew: None }
    }

    /// Somebody else has entered it.
    pub(super) fn there() -> Self {
        Self { known: Known::There, ..Self::absent() }
    }

    /// How it shall be from now on; `None`: not at all.
    pub(super) fn want(&mut self, wanted: Option<T>) {
        self.wanted = wanted;
    }

    pub(super) fn wanted(&self) -> Option<&T> {
        self.wanted.as_ref()
    }

    /// Somebody else has changed it, or taken it out.
    pub(super) fn changed(&mut self, is_there: bool) {
        self.known = if is_there { Known::There } else { Known::Absent };
        (self.asked, self.again) = (None, Time::ZERO);
    }

    fn is_due(&self) -> bool {
        match (&self.wanted, &self.known) {
            (None, Known::Absent) => false,
            (Some(wanted), Known::Says(known)) => wanted != known,
            _ => true,
        }
    }

    /// What the directory must be asked now, in a request of this number.
    pub(super) fn next(&mut self, now: Time, number: u64) -> Option<Ask<T>> {
        let renews = self.renew.is_some_and(|at| at <= now) && self.wanted.is_some();
        if now < self.again || !(self.is_due() || renews) {
            return None;
        }
        let ask = match (&self.wanted, &self.known) {
            (Some(wanted), Known::Absent) => Ask::Enter(wanted.clone()),
            (Some(wanted), _) => Ask::Change(wanted.clone()),
            (None, _) => Ask::TakeOut,
        };
        (self.again, self.renew) = (now + AGAIN_AFTER, None);
        self.asked = Some((number, ask.clone()));
        Some(ask)
    }

    /// Takes an answer; returns what has been done, if it is the answer to that.
    pub(super) fn hear(&mut self, now: Time, message: &Message) -> Option<Ask<T>> {
        let PlainContent::Management(content) = &message.content else { return None };
        let (_, ask) = self.asked.take_if(|(number, _)| *number == message.in_reply_to)?;
        match content {
            ManagementContent::Done(_, outcome) => {
                self.known = match &ask {
                    Ask::Enter(entry) | Ask::Change(entry) => Known::Says(entry.clone()),
                    Ask::TakeOut => Known::Absent,
                };
                self.again = Time::ZERO;
                if let Outcome::Entered(granted) = outcome {
                    self.renew = granted.lease_time.map(|end| now + end.since(now) / 2);
                }
                return Some(ask);
            }
            ManagementContent::Failed(_, FailureReason::AlreadyRegistered) => self.known = Known::There,
            ManagementContent::Failed(_, FailureReason::NotRegistered) => self.known = Known::Absent,
            _ => {}
        }
        None
    }

    /// When [`Self::next`] has something to ask.
    pub(super) fn next_deadline(&self) -> Option<Time> {
        if self.is_due() { Some(self.again) } else { self.renew.filter(|_| self.wanted.is_some()) }
    }
}

/// A request to a directory.
pub(super) fn request(number: u64, from: &AgentId, to: &AgentId, function: Function) -> Message {
    let content = PlainContent::Management(ManagementContent::Action(function));
    AclMessage {
        language: "fipa-sl0",
        ontology: ONTOLOGY,
        protocol: "fipa-request",
        conversation_id: number,
        reply_with: number,
        ..AclMessage::new(Performative::Request, from.clone(), to.clone(), content)
    }
}

#[cfg(test)]
mod tests {
    use bottega_agents::platform::{AmsAgentDescription, RefuseReason};

    use super::*;

    #[test]
    fn an_entry_becomes_what_is_wanted_whatever_the_directory_says() {
        let (me, ams) = (AgentId::new("me@b"), AgentId::new("ams@b"));
        let at = |seconds| Time::since_start(Duration::from_secs(seconds));
        let function = || Function::RegisterAgent(AmsAgentDescription::default());
        let say = |number, content| {
            let asked = request(number, &me, &ams, function());
            asked.reply(Performative::Inform, ams.clone(), PlainContent::Management(content))
        };
        let done = |number| say(number, ManagementContent::Done(function(), Outcome::Done));
        let failed = |number, reason| say(number, ManagementContent::Failed(function(), reason));
        let mut page = Page::absent();
        assert_eq!(page.next(at(0), 1), None);
        page.want(Some("a"));
        assert_eq!(page.next(at(0), 1), Some(Ask::Enter("a")));
        assert_eq!(page.next(at(0), 2), None, "it is asked already");
        assert_eq!(page.hear(at(0), &failed(1, FailureReason::AlreadyRegistered)), None);
        assert_eq!((page.next(at(0), 2), page.next(at(1), 2)), (None, Some(Ask::Change("a"))));
        // A late answer to another request is none.
        assert_eq!(page.hear(at(1), &done(1)), None);
        assert_eq!(page.next(at(2), 3), Some(Ask::Change("a")), "nothing was heard");
        assert_eq!(page.hear(at(2), &done(3)), Some(Ask::Change("a")));
        assert_eq!((page.next(at(9), 4), page.next_deadline()), (None, None));
        page.want(Some("b"));
        assert_eq!(page.next(at(9), 4), Some(Ask::Change("b")));
        assert_eq!(page.hear(at(9), &failed(4, FailureReason::NotRegistered)), None);
        assert_eq!(page.next(at(10), 5), Some(Ask::Enter("b")));
        page.hear(at(10), &say(5, ManagementContent::Refused(function(), RefuseReason::Unauthorised)));
        assert_eq!(page.next_deadline(), Some(at(11)));
        assert_eq!(page.next(at(11), 6), Some(Ask::Enter("b")));
        page.hear(at(11), &done(6));
        page.changed(true);
        assert_eq!(page.next(at(11), 7), Some(Ask::Change("b")), "somebody else may have written anything");
        page.want(None);
        assert_eq!(page.next(at(12), 8), Some(Ask::TakeOut));
        assert_eq!(page.hear(at(12), &done(8)), Some(Ask::TakeOut));
        assert_eq!(page.next_deadline(), None);
    }

    #[test]
    fn a_lease_is_renewed_when_half_of_it_is_over() {
        let (me, df) = (AgentId::new("me@b"), AgentId::new("df@b"));
        let at = |seconds| Time::since_start(Duration::from_secs(seconds));
        let granted = bottega_agents::platform::DfAgentDescription { lease_time: Some(at(20)), ..Default::default() };
        let function = Function::Register(granted.clone());
        let done = ManagementContent::Done(function.clone(), Outcome::Entered(granted));
        let answer = request(1, &me, &df, function).reply(Performative::Inform, df, PlainContent::Management(done));
        let mut page = Page::absent();
        page.want(Some("a"));
        page.next(at(0), 1);
        page.hear(at(0), &answer);
        assert_eq!((page.next(at(9), 2), page.next_deadline()), (None, Some(at(10))));
        assert_eq!(page.next(at(10), 2), Some(Ask::Change("a")));
    }
}
