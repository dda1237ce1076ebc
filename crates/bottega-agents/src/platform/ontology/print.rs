//! The printer of the ontology: converts types to SL.

use super::{
    super::management::{
        AmsAgentDescription, DfAgentDescription, FailureReason, Function, LifeCycleRequest, ManagementContent, Name,
        NotUnderstoodReason, Outcome, PlatformDescription, RefuseReason, SearchConstraints, ServiceDescription,
        ServiceEntry,
    },
    AMS_DESCRIPTION, DF_DESCRIPTION, SERVICE_DESCRIPTION, SERVICE_ENTRY,
};
use crate::{AgentId, sl, sl::Term, wire::Calendar};

/// Returns a content in SL.
///
/// - `calendar`: converts times to dates.
/// - `actor`: the agent that acts: the receiver of a request, or the sender of an answer.
pub fn print_content(calendar: Calendar, actor: &AgentId, content: &ManagementContent) -> String {
    print_content_of(calendar, actor, content, None)
}

/// Returns a content in SL, as [`print_content`] does, for an answer.
///
/// - `expression`: the first expression of the request or subscription, which is repeated unchanged; `None`: it is made
///   from the content.
pub fn print_content_of(
    calendar: Calendar,
    actor: &AgentId,
    content: &ManagementContent,
    expression: Option<&Term>,
) -> String {
    let action = |function: &Function| match expression {
        Some(expression) if expression.arguments_of("action").is_some() => expression.clone(),
        _ => action(calendar, actor, function),
    };
    use ManagementContent as M;
    let terms = match content {
        M::Action(function) => vec![action(function)],
        M::Agreed(function) => vec![action(function), Term::Bare("true".to_owned())],
        M::Refused(function, reason) => vec![action(function), refuse_reason(reason)],
        M::Failed(function, reason) => vec![action(function), failure_reason(reason)],
        M::Done(function, outcome) => vec![done(calendar, actor, function, outcome, action)],
        M::LifeCycle(request) => vec![life_cycle(actor, *request)],
        M::LifeCycleDone(request) => vec![Term::call("done", [life_cycle(actor, *request)])],
        M::NotUnderstood(reason) => {
            // Repeat the act that was not understood, if possible
            expression.cloned().into_iter().chain([not_understood_reason(reason)]).collect()
        }
        M::Subscription(template, constraints) => vec![iota(calendar, actor, template, constraints)],
        M::Updates(template, constraints, offers) => {
            let wish = expression.cloned().unwrap_or_else(|| iota(calendar, actor, template, constraints));
            let offers = offers.iter().map(|offer| df_description(calendar, offer));
            vec![Term::call("=", [wish, Term::call("sequence", offers)])]
        }
        M::Cancel => expression.map(|expression| Term::call("done", [expression.clone()])).into_iter().collect(),
        M::Undelivered { receiver, reason } => {
            let error = Term::call("internal-error", [Term::text(reason)]);
            let act = Term::call("action", [agent_term(actor), Term::call("ACLMessage", [])]);
            vec![act, Term::call("MTS-error", [agent_term(receiver), error])]
        }
    };
    sl::print(&terms)
}

fn done(
    calendar: Calendar,
    actor: &AgentId,
    function: &Function,
    outcome: &Outcome,
    as_requested: impl Fn(&Function) -> Term,
) -> Term {
    // JADE writes and reads a sequence where the standard has a set
    let result = |function: &Function, found: Vec<Term>| {
        Term::call("result", [as_requested(function), Term::call("sequence", found)])
    };
    match outcome {
        Outcome::Done => Term::call("done", [as_requested(function)]),
        // The directory returns the granted offer if it differs from the requested one
        Outcome::Entered(granted) => match function {
            Function::Register(wanted) if wanted.lease_time != granted.lease_time => {
                Term::call("done", [action(calendar, actor, &Function::Register(granted.clone()))])
            }
            Function::Modify(wanted) if wanted.lease_time != granted.lease_time => {
                Term::call("done", [action(calendar, actor, &Function::Modify(granted.clone()))])
            }
            _ => Term::call("done", [as_requested(function)]),
        },
        Outcome::Agents(agents) => result(function, agents.iter().map(ams_description).collect()),
        Outcome::Offers(offers) => {
            result(function, offers.iter().map(|offer| df_description(calendar, offer)).collect())
        }
        Outcome::Platform(platform) => result(function, vec![platform_description(platform)]),
        Outcome::ServiceRoot(entries) => result(function, entries.iter().map(service_entry).collect()),
    }
}

