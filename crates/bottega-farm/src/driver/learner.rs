//! The learner of a job: measures how long zones take each machine, from the rows of the Blackboard.

use std::{
    collections::{BTreeMap, BTreeSet},
    sync::Arc,
    time::Duration,
};

use bottega_agents::{AgentId, Revision, machine_of};

use crate::{
    AgentRow, Choice, Forecast, JobLesson, PaintedZone, PictureOutlook, RelativePower, Report, Subject, TaskFeatures,
    WorkRow, ZoneId, ZoneRow, ZoneState,
};

/// Collects zone times from the rows of a job. Ignores zones that are cut, and works that another process has analyzed.
#[derive(Debug, Default)]
pub(super) struct Learner {
    technique: Arc<str>,
    subject: Subject,
    features: Option<TaskFeatures>,
    /// The survey's predictions.
    outlook: Arc<PictureOutlook>,
    /// T_est of each zone before its profile, in reference-machine time.
    expected: BTreeMap<ZoneId, Duration>,
    /// The current order of each zone: its parameters, and the samples that it had before.
    orders: BTreeMap<ZoneId, (Option<Choice>, u32)>,
    cut: BTreeSet<ZoneId>,
    /// V_cp of each agent, as first and last reported.
    powers: BTreeMap<AgentId, [RelativePower; 2]>,
    /// The last reported painting time of each zone, in the agent's own time, and its order.
    reported: BTreeMap<ZoneId, (Revision, Duration)>,
    done: BTreeMap<ZoneId, DoneZone>,
}

/// A zone that was painted as a whole.
#[derive(Clone, Debug)]
struct DoneZone {
    agent: AgentId,
    /// The time of all its samples, in the agent's own time.
    time: Duration,
}

impl Learner {
    /// Returns a learner for jobs of this technique and subject.
    pub(super) fn new(technique: &Arc<str>, subject: &Subject) -> Self {
        Self { technique: Arc::clone(technique), subject: subject.clone(), ..Self::default() }
    }

    /// Sets the prediction features once the zones are cut.
    pub(super) fn begin(&mut self, outlook: Arc<PictureOutlook>) {
        self.outlook = outlook;
    }

    /// Records the row of the work.
    pub(super) fn see_work(&mut self, work: &WorkRow) {
        self.features = Some(work.features);
    }

    /// Records the row of an agent.
    pub(super) fn see_agent(&mut self, row: &AgentRow) {
        self.powers.entry(row.agent.clone()).or_insert([row.power; 2])[1] = row.power;
    }

    /// Records a report to the Master.
    pub(super) fn hear(&mut self, report: &Report) {
        if let Some(painting) = report.outcome.as_ref().ok().filter(|painting| painting.is_measured) {
            self.reported.insert(report.zone, (report.fence, painting.busy));
        }
    }

    /// Records the row of a zone.
    pub(super) fn see_zone(&mut self, row: &ZoneRow) {
        if row.piece.is_some() || row.cut.is_some() {
            self.cut.insert(row.root());
            return;
        }
        match (row.state, row.time_estimated) {
            (ZoneState::Open | ZoneState::Profiled, Some(expected)) if row.result.is_none() && row.attempt == 0 => {
                self.expected.entry(row.zone).or_insert(expected);
            }
            (ZoneState::Profiling, _) => _ = self.orders.insert(row.zone, (row.choice, 0)),
            (ZoneState::Awarded, _) => _ = self.orders.insert(row.zone, (row.choice, row.samples_done())),
            (ZoneState::Done, _) => self.see_done(row),
            _ => {}
        }
    }

    fn see_done(&mut self, row: &ZoneRow) {
        let (Some(agent), Some(result)) = (&row.agent, row.result) else { return };
        let Some((_, time)) = self.reported.get(&row.zone).filter(|(fence, _)| *fence == result.fence) else { return };
        let Some((choice, before)) = self.orders.get(&row.zone) else { return };
        // An agent that decides on other parameters than the profile's discards its samples.
        let before = if *choice == row.choice { *before } else { 0 };
        let painted = result.samples.saturating_sub(before);
        if painted > 0 {
            let time = time.mul_f64(f64::from(result.samples) / f64::from(painted));
            self.done.insert(row.zone, DoneZone { agent: agent.clone(), time });
        }
    }

