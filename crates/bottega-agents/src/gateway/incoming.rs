//! Messages from foreign agents to the platform's agents.

use super::{
    CarriesForeign, Gateway, GatewayActions, Way, is_answer,
    threads::{Thread, parse_number, strange_number},
};
use crate::{
    AclMessage, Action, AgentId, Performative, Time,
    platform::{
        ManagementContent, NotUnderstoodReason, ONTOLOGY, RefuseReason, Unread, print_content_of, read_content,
    },
    sl,
    sl::Term,
    wire::WireMessage,
};

/// The result of reading a message.
#[allow(clippy::large_enum_variant, reason = "lives for a moment")]
enum Read<C> {
    Content(C),
    /// Answer with this performative and content.
    Answer(Performative, ManagementContent),
    /// Ignore the message.
    Nothing,
}

/// A content parsed as SL, as far as possible.
struct Expressions(Result<Vec<Term>, NotUnderstoodReason>);

impl<C, V> Gateway<C, V>
where
    C: CarriesForeign,
    V: From<String> + AsRef<str>,
{
    /// Delivers a foreign message to an agent of this process, or answers it.
    pub(super) fn deliver(
        &mut self,
        now: Time,
        form: &str,
        to: &AgentId,
        message: WireMessage,
        actions: &mut GatewayActions<C, V>,
    ) {
        let Some(sender) = message.sender.clone() else {
            // Without a sender there is no receiver for an answer
            self.passed(now, Way::Dropped, to, &message, actions);
            return;
        };
        if self.is_forged(to, &sender, &message) {
            self.passed(now, Way::Dropped, to, &message, actions);
            return;
        }
        self.passed(now, Way::In, to, &message, actions);
        let expressions = read_sl(&message);
        let expression = expressions.0.as_ref().ok().and_then(|terms| terms.first().cloned());
        match self.read(now, to, &message, expressions) {
            Read::Nothing => {}
            Read::Content(content) => {
                let typed = self.typed(now, form, to, sender, message, content, expression, actions);
                actions.push(Action::Send(typed));
            }
            Read::Answer(act, content) => {
                let me = self.with_addresses(to);
                let text = print_content_of(self.config.calendar, &me, &content, expression.as_ref());
                let answer = message.reply(act, me, text);
                self.send_wire(now, Some(form), &answer, actions);
            }
        }
    }

    /// Returns true if a foreign message claims to be from an agent of this process, or, to a service, from any agent
    /// of this platform: each process has these services, so none needs to ask from outside. Other processes of the
    /// platform report failures, and their agents write to those here.
    fn is_forged(&self, to: &AgentId, sender: &AgentId, message: &WireMessage) -> bool {
        let same = |other: &AgentId| other.name.eq_ignore_ascii_case(&sender.name);
        let asks_service = self.is_service(to) && !is_answer(message.performative);
        self.config.administrators.iter().any(same)
            || self.acc.resident(sender).is_some() && message.performative != Performative::Failure
            || asks_service && self.acc.is_ours(sender)
    }

    fn read(&self, now: Time, to: &AgentId, message: &WireMessage, expressions: Expressions) -> Read<C> {
        let of_management = message.ontology.as_deref().is_none_or(|name| name.eq_ignore_ascii_case(ONTOLOGY));
        if !self.is_service(to) {
            return self.read_for_agent(now, message, of_management, expressions);
        }
        let not_understood = |reason| match is_answer(message.performative) {
            true => Read::Nothing,
            false => Read::Answer(Performative::NotUnderstood, ManagementContent::NotUnderstood(reason)),
        };
        if !of_management {
            return not_understood(NotUnderstoodReason::UnsupportedValue("ontology".into()));
        }
        if !is_expected(message.performative) {
            return not_understood(NotUnderstoodReason::UnsupportedAct(message.performative));
        }
        let read = match expressions.0 {
            Ok(terms) => read_content(self.config.calendar, now, message.performative, &terms),
            // The conversation identifies the cancelled act
            Err(_) if message.performative == Performative::Cancel => Ok(ManagementContent::Cancel),
            Err(reason) => return not_understood(reason),
        };
        match read {
            // Only an AMS may send this, and only within its platform
            Ok(ManagementContent::LifeCycle(_)) => {
                not_understood(NotUnderstoodReason::UnrecognisedValue("content".into()))
            }
            Ok(content) => Read::Content(C::from(content)),
            Err(_) if is_answer(message.performative) => Read::Nothing,
            Err(Unread::NotUnderstood(reason)) => not_understood(reason),
            Err(Unread::Refuse(reason)) => refuse(reason),
        }
    }

    /// Reads a message for an agent that is not a service: agent management as types, everything else as text.
    fn read_for_agent(
        &self,
        now: Time,
        message: &WireMessage,
        of_management: bool,
        expressions: Expressions,
    ) -> Read<C> {
        if of_management && message.ontology.is_some() {
            let read = expressions
                .0
                .ok()
                .and_then(|terms| read_content(self.config.calendar, now, message.performative, &terms).ok());
            match read {
                // Agents obey only their own AMS, which is in this process
                Some(ManagementContent::LifeCycle(_)) => {
                    let content =
                        ManagementContent::NotUnderstood(NotUnderstoodReason::UnexpectedAct(message.performative));
                    return Read::Answer(Performative::NotUnderstood, content);
                }
                Some(content) if is_answer(message.performative) => return Read::Content(C::from(content)),
                _ => {}
            }
        }
        match C::from_foreign(message.clone()) {
            Some(content) => Read::Content(content),
            None if is_answer(message.performative) => Read::Nothing,
            None => {
                let reason = NotUnderstoodReason::UnrecognisedValue("content".into());
                Read::Answer(Performative::NotUnderstood, ManagementContent::NotUnderstood(reason))
            }
        }
    }

    /// Returns the message in the types of this platform.
    fn typed(
        &mut self,
        now: Time,
        form: &str,
        to: &AgentId,
        sender: AgentId,
        mut message: WireMessage,
        content: C,
        expression: Option<Term>,
        actions: &mut GatewayActions<C, V>,
    ) -> AclMessage<C> {
        let salt = self.config.salt;
        let conversation = message.conversation_id.as_deref().unwrap_or_default();
        let conversation_id = parse_number(salt, conversation).unwrap_or_else(|| strange_number(&sender, conversation));
        let in_reply_to = message.in_reply_to.as_deref().and_then(|text| parse_number(salt, text)).unwrap_or(0);
        let reply_by = message.reply_by.as_ref().map(|date| self.config.calendar.time(now, date));
        message.content = None;
        message.user.clear();
        let performative = message.performative;
        let (protocol, language) = (known_protocol(message.protocol.as_deref()), known_language(&message));
        let thread = Thread { message, expression, form: form.to_owned() };
        let (reply_with, entry) = self.threads.begin(conversation_id, thread, self.is_service(to));
        if let Some((key, text)) = entry {
            self.put(now, key, text, actions);
        }
        AclMessage {
            language,
            ontology: if content.management().is_some() { ONTOLOGY } else { "" },
            protocol,
            conversation_id,
            reply_with,
            in_reply_to,
            reply_by,
            ..AclMessage::new(performative, sender, to.clone(), content)
        }
    }
}

