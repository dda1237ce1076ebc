//! The rounds of the auction: calls for proposals, bids, awards, and which agents are called again.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use bottega_agents::{Performative, Time};

use super::{assignments::Assignments, roster::Roster};
use crate::{
    AuctionRule, Bid, Bidder, BidderStanding, Decision, FarmAction, FarmContent, FarmEffect, MemberId, Offer, Proposal,
    RoundSummary, ZoneId, ZoneRow, ZoneState,
    auction::{BIDDERS_MAX, BIDDERS_MIN},
    contents::{asking, message},
    decide, protocol,
};

/// A round of the auction in progress.
#[derive(Clone, Debug)]
struct Round {
    deadline: Time,
    offers: Vec<Offer>,
    /// Number of agents called.
    called: u32,
    awaited: Vec<MemberId>,
    proposals: Vec<(MemberId, Proposal)>,
}

/// The rounds in progress. They can be lost without harm: a new Master calls again.
#[derive(Clone, Debug, Default)]
pub(super) struct Rounds {
    /// By conversation. Each has its own zones and bidders.
    running: BTreeMap<u64, Round>,
    /// Rounds in which all called agents have answered.
    answered: VecDeque<u64>,
    /// True if a zone has become open or an agent has less load since [`Self::recall`] last ran.
    recalls: bool,
    /// Bidders of rounds without any award, since the last award, report or newly open zone: they would bid the same
    /// again. A zone whose row is being written is on offer already, but cannot be awarded.
    in_vain: BTreeSet<MemberId>,
}

impl Rounds {
    /// Opens a round once an agent needs another zone: calls all agents that lack zones, up to [`BIDDERS_MAX`], and
    /// others up to [`BIDDERS_MIN`].
    /// Returns false if there is nothing to offer or no agent needs a zone.
    pub(super) fn open(&mut self, now: Time, assignments: &mut Assignments, actions: &mut Vec<FarmAction>) -> bool {
        if !assignments.ledger.open.has_waiting() || !assignments.roster.is_due(now) {
            return false;
        }
        // Choose the bidders and the zones on offer
        let bidders = assignments.roster.bidders(BIDDERS_MIN, BIDDERS_MAX);
        let conversation = assignments.rows.number();
        let offers = assignments.ledger.open.offer(conversation, bidders.len());
        // Send the call for proposals
        let deadline = now + assignments.config.timing.bids;
        let content = FarmContent::Offers(offers.as_slice().into());
        let (me, to) = (&assignments.config.id, assignments.names(&bidders));
        let cfp = message(Performative::CallForProposal, protocol::CONTRACT_NET, me, to, content);
        actions.push(FarmAction::Send(asking(cfp, conversation, Some(deadline))));
        // Mark the bidders as called
        assignments.roster.call(conversation, &bidders);
        self.running.insert(
            conversation,
            Round { deadline, offers, called: bidders.len() as u32, awaited: bidders, proposals: Vec::new() },
        );
        true
    }

    /// Returns true if a proposal bids for a zone on offer. A proposal without such a bid is a refusal, so that it
    /// does not count as competition.
    pub(super) fn is_bid(&self, conversation: u64, proposal: &Proposal) -> bool {
        let offers = self.running.get(&conversation).map_or(&[][..], |round| &round.offers);
        let is_offered = |bid: &Bid| offers.iter().any(|offer| offer.zone == bid.zone);
        proposal.room > 0 && proposal.bids.iter().any(is_offered)
    }

    /// Takes in a refusal: the agent is not called again before `rests_until`.
    pub(super) fn take_refusal(
        &mut self,
        conversation: u64,
        agent: Option<MemberId>,
        rests_until: Time,
        roster: &mut Roster,
    ) {
        let is_awaited =
            |agent: &MemberId| self.running.get(&conversation).is_some_and(|it| it.awaited.contains(agent));
        if let Some(agent) = agent.filter(is_awaited) {
            roster.rest(agent, rests_until);
        }
        self.take_bid(conversation, agent, None, roster);
    }

    /// Takes in an agent's answer to a call for proposals; `None`: a refusal.
    pub(super) fn take_bid(
        &mut self,
        conversation: u64,
        agent: Option<MemberId>,
        proposal: Option<Proposal>,
        roster: &mut Roster,
    ) {
        let Some(round) = self.running.get_mut(&conversation) else { return };
        let place = round.awaited.iter().position(|awaited| Some(*awaited) == agent);
        if let Some(agent) = place.map(|place| round.awaited.swap_remove(place)) {
            match proposal {
                Some(proposal) => {
                    round.proposals.push((agent, proposal));
                    roster.note_bid(agent);
                }
                None => roster.release(agent),
            }
        }
        if round.awaited.is_empty() {
            self.answered.push_back(conversation);
        }
    }

    /// Removes an agent that has left from the round that called it.
    pub(super) fn remove_agent(&mut self, round: u64, agent: MemberId) {
        if let Some(round) = self.running.get_mut(&round) {
            round.awaited.retain(|other| *other != agent);
            round.proposals.retain(|(other, _)| *other != agent);
        }
    }

    /// Ends the rounds in which all have answered or whose deadline is over.
    pub(super) fn close_ended(&mut self, now: Time, assignments: &mut Assignments, actions: &mut Vec<FarmAction>) {
        while let Some(conversation) = self.answered.pop_front() {
            self.close(now, conversation, assignments, actions);
        }
        while let Some((&conversation, round)) = self.running.first_key_value() {
            if round.deadline > now && !round.awaited.is_empty() {
                return;
            }
            self.close(now, conversation, assignments, actions);
        }
    }

