//! The parser of the ontology: converts SL to types.

use std::borrow::Cow;

use super::{
    super::{
        LifeCycleState,
        management::{
            AmsAgentDescription, DfAgentDescription, FailureReason, Function, LifeCycleRequest, ManagementContent,
            NotUnderstoodReason, Outcome, PlatformDescription, Property, RefuseReason, SearchConstraints,
            ServiceDescription, ServiceEntry,
        },
    },
    AMS_DESCRIPTION, DF_DESCRIPTION, SERVICE_DESCRIPTION, SERVICE_ENTRY,
};
use crate::{
    AgentId, Performative, Time,
    sl::Term,
    wire::{ADDRESSES_MAX, Calendar, DateTime},
};

/// The reason why a content cannot be read; if it is that of a request, also the answer to it.
#[derive(Clone, Debug, PartialEq)]
pub enum Unread {
    /// The content does not belong to agent management.
    NotUnderstood(NotUnderstoodReason),
    /// The content belongs to agent management, but is malformed.
    Refuse(RefuseReason),
}

impl From<RefuseReason> for Unread {
    fn from(reason: RefuseReason) -> Self {
        Self::Refuse(reason)
    }
}

fn senseless() -> Unread {
    Unread::NotUnderstood(NotUnderstoodReason::UnrecognisedValue("content".into()))
}

/// Returns the management content of a message.
///
/// - `calendar`: converts dates to times.
/// - `now`: the time from which relative dates count.
/// - `act`: the performative of the message.
/// - `content`: the terms of the content, as [`crate::sl::parse`] returns them.
///
/// # Errors
/// The content does not belong to agent management, or is malformed.
pub fn read_content(
    calendar: Calendar,
    now: Time,
    act: Performative,
    content: &[Term],
) -> Result<ManagementContent, Unread> {
    let reader = TermReader { calendar, now };
    use ManagementContent as M;
    match (act, content) {
        // Any content: the conversation identifies the cancelled act
        (Performative::Cancel, _) => Ok(M::Cancel),
        (Performative::Request, [action]) => reader.request(action),
        (Performative::Subscribe, [iota]) => {
            let (template, constraints) = reader.iota(iota)?;
            Ok(M::Subscription(template, constraints))
        }
        (Performative::Inform, []) => Ok(M::Cancel),
        (Performative::Inform, [said]) => reader.inform(said),
        (Performative::Agree, [action, ..]) => Ok(M::Agreed(reader.action(action)?)),
        (Performative::Refuse, [action, reason]) => {
            Ok(M::Refused(reader.action(action)?, refuse_reason(reason).ok_or_else(senseless)?))
        }
        (Performative::Failure, [action, reason]) => match reason.arguments_of("MTS-error") {
            Some([receiver, why]) => Ok(M::Undelivered { receiver: read_agent(receiver)?, reason: error_text(why) }),
            _ => Ok(M::Failed(reader.action(action)?, failure_reason(reason))),
        },
        (Performative::NotUnderstood, [.., reason]) => Ok(M::NotUnderstood(not_understood_reason(reason))),
        _ => Err(senseless()),
    }
}

struct TermReader {
    calendar: Calendar,
    now: Time,
}

impl TermReader {
    fn request(&self, action: &Term) -> Result<ManagementContent, Unread> {
        if let Some([_, act]) = action.arguments_of("action")
            && let Some((word, [])) = act.as_call()
            && let Some(request) = life_cycle_request(word)
        {
            return Ok(ManagementContent::LifeCycle(request));
        }
        self.action(action).map(ManagementContent::Action)
    }

    /// Parses `(action AID (function …))`.
    fn action(&self, action: &Term) -> Result<Function, Unread> {
        let Some([_, act]) = action.arguments_of("action") else { return Err(senseless()) };
        let (word, arguments) = act.as_call().ok_or_else(senseless)?;
        Ok(self.function(word, arguments)?)
    }

