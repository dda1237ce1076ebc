//! Who gets which zone. Pure: the Master asks, and sends what comes out.
//!
//! Source: MAGarRO, section 3.4, "Auctioning": agents try to get the more complex zones first; among several the one
//! with more credit wins; credit rises or falls in proportion to T_est − T.

mod field;
mod open_zones;

use std::time::Duration;

pub use self::{field::Field, open_zones::OpenZones};
use crate::{Bid, Offer, ZoneId};

/// Agents called in one round at most.
pub(crate) const BIDDERS_MAX: usize = 16;
/// How far beyond the expected end of all work a zone may be finished, as a share of the time until then.
const SLACK: f64 = 0.02;
/// A piece that takes an agent less than this is not worth its messages.
const PIECE_TIME_MIN: f64 = 0.1;
/// An agent gets zones that take this share of the time that is left, at most: what was estimated wrong can then be made
/// good with the rest (the factoring of Hummel, Schonberg and Flynn 1992).
const SHARE_OF_REST: f64 = 0.5;

/// Zones too large for all bidders that are set against all other agents in one round, at most.
const LEFT_MAX: usize = 4;

/// How a zone's winner is found.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum AuctionRule {
    /// The most complex open zone goes to the bidder with the most credit.
    Paper,
    /// An agent gets the largest zone that it finishes before the work as a whole can be expected to end; when there is
    /// none, only what nobody else would finish sooner. So a slow agent does not take the last big zone.
    #[default]
    FinishingTime,
}

/// An agent's number on the list of its Master, which it keeps for good.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct MemberId(pub u32);

impl MemberId {
    const FIRST: Self = Self(0);

    /// As an index into the list.
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

/// What a bidder said.
#[derive(Clone, Debug, PartialEq)]
pub struct Proposal {
    /// Zones that it has room for.
    pub room: u32,
    /// When it would finish which zone.
    pub bids: Vec<Bid>,
}

/// One who has made a proposal.
#[derive(Clone, Debug, PartialEq)]
pub struct Bidder {
    /// Who.
    pub agent: MemberId,
    /// Its credit.
    pub credit: f64,
    /// Its own time for a second of the reference machine's, all its processors together.
    pub own: f64,
    /// What it said.
    pub proposal: Proposal,
}

/// A zone, or the first part of one, and who gets it.
#[derive(Clone, Debug, PartialEq)]
pub struct Award {
    /// Which zone.
    pub zone: ZoneId,
    /// Who.
    pub agent: MemberId,
    /// How much of the zone, 0..1; `None`: all of it.
    pub share: Option<f64>,
}

/// What is known when a round ends.
pub struct Standing<'a> {
    /// All agents of the Master, also those that do not bid now.
    pub field: &'a Field,
    /// When the round ends, in seconds.
    pub now: f64,
    /// T_est of all that nobody has in hand, in seconds.
    pub open: f64,
    /// Whether a zone can be cut; `None`: none is.
    pub can_cut: Option<&'a dyn Fn(ZoneId) -> bool>,
}

/// Finds the winners of one round. Each zone has at most one, each bidder wins at most as many as it has room for, and
/// nothing that it did not bid for.
///
/// - `offers`: largest first.
pub fn award(rule: AuctionRule, offers: &[Offer], bidders: Vec<Bidder>, standing: &Standing<'_>) -> Vec<Award> {
    let mut bidders: Vec<Candidate> = bidders.into_iter().map(|bidder| Candidate::new(bidder, offers)).collect();
    match rule {
        AuctionRule::Paper => by_credit(offers, &mut bidders),
        AuctionRule::FinishingTime => ByTime::new(offers, bidders, standing).award(),
    }
}

/// A bidder during a round.
struct Candidate {
    bidder: Bidder,
    /// When it would have finished each of the offers, in their order, by its own word; in seconds from now. `None`: it does
    /// not bid for that one.
    finish: Vec<Option<f64>>,
    room: u32,
    /// What it has won in this round, in its own seconds.
    won: f64,
}

impl Candidate {
    fn new(bidder: Bidder, offers: &[Offer]) -> Self {
        let bids = &bidder.proposal.bids;
        let bid_for = |(place, offer): (usize, &Offer)| {
            // They come in the order of the offers, unless something was taken away meanwhile.
            let likely = bids.get(place).filter(|bid| bid.zone == offer.zone);
            likely.or_else(|| bids.iter().find(|bid| bid.zone == offer.zone)).map(|bid| bid.finish.as_secs_f64())
        };
        let finish = offers.iter().enumerate().map(bid_for).collect();
        Self { finish, room: bidder.proposal.room, bidder, won: 0.0 }
    }

