//! The experience of a machine: how long zones took it in the works before. Text in, text out; files are the caller's.
//!
//! The survey predicts the time of a zone by a fitted sum of counts. What a machine learns is the logarithm of the
//! measured time over that: a mean for the technique, what the kind of the picture adds to it, what the kind of the zone
//! adds, what both together add, and what the zone's size adds. So a prediction falls back from what was learnt of just
//! such zones to what was learnt of all. V_cp is learnt in the same way.
//!
//! A picture does not depend on it: zones are cut, and rules asked, by the survey alone.

mod kind;
mod lessons;

use std::{sync::Arc, time::Duration};

use serde::{Deserialize, Serialize};

use self::{kind::TaskKind, lessons::Lessons};
use crate::{RelativePower, TaskFeatures, TaskOutlook};

/// The form of the text. Another number is not read.
const FORMAT: u32 = 1;
/// Longest text that is read.
const TEXT_MAX: usize = 1 << 20;
/// A job that paints for so many seconds counts in full; a shorter one tells less, for all has a beginning.
const TELLING_SECONDS: f64 = 1.0;

/// What a machine has learnt of how long zones take it, and of its V_cp.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Experience {
    /// Jobs that it was learnt in.
    jobs: u64,
    /// ln of the measured time over the one that the survey predicts.
    paces: Lessons,
    /// ln V_cp.
    powers: Lessons,
}

/// A zone that was painted as a whole.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PaintedZone {
    /// What the survey said of it.
    pub outlook: TaskOutlook,
    /// Its samples a pixel.
    pub samples: u32,
    /// What all of them took, in the painter's own processor time.
    pub time: Duration,
}

/// What a machine did in a job.
#[derive(Clone, Debug, PartialEq)]
pub struct JobLesson {
    /// Engine, integrator and whatever else decides how a path is followed.
    pub technique: Arc<str>,
    /// What the survey said of the whole picture.
    pub features: TaskFeatures,
    /// V_cp in the end.
    pub power: Option<RelativePower>,
    /// The zones that it painted.
    pub zones: Vec<PaintedZone>,
}

/// One thing that was learnt, for those who look on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LearntFactor {
    /// `time` or `power`: whether it is a factor of the time that the survey predicts, or of V_cp.
    pub of: String,
    /// For which tasks.
    pub tasks: String,
    /// The factor. That of a narrower kind of tasks comes on top of those of the wider ones.
    pub factor: f64,
    /// Zones that it rests on; older jobs count less.
    pub zones: f64,
    /// Jobs since it was used last.
    pub age: u64,
}

