//! An agent's entry in a directory, kept in the wanted state.

use std::time::Duration;

use super::management::{CarriesManagement, FailureReason, Function, ManagementContent, ONTOLOGY, Outcome};
use crate::{AclMessage, AgentId, Performative, Time};

/// Time after which a request to a directory is repeated if it failed or had no answer.
const AGAIN_AFTER: Duration = Duration::from_secs(1);

/// A request to a directory, about an entry of type `T`.
#[derive(Clone, Debug, PartialEq)]
pub enum PageAsk<T> {
    /// Create the entry.
    Enter(T),
    /// Replace the entry.
    Change(T),
    /// Remove the entry.
    TakeOut,
}

/// The known state of an entry.
#[derive(Clone, Debug, PartialEq)]
enum Known<T> {
    Absent,
    /// The entry exists, with unknown content.
    There,
    Says(T),
}

/// An agent's entry in a directory, with its wanted and its known state.
#[derive(Clone, Debug)]
pub struct Page<T> {
    wanted: Option<T>,
    known: Known<T>,
    /// The request without an answer, with its number.
    pending: Option<(u64, PageAsk<T>)>,
    /// No request is sent before this time.
    again: Time,
    /// The time at which the lease must be renewed.
    renew: Option<Time>,
}

impl<T: Clone + PartialEq> Page<T> {
    /// Makes the page of an entry that does not exist; none is wanted yet.
    pub fn absent() -> Self {
        Self { wanted: None, known: Known::Absent, pending: None, again: Time::ZERO, renew: None }
    }

    /// Makes the page of an entry that another agent has created, with unknown content. Until [`Self::want`] is called
    /// none is wanted, so that [`Self::next`] removes it.
    pub fn there() -> Self {
        Self { known: Known::There, ..Self::absent() }
    }

    /// Sets the wanted content; `None`: no entry.
    pub fn want(&mut self, wanted: Option<T>) {
        self.wanted = wanted;
    }

    /// Returns the wanted content; `None`: no entry is wanted.
    pub fn wanted(&self) -> Option<&T> {
        self.wanted.as_ref()
    }

    /// Notes that another agent has changed the entry, or removed it (then `is_there` is false).
    pub fn changed(&mut self, is_there: bool) {
        self.known = if is_there { Known::There } else { Known::Absent };
        (self.pending, self.again) = (None, Time::ZERO);
    }

    fn is_due(&self) -> bool {
        match (&self.wanted, &self.known) {
            (None, Known::Absent) => false,
            (Some(wanted), Known::Says(known)) => wanted != known,
            _ => true,
        }
    }

    /// Returns the request to send at `now`; `None`: there is none. The request is open until an answer that refers to
    /// `number`, or until it is repeated, at the earliest after 1 s.
    pub fn next(&mut self, now: Time, number: u64) -> Option<PageAsk<T>> {
        let renews = self.renew.is_some_and(|at| at <= now) && self.wanted.is_some();
        if now < self.again || !(self.is_due() || renews) {
            return None;
        }
        let ask = match (&self.wanted, &self.known) {
            (Some(wanted), Known::Absent) => PageAsk::Enter(wanted.clone()),
            (Some(wanted), _) => PageAsk::Change(wanted.clone()),
            (None, _) => PageAsk::TakeOut,
        };
        (self.again, self.renew) = (now + AGAIN_AFTER, None);
        self.pending = Some((number, ask.clone()));
        Some(ask)
    }