    fn own(&self, lot: &Lot) -> f64 {
        self.bidder.own * lot.time
    }

    /// When it would have finished a zone, by its own word and behind what it has won.
    fn finish(&self, lot: &Lot) -> Option<f64> {
        self.finish[lot.place].map(|finish| finish + self.won)
    }

    fn bids_for(&self, lot: &Lot) -> bool {
        self.finish[lot.place].is_some()
    }

    /// When it would begin one.
    fn ready(&self, open: &[Lot]) -> f64 {
        let begin = |lot: &Lot| Some((self.finish(lot)? - self.own(lot)).max(self.won));
        open.iter().find_map(begin).unwrap_or(self.won)
    }
}

/// An offer during a round.
#[derive(Clone, Copy, Debug)]
struct Lot {
    zone: ZoneId,
    /// Among all offers.
    place: usize,
    /// T_est, in seconds.
    time: f64,
    complexity: f64,
}

impl Lot {
    fn all(offers: &[Offer]) -> Vec<Self> {
        let lot = |(place, offer): (usize, &Offer)| {
            let (time, complexity) = (offer.time_estimated.as_secs_f64(), offer.complexity);
            Self { zone: offer.zone, place, time, complexity }
        };
        offers.iter().enumerate().map(lot).collect()
    }
}

fn by_credit(offers: &[Offer], bidders: &mut [Candidate]) -> Vec<Award> {
    let mut by_complexity = Lot::all(offers);
    by_complexity.sort_by(|a, b| b.complexity.total_cmp(&a.complexity));
    let mut winners = Vec::new();
    for lot in by_complexity {
        let bids = bidders.iter_mut().filter(|bidder| bidder.room > 0 && bidder.bids_for(&lot));
        // Of equal credit the one that came first.
        let best = bids.reduce(|best, other| if other.bidder.credit > best.bidder.credit { other } else { best });
        if let Some(winner) = best {
            winner.room -= 1;
            winners.push(Award { zone: lot.zone, agent: winner.bidder.agent, share: None });
        }
    }
    winners
}

/// A round that is decided by when zones would be finished.
struct ByTime<'a> {
    /// Not given away, largest first.
    open: Vec<Lot>,
    bidders: Vec<Candidate>,
    standing: &'a Standing<'a>,
    /// When the work as a whole should end, in seconds from now.
    end: f64,
}

/// What a bidder gets.
enum Gets {
    All(usize),
    Part(usize, f64),
}

impl<'a> ByTime<'a> {
    fn new(offers: &[Offer], mut bidders: Vec<Candidate>, standing: &'a Standing<'a>) -> Self {
        bidders.retain(|bidder| bidder.room > 0);
        let end = standing.field.end(standing.now, standing.open) * (1.0 + SLACK);
        Self { open: Lot::all(offers), bidders, standing, end }
    }

    fn award(mut self) -> Vec<Award> {
        let mut winners = Vec::new();
        while let Some(index) = self.first() {
            let Some(gets) = self.best_for(index) else {
                self.bidders.swap_remove(index);
                continue;
            };
            let (place, share) = match gets {
                Gets::All(place) => (place, None),
                Gets::Part(place, share) => (place, Some(share)),
            };
            let offer = self.open.remove(place);
            let bidder = &mut self.bidders[index];
            winners.push(Award { zone: offer.zone, agent: bidder.bidder.agent, share });
            bidder.won += bidder.own(&offer) * share.unwrap_or(1.0);
            bidder.room -= 1;
            if bidder.room == 0 {
                self.bidders.swap_remove(index);
            }
        }
        winners
    }

    /// Whoever is idle first chooses first; of several the one with more credit, then who came first.
    fn first(&self) -> Option<usize> {
        (0..self.bidders.len()).min_by(|&a, &b| {
            let (a, b) = (&self.bidders[a], &self.bidders[b]);
            let by_credit = b.bidder.credit.total_cmp(&a.bidder.credit);
            a.ready(&self.open)
                .total_cmp(&b.ready(&self.open))
                .then(by_credit)
                .then(a.bidder.agent.cmp(&b.bidder.agent))
        })
    }

