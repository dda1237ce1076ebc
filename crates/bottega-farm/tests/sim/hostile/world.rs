//! The world of a hostile platform: machines that paint, tiles that exist or do not, the film, and what visitors say.

use std::{
    collections::{BTreeMap, BTreeSet},
    sync::Arc,
    time::Duration,
};

use bottega_agents::{AgentId, BlobId, Random, Revision, Time, World};
use bottega_farm::{
    BAND_MAX, Bid, FarmCompletion, FarmEffect, Mask, Offer, PaintOrder, PaintResult, RelativePower, ResultRef,
    VisitorEffect, VisitorReport, WorkRow, ZoneId, ZoneRow, ZoneState,
};
use bottega_image::Rect;

use super::cast::{AnyAgent, AnyCompletion, AnyEffect};
use crate::sim::{stage::MachineWorld, survey::survey};

type Reports = Vec<(Duration, AnyCompletion)>;

/// The state of the world, and a log of its events.
#[derive(Default)]
pub(super) struct HostileWorld {
    /// V_cp by agent.
    pub(super) power: BTreeMap<AgentId, f64>,
    /// Visitors that misbehave.
    pub(super) rude: BTreeSet<AgentId>,
    /// The time at which each machine is free.
    free: BTreeMap<AgentId, Time>,
    /// The paintings under way, by order, with their end.
    sittings: BTreeMap<(AgentId, ZoneId, Revision), (Time, Time)>,
    /// All paintings, by digest: their pixels and samples.
    tiles: BTreeMap<BlobId, (Rect, u32)>,
    work: Option<Arc<WorkRow>>,
    pub(super) zones: BTreeMap<ZoneId, ZoneRow>,
    /// The content of the present Master's film.
    pub(super) composed: BTreeMap<ZoneId, (Mask, Rect)>,
    pub(super) finished: Option<Vec<ZoneId>>,
    pub(super) left_out: BTreeMap<AgentId, String>,
    /// Tiles to compose that were never painted.
    pub(super) missing: usize,
    pub(super) survey_shrink: u32,
}

impl HostileWorld {
    pub(super) fn new(survey_shrink: u32) -> Self {
        Self { survey_shrink, ..Self::default() }
    }

    fn survey_of(&mut self, agent: &AgentId, effect: &FarmEffect, random: &mut Random) -> (Duration, FarmCompletion) {
        match *effect {
            FarmEffect::Survey { width, height, .. } => {
                let (width, height) = (width / self.survey_shrink, height / self.survey_shrink);
                (Duration::from_millis(100), FarmCompletion::Surveyed(Ok(Arc::new(survey(width, height)))))
            }
            FarmEffect::Fetch(work) => (Duration::from_millis(50), FarmCompletion::Fetched(work)),
            _ => {
                let power = RelativePower::new(self.power[agent] * (0.75 + 0.5 * random.unit()));
                (Duration::from_millis(20), FarmCompletion::Benchmarked { power, lanes: 1.0 })
            }
        }
    }

    /// Paints an order. Returns the time of its end, and its result.
    fn paint(
        &mut self,
        now: Time,
        agent: &AgentId,
        order: &PaintOrder,
        random: &mut Random,
    ) -> (Duration, PaintResult) {
        // Without the samples before, it begins with the first, to the same bits.
        let has_before = |from: ResultRef| self.tiles.get(&from.digest) == Some(&(order.rect, from.samples));
        let start = if order.from.is_some_and(has_before) { order.samples.start } else { 0 };
        let cost = MachineWorld::cost(&order.rect, order.samples.end - start);
        let begin = self.free.get(agent).copied().unwrap_or_default().max(now);
        let power = self.power.get(agent).copied().unwrap_or(1.0);
        let busy = cost.mul_f64(power * (0.9 + 0.2 * random.unit()));
        self.free.insert(agent.clone(), begin + busy);
        self.sittings.insert((agent.clone(), order.zone, order.fence), (begin, begin + busy));
        let digest = digest(order);
        self.tiles.insert(digest, (order.rect, order.samples.end));
        let result = ResultRef { fence: order.fence, samples: order.samples.end, digest };
        (begin + busy - now, PaintResult { result, busy, is_measured: true, error: None, unfinished: 1.0 })
    }

