//! Rights on a server: which role may publish and read which subjects.
//!
//! A guest may publish messages of its own agents, its presence and its payloads, and enter its own agents into the
//! directories; it may read blobs and receive messages. It cannot send as a Master, write rows, jobs
//! or leaders, or change streams.

use super::names;

/// The inbox of a machine without a key.
pub(super) const NEWCOMER: &str = "NEWCOMER";

/// The subjects that a client may publish and subscribe to.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Rights {
    /// Patterns of the subjects to which the client may publish.
    pub publish: Vec<String>,
    /// Patterns of the subjects to which the client may subscribe.
    pub subscribe: Vec<String>,
}

impl Rights {
    /// Makes the rights of a machine without a key: it may only request enrolment.
    ///
    /// - `group`: the group whose token the machine has.
    pub fn of_newcomer(group: &str) -> Self {
        Self { publish: vec![names::enrolment(group)], subscribe: vec![format!("{}.>", names::inbox(NEWCOMER))] }
    }

    /// Makes the rights of a guest: a member that works for others.
    ///
    /// - `farm`: the name of the farm.
    /// - `member`: the name of the guest.
    pub fn of_guest(farm: &str, member: &str) -> Self {
        let [rows, notices] = [names::blackboard(farm), names::notices(farm)].map(|bucket| format!("KV_{bucket}"));
        let (objects, payloads) = (format!("OBJ_{}", names::objects(farm)), names::payloads(farm));
        let mut publish = vec![
            names::said_by(farm, member),
            format!("$KV.{}.presence.{}.>", names::notices(farm), names::token(member)),
            // In white and yellow pages, the entries of its own agents only
            format!("$KV.{}.page.*.*.agent.{}.*", names::notices(farm), names::token(member)),
            format!("{}>", names::payloads_prefix(farm)),
            format!("$JS.API.DIRECT.GET.{payloads}"),
            format!("$JS.API.DIRECT.GET.{payloads}.>"),
            "$JS.FC.>".to_owned(),
        ];
        publish.extend([&rows, &notices, &objects, &payloads].map(|stream| format!("$JS.API.STREAM.INFO.{stream}")));
        for stream in [&notices, &objects] {
            for call in ["DIRECT.GET", "STREAM.MSG.GET", "CONSUMER.CREATE"] {
                publish.push(format!("$JS.API.{call}.{stream}"));
                publish.push(format!("$JS.API.{call}.{stream}.>"));
            }
            publish.push(format!("$JS.API.CONSUMER.INFO.{stream}.>"));
        }
        Self { publish, subscribe: vec![format!("{}.>", names::inbox(member)), names::said_to(farm, member)] }
    }
}
