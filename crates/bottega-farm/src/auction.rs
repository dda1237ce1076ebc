//! The auction: assigns zones to bidders. Pure functions without I/O: the Master calls them and sends the awards.
//!
//! Source: MAGarRO, section 3.4, "Auctioning": agents try to get the more complex zones first; of several bidders the
//! one with the most credit wins; credit changes in proportion to T_est − T. The default rule divides the finishing
//! time an agent promises by its reliability, and gives each zone to the bidder that finishes it soonest. `docs/magarro.md` states the rules.

mod by_credit;
mod by_time;
mod credit;
mod field;
mod member;
mod open_zones;
mod round;
mod tally;
mod terms;

use self::{by_time::ByTime, round::Candidate};
pub use self::{
    credit::Credit,
    field::Field,
    member::MemberId,
    open_zones::OpenZones,
    tally::{AuctionTally, RoundSummary, Theft},
    terms::{AuctionRule, Award, Bidder, BidderStanding, Decision, Proposal},
};
use crate::Offer;

/// Maximum number of agents called in one round.
pub(crate) const BIDDERS_MAX: usize = 16;
/// Number of agents called in one round if too few lack zones: others then bid for a zone to come after those in their
/// hands, so that agents of a small society compete, too.
pub(crate) const BIDDERS_MIN: usize = 4;

/// Decides one round, and returns the awards. Each zone has at most one winner. A bidder wins at most as many zones as
/// it has room for, and only zones that it bid for.
///
/// - `offers`: the zones on offer, largest first.
/// - `bidders`: those with a proposal; of equal ones under [`AuctionRule::Paper`] the first wins.
/// - `standing`: the loads of all agents and the open work, at the end of the round.
pub fn decide(rule: AuctionRule, offers: &[Offer], bidders: Vec<Bidder>, standing: &BidderStanding<'_>) -> Decision {
    let by_time = |bidders: Vec<Bidder>, weighs: bool| {
        // Divide promised times by the bidder's reliability, if it is weighed
        let worth = |bidder: &Bidder| if weighs { bidder.worth } else { 1.0 };
        let candidate = |bidder: Bidder| {
            let worth = worth(&bidder);
            Candidate::new(bidder, offers, worth)
        };
        ByTime::new(offers, bidders.into_iter().map(candidate).collect(), standing).award()
    };
    match rule {
        // The paper's rule: rank the bidders by credit
        AuctionRule::Paper => {
            let candidate = |bidder| Candidate::new(bidder, offers, 1.0);
            by_credit::decide(offers, &mut bidders.into_iter().map(candidate).collect::<Vec<_>>())
        }
        // By the finishing times as promised
        AuctionRule::Promised => by_time(bidders, false),
        // By the promised finishing times, divided by the bidders' reliability
        AuctionRule::FinishingTime | AuctionRule::Stealing => {
            // Check whether reliability changes the outcome: decide a second time with all promises believed.
            let first = bidders.first().map_or(1.0, |bidder| bidder.worth);
            let differ = bidders.iter().any(|bidder| bidder.worth != first);
            let at_their_word = differ.then(|| by_time(bidders.clone(), false));
            let decision = by_time(bidders, true);
            let credit_decided = at_their_word.is_some_and(|other| other.awards != decision.awards);
            Decision { credit_decided, ..decision }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::{collections::BTreeMap, time::Duration};

    use bottega_agents::Time;
    use proptest::prelude::*;

    use super::*;
    use crate::{Bid, ZoneId};

    /// Runs one round with agents given as (V_cp, load in own seconds, credit), each with room for `room` zones and a
    /// bid for every zone, and zones with these times.
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
            Bidder { agent, credit, worth: 1.0, own, needs: room, proposal: Proposal { room, bids } }
        };
        let bidders = agents.iter().enumerate().map(bidder).collect();
        let standing = BidderStanding { field: &field, now: 0.0, open, can_cut };
        let awards = decide(rule, &offers, bidders, &standing).awards;
        (offers, awards)
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
        assert_eq!(winners, [whole(0, 1), whole(1, 0)], "the fast one finishes the first sooner");
        let (_, winners) = round(AuctionRule::FinishingTime, &[(10.0, 0.0, 0.0), (1.0, 0.0, 0.0)], 1, &times, None);
        assert!(winners.contains(&whole(4, 0)), "{winners:?}");
    }

    #[test]
    fn a_zone_that_two_choose_goes_to_who_finishes_it_sooner() {
        // The slow one is idle and needs 4 s; the fast one is busy for a second and needs another.
        let (_, winners) = round(AuctionRule::FinishingTime, &[(4.0, 0.0, 0.0), (1.0, 1.0, 0.0)], 1, &[1.0; 12], None);
        assert_eq!(winners, [whole(0, 1), whole(1, 0)]);
        let (_, winners) = round(AuctionRule::FinishingTime, &[(4.0, 0.0, 0.0), (1.0, 4.0, 0.0)], 1, &[1.0; 12], None);
        assert_eq!(winners, [whole(0, 0), whole(1, 1)]);
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