    fn look(&self, now: Time, agent: &AgentId, orders: Vec<(ZoneId, Revision)>) -> FarmCompletion {
        let progress = |(zone, fence)| {
            let (begin, end) = *self.sittings.get(&(agent.clone(), zone, fence))?;
            let painted = now.min(end).since(begin.min(now));
            Some((zone, fence, painted.as_nanos() as u64))
        };
        FarmCompletion::Looked(orders.into_iter().filter_map(progress).collect())
    }

    /// Puts a zone into the film, if it was ever painted.
    fn compose(&mut self, zone: ZoneId, result: &ResultRef, mask: Mask) -> Result<(), String> {
        let row = &self.zones[&zone];
        assert_eq!((row.state, row.result), (ZoneState::Done, Some(*result)), "{zone} is composed and not done");
        let Some(&(rect, samples)) = self.tiles.get(&result.digest) else {
            self.missing += 1;
            return Err("there is no such tile".to_owned());
        };
        let frame = self.work.as_ref().expect("the film is begun").settings.frame;
        let choice = row.choice.expect("what is done has a choice");
        assert_eq!(rect, row.painted(&choice, &frame), "{zone} is composed of other pixels");
        assert_eq!(samples, row.goal_samples(&choice), "{zone} is composed of other samples");
        assert!(self.composed.insert(zone, (mask, rect)).is_none(), "{zone} is composed twice");
        Ok(())
    }

    fn farm(&mut self, now: Time, agent: &AgentId, effect: FarmEffect, random: &mut Random, reports: &mut Reports) {
        let mut report = |after, completion| reports.push((after, AnyCompletion::Farm(completion)));
        match effect {
            FarmEffect::Survey { .. } | FarmEffect::Benchmark | FarmEffect::Fetch(_) => {
                let (after, completion) = self.survey_of(agent, &effect, random);
                report(after, completion);
            }
            FarmEffect::Paint(order) => {
                let (after, painted) = self.paint(now, agent, &order, random);
                let (zone, fence) = (order.zone, order.fence);
                report(after, FarmCompletion::Painted { zone, fence, outcome: Ok(painted) });
            }
            FarmEffect::Look(orders) => report(Duration::ZERO, self.look(now, agent, orders)),
            FarmEffect::BeginFilm(work) => {
                self.work = Some(work);
                self.composed.clear();
            }
            FarmEffect::ZoneChanged(row) => {
                let bands = row.choice.map_or([0; 4], |choice| choice.bands.into_array());
                assert!(bands.iter().all(|band| *band <= BAND_MAX), "{} has a band of {bands:?}", row.zone);
                self.zones.insert(row.zone, (*row).clone());
            }
            FarmEffect::Compose { zone, result, mask } => {
                let outcome = self.compose(zone, &result, mask);
                report(Duration::from_millis(1), FarmCompletion::Composed { zone, outcome });
            }
            FarmEffect::Finish { failed } => {
                assert!(self.finished.is_none(), "the work ends once");
                self.finished = Some(failed);
            }
            FarmEffect::LeftOut { agent, reason } => _ = self.left_out.insert(agent, reason),
            FarmEffect::Compare { zone, .. } => panic!("{zone} is compared by its look, and all engines are exact"),
            FarmEffect::Abandon { reason } => panic!("{reason}"),
            FarmEffect::Drop { .. }
            | FarmEffect::Dismissed { .. }
            | FarmEffect::TooFew { .. }
            | FarmEffect::Stalled { .. }
            | FarmEffect::AgentChanged(_)
            | FarmEffect::RoundClosed(_)
            | FarmEffect::Stolen(_)
            | FarmEffect::Analyzed { .. } => {}
        }
    }

