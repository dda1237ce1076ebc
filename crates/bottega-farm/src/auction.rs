//! Who gets which zone. Pure: the Master asks, and sends what comes out.
//!
//! Source: MAGarRO, section 3.4, "Auctioning": agents try to get the more complex zones first; among several the one
//! with more credit wins; credit rises or falls in proportion to T_est − T.

use std::{cmp::Reverse, collections::BTreeMap, time::Duration};

use bottega_agents::AgentId;

use crate::{AgentRow, Bid, Offer, ZoneId, adaptation::scaled};

/// Zones offered in one call for proposals at most: the largest, and some of the smallest for agents that are too slow
/// for those.
pub(crate) const OFFERS_MAX: usize = 32;
const SMALL_OFFERS: usize = 8;
/// Agents called in one round at most.
pub(crate) const BIDDERS_MAX: usize = 16;
/// How far beyond the expected end of all work a zone may be finished, as a share of the time until then.
const SLACK: f64 = 0.02;

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

/// What a bidder said.
#[derive(Clone, Debug, PartialEq)]
pub struct Proposal {
    /// Zones that it has room for.
    pub room: u32,
    /// When it would finish which zone.
    pub bids: Vec<Bid>,
}

/// What the Master knows of an agent besides its proposal.
#[derive(Clone, Debug, PartialEq)]
pub struct Contender {
    /// Its row.
    pub row: AgentRow,
    /// T_est of all that it has in hand, reference-machine time.
    pub load: Duration,
}

impl Contender {
    /// How long so much reference-machine time takes it, all its processors together.
    pub fn own(&self, reference: Duration) -> Duration {
        scaled(self.row.power.to_own(reference), 1.0 / self.row.lanes.max(1e-6))
    }
}

/// How large a zone is; of equal ones the first by id counts as the largest.
type Rank = (u64, Reverse<ZoneId>);

/// The zones that wait for an auction, largest last.
#[derive(Clone, Debug, Default)]
pub struct OpenZones {
    by_rank: BTreeMap<Rank, Offer>,
    time: Duration,
}

impl OpenZones {
    /// What counts as large: T_est by default, complexity in the paper. Positive floats order as their bits do.
    fn rank(rule: AuctionRule, offer: &Offer) -> Rank {
        let rank = match rule {
            AuctionRule::Paper => offer.complexity.max(0.0).to_bits(),
            AuctionRule::FinishingTime => u64::try_from(offer.time_estimated.as_nanos()).unwrap_or(u64::MAX),
        };
        (rank, Reverse(offer.zone))
    }

    /// Adds a zone.
    pub fn insert(&mut self, rule: AuctionRule, offer: Offer) {
        if self.by_rank.insert(Self::rank(rule, &offer), offer).is_none() {
            self.time += offer.time_estimated;
        }
    }

    /// Takes a zone away, given as it was added.
    pub fn remove(&mut self, rule: AuctionRule, offer: &Offer) {
        if let Some(offer) = self.by_rank.remove(&Self::rank(rule, offer)) {
            self.time -= offer.time_estimated;
        }
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.by_rank.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.by_rank.is_empty()
    }

    /// T_est of all.
    pub fn time_estimated(&self) -> Duration {
        self.time
    }

    /// What to offer in one call, largest first: all, or the largest and some of the smallest.
    pub fn offers(&self) -> Vec<Offer> {
        let smallest_first = self.by_rank.values().copied();
        if self.by_rank.len() <= OFFERS_MAX {
            return smallest_first.rev().collect();
        }
        let mut offers: Vec<Offer> = smallest_first.clone().rev().take(OFFERS_MAX - SMALL_OFFERS).collect();
        let small: Vec<Offer> = smallest_first.take(SMALL_OFFERS).collect();
        offers.extend(small.into_iter().rev());
        offers
    }
}

/// When all the work will be done if it is spread without loss, from now.
///
/// - `open`: T_est of all that nobody has in hand.
pub fn expected_end(contenders: &BTreeMap<AgentId, Contender>, open: Duration) -> Duration {
    let speed = |contender: &Contender| contender.row.lanes / contender.row.power.get();
    let speed: f64 = contenders.values().map(speed).sum();
    let in_hand: f64 = contenders.values().map(|contender| contender.load.as_secs_f64()).sum();
    if speed > 0.0 {
        Duration::try_from_secs_f64((open.as_secs_f64() + in_hand) / speed).unwrap_or(Duration::MAX)
    } else {
        Duration::MAX
    }
}