    fn function(&self, word: &str, arguments: &[Term]) -> Result<Function, RefuseReason> {
        let plain = word.replace('-', "").to_ascii_lowercase();
        match plain.as_str() {
            "register" | "deregister" | "modify" | "search" => self.directory_function(&plain, arguments),
            "getdescription" => none(arguments).map(|()| Function::GetDescription),
            "getserviceroot" => none(arguments).map(|()| Function::GetServiceRoot),
            "supplybasicservice" => {
                let entry = one(arguments, SERVICE_ENTRY)?;
                Ok(Function::SupplyBasicService(read_service_entry(entry)?))
            }
            "quit" | "destroy" => {
                let agent = read_agent(one(arguments, "agent-identifier")?)?;
                Ok(Function::TerminateAgent { agent, graceful: plain == "quit" })
            }
            _ => Err(RefuseReason::UnsupportedFunction(Cow::Owned(word.to_owned()))),
        }
    }

    /// Parses functions that white and yellow pages share: the description distinguishes them.
    fn directory_function(&self, word: &str, arguments: &[Term]) -> Result<Function, RefuseReason> {
        let Some((description, rest)) = arguments.split_first() else {
            return Err(RefuseReason::MissingArgument("agent-description".into()));
        };
        let constraints = match rest {
            [] => SearchConstraints::default(),
            [constraints] if word == "search" => read_constraints(constraints)?,
            _ => return Err(RefuseReason::UnexpectedArgumentCount),
        };
        if description.arguments_of(AMS_DESCRIPTION).is_some() {
            let agent = read_ams_description(description)?;
            return Ok(match word {
                "register" => Function::RegisterAgent(agent),
                "deregister" => Function::DeregisterAgent(agent),
                "modify" => Function::ModifyAgent(agent),
                _ => Function::SearchAgents(agent, constraints),
            });
        }
        if description.arguments_of(DF_DESCRIPTION).is_none() {
            let head = description.as_call().map_or("", |(head, _)| head);
            return Err(RefuseReason::UnexpectedArgument(Cow::Owned(head.to_owned())));
        }
        let offer = read_df_description(self.calendar, self.now, description)?;
        Ok(match word {
            "register" => Function::Register(offer),
            "deregister" => Function::Deregister(offer),
            "modify" => Function::Modify(offer),
            _ => Function::Search(offer, constraints),
        })
    }

    fn inform(&self, said: &Term) -> Result<ManagementContent, Unread> {
        if let Some([done]) = said.arguments_of("done") {
            if let Some([_, act]) = done.arguments_of("action")
                && let Some((word, [])) = act.as_call()
                && let Some(request) = life_cycle_request(word)
            {
                return Ok(ManagementContent::LifeCycleDone(request));
            }
            // Another result, such as that of a cancelled subscription
            let Ok(function) = self.action(done) else { return Ok(ManagementContent::Cancel) };
            let outcome = match &function {
                // It contains what was entered, with the granted lease
                Function::Register(granted) | Function::Modify(granted) => Outcome::Entered(granted.clone()),
                _ => Outcome::Done,
            };
            return Ok(ManagementContent::Done(function, outcome));
        }
        if let Some([action, found]) = said.arguments_of("result") {
            let function = self.action(action)?;
            let outcome = self.outcome(&function, found)?;
            return Ok(ManagementContent::Done(function, outcome));
        }
        if let Some([wish, found]) = said.arguments_of("=") {
            let (template, constraints) = self.iota(wish)?;
            return Ok(ManagementContent::Updates(template, constraints, self.offers(found)?));
        }
        Err(senseless())
    }

    fn outcome(&self, function: &Function, found: &Term) -> Result<Outcome, Unread> {
        // A single result may lack the set around it
        let elements = found.elements().unwrap_or(std::slice::from_ref(found));
        Ok(match function {
            Function::SearchAgents(..) => {
                Outcome::Agents(elements.iter().map(ams_description_leniently).collect::<Result<_, _>>()?)
            }
            Function::Search(..) => Outcome::Offers(self.offers(found)?),
            Function::GetDescription => Outcome::Platform(read_platform(elements.first().ok_or_else(senseless)?)?),
            Function::GetServiceRoot => {
                Outcome::ServiceRoot(elements.iter().map(read_service_entry).collect::<Result<_, _>>()?)
            }
            _ => return Err(senseless()),
        })
    }

