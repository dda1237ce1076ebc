//! The ontology `bottega-painting`: how an agent of another platform paints zones of a picture, between FIPA SL and types.
//!
//! The Master of a job that admits such agents (`bottega render … --farm --strangers`) is registered in the yellow pages as
//! `master-N@PLATFORM`, of the service type `bottega-master`; N is the number of the job. All contents are SL (`fipa-sl`,
//! or `fipa-sl0` except for the subscription). Parameters are named, compared without case, and unknown ones are ignored.
//! `S` is the agent identifier of the agent. Times are in seconds of that agent's machine; numbers are decimal.
//!
//! **Subscribe** (`fipa-subscribe`). `power` is how many times slower than the reference machine the agent is (V_cp,
//! default 1; measured results correct it), `lanes` is how many zones it paints at once (default 1).
//!
//! ```text
//! S  → M  subscribe  ((iota ?work (paints :agent S :power 1.5 :lanes 1 :work ?work)))
//! M  → S  agree      ((iota …) true)
//! M  → S  inform     ((= (iota …) (work :number 3 :scene room.xml :files (sequence
//!                      (file :name room.xml :bytes 5120 :at "http://host:41234/models/77/0") …)
//!                      :width 640 :height 480 :samples 64 :max-depth 8 :light-samples 1 :seed 5)))
//! ```
//!
//! The first file is the scene; names are relative to its folder. Fetch the files by GET. A `max-depth` of 0 is emitted
//! light only, 1 adds direct light, and so on. There may be a `camera` (by name, or by number from 0) and a pixel `filter`
//! (`box`, `tent`, `blackman-harris` …); by default those of the scene file apply.
//!
//! **Auction** (`fipa-contract-net`). The Master sends a call for proposals; a zone has a complexity (its predicted cost,
//! in average pixels) and the predicted time for this agent. `room` is the most zones that it may ask for. A proposal
//! names, in seconds from now, when each zone would be finished if it were the next. A proposal after the `reply-by` is too
//! late.
//!
//! ```text
//! M  → S  cfp        ((action S (paint :zones (sequence (zone :number 4 :complexity 912.5 :seconds 2.5) …))) (room 2))
//! S  → M  propose    ((action S (paint :zones (sequence (zone :number 4 :seconds 3)))) (room 1))
//! S  → M  refuse     ((action S (paint)) (busy))
//! M  → S  reject-proposal ((action S (paint)) (given-to-others))
//! ```
//!
//! **Orders.** An award is an *accept-proposal*; before the auction the Master asks for the first samples of a zone (its
//! profile) by a *request*. Both contain the same action. The rectangle excludes its right and lower edges; it may be
//! larger than the zone (bands). `order` is the fencing token. An agent paints all samples of its zone: two engines never
//! add to one zone.
//!
//! ```text
//! M  → S  request | accept-proposal
//!         ((action S (paint :zone 4 :order 345 :x0 0 :y0 0 :x1 64 :y1 48 :samples 4 :max-depth 8 :light-samples 1
//!           :seed 5 :seconds 0.2 :deliver "http://host:41234/results/9f3c…")))
//! S  → M  inform     ((done (action S (paint :zone 4 :order 345))))
//! S  → M  failure    ((action S (paint :zone 4 :order 345)) (out-of-memory))
//! M  → S  cancel     ((action S (paint :zone 4 :order 345)))
//! ```
//!
//! Before the *inform*, deliver the mean of the samples: an OpenEXR file of the rectangle's size (channels R, G, B, linear
//! Rec. 709; A if there is alpha) by PUT to `deliver`, which only the agent with the order knows. 201: accepted; 422: not a
//! picture of this size, or not of finite numbers (the text says which); 404: not expected, or no longer.
//!
//! **The end.** `inform ((done (iota …)))`: the picture is finished. `failure ((iota …) (left-out "why"))`: the Master
//! excludes this agent. `failure ((iota …) (work-ended cancelled))`: the picture will not be finished. By a *cancel* of the
//! subscription, the agent returns its orders and leaves.
//!
//! Not understood: another ontology or language, an unexpected act, content that is not SL. Refused: `(not-subscribed)`,
//! `(missing-parameter F p)`, `(unrecognised-parameter-value F p)`. A proposal is rejected with `(too-late)`,
//! `(not-called)`, `(not-offered N)` or `(offered-once N)`; an *inform* that a zone is done is answered by *disconfirm*,
//! with `(not-your-order)` or `(nothing-delivered)`. Version 1; additions will be further parameters.