    /// Returns the final V_cp of a machine; `None`: unknown. Agents learn it from each other's estimates, so all values may
    /// drift together: the mean over all machines is therefore reset to its initial value.
    fn power(&self, machine: &str) -> Option<RelativePower> {
        let mean = |logs: &[f64]| logs.iter().sum::<f64>() / logs.len() as f64;
        let mut changes: BTreeMap<&str, Vec<[f64; 2]>> = BTreeMap::new();
        for (agent, powers) in &self.powers {
            changes.entry(machine_of(&agent.name)).or_default().push(powers.map(|power| power.get().ln()));
        }
        let of = |powers: &Vec<[f64; 2]>, which: usize| mean(&powers.iter().map(|it| it[which]).collect::<Vec<_>>());
        let drifts: Vec<f64> = changes.values().map(|powers| of(powers, 1) - of(powers, 0)).collect();
        changes.get(machine).map(|powers| RelativePower::new((of(powers, 1) - mean(&drifts)).exp()))
    }

    /// Returns the zones whose time can be compared with its prediction.
    fn compared(&self) -> impl Iterator<Item = (ZoneId, Duration, &DoneZone)> {
        let whole = self.done.iter().filter(|(zone, _)| !self.cut.contains(zone));
        whole.filter_map(|(&zone, done)| Some((zone, *self.expected.get(&zone)?, done)))
    }

    /// Returns the accuracy of the times predicted before profiling.
    pub(super) fn forecast(&self) -> Option<Forecast> {
        let pair = |(_, expected, done): (ZoneId, Duration, &DoneZone)| {
            let power = self.power(machine_of(&done.agent.name))?;
            Some((expected.as_secs_f64(), power.to_reference(done.time).as_secs_f64()))
        };
        Forecast::of(&self.compared().filter_map(pair).collect::<Vec<_>>())
    }

    /// Returns the lesson of each machine, by its name.
    ///
    /// - `samples`: the samples per pixel that the user requested.
    pub(super) fn lessons(&self, samples: u32) -> BTreeMap<String, JobLesson> {
        let Some(features) = self.features else { return BTreeMap::new() };
        let mut lessons: BTreeMap<String, JobLesson> = BTreeMap::new();
        let new = || JobLesson {
            technique: Arc::clone(&self.technique),
            subject: self.subject.clone(),
            features,
            outlook: Arc::clone(&self.outlook),
            power: None,
            to_reference: RelativePower::REFERENCE,
            zones: Vec::new(),
        };
        for (zone, _, done) in self.compared() {
            let Some(outlook) = self.outlook.zones.get(zone.index()) else { continue };
            let lesson = lessons.entry(machine_of(&done.agent.name).to_owned()).or_insert_with(new);
            lesson.zones.push(PaintedZone { outlook: *outlook, samples, time: done.time });
        }
        lessons.iter_mut().for_each(|(machine, lesson)| {
            lesson.to_reference = self.power(machine).unwrap_or(RelativePower::REFERENCE);
        });
        // The speed relative to other machines needs at least two.
        if lessons.len() > 1 {
            lessons.iter_mut().for_each(|(machine, lesson)| lesson.power = self.power(machine));
        }
        lessons
    }
}

#[cfg(test)]
mod tests {
    use bottega_agents::BlobId;
    use bottega_engines::Tunables;
    use bottega_image::{Rect, Sides};

    use super::*;
    use crate::{NeighborDifference, Painting, ResultRef, TaskOutlook, WorkId};

    const SECOND: Duration = Duration::from_secs(1);

    fn choice(samples: u32, max_depth: u32) -> Choice {
        Choice { tunables: Tunables { max_depth, light_samples: 1 }, samples, bands: Sides::all(0) }
    }

    fn row(zone: u32) -> ZoneRow {
        let rect = Rect::of_size(8, 8);
        let row = ZoneRow::open(WorkId(1), ZoneId(zone), rect, 64.0, NeighborDifference::default());
        ZoneRow { time_estimated: Some(2 * SECOND), ..row }
    }

    fn result(samples: u32) -> Option<ResultRef> {
        Some(ResultRef { fence: Revision(3), samples, digest: BlobId([0; 32]) })
    }

    fn report(zone: u32, samples: u32, chosen: Choice) -> Report {
        let painting = Painting {
            choice: chosen,
            result: result(samples).unwrap(),
            time_measured: SECOND,
            busy: 4 * SECOND,
            is_measured: true,
            was_ready: true,
            goal: samples,
            time_left: SECOND,
            error: None,
        };
        Report { zone: ZoneId(zone), fence: Revision(3), outcome: Ok(painting), reasons: None }
    }