fn action(calendar: Calendar, actor: &AgentId, function: &Function) -> Term {
    let arguments = match function {
        Function::RegisterAgent(agent) | Function::DeregisterAgent(agent) | Function::ModifyAgent(agent) => {
            vec![ams_description(agent)]
        }
        Function::SearchAgents(template, constraints) => {
            vec![ams_description(template), search_constraints(constraints)]
        }
        Function::TerminateAgent { agent, .. } => vec![agent_term(agent)],
        Function::GetDescription | Function::GetServiceRoot => Vec::new(),
        Function::Register(offer) | Function::Deregister(offer) | Function::Modify(offer) => {
            vec![df_description(calendar, offer)]
        }
        Function::Search(template, constraints) => {
            vec![df_description(calendar, template), search_constraints(constraints)]
        }
        Function::SupplyBasicService(entry) => vec![service_entry(entry)],
    };
    Term::call("action", [agent_term(actor), Term::call(function.word(), arguments)])
}

fn life_cycle(actor: &AgentId, request: LifeCycleRequest) -> Term {
    Term::call("action", [agent_term(actor), Term::call(request.word(), [])])
}

/// Formats `(iota ?x (result (action DF (search …)) ?x))`.
fn iota(calendar: Calendar, df: &AgentId, template: &DfAgentDescription, constraints: &SearchConstraints) -> Term {
    let variable = || Term::Bare("?x".to_owned());
    let search = action(calendar, df, &Function::Search(template.clone(), constraints.clone()));
    Term::call("iota", [variable(), Term::call("result", [search, variable()])])
}

/// An object with named parameters; absent and empty ones are omitted.
struct Fields(Vec<Term>);

impl Fields {
    fn new(kind: &str) -> Self {
        Self(vec![Term::text(kind)])
    }

    fn put(mut self, key: &str, value: Option<Term>) -> Self {
        if let Some(value) = value {
            self.0.push(Term::Bare(format!(":{key}")));
            self.0.push(value);
        }
        self
    }

    fn text(self, key: &str, value: Option<&str>) -> Self {
        self.put(key, value.map(Term::text))
    }

    fn list(self, key: &str, head: &str, elements: Vec<Term>) -> Self {
        let list = (!elements.is_empty()).then(|| Term::call(head, elements));
        self.put(key, list)
    }

    fn texts(self, key: &str, values: &[String]) -> Self {
        self.list(key, "set", values.iter().map(Term::text).collect())
    }

    fn term(self) -> Term {
        Term::List(self.0)
    }
}

pub(crate) fn agent_term(agent: &AgentId) -> Term {
    let addresses = agent.addresses.iter().map(Term::text).collect();
    Fields::new("agent-identifier").text("name", Some(&agent.name)).list("addresses", "sequence", addresses).term()
}

pub(crate) fn ams_description(agent: &AmsAgentDescription) -> Term {
    Fields::new(AMS_DESCRIPTION)
        .put("name", agent.name.as_ref().map(agent_term))
        .text("ownership", agent.ownership.as_deref())
        .text("state", agent.state.map(super::super::LifeCycleState::word))
        .term()
}

pub(crate) fn df_description(calendar: Calendar, offer: &DfAgentDescription) -> Term {
    Fields::new(DF_DESCRIPTION)
        .put("name", offer.name.as_ref().map(agent_term))
        .texts("protocols", &offer.protocols)
        .texts("languages", &offer.languages)
        .texts("ontologies", &offer.ontologies)
        .list("services", "set", offer.services.iter().map(service_description).collect())
        .put("lease-time", offer.lease_time.map(|end| Term::Bare(calendar.date(end).as_str().to_owned())))
        .texts("scope", &offer.scope)
        .term()
}

