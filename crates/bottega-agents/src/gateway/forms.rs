//! Representations of messages to foreign agents that have not written yet.

use std::collections::{BTreeMap, VecDeque};

use crate::{AgentId, wire::Form};

/// Maximum number of platforms whose representation is remembered; the oldest are dropped.
const REMEMBERED_MAX: usize = 1 << 12;

/// The representations of messages to other platforms that do not answer one. An answer has the representation of the
/// message that it answers.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct FirstForms {
    /// The representation for a platform that is not in `by_platform` and has sent no message yet. One that has sent
    /// messages gets the representation of its last one.
    pub default: Form,
    /// The representation by name of the platform, compared without case; overrides the one that the platform itself
    /// uses.
    pub by_platform: BTreeMap<String, Form>,
}

/// The known representations, by the platforms' names in lower case.
#[derive(Clone, Debug)]
pub(super) struct Forms {
    default: Form,
    set: BTreeMap<String, Form>,
    heard: BTreeMap<String, Form>,
    /// The platforms heard from, in order of their first message.
    order: VecDeque<String>,
}

impl Forms {
    pub(super) fn new(first: &FirstForms) -> Self {
        let set = first.by_platform.iter().map(|(name, form)| (name.to_lowercase(), *form)).collect();
        Self { default: first.default, set, heard: BTreeMap::new(), order: VecDeque::new() }
    }

    /// Notes that an agent used this representation, and so can read it.
    pub(super) fn hear(&mut self, sender: &AgentId, form: Form) {
        let Some(platform) = platform(sender) else { return };
        if self.heard.insert(platform.clone(), form).is_none() {
            self.order.push_back(platform);
            if self.order.len() > REMEMBERED_MAX
                && let Some(oldest) = self.order.pop_front()
            {
                self.heard.remove(&oldest);
            }
        }
    }

    /// Returns the representation for a message that is not an answer.
    pub(super) fn of(&self, receiver: &AgentId) -> Form {
        let known = |platform: String| self.set.get(&platform).or_else(|| self.heard.get(&platform)).copied();
        platform(receiver).and_then(known).unwrap_or(self.default)
    }
}

fn platform(agent: &AgentId) -> Option<String> {
    agent.name.rsplit_once('@').map(|(_, platform)| platform.to_lowercase())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_platform_is_written_to_as_was_set_or_as_it_wrote_itself() {
        let by_platform = BTreeMap::from([("Old".to_owned(), Form::String)]);
        let mut forms = Forms::new(&FirstForms { default: Form::Xml, by_platform });
        let of = |forms: &Forms, name: &str| forms.of(&AgentId::new(name));
        assert_eq!(
            [of(&forms, "a@old"), of(&forms, "a@new"), of(&forms, "nobody")],
            [Form::String, Form::Xml, Form::Xml]
        );
        forms.hear(&AgentId::new("b@NEW"), Form::String);
        forms.hear(&AgentId::new("b@old"), Form::Xml);
        assert_eq!(
            [of(&forms, "a@old"), of(&forms, "a@new"), of(&forms, "a@third")],
            [Form::String, Form::String, Form::Xml]
        );
        for number in 0..REMEMBERED_MAX {
            forms.hear(&AgentId::new(format!("a@{number}")), Form::Xml);
        }
        assert_eq!((of(&forms, "a@new"), forms.heard.len()), (Form::Xml, REMEMBERED_MAX), "the oldest is forgotten");
    }
}