/// Why a text is no experience that can be used.
#[derive(Debug, thiserror::Error)]
pub enum ExperienceError {
    /// It is longer than any.
    #[error("the text has {0} bytes, which no experience has")]
    TooLong(usize),
    /// It is not JSON, or has other fields.
    #[error("not what a machine has learnt")]
    Syntax(#[source] serde_json::Error),
    /// It was written in another form.
    #[error("what was learnt has form {found}, not {FORMAT}: another version of bottega has written it")]
    Format {
        /// The form of the text.
        found: u32,
    },
    /// A number makes no sense.
    #[error("what was learnt of `{tasks}` is no number that can be")]
    Factor {
        /// The kind of tasks.
        tasks: String,
    },
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ExperienceText {
    format: u32,
    jobs: u64,
    paces: Lessons,
    powers: Lessons,
}

/// Only the form, of which all else depends.
#[derive(Deserialize)]
struct Form {
    format: u32,
}

impl Experience {
    /// Whether nothing was learnt.
    pub fn is_empty(&self) -> bool {
        self.jobs == 0
    }

    /// Jobs that it was learnt in.
    pub fn jobs(&self) -> u64 {
        self.jobs
    }

    /// Learns from a job. One of which nothing was painted teaches nothing.
    pub fn learn(&mut self, job: &JobLesson) {
        let seconds: f64 = job.zones.iter().map(|zone| zone.time.as_secs_f64()).sum();
        let weight = (seconds / TELLING_SECONDS).min(1.0);
        let observed: Vec<_> = job.zones.iter().filter_map(|zone| observed(job, zone)).collect();
        if observed.is_empty() || weight <= 0.0 {
            return;
        }
        self.jobs += 1;
        self.paces.learn(&observed, weight, self.jobs);
        if let Some(power) = job.power {
            let kind = TaskKind::of_picture(&job.technique, &job.features);
            let alike = vec![(kind.names(), power.get().ln()); observed.len()];
            self.powers.learn(&alike, weight, self.jobs);
        }
    }

    /// By what factor the time of a zone that the survey predicts is to be taken; `None`: nothing was learnt of the technique.
    ///
    /// - `picture`: what the survey says of the whole picture.
    /// - `samples`: a pixel.
    fn factor(&self, technique: &str, picture: &TaskFeatures, zone: &TaskOutlook, samples: u32) -> Option<f64> {
        let kind = TaskKind::of_zone(technique, picture, zone, samples);
        self.paces.expected(&kind.names()).map(f64::exp)
    }

    /// V_cp for pictures of a kind; `None`: nothing was learnt of the technique.
    pub fn power(&self, technique: &str, picture: &TaskFeatures) -> Option<RelativePower> {
        let kind = TaskKind::of_picture(technique, picture);
        self.powers.expected(&kind.names()).map(|log| RelativePower::new(log.exp()))
    }

    /// All that was learnt, the widest kinds of tasks first.
    pub fn factors(&self) -> Vec<LearntFactor> {
        let of = |what: &'static str, lessons: &Lessons| -> Vec<LearntFactor> {
            let told = |(tasks, lesson): (&str, &lessons::Lesson)| LearntFactor {
                of: what.to_owned(),
                tasks: tasks.to_owned(),
                factor: lesson.factor(),
                zones: lesson.count(),
                age: self.jobs.saturating_sub(lesson.job()),
            };
            lessons.iter().map(told).collect()
        };
        let mut all = of("power", &self.powers);
        all.extend(of("time", &self.paces));
        all.sort_by_key(|factor| (factor.of.clone(), factor.tasks.matches(", ").count(), factor.tasks.clone()));
        all
    }

    /// As a text.
    pub fn to_json(&self) -> String {
        let Self { jobs, paces, powers } = self.clone();
        serde_json::to_string(&ExperienceText { format: FORMAT, jobs, paces, powers })
            .expect("numbers and text can be written")
    }

    /// Reads a text.
    ///
    /// # Errors
    /// It is damaged, too long, of another form, or holds what cannot have been learnt.
    pub fn from_json(text: &str) -> Result<Self, ExperienceError> {
        if text.len() > TEXT_MAX {
            return Err(ExperienceError::TooLong(text.len()));
        }
        let Form { format: found } = serde_json::from_str(text).map_err(ExperienceError::Syntax)?;
        if found != FORMAT {
            return Err(ExperienceError::Format { found });
        }
        let ExperienceText { jobs, mut paces, mut powers, .. } =
            serde_json::from_str(text).map_err(ExperienceError::Syntax)?;
        for lessons in [&mut paces, &mut powers] {
            if let Some(tasks) = lessons.nonsense() {
                return Err(ExperienceError::Factor { tasks: tasks.to_owned() });
            }
            lessons.forget_oldest();
        }
        Ok(Self { jobs, paces, powers })
    }
}

/// What a zone tells. `None`: nothing, for its time cannot be compared.
fn observed(job: &JobLesson, zone: &PaintedZone) -> Option<(Vec<String>, f64)> {
    let predicted = zone.outlook.sample_time * f64::from(zone.samples);
    let ratio = zone.time.as_secs_f64() / predicted;
    let kind = TaskKind::of_zone(&job.technique, &job.features, &zone.outlook, zone.samples);
    (ratio.is_finite() && ratio > 0.0).then(|| (kind.names(), ratio.ln()))
}

/// What a machine knows of a work before it has painted any of it.
#[derive(Clone, Debug)]
pub struct Foreknowledge {
    /// What it has learnt in works before.
    pub experience: Arc<Experience>,
    /// As [`JobLesson::technique`].
    pub technique: Arc<str>,
    /// V_cp by its benchmark.
    pub benchmark: RelativePower,
}

impl Default for Foreknowledge {
    fn default() -> Self {
        Self { experience: Arc::default(), technique: "".into(), benchmark: RelativePower::REFERENCE }
    }
}

impl Foreknowledge {
    /// V_cp with which it begins.
    pub fn power(&self, picture: &TaskFeatures) -> RelativePower {
        self.experience.power(&self.technique, picture).unwrap_or(self.benchmark)
    }

