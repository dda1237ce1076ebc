//! Tests of the door as a state machine.

use std::{sync::Arc, time::Duration};

use bottega_agents::{
    AclMessage, Action, AgentId, Event, Performative as P, Revision, StateMachine, Time, gateway::PlainContent,
    platform::ManagementContent, wire::WireMessage,
};
use bottega_farm::{Offer, PaintOrder, ResultRef, VisitorEffect, VisitorReport, ZoneId};
use bottega_image::Rect;

use super::{
    super::talk::Message,
    door::{DoorConfig, DoorEffect, DoorReport, MasterDoor},
    ontology::{Model, ONTOLOGY},
};

const S: &str = "py@studio";

fn at(millis: u64) -> Time {
    Time::since_start(Duration::from_millis(millis))
}

struct Door {
    door: MasterDoor,
    now: u64,
}

/// The actions that an event has caused.
#[derive(Default)]
struct DoorOutput {
    /// The act and the content of each message.
    said: Vec<(P, String)>,
    conversations: Vec<u64>,
    effects: Vec<DoorEffect>,
}

impl Door {
    fn new() -> Self {
        let model = Model { number: 3, seed: 5, files: Vec::new(), camera: None, filter: None };
        let (id, df) = (AgentId::new("master-3@b"), AgentId::new("df@b"));
        let deliver = "http://h/results".to_owned();
        Self { door: MasterDoor::new(DoorConfig { id, df, model, deliver, secret: 7 }), now: 0 }
    }

    fn take(&mut self, event: Event<PlainContent, String, DoorReport>) -> DoorOutput {
        let (mut actions, mut output) = (Vec::new(), DoorOutput::default());
        self.door.handle(at(self.now), event, &mut actions);
        for action in actions {
            match action {
                Action::Effect(effect) => output.effects.push(effect),
                Action::Send(message) => match &message.content {
                    PlainContent::Foreign(wire) => {
                        output.conversations.push(message.conversation_id);
                        output.said.push((message.performative, wire.content.clone().unwrap_or_default()));
                    }
                    PlainContent::Management(ManagementContent::Cancel) => {
                        output.said.push((message.performative, "over".to_owned()));
                    }
                    PlainContent::Management(_) => {}
                },
                _ => {}
            }
        }
        output
    }

    fn hears(&mut self, from: &str, act: P, conversation: u64, content: &str) -> DoorOutput {
        let wire = WireMessage {
            content: Some(content.to_owned()),
            ontology: Some(ONTOLOGY.to_owned()),
            ..WireMessage::new(act)
        };
        let content = PlainContent::Foreign(Arc::new(wire));
        let message: Message = AclMessage {
            conversation_id: conversation,
            reply_with: conversation,
            ..AclMessage::new(act, AgentId::new(from), AgentId::new("master-3@b"), content)
        };
        self.take(Event::Message(message))
    }

    fn puts(&mut self, effect: VisitorEffect) -> DoorOutput {
        self.take(Event::Completed(DoorReport::Visitor { agent: S.to_owned(), effect }))
    }

    fn subscribed() -> Self {
        let mut door = Self::new();
        let output = door.hears(S, P::Subscribe, 1, "((iota ?w (paints :power 2 :work ?w)))");
        assert_eq!(output.said[0].0, P::Agree);
        assert!(matches!(output.effects.last(), Some(DoorEffect::Admit { agent, applicant })
            if agent == S && applicant.power.get() == 2.0));
        door
    }

    /// Sends a call for proposals. Returns its conversation.
    fn calls(&mut self, call: u64, zones: &[u32]) -> u64 {
        let offer = |&zone| Offer { zone: ZoneId(zone), complexity: 10.0, time_estimated: Duration::from_secs(3) };
        let offers = zones.iter().map(offer).collect();
        let output = self.puts(VisitorEffect::Offers { call, offers, room: 2, within: Duration::from_millis(500) });
        assert_eq!(output.said[0].0, P::CallForProposal);
        assert!(output.said[0].1.contains(":seconds 6"), "{}", output.said[0].1);
        output.conversations[0]
    }