    /// Decides a round, announces the result and writes the awards.
    fn close(&mut self, now: Time, conversation: u64, assignments: &mut Assignments, actions: &mut Vec<FarmAction>) {
        let Some(mut round) = self.running.remove(&conversation) else { return };
        // Agents that have not answered have refused
        for &agent in &round.awaited {
            assignments.roster.release(agent);
            assignments.roster.rest(agent, now + assignments.config.timing.heartbeat);
        }
        // Decide the round, with bidders in order of their ids
        round.proposals.sort_unstable_by_key(|(agent, _)| *agent);
        let bidders: Vec<MemberId> = round.proposals.iter().map(|(agent, _)| *agent).collect();
        let bids: usize = round.proposals.iter().map(|(_, proposal)| proposal.bids.len()).sum();
        let Decision { awards: winners, outbid, credit_decided } =
            decide_round(now, &round.offers, round.proposals, assignments);
        let summary = RoundSummary {
            round: conversation,
            offers: round.offers.len() as u32,
            called: round.called,
            bidders: bidders.len() as u32,
            bids: bids as u32,
            awards: winners.len() as u32,
            outbid,
            credit_decided,
        };
        // A single agent has no competitor, so its awards do not count as an auction
        if assignments.roster.count() > 1 {
            actions.push(FarmAction::Effect(FarmEffect::RoundClosed(summary)));
        }
        // Return all zones on offer; those awarded below leave when their rows are counted
        let rule = assignments.config.auction;
        for offer in round.offers {
            assignments.ledger.open.give_back(rule, conversation, offer);
        }
        let has_won = |agent: MemberId| winners.iter().any(|award| award.agent == agent);
        let losers: Vec<MemberId> = bidders.iter().copied().filter(|&agent| !has_won(agent)).collect();
        for &agent in &losers {
            // An agent that needs a zone is called again only after a change; others with the next round
            assignments.roster.pass_over(now, agent);
        }
        // Send reject-proposal to the losers
        if !losers.is_empty() {
            let (me, to) = (&assignments.config.id, assignments.names(&losers));
            let reject = message(Performative::RejectProposal, protocol::CONTRACT_NET, me, to, FarmContent::Nothing);
            actions.push(FarmAction::Send(asking(reject, conversation, None)));
        }
        // Write the awards
        for award in &winners {
            assignments.award(now, award, conversation, actions);
        }
        for &agent in &bidders {
            assignments.roster.release(agent);
        }
        // Note whether the round was in vain
        self.recalls = true;
        if winners.is_empty() {
            self.in_vain.extend(bidders);
        } else {
            self.in_vain.clear();
        }
    }

    /// Lets the agent that finishes the largest waiting zone soonest bid again. It may have been passed over in a
    /// different situation.
    pub(super) fn recall(&mut self, now: Time, assignments: &mut Assignments) {
        let roster = &mut assignments.roster;
        if !std::mem::take(&mut self.recalls) || roster.is_due(now) || !roster.has_passed_over() {
            return;
        }
        if assignments.config.auction == AuctionRule::Paper {
            return roster.call_again(&self.in_vain);
        }
        let Some(time) = assignments.ledger.open.largest_waiting() else { return };
        let soonest = roster.field().soonest(now.elapsed().as_secs_f64(), time.as_secs_f64());
        if let Some((_, agent)) = soonest.filter(|(_, agent)| !self.in_vain.contains(agent)) {
            roster.reconsider(agent);
        }
    }

    /// Notes that a zone may be open, or that an agent has less load: agents that bid in vain may bid again.
    pub(super) fn note_change(&mut self) {
        self.recalls = true;
        self.in_vain.clear();
    }

    /// Lets all agents bid again, whether they lost or bid in vain.
    pub(super) fn call_all_again(&mut self, roster: &mut Roster) {
        self.in_vain.clear();
        roster.call_again(&self.in_vain);
    }

    /// Drops all rounds without a decision.
    pub(super) fn clear(&mut self) {
        self.running.clear();
    }

    /// Returns the deadline of the next round to end. Rounds end in the order in which they began.
    pub(super) fn next_deadline(&self) -> Option<Time> {
        self.running.values().next().map(|round| round.deadline)
    }
}

/// Runs the auction's rule on the zones of a round that are still open.
fn decide_round(
    now: Time,
    offers: &[Offer],
    proposals: Vec<(MemberId, Proposal)>,
    assignments: &Assignments,
) -> Decision {
    let Assignments { config, rows, ledger, roster, .. } = assignments;
    // Leave out zones that were taken or changed since the call
    let is_still_open = |offer: &&Offer| {
        let is_open = |row: &ZoneRow| row.state == ZoneState::Profiled && !row.is_waiting();
        rows.settled_zone(offer.zone).is_some_and(is_open)
    };
    let offers: Vec<Offer> = offers.iter().filter(is_still_open).copied().collect();
    // Add credit, reliability, speed and room to each proposal
    let bidder = |(agent, proposal): (MemberId, Proposal)| {
        let member = roster.get(agent)?;
        let (credit, worth, own) = (member.row.credit.sum, member.worth(), member.promised_own());
        let proposal = Proposal { room: proposal.room.min(roster.room(agent)), ..proposal };
        Some(Bidder { agent, credit, worth, own, needs: roster.lacks(agent), proposal })
    };
    let bidders = proposals.into_iter().filter_map(bidder).collect();
    // Run the rule
    let can_cut: &dyn Fn(ZoneId) -> bool = &|zone| rows.cut(zone, 0.5).is_some();
    let standing = BidderStanding {
        field: roster.field(),
        now: now.elapsed().as_secs_f64(),
        open: ledger.waiting_time().as_secs_f64(),
        can_cut: config.shares_tail.then_some(can_cut),
    };
    decide(config.auction, &offers, bidders, &standing)
}
