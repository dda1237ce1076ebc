//! Messages from the platform's agents to foreign agents.

use super::{
    CarriesForeign, Gateway, GatewayActions, Way,
    threads::{Thread, print_number},
};
use crate::{
    AclMessage, AgentId, Performative, Time,
    platform::{ManagementContent, ONTOLOGY, print_content_of},
    wire::WireMessage,
};

impl<C, V> Gateway<C, V>
where
    C: CarriesForeign,
    V: From<String> + AsRef<str>,
{
    /// Sends a message of an agent of this platform to its receivers elsewhere.
    pub(super) fn leave(&mut self, now: Time, message: &AclMessage<C>, actions: &mut GatewayActions<C, V>) {
        let thread = self.threads.get(message.in_reply_to).cloned();
        let Some(wire) = self.wire(message, thread.as_ref()) else { return };
        if let Some(key) = self.ended_subscription(message) {
            self.put(now, key, String::new(), actions);
        }
        let form = thread.as_ref().map(|thread| thread.form.as_str());
        self.send_wire(now, form, &wire, actions);
    }

    /// Sends a message to each of its receivers, or informs its sender that they cannot be reached.
    ///
    /// - `form`: the representation of the message that it answers; `None`: it is not an answer.
    pub(super) fn send_wire(
        &mut self,
        now: Time,
        form: Option<&str>,
        message: &WireMessage,
        actions: &mut GatewayActions<C, V>,
    ) {
        for receiver in &message.receivers {
            let form = form.unwrap_or_else(|| self.forms.of(receiver).name());
            match self.acc.dispatch(now, form, message.clone(), receiver) {
                Ok(outbound) => self.send(now, outbound, actions),
                Err(why) => {
                    self.passed(now, Way::Lost, receiver, message, actions);
                    let reason = why.to_string();
                    let routed = self.acc.failure(now, form, None, message, receiver, &reason);
                    self.route(now, form, routed.into_iter().collect(), actions);
                }
            }
        }
    }

    /// Returns the message as text. `None`: its content cannot be expressed.
    fn wire(&self, message: &AclMessage<C>, thread: Option<&Thread>) -> Option<WireMessage> {
        let from = self.with_addresses(&message.sender);
        let content = self.content(message, &from, thread);
        let mut wire = match thread {
            Some(thread) => thread.message.reply(message.performative, from, String::new()),
            None => WireMessage {
                sender: Some(from),
                receivers: message.receivers.clone(),
                language: word(message.language),
                ontology: word(message.ontology),
                protocol: word(message.protocol),
                conversation_id: self.number(message.conversation_id),
                in_reply_to: self.number(message.in_reply_to),
                ..WireMessage::new(message.performative)
            },
        };
        wire.reply_with = self.number(message.reply_with);
        wire.reply_by = message.reply_by.map(|by| self.config.calendar.date(by));
        match (content, message.content.foreign()) {
            (Some(content), _) => {
                wire.content = Some(content);
                wire.ontology.get_or_insert_with(|| ONTOLOGY.to_owned());
                wire.language.get_or_insert_with(|| "fipa-sl0".to_owned());
            }
            (None, Some(foreign)) => {
                wire.content.clone_from(&foreign.content);
                wire.user.clone_from(&foreign.user);
                for (slot, value) in [
                    (&mut wire.language, &foreign.language),
                    (&mut wire.ontology, &foreign.ontology),
                    (&mut wire.encoding, &foreign.encoding),
                    (&mut wire.protocol, &foreign.protocol),
                ] {
                    if value.is_some() {
                        slot.clone_from(value);
                    }
                }
            }
            (None, None) => return None,
        }
        Some(wire)
    }

    /// Returns agent-management content, in SL.
    fn content(&self, message: &AclMessage<C>, from: &AgentId, thread: Option<&Thread>) -> Option<String> {
        let content = message.content.management()?;
        // The actor is the receiver of a request, and the sender of an answer
        let actor = match message.performative {
            Performative::Request | Performative::Subscribe | Performative::Cancel => message.receivers.first()?,
            _ => from,
        };
        let expression = thread.and_then(|thread| thread.expression.as_ref());
        Some(print_content_of(self.config.calendar, actor, content, expression))
    }

    fn number(&self, number: u64) -> Option<String> {
        (number != 0).then(|| print_number(self.config.salt, number))
    }

    /// Returns the entry of a subscription's thread, if this message ends it.
    fn ended_subscription(&mut self, message: &AclMessage<C>) -> Option<String> {
        use Performative as P;
        let refused = matches!(message.performative, P::Refuse | P::Failure | P::NotUnderstood)
            && message.in_reply_to == message.conversation_id;
        let cancelled = matches!(message.content.management(), Some(ManagementContent::Cancel))
            && message.performative == P::Inform;
        if refused || cancelled { self.threads.end(message.conversation_id) } else { None }
    }
}

fn word(word: &str) -> Option<String> {
    (!word.is_empty()).then(|| word.to_owned())
}