    fn offers(&self, found: &Term) -> Result<Vec<DfAgentDescription>, Unread> {
        let elements = found.elements().unwrap_or(std::slice::from_ref(found));
        let read = |term| read_df_description(self.calendar, self.now, term);
        Ok(elements.iter().map(read).collect::<Result<_, _>>()?)
    }

    /// Parses `(iota ?x (result (action DF (search …)) ?x))`; the variable may have any name.
    fn iota(&self, term: &Term) -> Result<(DfAgentDescription, SearchConstraints), Unread> {
        let arguments = term.arguments_of("iota").or_else(|| term.arguments_of("all"));
        let Some([_, result]) = arguments else { return Err(senseless()) };
        let Some([action, _]) = result.arguments_of("result") else { return Err(senseless()) };
        match self.action(action)? {
            Function::Search(template, constraints) => Ok((template, constraints)),
            other => Err(RefuseReason::UnsupportedFunction(other.word().into()).into()),
        }
    }
}

fn none(arguments: &[Term]) -> Result<(), RefuseReason> {
    if arguments.is_empty() { Ok(()) } else { Err(RefuseReason::UnexpectedArgumentCount) }
}

fn one<'a>(arguments: &'a [Term], what: &'static str) -> Result<&'a Term, RefuseReason> {
    match arguments {
        [argument] => Ok(argument),
        [] => Err(RefuseReason::MissingArgument(what.into())),
        _ => Err(RefuseReason::UnexpectedArgumentCount),
    }
}

fn life_cycle_request(word: &str) -> Option<LifeCycleRequest> {
    LifeCycleRequest::ALL.into_iter().find(|request| request.word().eq_ignore_ascii_case(word))
}

/// An object with named parameters.
pub(crate) struct Object<'a> {
    kind: &'static str,
    fields: Vec<(&'a str, &'a Term)>,
}

impl<'a> Object<'a> {
    /// Parses `(kind :parameter value …)`.
    pub(crate) fn read(kind: &'static str, term: &'a Term) -> Result<Self, RefuseReason> {
        let Some(arguments) = term.arguments_of(kind) else {
            return Err(RefuseReason::UnexpectedArgument(
                term.as_call().map_or(Cow::Borrowed(kind), |(head, _)| Cow::Owned(head.to_owned())),
            ));
        };
        let mut fields = Vec::new();
        for pair in arguments.chunks(2) {
            let [Term::Bare(key), value] = pair else { return Err(RefuseReason::UnexpectedArgumentCount) };
            let Some(key) = key.strip_prefix(':') else { return Err(RefuseReason::UnexpectedArgumentCount) };
            fields.push((key, value));
        }
        Ok(Self { kind, fields })
    }

    pub(crate) fn get(&self, parameter: &str) -> Option<&'a Term> {
        self.fields.iter().find(|(key, _)| key.eq_ignore_ascii_case(parameter)).map(|(_, value)| *value)
    }

    fn bad(&self, parameter: &'static str) -> RefuseReason {
        RefuseReason::bad_value(self.kind, parameter)
    }

    pub(crate) fn text(&self, parameter: &'static str) -> Result<Option<String>, RefuseReason> {
        let text = |term: &Term| term.as_str().map(str::to_owned).ok_or_else(|| self.bad(parameter));
        self.get(parameter).map(text).transpose()
    }

    fn integer(&self, parameter: &'static str) -> Result<Option<i64>, RefuseReason> {
        let integer = |term: &Term| term.as_str().and_then(|text| text.parse().ok()).ok_or_else(|| self.bad(parameter));
        self.get(parameter).map(integer).transpose()
    }

    /// Returns the elements of a set or a sequence; none if the parameter is absent.
    pub(crate) fn elements(&self, parameter: &'static str) -> Result<&'a [Term], RefuseReason> {
        self.get(parameter).map_or(Ok(&[]), |term| term.elements().ok_or_else(|| self.bad(parameter)))
    }

    pub(crate) fn texts(&self, parameter: &'static str) -> Result<Vec<String>, RefuseReason> {
        let text = |term: &Term| term.as_str().map(str::to_owned).ok_or_else(|| self.bad(parameter));
        self.elements(parameter)?.iter().map(text).collect()
    }

    fn agent(&self, parameter: &'static str) -> Result<Option<AgentId>, RefuseReason> {
        self.get(parameter).map(read_agent).transpose()
    }
}