    /// Reports a zone that is profiled with 4 samples and painted with 16 more in 4 s.
    fn painted(learner: &mut Learner, zone: u32, agent: &str, chosen: Choice) {
        let agent = Some(AgentId::new(agent));
        let row = row(zone);
        learner.see_zone(&row);
        learner.see_zone(&ZoneRow { state: ZoneState::Profiling, agent: agent.clone(), ..row.clone() });
        let profiled = ZoneRow { choice: Some(choice(20, 8)), result: result(4), ..row };
        learner.see_zone(&ZoneRow { state: ZoneState::Profiled, time_estimated: Some(SECOND), ..profiled.clone() });
        learner.see_zone(&ZoneRow { state: ZoneState::Awarded, agent: agent.clone(), ..profiled.clone() });
        learner.hear(&report(zone, 20, chosen));
        let done = ZoneRow { state: ZoneState::Done, agent, choice: Some(chosen), result: result(20), ..profiled };
        learner.see_zone(&done);
    }

    fn learner() -> Learner {
        let mut learner = Learner::new(&"builtin path".into(), &Subject::default());
        let zones = vec![TaskOutlook { sample_time: 0.1, ..TaskOutlook::default() }; 4];
        learner.begin(Arc::new(PictureOutlook { zones, ..PictureOutlook::default() }));
        learner.features = Some(TaskFeatures::default());
        for (agent, power) in [("render-1@fast.7", 0.5), ("render-1@slow", 2.0)] {
            learner.powers.insert(AgentId::new(agent), [RelativePower::new(power), RelativePower::new(3.0 * power)]);
        }
        learner
    }

    #[test]
    fn each_machine_learns_from_its_own_zones_in_its_own_time() {
        let mut learner = learner();
        painted(&mut learner, 0, "render-1@fast.7", choice(20, 8));
        painted(&mut learner, 1, "render-1@slow", choice(20, 8));
        // The painter has chosen other parameters, so it started again: the time includes all samples.
        painted(&mut learner, 2, "render-1@slow", choice(20, 4));
        let lessons = learner.lessons(20);
        let times =
            |machine: &str| lessons[machine].zones.iter().map(|zone| zone.time.as_secs_f64()).collect::<Vec<_>>();
        assert_eq!(lessons.len(), 2);
        assert_eq!((times("fast"), times("slow")), (vec![5.0], vec![5.0, 4.0]));
        // All agents have drifted equally, which has no effect.
        for (machine, power) in [("slow", 2.0), ("fast", 0.5)] {
            assert!((lessons[machine].power.unwrap().get() - power).abs() < 1e-9, "{machine}");
        }
        // Predicted are 2 s on the reference machine; measured are 10 s, 2.5 s and 2 s.
        let forecast = learner.forecast().unwrap();
        assert_eq!(forecast.zones, 3);
        assert!((forecast.median_error - 0.2).abs() < 1e-9, "{forecast:?}");
    }

    #[test]
    fn a_zone_during_which_its_painter_loaded_something_teaches_nothing() {
        let mut learner = learner();
        let cold = report(0, 20, choice(20, 8));
        let cold = Report { outcome: cold.outcome.map(|it| Painting { is_measured: false, ..it }), ..cold };
        learner.hear(&cold);
        assert!(learner.reported.is_empty());
    }

    #[test]
    fn zones_in_pieces_and_works_that_others_began_teach_nothing() {
        let mut learner = learner();
        painted(&mut learner, 0, "render-1@slow", choice(20, 8));
        let piece = ZoneRow { piece: Some(Rect::of_size(4, 8)), root: Some(ZoneId(0)), zone: ZoneId(9), ..row(0) };
        learner.see_zone(&piece);
        assert_eq!((learner.lessons(20).len(), learner.forecast()), (0, None));
        let mut late = Learner { expected: BTreeMap::new(), ..self::learner() };
        let done = ZoneRow { state: ZoneState::Done, result: result(20), time_measured: Some(SECOND), ..row(1) };
        late.see_zone(&ZoneRow { agent: Some(AgentId::new("render-1@slow")), ..done });
        assert!(late.lessons(20).is_empty());
    }
}