    fn orders(&mut self, fence: u64, call: Option<u64>) -> (P, String) {
        let order = Box::new(PaintOrder {
            zone: ZoneId(4),
            fence: Revision(fence),
            rect: Rect::new(8, 0, 16, 8),
            samples: 0..4,
            tunables: bottega_engines::Tunables { max_depth: 8, light_samples: 1 },
            preference: Default::default(),
            from: None,
            error_use: Default::default(),
            samples_max: 4,
            time_estimated: None,
        });
        let output = self.puts(VisitorEffect::Paint { order, call });
        let key = output.effects.iter().find_map(|effect| match effect {
            DoorEffect::Expect { key, .. } => Some(key.clone()),
            _ => None,
        });
        (output.said[0].0, key.expect("it is expected"))
    }
}

fn report(output: &DoorOutput) -> Option<&VisitorReport> {
    output.effects.iter().find_map(|effect| match effect {
        DoorEffect::Tell { report, .. } => Some(report),
        _ => None,
    })
}

#[test]
fn a_stranger_promises_paints_and_delivers() {
    let mut door = Door::subscribed();
    let conversation = door.calls(71, &[4, 5]);
    let output = door.hears(
        S,
        P::Propose,
        conversation,
        "((action S (paint :zones (sequence (zone :number 4 :seconds 2.5)))) (room 1))",
    );
    assert!(output.said.is_empty());
    match report(&output) {
        Some(VisitorReport::Bids { call: 71, room: 1, bids }) => {
            assert_eq!((bids[0].zone, bids[0].finish), (ZoneId(4), Duration::from_millis(2500)));
        }
        other => panic!("{other:?}"),
    }
    let (act, key) = door.orders(345, Some(71));
    assert_eq!(act, P::AcceptProposal);
    let output = door.hears(S, P::Inform, conversation, "((done (action S (paint :zone 4 :order 345))))");
    assert!(output.said[0].0 == P::Disconfirm && output.said[0].1.contains("(nothing-delivered)"), "{:?}", output.said);
    door.now = 2000;
    let result = ResultRef { fence: Revision(345), samples: 4, digest: bottega_agents::BlobId([1; 32]) };
    door.take(Event::Completed(DoorReport::Delivered { key, result }));
    let output = door.hears(S, P::Inform, conversation, "((done (action S (paint :zone 4 :order 345))))");
    assert!(matches!(report(&output), Some(VisitorReport::Painted { outcome: Ok((_, taken)), .. })
        if *taken == Duration::from_secs(2)));
    // The order has been completed and no longer exists.
    let output = door.hears(S, P::Inform, conversation, "((done (action S (paint :zone 4 :order 345))))");
    assert!(output.said[0].0 == P::Disconfirm && output.said[0].1.contains("(not-your-order)"));
    let output = door.take(Event::Completed(DoorReport::Over { why: None }));
    assert_eq!(output.said, [(P::Inform, "over".to_owned())]);
}