    /// The step of a visitor that keeps to the rules.
    fn visit(&mut self, now: Time, agent: &AgentId, effect: VisitorEffect, random: &mut Random, reports: &mut Reports) {
        match effect {
            VisitorEffect::Offers { call, offers, room, .. } => {
                let load = self.free.get(agent).map_or(Duration::ZERO, |free| free.since(now));
                let power = self.power[agent];
                let bid = |offer: &Offer| Bid { zone: offer.zone, finish: offer.time_estimated.mul_f64(power) + load };
                let bids = offers.iter().map(bid).collect();
                let answer = VisitorReport::Bids { call, room, bids };
                reports.push((Duration::from_millis(20), AnyCompletion::Visitor(answer)));
            }
            VisitorEffect::Paint { order, .. } => {
                let (after, painted) = self.paint(now, agent, &order, random);
                let (zone, fence) = (order.zone, order.fence);
                let outcome = Ok((painted.result, painted.busy));
                let report = VisitorReport::Painted { zone, fence, outcome };
                reports.push((after, AnyCompletion::Visitor(report)));
            }
            VisitorEffect::Welcome(_)
            | VisitorEffect::Rejected { .. }
            | VisitorEffect::Withdrawn { .. }
            | VisitorEffect::LeftOut { .. } => {}
        }
    }
}

/// The step of a visitor that breaks the rules: nothing, nonsense, or too much.
fn intrude(effect: &VisitorEffect, random: &mut Random, reports: &mut Reports) {
    let times = [Duration::ZERO, Duration::from_secs(1 << 30), Duration::MAX];
    while random.unit() < 0.6 {
        let time = times[random.below(times.len())];
        let report = match (random.below(6), effect) {
            (0..4, VisitorEffect::Offers { call, offers, .. }) => {
                let bid = |zone| Bid { zone, finish: time };
                let offered = offers.iter().map(|offer| bid(offer.zone)).chain([bid(ZoneId(u32::MAX))]);
                let bids = if random.unit() < 0.5 { offered.collect() } else { Vec::new() };
                let room = [0, 1, u32::MAX][random.below(3)];
                VisitorReport::Bids { call: call + random.below(2) as u64, room, bids }
            }
            (0..4, VisitorEffect::Paint { order, .. }) => {
                let fence = Revision(order.fence.0 - random.below(2) as u64);
                let digest = BlobId([0xee; 32]);
                let nothing = ResultRef { fence: Revision::ABSENT, samples: u32::MAX, digest };
                let outcome = if random.unit() < 0.5 { Ok((nothing, time)) } else { Err("no reason".to_owned()) };
                VisitorReport::Painted { zone: order.zone, fence, outcome }
            }
            (4, _) => VisitorReport::Leaves,
            (5, _) => VisitorReport::Returns,
            _ => VisitorReport::Refuses { call: random.below(64) as u64 },
        };
        reports.push((Duration::from_millis(random.below(2000) as u64), AnyCompletion::Visitor(report)));
    }
    if random.unit() < 0.5 {
        reports.push((Duration::from_secs(3), AnyCompletion::Visitor(VisitorReport::Returns)));
    }
}

/// Returns a stand-in for the digest of a zone's samples, equal for all agents.
fn digest(order: &PaintOrder) -> BlobId {
    let PaintOrder { zone, rect, samples, tunables, .. } = order;
    let words = [zone.0, samples.end, rect.x0, rect.y0, rect.x1, rect.y1, tunables.max_depth, tunables.light_samples];
    let mut digest = [0; 32];
    digest.chunks_exact_mut(4).zip(words).for_each(|(bytes, word)| bytes.copy_from_slice(&word.to_le_bytes()));
    BlobId(digest)
}

impl World<AnyAgent> for HostileWorld {
    fn perform(
        &mut self,
        now: Time,
        agent: &AgentId,
        effect: AnyEffect,
        random: &mut Random,
        reports: &mut Vec<(Duration, AnyCompletion)>,
    ) {
        match effect {
            AnyEffect::Farm(effect) => self.farm(now, agent, effect, random, reports),
            AnyEffect::Visitor(effect) if self.rude.contains(agent) => intrude(&effect, random, reports),
            AnyEffect::Visitor(effect) => self.visit(now, agent, effect, random, reports),
        }
    }
}