use std::{collections::BTreeSet, time::Duration};

use bottega_agents::{AgentId, Revision, sl::Term};
use bottega_farm::{Bid, Offer, PaintOrder, RelativePower, WorkRow, ZoneId};

use super::super::terms::{Call, Fields, Unread, reason, unrecognised_content};

/// The name of the ontology.
pub(super) const ONTOLOGY: &str = "bottega-painting";
/// The service type of Masters.
pub(super) const SERVICE_TYPE: &str = "bottega-master";
/// The most zones that an agent may paint at once.
const LANES_MAX: f64 = 1024.0;
/// The longest time that a bid may name for a zone, in seconds.
const SECONDS_MAX: f64 = 1e7;

/// A file of a scene, offered for download.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct ModelFile {
    /// The path relative to the scene's folder.
    pub(super) name: String,
    pub(super) bytes: u64,
    /// The URL of the file.
    pub(super) at: String,
}

/// The description of a job for agents of other platforms.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Model {
    /// The number of the job.
    pub(super) number: u32,
    pub(super) seed: u64,
    /// The requested camera; none: the first of the scene file.
    pub(super) camera: Option<String>,
    /// The requested pixel filter; none: that of the scene file.
    pub(super) filter: Option<String>,
    /// The files, the scene file first.
    pub(super) files: Vec<ModelFile>,
}

/// The properties of an agent that subscribes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Applicant {
    pub(super) power: RelativePower,
    pub(super) lanes: f64,
}

/// Returns the agent identifier as a term.
pub(super) fn agent_term(agent: &AgentId) -> Term {
    Fields::of("agent-identifier").text("name", &agent.name).term()
}

fn action(agent: &AgentId, function: Term) -> Term {
    Term::call("action", [agent_term(agent), function])
}

/// Reads `(iota ?x (paints …))`.
pub(super) fn read_application(iota: &Term) -> Result<Applicant, Unread> {
    let Some([_, wish]) = iota.arguments_of("iota") else { return Err(unrecognised_content()) };
    let call = Call::plain(wish)?;
    if !call.is("paints") {
        return Err(call.unsupported());
    }
    let power = call.measure("power", 1e-6)?.unwrap_or(1.0);
    let lanes = call.measure("lanes", 1e-3)?.unwrap_or(1.0);
    if lanes > LANES_MAX {
        return Err(call.bad("lanes"));
    }
    Ok(Applicant { power: RelativePower::new(power), lanes })
}

/// Returns the job as an object.
pub(super) fn work_term(model: &Model, work: &WorkRow) -> Term {
    let file = |file: &ModelFile| {
        Fields::of("file").text("name", &file.name).number("bytes", &file.bytes).text("at", &file.at).term()
    };
    let settings = &work.settings;
    let scene = model.files.first().map_or("", |scene| &scene.name);
    Fields::of("work")
        .number("number", &model.number)
        .text("scene", scene)
        .put("files", Term::call("sequence", model.files.iter().map(file)))
        .number("width", &settings.picture.width())
        .number("height", &settings.picture.height())
        .number("samples", &settings.samples)
        .number("max-depth", &settings.tunables.max_depth)
        .number("light-samples", &settings.tunables.light_samples)
        .number("seed", &model.seed)
        .text_if("camera", model.camera.as_deref())
        .text_if("filter", model.filter.as_deref())
        .term()
}