pub(crate) fn read_agent(term: &Term) -> Result<AgentId, RefuseReason> {
    const OBJECT: &str = "agent-identifier";
    let object = Object::read(OBJECT, term)?;
    let name = object.text("name")?.ok_or_else(|| RefuseReason::missing(OBJECT, "name"))?;
    let addresses = object.texts("addresses")?;
    if addresses.len() > ADDRESSES_MAX {
        return Err(object.bad("addresses"));
    }
    Ok(AgentId { name: name.into(), addresses: addresses.into() })
}

pub(crate) fn read_ams_description(term: &Term) -> Result<AmsAgentDescription, RefuseReason> {
    let object = Object::read(AMS_DESCRIPTION, term)?;
    let state = |word: String| LifeCycleState::from_word(&word).ok_or_else(|| object.bad("state"));
    Ok(AmsAgentDescription {
        name: object.agent("name")?,
        ownership: object.text("ownership")?,
        state: object.text("state")?.map(state).transpose()?,
    })
}

/// Parses a description from another platform, ignoring states that FIPA does not define.
fn ams_description_leniently(term: &Term) -> Result<AmsAgentDescription, RefuseReason> {
    let object = Object::read(AMS_DESCRIPTION, term)?;
    Ok(AmsAgentDescription {
        name: object.agent("name")?,
        ownership: object.text("ownership")?,
        state: object.text("state")?.and_then(|word| LifeCycleState::from_word(&word)),
    })
}

pub(crate) fn read_df_description(
    calendar: Calendar,
    now: Time,
    term: &Term,
) -> Result<DfAgentDescription, RefuseReason> {
    let object = Object::read(DF_DESCRIPTION, term)?;
    let lease_time = |text: String| {
        DateTime::parse(&text).map(|date| calendar.time(now, &date)).map_err(|_| object.bad("lease-time"))
    };
    Ok(DfAgentDescription {
        name: object.agent("name")?,
        services: object.elements("services")?.iter().map(read_service).collect::<Result<_, _>>()?,
        protocols: object.texts("protocols")?,
        ontologies: object.texts("ontologies")?,
        languages: object.texts("languages")?,
        lease_time: object.text("lease-time")?.map(lease_time).transpose()?,
        scope: object.texts("scope")?,
    })
}

fn read_service(term: &Term) -> Result<ServiceDescription, RefuseReason> {
    let object = Object::read(SERVICE_DESCRIPTION, term)?;
    Ok(ServiceDescription {
        name: object.text("name")?,
        service_type: object.text("type")?,
        protocols: object.texts("protocols")?,
        ontologies: object.texts("ontologies")?,
        languages: object.texts("languages")?,
        ownership: object.text("ownership")?,
        properties: object.elements("properties")?.iter().map(read_property).collect::<Result<_, _>>()?,
    })
}

fn read_property(term: &Term) -> Result<Property, RefuseReason> {
    let object = Object::read("property", term)?;
    Ok(Property {
        name: object.text("name")?.ok_or_else(|| RefuseReason::missing("property", "name"))?,
        value: object.get("value").cloned().ok_or_else(|| RefuseReason::missing("property", "value"))?,
    })
}

fn read_constraints(term: &Term) -> Result<SearchConstraints, RefuseReason> {
    let object = Object::read("search-constraints", term)?;
    Ok(SearchConstraints {
        max_depth: object.integer("max-depth")?,
        max_results: object.integer("max-results")?,
        search_id: object.text("search-id")?,
    })
}

