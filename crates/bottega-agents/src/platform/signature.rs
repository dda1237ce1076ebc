//! The request that created an entry of the store, recorded to recognize its repetitions.

use super::{ontology::Object, service::Said};
use crate::{conversation::has_name, sl::Term};

/// The parameter of an entry that names its request.
const REQUEST: &str = "X-request";

/// Returns the name of a request in entries. It identifies a request that two processes received, because the first
/// one failed or its answer was lost. `None`: the request is outside any conversation.
pub(super) fn name_of_request(request: &Said) -> Option<String> {
    has_name(request.conversation_id).then(|| format!("r{:x}", request.conversation_id))
}

/// Returns the entry with the name of `request` added.
pub(super) fn signed(entry: Term, request: &Said) -> Term {
    by_request(entry, name_of_request(request).as_deref())
}

/// Returns the entry with a request's name added.
pub(super) fn by_request(mut entry: Term, name: Option<&str>) -> Term {
    if let (Term::List(terms), Some(name)) = (&mut entry, name) {
        terms.extend([Term::Bare(format!(":{REQUEST}")), Term::text(name)]);
    }
    entry
}

/// Returns the name of the request that created an entry.
pub(super) fn written_by(object: &'static str, entry: &Term) -> Option<String> {
    Object::read(object, entry).ok()?.text(REQUEST).ok()?
}