fn service_description(service: &ServiceDescription) -> Term {
    let property = |property: &super::super::management::Property| {
        Fields::new("property").text("name", Some(&property.name)).put("value", Some(property.value.clone())).term()
    };
    Fields::new(SERVICE_DESCRIPTION)
        .text("name", service.name.as_deref())
        .text("type", service.service_type.as_deref())
        .text("ownership", service.ownership.as_deref())
        .texts("protocols", &service.protocols)
        .texts("languages", &service.languages)
        .texts("ontologies", &service.ontologies)
        .list("properties", "set", service.properties.iter().map(property).collect())
        .term()
}

fn search_constraints(constraints: &SearchConstraints) -> Term {
    Fields::new("search-constraints")
        .put("max-depth", constraints.max_depth.map(Term::integer))
        .put("max-results", constraints.max_results.map(Term::integer))
        .text("search-id", constraints.search_id.as_deref())
        .term()
}

fn platform_description(platform: &PlatformDescription) -> Term {
    let service = |service: &ServiceEntry| {
        Fields::new("ap-service")
            .text("name", Some(&service.id))
            .text("type", Some(&service.service_type))
            .list("addresses", "sequence", service.addresses.iter().map(Term::text).collect())
            .term()
    };
    Fields::new("ap-description")
        .text("name", Some(&platform.name))
        .list("ap-services", "set", platform.services.iter().map(service).collect())
        .term()
}

pub(crate) fn service_entry(entry: &ServiceEntry) -> Term {
    Fields::new(SERVICE_ENTRY)
        .text("service-id", Some(&entry.id))
        .text("service-type", Some(&entry.service_type))
        .list("service-locator", "sequence", entry.addresses.iter().map(Term::text).collect())
        .term()
}

fn names<const N: usize>(head: &str, arguments: [&Name; N]) -> Term {
    Term::call(head, arguments.map(|name| Term::text(&**name)))
}

fn refuse_reason(reason: &RefuseReason) -> Term {
    match reason {
        RefuseReason::Unauthorised => Term::call("unauthorised", []),
        RefuseReason::UnsupportedFunction(function) => names("unsupported-function", [function]),
        RefuseReason::MissingArgument(argument) => names("missing-argument", [argument]),
        RefuseReason::UnexpectedArgument(argument) => names("unexpected-argument", [argument]),
        RefuseReason::UnexpectedArgumentCount => Term::call("unexpected-argument-count", []),
        RefuseReason::MissingParameter(object, parameter) => names("missing-parameter", [object, parameter]),
        RefuseReason::UnexpectedParameter(object, parameter) => names("unexpected-parameter", [object, parameter]),
        RefuseReason::UnrecognisedParameterValue(object, parameter) => {
            names("unrecognised-parameter-value", [object, parameter])
        }
        RefuseReason::Other(term) => term.clone(),
    }
}

fn failure_reason(reason: &FailureReason) -> Term {
    match reason {
        FailureReason::AlreadyRegistered => Term::call("already-registered", []),
        FailureReason::NotRegistered => Term::call("not-registered", []),
        FailureReason::InternalError(message) => Term::call("internal-error", [Term::text(message)]),
    }
}

fn not_understood_reason(reason: &NotUnderstoodReason) -> Term {
    match reason {
        NotUnderstoodReason::UnsupportedAct(act) => Term::call("unsupported-act", [Term::text(act.word())]),
        NotUnderstoodReason::UnexpectedAct(act) => Term::call("unexpected-act", [Term::text(act.word())]),
        NotUnderstoodReason::UnsupportedValue(parameter) => names("unsupported-value", [parameter]),
        NotUnderstoodReason::UnrecognisedValue(parameter) => names("unrecognised-value", [parameter]),
        NotUnderstoodReason::Other(term) => term.clone(),
    }
}