/// Returns the content of a call for proposals.
///
/// - `seconds`: the predicted time of a zone for this agent.
pub(super) fn call_terms(agent: &AgentId, offers: &[Offer], room: u32, seconds: impl Fn(&Offer) -> f64) -> Vec<Term> {
    let zone = |offer: &Offer| {
        Fields::of("zone")
            .number("number", &offer.zone.0)
            .number("complexity", &rounded(offer.complexity))
            .number("seconds", &rounded(seconds(offer)))
            .term()
    };
    let zones = Term::call("sequence", offers.iter().map(zone));
    let paint = Fields::of("paint").put("zones", zones).term();
    vec![action(agent, paint), Term::call("room", [Term::integer(room.into())])]
}

fn rounded(value: f64) -> f64 {
    (value * 1e4).round() / 1e4
}

/// Reads a proposal for offered zones.
///
/// # Errors
/// The reason for its rejection.
pub(super) fn read_proposal(terms: &[Term], offers: &[Offer]) -> Result<(u32, Vec<Bid>), Unread> {
    let (first, rest) = terms.split_first().ok_or_else(unrecognised_content)?;
    let call = Call::of(first)?;
    let zones = call.needed("zones")?.elements().ok_or_else(|| call.bad("zones"))?;
    let mut seen = BTreeSet::new();
    let mut bids = Vec::new();
    for zone in zones {
        let said = Call::plain(zone)?;
        let number: u32 = said.number("number")?;
        let text = number.to_string();
        if !offers.iter().any(|offer| offer.zone.0 == number) {
            return Err(Unread::Refused(reason("not-offered", [&*text])));
        }
        if !seen.insert(number) {
            return Err(Unread::Refused(reason("offered-once", [&*text])));
        }
        let seconds = said.measure("seconds", 0.0)?.ok_or_else(|| said.bad("seconds"))?;
        if seconds > SECONDS_MAX {
            return Err(said.bad("seconds"));
        }
        bids.push(Bid { zone: ZoneId(number), finish: Duration::from_secs_f64(seconds) });
    }
    if bids.is_empty() {
        return Err(call.bad("zones"));
    }
    let room = rest.iter().find_map(|term| term.arguments_of("room")?.first()?.as_str()?.parse().ok());
    Ok((room.unwrap_or(1).clamp(1, bids.len() as u32), bids))
}

/// Returns an order as an action.
pub(super) fn order_term(agent: &AgentId, order: &PaintOrder, seed: u64, deliver: &str) -> Term {
    let paint = Fields::of("paint")
        .number("zone", &order.zone.0)
        .number("order", &order.fence.0)
        .number("x0", &order.rect.x0)
        .number("y0", &order.rect.y0)
        .number("x1", &order.rect.x1)
        .number("y1", &order.rect.y1)
        .number("samples", &(order.samples.end - order.samples.start))
        .number("max-depth", &order.tunables.max_depth)
        .number("light-samples", &order.tunables.light_samples)
        .number("seed", &seed);
    let paint = match order.time_estimated {
        Some(time) => paint.number("seconds", &rounded(time.as_secs_f64())),
        None => paint,
    };
    action(agent, paint.text("deliver", deliver).term())
}

/// Returns an action that only names an order.
pub(super) fn named_order_term(agent: &AgentId, zone: ZoneId, fence: Revision) -> Term {
    action(agent, Fields::of("paint").number("zone", &zone.0).number("order", &fence.0).term())
}

/// Returns an action that names no order.
pub(super) fn no_order_term(agent: &AgentId) -> Term {
    action(agent, Fields::of("paint").term())
}

/// Reads which order `(action S (paint :zone 4 :order 345))` names.
pub(super) fn read_order(term: &Term) -> Result<(ZoneId, Revision), Unread> {
    let call = Call::of(term)?;
    if !call.is("paint") {
        return Err(call.unsupported());
    }
    Ok((ZoneId(call.number("zone")?), Revision(call.number("order")?)))
}

/// Reads `(done (action …))`.
pub(super) fn read_done(term: &Term) -> Result<(ZoneId, Revision), Unread> {
    match term.arguments_of("done") {
        Some([action]) => read_order(action),
        _ => Err(unrecognised_content()),
    }
}