#[test]
fn what_is_absurd_is_refused_in_the_words_of_the_standard_and_nothing_is_lost() {
    let zones = |zones: &str| format!("((action S (paint :zones (sequence {zones}))) (room 1))");
    for (proposal, why) in [
        (zones("(zone :number 9 :seconds 1)"), "(not-offered \"9\")"),
        (zones("(zone :number 4 :seconds 1) (zone :number 4 :seconds 2)"), "(offered-once \"4\")"),
        (zones("(zone :number 4 :seconds nan)"), "(unrecognised-parameter-value zone seconds)"),
        (zones("(zone :number 4 :seconds -1)"), "(unrecognised-parameter-value zone seconds)"),
        (zones("(zone :number 4 :seconds 1e300)"), "(unrecognised-parameter-value zone seconds)"),
        (zones("(zone :number 4)"), "(unrecognised-parameter-value zone seconds)"),
        (zones(""), "(unrecognised-parameter-value paint zones)"),
        ("((action S (dance)))".to_owned(), "(missing-parameter dance zones)"),
    ] {
        let mut door = Door::subscribed();
        let conversation = door.calls(71, &[4, 5]);
        let output = door.hears(S, P::Propose, conversation, &proposal);
        assert!(matches!(report(&output), Some(VisitorReport::Refuses { call: 71 })), "{proposal}");
        let (act, text) = &output.said[0];
        assert!(*act == P::RejectProposal && text.contains(&why.replace('"', "")) || text.contains(why), "{text}");
        // A second proposal to the same call is rejected.
        let again = door.hears(S, P::Propose, conversation, &zones("(zone :number 4 :seconds 1)"));
        assert!(again.said[0].1.contains("(not-called)") && again.effects.is_empty());
    }
    let mut door = Door::subscribed();
    let conversation = door.calls(71, &[4]);
    door.now = 501;
    let output = door.hears(S, P::Propose, conversation, &zones("(zone :number 4 :seconds 1)"));
    assert!(output.said[0].1.contains("(too-late)") && output.effects.is_empty());
    // Messages from an agent that has not subscribed, without a call, and without valid SL.
    for (from, act, content, answer, why) in [
        ("x@y", P::Propose, zones("(zone :number 4 :seconds 1)"), P::Refuse, "(not-subscribed)"),
        ("x@y", P::Inform, "((done (action S (paint :zone 4 :order 1))))".to_owned(), P::Refuse, "(not-subscribed)"),
        (S, P::Inform, "((done (action S (paint :zone 4 :order 1))))".to_owned(), P::Disconfirm, "(not-your-order)"),
        (S, P::Propose, zones("(zone :number 4 :seconds 1)"), P::RejectProposal, "(not-called)"),
        (S, P::Request, "((action S (paint)))".to_owned(), P::NotUnderstood, "(unsupported-act request)"),
        (S, P::Subscribe, ")(".to_owned(), P::NotUnderstood, "(unrecognised-value content)"),
        (S, P::Subscribe, "((iota ?w (sings)))".to_owned(), P::Refuse, "(unsupported-function sings)"),
        (
            S,
            P::Subscribe,
            "((iota ?w (paints :power 0)))".to_owned(),
            P::Refuse,
            "(unrecognised-parameter-value paints power)",
        ),
    ] {
        let output = door.hears(from, act, 99, &content);
        assert!(output.said[0].0 == answer && output.said[0].1.contains(why), "{act} {content}: {:?}", output.said);
        assert!(output.effects.is_empty(), "{act} {content}");
    }
}

#[test]
fn who_leaves_fails_or_cannot_be_reached_gives_back_what_it_has() {
    let failed = "((action S (paint :zone 4 :order 345)) (out-of-memory))";
    let mut door = Door::subscribed();
    let (act, _) = door.orders(345, None);
    assert_eq!(act, P::Request);
    let output = door.hears(S, P::Failure, 5, failed);
    assert!(
        matches!(report(&output), Some(VisitorReport::Painted { outcome: Err(why), .. }) if why == "(out-of-memory)")
    );
    door.orders(346, None);
    let output = door.hears(S, P::Cancel, 1, "");
    assert!(matches!(report(&output), Some(VisitorReport::Leaves)));
    assert!(output.effects.iter().any(|effect| matches!(effect, DoorEffect::Forget { .. })));
    assert_eq!(output.said, [(P::Inform, "over".to_owned())]);

    let mut door = Door::subscribed();
    door.orders(345, None);
    let lost = PlainContent::Management(ManagementContent::Undelivered {
        receiver: AgentId::new("PY@studio"),
        reason: "no connection".to_owned(),
    });
    let message = AclMessage::new(P::Failure, AgentId::new("acc@b"), AgentId::new("master-3@b"), lost);
    let output = door.take(Event::Message(message));
    assert!(matches!(report(&output), Some(VisitorReport::Leaves)));
    // A withdrawn order cannot be delivered any more.
    let mut door = Door::subscribed();
    door.orders(345, None);
    let output = door.puts(VisitorEffect::Withdrawn { zone: ZoneId(4), fence: Revision(345) });
    assert_eq!(output.said[0].0, P::Cancel);
    assert!(matches!(&output.effects[..], [DoorEffect::Forget { .. }]));
}