    /// Handles an answer of the directory. Returns the request that it completes; `None`: the request failed, or the
    /// message does not answer an open one.
    pub fn hear<C: CarriesManagement>(&mut self, now: Time, message: &AclMessage<C>) -> Option<PageAsk<T>> {
        let content = message.content.management()?;
        let (_, ask) = self.pending.take_if(|(number, _)| *number == message.in_reply_to)?;
        match content {
            ManagementContent::Done(_, outcome) => {
                self.known = match &ask {
                    PageAsk::Enter(entry) | PageAsk::Change(entry) => Known::Says(entry.clone()),
                    PageAsk::TakeOut => Known::Absent,
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

    /// Returns the time at which [`Self::next`] has a request; `None`: it has none until the entry is changed or
    /// something else is wanted.
    pub fn next_deadline(&self) -> Option<Time> {
        if self.is_due() { Some(self.again) } else { self.renew.filter(|_| self.wanted.is_some()) }
    }
}

/// Makes the message by which an agent requests a function of a directory.
///
/// - `number`: identifies the conversation; the answer refers to it.
/// - `from`: the agent that requests.
/// - `to`: the directory.
pub fn directory_request<C: CarriesManagement>(
    number: u64,
    from: &AgentId,
    to: &AgentId,
    function: Function,
) -> AclMessage<C> {
    let content = C::from(ManagementContent::Action(function));
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
    use crate::platform::{AmsAgentDescription, RefuseReason};

    use super::*;

    #[test]
    fn an_entry_becomes_what_is_wanted_whatever_the_directory_says() {
        let (me, ams) = (AgentId::new("me@b"), AgentId::new("ams@b"));
        let at = |seconds| Time::since_start(Duration::from_secs(seconds));
        let function = || Function::RegisterAgent(AmsAgentDescription::default());
        let say = |number, content| {
            let request = directory_request::<ManagementContent>(number, &me, &ams, function());
            request.reply(Performative::Inform, ams.clone(), content)
        };
        let done = |number| say(number, ManagementContent::Done(function(), Outcome::Done));
        let failed = |number, reason| say(number, ManagementContent::Failed(function(), reason));
        let mut page = Page::absent();
        assert_eq!(page.next(at(0), 1), None);
        page.want(Some("a"));
        assert_eq!(page.next(at(0), 1), Some(PageAsk::Enter("a")));
        assert_eq!(page.next(at(0), 2), None, "the request is pending");
        assert_eq!(page.hear(at(0), &failed(1, FailureReason::AlreadyRegistered)), None);
        assert_eq!((page.next(at(0), 2), page.next(at(1), 2)), (None, Some(PageAsk::Change("a"))));
        // A late answer to another request does not count.
        assert_eq!(page.hear(at(1), &done(1)), None);
        assert_eq!(page.next(at(2), 3), Some(PageAsk::Change("a")), "nothing was heard");
        assert_eq!(page.hear(at(2), &done(3)), Some(PageAsk::Change("a")));
        assert_eq!((page.next(at(9), 4), page.next_deadline()), (None, None));
        page.want(Some("b"));
        assert_eq!(page.next(at(9), 4), Some(PageAsk::Change("b")));
        assert_eq!(page.hear(at(9), &failed(4, FailureReason::NotRegistered)), None);
        assert_eq!(page.next(at(10), 5), Some(PageAsk::Enter("b")));
        page.hear(at(10), &say(5, ManagementContent::Refused(function(), RefuseReason::Unauthorised)));
        assert_eq!(page.next_deadline(), Some(at(11)));
        assert_eq!(page.next(at(11), 6), Some(PageAsk::Enter("b")));
        page.hear(at(11), &done(6));
        page.changed(true);
        assert_eq!(page.next(at(11), 7), Some(PageAsk::Change("b")), "somebody else may have written anything");
        page.want(None);
        assert_eq!(page.next(at(12), 8), Some(PageAsk::TakeOut));
        assert_eq!(page.hear(at(12), &done(8)), Some(PageAsk::TakeOut));
        assert_eq!(page.next_deadline(), None);
    }

    #[test]
    fn a_lease_is_renewed_when_half_of_it_is_over() {
        let (me, df) = (AgentId::new("me@b"), AgentId::new("df@b"));
        let at = |seconds| Time::since_start(Duration::from_secs(seconds));
        let granted = crate::platform::DfAgentDescription { lease_time: Some(at(20)), ..Default::default() };
        let function = Function::Register(granted.clone());
        let done = ManagementContent::Done(function.clone(), Outcome::Entered(granted));
        let answer =
            directory_request::<ManagementContent>(1, &me, &df, function).reply(Performative::Inform, df, done);
        let mut page = Page::absent();
        page.want(Some("a"));
        page.next(at(0), 1);
        page.hear(at(0), &answer);
        assert_eq!((page.next(at(9), 2), page.next_deadline()), (None, Some(at(10))));
        assert_eq!(page.next(at(10), 2), Some(PageAsk::Change("a")));
    }
}