fn refuse<C>(reason: RefuseReason) -> Read<C> {
    // The function of the refusal is unknown; the request is repeated as it came
    Read::Answer(Performative::Refuse, ManagementContent::Refused(crate::platform::Function::GetDescription, reason))
}

/// Returns true for performatives that the platform's services handle.
fn is_expected(act: Performative) -> bool {
    matches!(act, Performative::Request | Performative::Subscribe | Performative::Cancel) || is_answer(act)
}

/// Parses the content as SL, if that is its language.
fn read_sl(message: &WireMessage) -> Expressions {
    if message.language.as_deref().is_some_and(|language| !sl::is_known(language)) {
        return Expressions(Err(NotUnderstoodReason::UnsupportedValue("language".into())));
    }
    let content = message.content.as_deref().unwrap_or_default();
    Expressions(sl::parse(content).map_err(|_| NotUnderstoodReason::UnrecognisedValue("content".into())))
}

/// Returns the protocol's name as known within the platform.
fn known_protocol(name: Option<&str>) -> &'static str {
    const KNOWN: [&str; 8] = [
        "fipa-request",
        "fipa-query",
        "fipa-subscribe",
        "fipa-contract-net",
        "fipa-iterated-contract-net",
        "fipa-auction-english",
        "fipa-auction-dutch",
        "fipa-propose",
    ];
    name.and_then(|name| KNOWN.into_iter().find(|known| known.eq_ignore_ascii_case(name))).unwrap_or("")
}

fn known_language(message: &WireMessage) -> &'static str {
    let name = message.language.as_deref().unwrap_or("");
    sl::LANGUAGES.into_iter().find(|known| known.eq_ignore_ascii_case(name)).unwrap_or("")
}