/// Finds the winners of one round. Each zone has at most one, each bidder wins at most as many as it has room for, and
/// nothing that it did not bid for.
///
/// - `offers`: largest first.
/// - `contenders`: all agents of the Master, also those that do not bid now.
/// - `end`: [`expected_end`].
pub fn award(
    rule: AuctionRule,
    offers: &[Offer],
    proposals: &BTreeMap<AgentId, Proposal>,
    contenders: &BTreeMap<AgentId, Contender>,
    end: Duration,
) -> Vec<(ZoneId, AgentId)> {
    let mut bidders: Vec<Bidder<'_>> = proposals
        .iter()
        .filter_map(|(agent, proposal)| {
            let contender = contenders.get(agent)?;
            let finish = proposal.bids.iter().map(|bid| (bid.zone, bid.finish)).collect();
            Some(Bidder { agent, contender, room: proposal.room, finish })
        })
        .collect();
    match rule {
        AuctionRule::Paper => award_by_credit(offers, &mut bidders),
        AuctionRule::FinishingTime => award_by_time(offers, bidders, contenders, end),
    }
}

struct Bidder<'a> {
    agent: &'a AgentId,
    contender: &'a Contender,
    room: u32,
    finish: BTreeMap<ZoneId, Duration>,
}

fn award_by_credit(offers: &[Offer], bidders: &mut [Bidder<'_>]) -> Vec<(ZoneId, AgentId)> {
    let mut by_complexity: Vec<&Offer> = offers.iter().collect();
    by_complexity.sort_by(|a, b| b.complexity.total_cmp(&a.complexity));
    let mut winners = Vec::new();
    for offer in by_complexity {
        let bids = bidders.iter_mut().filter(|bidder| bidder.room > 0 && bidder.finish.contains_key(&offer.zone));
        // Of equal credit the first by name.
        let best = bids.reduce(
            |best, other| {
                if other.contender.row.credit > best.contender.row.credit { other } else { best }
            },
        );
        if let Some(winner) = best {
            winner.room -= 1;
            winners.push((offer.zone, winner.agent.clone()));
        }
    }
    winners
}

fn award_by_time(
    offers: &[Offer],
    mut bidders: Vec<Bidder<'_>>,
    contenders: &BTreeMap<AgentId, Contender>,
    end: Duration,
) -> Vec<(ZoneId, AgentId)> {
    let mut open: Vec<&Offer> = offers.iter().collect();
    let mut winners = Vec::new();
    // What each has won in this round, in its own time.
    let mut won: BTreeMap<&AgentId, Duration> = BTreeMap::new();
    let end = scaled(end, 1.0 + SLACK);
    bidders.retain(|bidder| bidder.room > 0);
    loop {
        let ready = |bidder: &Bidder<'_>| bidder.contender.own(bidder.contender.load) + delay(&won, bidder.agent);
        // Whoever is idle first chooses first; of several the one with more credit, then by name.
        let first = (0..bidders.len()).min_by(|&a, &b| {
            let (a, b) = (&bidders[a], &bidders[b]);
            let by_credit = b.contender.row.credit.total_cmp(&a.contender.row.credit);
            ready(a).cmp(&ready(b)).then(by_credit).then(a.agent.cmp(b.agent))
        });
        let Some(index) = first else { return winners };
        let bidder = &mut bidders[index];
        let finish = |offer: &Offer| Some(bidder.finish.get(&offer.zone)?.saturating_add(delay(&won, bidder.agent)));
        // When the soonest of all others would have finished it, behind all that it has in hand and has won.
        let soonest_other = |offer: &Offer| {
            let others = contenders.iter().filter(|(agent, _)| *agent != bidder.agent);
            others.map(|(agent, it)| it.own(it.load.saturating_add(offer.time_estimated)) + delay(&won, agent)).min()
        };
        let in_time = |offer: &&Offer| finish(offer).is_some_and(|finish| finish <= end);
        let nobody_sooner = |offer: &&Offer| {
            finish(offer).is_some_and(|finish| soonest_other(offer).is_none_or(|other| finish <= other))
        };
        let best = open.iter().copied().find(in_time).or_else(|| open.iter().copied().find(nobody_sooner));
        let Some(offer) = best else {
            bidders.swap_remove(index);
            continue;
        };
        open.retain(|other| other.zone != offer.zone);
        winners.push((offer.zone, bidder.agent.clone()));
        *won.entry(bidder.agent).or_default() += bidder.contender.own(offer.time_estimated);
        bidder.room -= 1;
        if bidder.room == 0 {
            bidders.swap_remove(index);
        }
    }
}

fn delay(won: &BTreeMap<&AgentId, Duration>, agent: &AgentId) -> Duration {
    won.get(agent).copied().unwrap_or_default()
}

/// The credit after a zone: T_est − T is added. Seconds of reference-machine time.
pub fn credit_after(credit: f64, estimated: Duration, measured: Duration) -> f64 {
    credit + estimated.as_secs_f64() - measured.as_secs_f64()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::RelativePower;

    fn seconds(seconds: f64) -> Duration {
        Duration::from_secs_f64(seconds)
    }

    /// Agents by (V_cp, load, credit), each with room for `room` and a bid for everything, and zones of these times.
    fn round(
        rule: AuctionRule,
        agents: &[(f64, f64, f64)],
        room: u32,
        times: &[f64],
    ) -> (Vec<Offer>, Vec<(ZoneId, AgentId)>) {
        let open = times.iter().enumerate().map(|(i, &time)| Offer {
            zone: ZoneId(i as u32),
            complexity: time,
            time_estimated: seconds(time),
        });
        let mut waiting = OpenZones::default();
        open.for_each(|offer| waiting.insert(rule, offer));
        let offers = waiting.offers();
        let contenders: BTreeMap<AgentId, Contender> = agents
            .iter()
            .enumerate()
            .map(|(i, &(power, load, credit))| {
                let agent = AgentId::new(format!("a{i}"));
                let row = AgentRow { agent: agent.clone(), power: RelativePower::new(power), lanes: 1.0, credit };
                (agent, Contender { row, load: seconds(load) })
            })
            .collect();
        let proposals = contenders
            .iter()
            .map(|(agent, contender)| {
                let bid = |offer: &Offer| Bid {
                    zone: offer.zone,
                    finish: contender.own(contender.load + offer.time_estimated),
                };
                (agent.clone(), Proposal { room, bids: offers.iter().map(bid).collect() })
            })
            .collect();
        let end = expected_end(&contenders, waiting.time_estimated());
        let winners = award(rule, &offers, &proposals, &contenders, end);
        (offers, winners)
    }

    #[test]
    fn credit_decides_in_the_paper() {
        let (_, winners) = round(AuctionRule::Paper, &[(1.0, 0.0, -1.0), (1.0, 0.0, 2.0)], 1, &[3.0, 9.0]);
        assert_eq!(winners, [(ZoneId(1), AgentId::new("a1")), (ZoneId(0), AgentId::new("a0"))]);
    }

    #[test]
    fn a_slow_agent_does_not_take_the_last_big_zone() {
        // The fast one is busy for a second yet, the slow one is idle; the zone takes 2 s here and 20 s there.
        let (_, winners) = round(AuctionRule::FinishingTime, &[(10.0, 0.0, 9.0), (1.0, 1.0, 0.0)], 1, &[2.0]);
        assert_eq!(winners, [(ZoneId(0), AgentId::new("a1"))]);
        let (_, winners) = round(AuctionRule::Paper, &[(10.0, 0.0, 9.0), (1.0, 1.0, 0.0)], 1, &[2.0]);
        assert_eq!(winners, [(ZoneId(0), AgentId::new("a0"))]);
    }

    #[test]
    fn a_slow_agent_gets_the_largest_zone_that_it_finishes_in_time() {
        let times = [9.0, 9.0, 9.0, 4.0, 1.0];
        let (_, winners) = round(AuctionRule::FinishingTime, &[(4.0, 0.0, 0.0), (1.0, 20.0, 0.0)], 1, &times);
        assert!(winners.contains(&(ZoneId(0), AgentId::new("a0"))), "{winners:?}");
        let (_, winners) = round(AuctionRule::FinishingTime, &[(10.0, 0.0, 0.0), (1.0, 0.0, 0.0)], 1, &times);
        assert!(winners.contains(&(ZoneId(4), AgentId::new("a0"))), "{winners:?}");
    }

    #[test]
    fn many_zones_are_offered_by_their_ends() {
        let mut open = OpenZones::default();
        for i in 0..100 {
            let time_estimated = Duration::from_secs(u64::from(i));
            open.insert(AuctionRule::default(), Offer { zone: ZoneId(i), complexity: 1.0, time_estimated });
        }
        let offered = open.offers();
        assert_eq!(offered.len(), OFFERS_MAX);
        assert_eq!((offered[0].zone, offered[OFFERS_MAX - 1].zone), (ZoneId(99), ZoneId(0)));
    }

    proptest! {
        #[test]
        fn each_zone_has_one_winner_and_no_hand_is_overfull(
            agents in prop::collection::vec((0.1f64..10.0, 0.0f64..9.0, -5.0f64..5.0), 0..6),
            times in prop::collection::vec(0.0f64..10.0, 0..50),
            (room, paper) in (0u32..4, any::<bool>()),
        ) {
            let rule = if paper { AuctionRule::Paper } else { AuctionRule::FinishingTime };
            let (offers, winners) = round(rule, &agents, room, &times);
            let mut won: BTreeMap<&AgentId, u32> = BTreeMap::new();
            let mut zones: Vec<ZoneId> = winners.iter().map(|(zone, _)| *zone).collect();
            for (_, agent) in &winners {
                *won.entry(agent).or_default() += 1;
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
