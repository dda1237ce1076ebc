//! Messages between a farm's agents and agents of other platforms, in FIPA SL.

use std::{sync::Arc, time::Duration};

use bottega_agents::{
    AclMessage, Action, AgentId, Performative, gateway::PlainContent, platform::ManagementContent, sl, sl::Term,
    wire::WireMessage,
};

use super::terms::{Unread, reason, unrecognised_content};

/// A message on the platform.
pub(super) type Message = AclMessage<PlainContent>;

/// Returns the content of a message from an agent of another platform; `None`: it has no such content, or is an answer. Answers
/// are not answered, so that a conversation ends.
pub(super) fn foreign(message: &Message) -> Option<&WireMessage> {
    use Performative as P;
    let is_answer = matches!(
        message.performative,
        P::Inform | P::Agree | P::Refuse | P::Failure | P::NotUnderstood | P::Confirm | P::Disconfirm
    );
    match &message.content {
        PlainContent::Foreign(wire) if !is_answer => Some(wire),
        _ => None,
    }
}

/// Checks that a content is of the given ontology, and in a supported language.
pub(super) fn is_of(wire: &WireMessage, ontology: &str) -> Result<(), Unread> {
    let unsupported = |parameter| Err(Unread::NotUnderstood(reason("unsupported-value", [parameter])));
    if wire.language.as_deref().is_some_and(|language| !sl::is_known(language)) {
        return unsupported("language");
    }
    if wire.ontology.as_deref().is_some_and(|other| !other.eq_ignore_ascii_case(ontology)) {
        return unsupported("ontology");
    }
    Ok(())
}

/// Returns the single expression in a content of the given ontology.
pub(super) fn expression(wire: &WireMessage, ontology: &str) -> Result<Term, Unread> {
    is_of(wire, ontology)?;
    let [expression] = <[Term; 1]>::try_from(expressions(wire)?).map_err(|_| unrecognised_content())?;
    Ok(expression)
}

/// Returns all expressions in a content.
pub(super) fn expressions(wire: &WireMessage) -> Result<Vec<Term>, Unread> {
    sl::parse(wire.content.as_deref().unwrap_or_default()).map_err(|_| unrecognised_content())
}

/// The ontology of an answer to a message without one.
const USUAL_ONTOLOGY: &str = "bottega-farm";

/// Returns an answer by `me`, with the language and ontology of the message.
pub(super) fn answer(message: &Message, me: &AgentId, act: Performative, terms: &[Term]) -> Message {
    let heard = match &message.content {
        PlainContent::Foreign(wire) => Some(wire),
        PlainContent::Management(_) => None,
    };
    let said = |value: Option<&String>, other: &str| Some(value.map_or_else(|| other.to_owned(), Clone::clone));
    let content = WireMessage {
        content: Some(sl::print(terms)),
        language: said(heard.and_then(|wire| wire.language.as_ref()), "fipa-sl0"),
        ontology: said(heard.and_then(|wire| wire.ontology.as_ref()), USUAL_ONTOLOGY),
        ..WireMessage::new(act)
    };
    message.reply(act, me.clone(), PlainContent::Foreign(Arc::new(content)))
}

/// Returns the answer to a request that is not carried out; `request` is repeated if it could be read.
pub(super) fn rejection(message: &Message, me: &AgentId, request: Option<&Term>, why: Unread) -> Message {
    let (act, why) = match why {
        Unread::Refused(why) => (Performative::Refuse, why),
        Unread::NotUnderstood(why) => (Performative::NotUnderstood, why),
    };
    let terms: Vec<Term> = request.cloned().into_iter().chain([why]).collect();
    answer(message, me, act, &terms)
}

/// Returns an `agree`: the request will be carried out.
pub(super) fn agree(message: &Message, me: &AgentId, request: &Term) -> Message {
    answer(message, me, Performative::Agree, &[request.clone(), Term::Bare("true".to_owned())])
}

/// Returns an `inform`: the request was carried out.
pub(super) fn done(message: &Message, me: &AgentId, request: &Term) -> Message {
    answer(message, me, Performative::Inform, &[Term::call("done", [request.clone()])])
}

/// Returns an `inform` with the requested result.
pub(super) fn result(message: &Message, me: &AgentId, request: &Term, what: Term) -> Message {
    answer(message, me, Performative::Inform, &[Term::call("result", [request.clone(), what])])
}

/// Returns a `failure`: the request could not be carried out.
pub(super) fn failure(message: &Message, me: &AgentId, request: &Term, why: &str) -> Message {
    let why = Term::call("internal-error", [Term::text(why)]);
    answer(message, me, Performative::Failure, &[request.clone(), why])
}

/// Returns a `failure`: the farm's server has not answered for `silent_for`.
pub(super) fn silent(message: &Message, me: &AgentId, request: &Term, silent_for: Duration) -> Message {
    failure(message, me, request, &format!("the farm has not answered for {} s", silent_for.as_secs()))
}

/// Returns the reason for an unsupported communicative act.
pub(super) fn unsupported(act: Performative) -> Unread {
    Unread::NotUnderstood(reason("unsupported-act", [act.word()]))
}

/// Returns the answer that ends a subscription; the gateway ends the conversation with it.
pub(super) fn over(message: &Message, me: &AgentId) -> Message {
    message.reply(Performative::Inform, me.clone(), PlainContent::Management(ManagementContent::Cancel))
}

/// Returns the action that sends a message.
pub(super) fn send<V, E>(message: Message) -> Action<PlainContent, V, E> {
    Action::Send(message)
}

/// Returns true if answers to a message go to this agent.
pub(super) fn hears(message: &Message, agent: &AgentId) -> bool {
    let same = |other: &AgentId| other.name.eq_ignore_ascii_case(&agent.name);
    match &message.content {
        PlainContent::Foreign(wire) if !wire.reply_to.is_empty() => wire.reply_to.iter().any(same),
        _ => same(&message.sender),
    }
}

/// Returns true if an agent may change things. Names are not authenticated.
pub(super) fn is_trusted(trusted: &[AgentId], agent: &AgentId) -> bool {
    trusted.iter().any(|one| one.name.eq_ignore_ascii_case(&agent.name))
}
