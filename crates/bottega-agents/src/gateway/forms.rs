//! The wire forms for strangers who have not asked anything yet.

use std::collections::{BTreeMap, VecDeque};

use crate::{AgentId, wire::Form};

/// The most platforms whose form is remembered; the oldest are forgotten.
const REMEMBERED_MAX: usize = 1 << 12;

/// The form of the first message to a platform, where it has not shown its own. An answer is in the form of the question.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct FirstForms {
    /// For all others.
    pub default: Form,
    /// By the name of the platform. This holds also for one that writes otherwise.
    pub by_platform: BTreeMap<String, Form>,
}

/// What is known of the forms of platforms, by their names in small letters.
#[derive(Clone, Debug)]
pub(super) struct Forms {
    default: Form,
    set: BTreeMap<String, Form>,
    heard: BTreeMap<String, Form>,
    /// Those that were heard of, in the order in which they were first.
    order: VecDeque<String>,
}

impl Forms {
    pub(super) fn new(first: &FirstForms) -> Self {
        let set = first.by_platform.iter().map(|(name, form)| (name.to_lowercase(), *form)).collect();
        Self { default: first.default, set, heard: BTreeMap::new(), order: VecDeque::new() }
    }

    /// Somebody has written in a form that it so can read.
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

    /// In which form to write to somebody who has not asked.
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