    fn best_for(&self, index: usize) -> Option<Gets> {
        let bidder = &self.bidders[index];
        let left = self.end - bidder.ready(&self.open);
        let takes_all = self.standing.can_cut.is_none() || left < 4.0 * PIECE_TIME_MIN;
        let wanted = if takes_all { left } else { left * SHARE_OF_REST };
        let bids = |lot: &Lot| bidder.bids_for(lot);
        if let Some(place) = self.open.iter().position(|lot| bids(lot) && bidder.own(lot) <= wanted) {
            return Some(Gets::All(place));
        }
        // All are larger. The largest that can be cut gives it what it can do in time.
        let can_cut = |lot: &Lot| {
            let rest = bidder.own(lot) - wanted;
            let is_worth_it = wanted >= PIECE_TIME_MIN && rest >= PIECE_TIME_MIN;
            bids(lot) && is_worth_it && self.standing.can_cut.is_some_and(|can_cut| can_cut(lot.zone))
        };
        if let Some(place) = self.open.iter().position(can_cut) {
            return Some(Gets::Part(place, wanted / bidder.own(&self.open[place])));
        }
        let in_time = |lot: &Lot| bidder.finish(lot).is_some_and(|finish| finish <= self.end);
        if let Some(place) = self.open.iter().position(in_time) {
            return Some(Gets::All(place));
        }
        (0..self.open.len().min(LEFT_MAX)).find(|&place| self.nobody_sooner(index, place)).map(Gets::All)
    }

    /// Whether none of all agents would have finished a zone before this one, behind all that it has in hand and has won.
    /// All are measured alike, by what the Master knows of them: so of all agents one is the soonest.
    fn nobody_sooner(&self, index: usize, place: usize) -> bool {
        let (lot, now, field) = (&self.open[place], self.standing.now, self.standing.field);
        let time = lot.time;
        let finish = |bidder: &Candidate| field.finish(now, time, bidder.bidder.agent) + bidder.won;
        let own = &self.bidders[index];
        if !own.bids_for(lot) {
            return false;
        }
        let limit = finish(own);
        let mut bids = self.bidders.iter().filter(|bidder| bidder.bids_for(lot));
        let bids_now = |agent: MemberId| self.bidders.iter().any(|it| it.bidder.agent == agent);
        !bids.any(|other| finish(other) < limit) && !field.anybody_sooner(now, time, limit, bids_now)
    }
}

