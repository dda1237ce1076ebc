//! By which request an entry of the store was made: so it is known when it comes once more.

use super::{ontology::Object, service::Said};
use crate::{gateway::has_name, sl::Term};

/// The parameter of an entry that names the request by which it was made.
const REQUEST: &str = "X-request";

/// A request as entries name it. One that two processes have taken, since the first did not live to answer it or was not heard,
/// is so known to be the same. `None`: it belongs to no conversation.
pub(super) fn name_of_request(request: &Said) -> Option<String> {
    has_name(request.conversation_id).then(|| format!("r{:x}", request.conversation_id))
}

/// An entry with the request that it is made by.
pub(super) fn signed(entry: Term, request: &Said) -> Term {
    by_request(entry, name_of_request(request).as_deref())
}

/// An entry with the name of the request that it is made by.
pub(super) fn by_request(mut entry: Term, name: Option<&str>) -> Term {
    if let (Term::List(terms), Some(name)) = (&mut entry, name) {
        terms.extend([Term::Bare(format!(":{REQUEST}")), Term::text(name)]);
    }
    entry
}

/// By which request an entry was made.
pub(super) fn written_by(object: &'static str, entry: &Term) -> Option<String> {
    Object::read(object, entry).ok()?.text(REQUEST).ok()?
}