fn read_platform(term: &Term) -> Result<PlatformDescription, RefuseReason> {
    const OBJECT: &str = "ap-description";
    let object = Object::read(OBJECT, term)?;
    let name = object.text("name")?.ok_or_else(|| RefuseReason::missing(OBJECT, "name"))?;
    // JADE puts quotes into the name
    let name = name.trim_matches('"').to_owned();
    let service = |term| {
        let object = Object::read("ap-service", term)?;
        Ok(ServiceEntry {
            id: object.text("name")?.unwrap_or_default(),
            service_type: object.text("type")?.unwrap_or_default(),
            addresses: object.texts("addresses")?,
        })
    };
    Ok(PlatformDescription {
        name,
        services: object.elements("ap-services")?.iter().map(service).collect::<Result<_, _>>()?,
    })
}

pub(crate) fn read_service_entry(term: &Term) -> Result<ServiceEntry, RefuseReason> {
    let object = Object::read(SERVICE_ENTRY, term)?;
    Ok(ServiceEntry {
        id: object.text("service-id")?.unwrap_or_default(),
        service_type: object.text("service-type")?.unwrap_or_default(),
        addresses: object.texts("service-locator")?,
    })
}

/// Returns a reason `(word argument …)`, or the word alone, as JADE writes it.
fn reason(term: &Term) -> Option<(&str, Vec<Cow<'static, str>>)> {
    match term {
        Term::List(_) => {
            let (word, arguments) = term.as_call()?;
            let names = arguments.iter().map(|term| term.as_str().map(|text| Cow::Owned(text.to_owned())));
            Some((word, names.collect::<Option<_>>()?))
        }
        word => Some((word.as_str()?, Vec::new())),
    }
}

fn refuse_reason(term: &Term) -> Option<RefuseReason> {
    let (word, arguments) = reason(term)?;
    let first = || arguments.first().cloned().unwrap_or_default();
    let second = || arguments.get(1).cloned().unwrap_or_default();
    Some(match word.to_ascii_lowercase().as_str() {
        "unauthorised" => RefuseReason::Unauthorised,
        "unsupported-function" => RefuseReason::UnsupportedFunction(first()),
        "missing-argument" => RefuseReason::MissingArgument(first()),
        "unexpected-argument" => RefuseReason::UnexpectedArgument(first()),
        "unexpected-argument-count" => RefuseReason::UnexpectedArgumentCount,
        "missing-parameter" => RefuseReason::MissingParameter(first(), second()),
        "unexpected-parameter" => RefuseReason::UnexpectedParameter(first(), second()),
        "unrecognised-parameter-value" => RefuseReason::UnrecognisedParameterValue(first(), second()),
        _ => RefuseReason::Other(term.clone()),
    })
}

fn failure_reason(term: &Term) -> FailureReason {
    match reason(term).map(|(word, _)| word.to_ascii_lowercase()).as_deref() {
        Some("already-registered") => FailureReason::AlreadyRegistered,
        Some("not-registered") => FailureReason::NotRegistered,
        _ => FailureReason::InternalError(error_text(term)),
    }
}

/// Returns the text in `(internal-error "…")`, or the whole term.
fn error_text(term: &Term) -> String {
    match term.arguments_of("internal-error") {
        Some([Term::Text(text)]) => text.clone(),
        _ => crate::sl::print_term(term),
    }
}

fn not_understood_reason(term: &Term) -> NotUnderstoodReason {
    let other = || NotUnderstoodReason::Other(term.clone());
    let Some((word, arguments)) = reason(term) else { return other() };
    let first = arguments.into_iter().next().unwrap_or_default();
    match word.to_ascii_lowercase().as_str() {
        "unsupported-act" => Performative::from_word(&first).map_or_else(other, NotUnderstoodReason::UnsupportedAct),
        "unexpected-act" => Performative::from_word(&first).map_or_else(other, NotUnderstoodReason::UnexpectedAct),
        "unsupported-value" => NotUnderstoodReason::UnsupportedValue(first),
        "unrecognised-value" => NotUnderstoodReason::UnrecognisedValue(first),
        _ => other(),
    }
}