    /// T_est of a zone of which nothing is painted: what it should take, in reference-machine time. Where nothing was learnt,
    /// what the survey predicts.
    ///
    /// - `picture`: what the survey says of the whole picture.
    /// - `samples`: a pixel.
    pub fn time(&self, picture: &TaskFeatures, zone: &TaskOutlook, samples: u32) -> Duration {
        let predicted = zone.sample_time * f64::from(samples);
        let own = self.experience.factor(&self.technique, picture, zone, samples);
        let reference = own.map_or(predicted, |factor| factor * predicted / self.power(picture).get());
        Duration::try_from_secs_f64(reference).unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PLAIN: TaskFeatures = TaskFeatures { glass: 0.0, texture: 0.0, media: 0.0 };
    const GLASS: TaskFeatures = TaskFeatures { glass: 0.9, ..PLAIN };
    const MIXED: TaskFeatures = TaskFeatures { glass: 0.2, ..PLAIN };

    fn zone(features: TaskFeatures, sample_time: f64, factor: f64) -> PaintedZone {
        let time = Duration::from_secs_f64(16.0 * sample_time * factor);
        PaintedZone { outlook: TaskOutlook { sample_time, features }, samples: 16, time }
    }

    /// A job in which zones of glass take `glass` times what the survey predicts, and others `plain` times.
    fn job(technique: &str, glass: f64, plain: f64) -> JobLesson {
        let zones = (1..=12).flat_map(|i| {
            let time = 0.02 * f64::from(i);
            [zone(GLASS, time, glass), zone(PLAIN, time, plain)]
        });
        let power = Some(RelativePower::new(0.5));
        JobLesson { technique: technique.into(), features: MIXED, power, zones: zones.collect() }
    }

    fn knowing(experience: Experience, technique: &str) -> Foreknowledge {
        let benchmark = RelativePower::new(2.0);
        Foreknowledge { experience: Arc::new(experience), technique: technique.into(), benchmark }
    }

    #[test]
    fn the_next_job_of_a_kind_is_predicted_and_another_falls_back_to_what_is_general() {
        let mut experience = Experience::default();
        experience.learn(&job("builtin path", 3.0, 1.5));
        let known = knowing(experience.clone(), "builtin path");
        let outlook = |features| TaskOutlook { sample_time: 0.1, features };
        let own = |picture, features| known.time(picture, &outlook(features), 10).as_secs_f64() * 0.5;
        assert!((own(&MIXED, GLASS) / 3.0 - 1.0).abs() < 0.1, "{}", own(&MIXED, GLASS));
        assert!((own(&MIXED, PLAIN) / 1.5 - 1.0).abs() < 0.1, "{}", own(&MIXED, PLAIN));
        // Another kind of picture: zones of glass are still more expensive.
        assert!(own(&PLAIN, GLASS) > 1.5 * own(&PLAIN, PLAIN));
        for picture in [PLAIN, MIXED] {
            assert!((known.power(&picture).get() - 0.5).abs() < 0.05);
        }
        // Another technique knows nothing: the survey and the benchmark are believed.
        let other = knowing(experience, "builtin photon");
        assert_eq!(other.time(&MIXED, &outlook(GLASS), 10), Duration::from_secs(1));
        assert_eq!(other.power(&MIXED).get(), 2.0);
    }

    #[test]
    fn what_is_new_counts_more_than_what_is_old() {
        let mut experience = Experience::default();
        for _ in 0..20 {
            experience.learn(&job("p", 1.0, 1.0));
        }
        for _ in 0..4 {
            experience.learn(&job("p", 4.0, 4.0));
        }
        let zone = TaskOutlook { sample_time: 0.1, features: GLASS };
        let factor = experience.factor("p", &MIXED, &zone, 16).unwrap();
        assert!((3.4..4.4).contains(&factor), "{factor}");
        assert_eq!(experience.jobs(), 24);
    }

    #[test]
    fn a_text_comes_back_and_what_is_none_is_refused() {
        let mut experience = Experience::default();
        experience.learn(&job("builtin path", 3.0, 1.5));
        let text = experience.to_json();
        let read = Experience::from_json(&text).unwrap();
        assert_eq!(read.to_json(), text);
        assert_eq!(read.factors().len(), experience.factors().len());
        assert!(matches!(Experience::from_json("{\"format\":1"), Err(ExperienceError::Syntax(_))));
        assert!(matches!(Experience::from_json("[1]"), Err(ExperienceError::Syntax(_))));
        assert!(matches!(Experience::from_json(&text[..text.len() / 2]), Err(ExperienceError::Syntax(_))));
        let newer = text.replace("\"format\":1", "\"format\":9");
        assert!(matches!(Experience::from_json(&newer), Err(ExperienceError::Format { found: 9 })));
        let long = " ".repeat(TEXT_MAX + 1);
        assert!(matches!(Experience::from_json(&long), Err(ExperienceError::TooLong(_))));
        let mad = r#"{"format":1,"jobs":3,"paces":{"p":{"log":1e9,"count":3.0,"job":2}},"powers":{}}"#;
        assert!(matches!(Experience::from_json(mad), Err(ExperienceError::Factor { .. })));
    }

    #[test]
    fn it_stays_small_and_keeps_what_was_used_last() {
        let mut experience = Experience::default();
        experience.learn(&job("kept", 2.0, 2.0));
        for i in 0..400 {
            experience.learn(&job(&format!("technique {i}"), 2.0, 2.0));
            if i % 20 == 0 {
                experience.learn(&job("kept", 2.0, 2.0));
            }
        }
        assert!(experience.to_json().len() < 100_000);
        assert!(experience.power("kept", &MIXED).is_some() && experience.power("technique 3", &MIXED).is_none());
    }

    #[test]
    fn nonsense_teaches_nothing() {
        let mut experience = Experience::default();
        let nothing = PaintedZone { time: Duration::ZERO, ..zone(GLASS, 0.1, 1.0) };
        let unknown = PaintedZone { outlook: TaskOutlook::default(), ..zone(GLASS, 0.1, 1.0) };
        let outlook = TaskOutlook { sample_time: f64::INFINITY, features: TaskFeatures { glass: f64::NAN, ..PLAIN } };
        let mad = PaintedZone { outlook, ..nothing };
        experience.learn(&JobLesson { zones: vec![nothing, unknown, mad], ..job("p", 1.0, 1.0) });
        assert!(experience.is_empty());
        let known = knowing(experience, "p");
        let zone = TaskOutlook { sample_time: f64::NAN, features: PLAIN };
        assert_eq!(known.time(&PLAIN, &zone, 16), Duration::ZERO);
    }
}