/// The credit after a zone: T_est − T is added. Seconds of reference-machine time.
pub fn credit_after(credit: f64, estimated: Duration, measured: Duration) -> f64 {
    credit + estimated.as_secs_f64() - measured.as_secs_f64()
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use bottega_agents::Time;
    use proptest::prelude::*;

    use super::*;

    /// Agents by (V_cp, load in own seconds, credit), each with room for `room` and a bid for everything, and zones of
    /// these times.
    fn round(
        rule: AuctionRule,
        agents: &[(f64, f64, f64)],
        room: u32,
        times: &[f64],
        can_cut: Option<&dyn Fn(ZoneId) -> bool>,
    ) -> (Vec<Offer>, Vec<Award>) {
        let mut waiting = OpenZones::default();
        for (i, &time) in times.iter().enumerate() {
            let offer =
                Offer { zone: ZoneId(i as u32), complexity: time, time_estimated: Duration::from_secs_f64(time) };
            waiting.insert(rule, offer);
        }
        let open = waiting.time_estimated().as_secs_f64();
        let offers = waiting.offer(1, 16);
        let mut field = Field::default();
        let bidder = |(i, &(own, load, credit)): (usize, &(f64, f64, f64))| {
            let agent = MemberId(i as u32);
            let ready = Time::since_start(Duration::from_secs_f64(load));
            field.set(agent, Some((own, (load > 0.0).then_some(ready))));
            let finish = |offer: &Offer| offer.time_estimated.mul_f64(own) + Duration::from_secs_f64(load);
            let bids = offers.iter().map(|offer| Bid { zone: offer.zone, finish: finish(offer) }).collect();
            Bidder { agent, credit, own, proposal: Proposal { room, bids } }
        };
        let bidders = agents.iter().enumerate().map(bidder).collect();
        let winners = award(rule, &offers, bidders, &Standing { field: &field, now: 0.0, open, can_cut });
        (offers, winners)
    }

    fn whole(zone: u32, agent: u32) -> Award {
        Award { zone: ZoneId(zone), agent: MemberId(agent), share: None }
    }

    #[test]
    fn credit_decides_in_the_paper() {
        let (_, winners) = round(AuctionRule::Paper, &[(1.0, 0.0, -1.0), (1.0, 0.0, 2.0)], 1, &[3.0, 9.0], None);
        assert_eq!(winners, [whole(1, 1), whole(0, 0)]);
    }

    #[test]
    fn a_slow_agent_does_not_take_the_last_big_zone() {
        // The fast one is busy for a second yet, the slow one is idle; the zone takes 2 s here and 20 s there.
        let (_, winners) = round(AuctionRule::FinishingTime, &[(10.0, 0.0, 9.0), (1.0, 1.0, 0.0)], 1, &[2.0], None);
        assert_eq!(winners, [whole(0, 1)]);
        let (_, winners) = round(AuctionRule::Paper, &[(10.0, 0.0, 9.0), (1.0, 1.0, 0.0)], 1, &[2.0], None);
        assert_eq!(winners, [whole(0, 0)]);
    }

    #[test]
    fn a_slow_agent_gets_the_largest_zone_that_it_finishes_in_time() {
        let times = [9.0, 9.0, 9.0, 4.0, 1.0];
        let (_, winners) = round(AuctionRule::FinishingTime, &[(4.0, 0.0, 0.0), (1.0, 20.0, 0.0)], 1, &times, None);
        assert!(winners.contains(&whole(0, 0)), "{winners:?}");
        let (_, winners) = round(AuctionRule::FinishingTime, &[(10.0, 0.0, 0.0), (1.0, 0.0, 0.0)], 1, &times, None);
        assert!(winners.contains(&whole(4, 0)), "{winners:?}");
    }

    #[test]
    fn a_zone_is_cut_for_one_who_is_too_slow_for_all_of_it() {
        // All would be done after 10 / (1 + 1/4) = 8 s; the slow one gets what takes it half of that, 1 s of the zone.
        let agents = [(4.0, 0.0, 0.0), (1.0, 0.0, -1.0)];
        let (_, winners) = round(AuctionRule::FinishingTime, &agents, 1, &[6.0, 4.0], Some(&|_| true));
        let share = winners[0].share.unwrap();
        assert_eq!((winners[0].zone, winners[0].agent), (ZoneId(0), MemberId(0)));
        assert!((share * 6.0 - 1.0).abs() < 0.05, "{share}");
        // The fast one takes the other one whole: it is half of what it can do in time.
        assert_eq!(winners[1], whole(1, 1));
        let (_, winners) = round(AuctionRule::FinishingTime, &agents, 1, &[6.0, 4.0], Some(&|_| false));
        assert!(winners.iter().all(|award| award.share.is_none()), "{winners:?}");
    }

    proptest! {
        #[test]
        fn each_zone_has_one_winner_and_no_hand_is_overfull(
            agents in prop::collection::vec((0.1f64..10.0, 0.0f64..9.0, -5.0f64..5.0), 0..6),
            times in prop::collection::vec(0.0f64..10.0, 0..50),
            (room, paper, cuts) in (0u32..4, any::<bool>(), any::<bool>()),
        ) {
            let rule = if paper { AuctionRule::Paper } else { AuctionRule::FinishingTime };
            let can_cut: &dyn Fn(ZoneId) -> bool = &|zone| zone.0 % 3 != 0;
            let (offers, winners) = round(rule, &agents, room, &times, cuts.then_some(can_cut));
            let mut won: BTreeMap<MemberId, u32> = BTreeMap::new();
            let mut zones: Vec<ZoneId> = winners.iter().map(|award| award.zone).collect();
            for award in &winners {
                *won.entry(award.agent).or_default() += 1;
                prop_assert!(award.share.is_none_or(|share| share > 0.0 && share < 1.0 && award.zone.0 % 3 != 0));
            }
            prop_assert!(won.values().all(|&count| count <= room));
            zones.sort();
            zones.dedup();
            prop_assert_eq!(zones.len(), winners.len());
            // Where all bid, somebody gets something: nothing waits for ever.
            prop_assert!(!winners.is_empty() || agents.is_empty() || offers.is_empty() || room == 0);
        }
    }
}
