//! Experience: what a machine has learned about the time of zones in earlier works. Read from and written to text; the
//! caller handles files.
//!
//! The survey predicts the time of a zone as a fitted sum of counts. Learned is the logarithm of measured over
//! predicted time, as a sum of terms: one for the technique, and corrections for the kind of picture, the kind of zone,
//! both together, and the size of the zone. A prediction uses the terms that are known, from the widest kind to the
//! narrowest. V_cp is learned in the same way.
//!
//! Pictures do not depend on experience: the partition and the rules use the survey alone.

mod kind;
mod lessons;

use std::{sync::Arc, time::Duration};

use serde::{Deserialize, Serialize};

use self::{kind::TaskKind, lessons::Lessons};
use crate::{RelativePower, TaskFeatures, TaskOutlook};

/// Version of the text's format; other versions are rejected.
const FORMAT: u32 = 1;
/// Maximum length of a text, in bytes.
const TEXT_MAX: usize = 1 << 20;
/// Seconds of painting from which a job counts fully; shorter ones have less weight, because of start-up time.
const TELLING_SECONDS: f64 = 1.0;

/// The learned times of zones and V_cp of a machine.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Experience {
    /// The number of jobs learned from.
    jobs: u64,
    /// ln(measured time / time predicted by the survey).
    paces: Lessons,
    /// ln V_cp.
    powers: Lessons,
}

/// A measured zone that was painted as a whole.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PaintedZone {
    /// The survey's prediction for it.
    pub outlook: TaskOutlook,
    /// Samples per pixel.
    pub samples: u32,
    /// Time of all samples, in the painter's own processor time.
    pub time: Duration,
}

/// The measurements of one machine in one job.
#[derive(Clone, Debug, PartialEq)]
pub struct JobLesson {
    /// Engine, integrator and all else that determines how paths are traced, as a name.
    pub technique: Arc<str>,
    /// The survey's features of the whole picture.
    pub features: TaskFeatures,
    /// V_cp at the end of the job, if known.
    pub power: Option<RelativePower>,
    /// The zones that the machine painted.
    pub zones: Vec<PaintedZone>,
}

/// A learned factor, for display.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LearntFactor {
    /// `time`: a factor on the time predicted by the survey; `power`: on V_cp.
    pub of: String,
    /// The kind of tasks that it applies to.
    pub tasks: String,
    /// The factor. Those of narrower kinds multiply those of wider ones.
    pub factor: f64,
    /// Number of zones that it is based on; older jobs count less.
    pub zones: f64,
    /// Number of jobs since it was last updated.
    pub age: u64,
}

/// An error in the text of an experience.
#[derive(Debug, thiserror::Error)]
pub enum ExperienceError {
    /// It is longer than the maximum.
    #[error("the text has {0} bytes, which no experience has")]
    TooLong(usize),
    /// It is not JSON, or has other fields.
    #[error("not what a machine has learnt")]
    Syntax(#[source] serde_json::Error),
    /// It has another version of the format.
    #[error("what was learnt has form {found}, not {FORMAT}: another version of bottega has written it")]
    Format {
        /// The version found.
        found: u32,
    },
    /// A number is out of range.
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

/// The version alone, read first.
#[derive(Deserialize)]
struct Form {
    format: u32,
}

impl Experience {
    /// True if nothing was learned.
    pub fn is_empty(&self) -> bool {
        self.jobs == 0
    }

    /// The number of jobs learned from.
    pub fn jobs(&self) -> u64 {
        self.jobs
    }

    /// Learns from a job; does nothing without measured zones.
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

    /// The factor on the time that the survey predicts for a zone; `None`: nothing was learned about the technique.
    ///
    /// - `picture`: the survey's features of the whole picture.
    /// - `samples`: samples per pixel.
    fn factor(&self, technique: &str, picture: &TaskFeatures, zone: &TaskOutlook, samples: u32) -> Option<f64> {
        let kind = TaskKind::of_zone(technique, picture, zone, samples);
        self.paces.expected(&kind.names()).map(f64::exp)
    }

    /// Learned V_cp for a kind of picture; `None`: nothing was learned about the technique.
    pub fn power(&self, technique: &str, picture: &TaskFeatures) -> Option<RelativePower> {
        let kind = TaskKind::of_picture(technique, picture);
        self.powers.expected(&kind.names()).map(|log| RelativePower::new(log.exp()))
    }

    /// All learned factors, those of the widest kinds first.
    pub fn factors(&self) -> Vec<LearntFactor> {
        let of = |what: &'static str, lessons: &Lessons| -> Vec<LearntFactor> {
            let learnt = |(tasks, lesson): (&str, &lessons::Lesson)| LearntFactor {
                of: what.to_owned(),
                tasks: tasks.to_owned(),
                factor: lesson.factor(),
                zones: lesson.count(),
                age: self.jobs.saturating_sub(lesson.job()),
            };
            lessons.iter().map(learnt).collect()
        };
        let mut all = of("power", &self.powers);
        all.extend(of("time", &self.paces));
        all.sort_by_key(|factor| (factor.of.clone(), factor.tasks.matches(", ").count(), factor.tasks.clone()));
        all
    }

    /// The experience as JSON.
    pub fn to_json(&self) -> String {
        let Self { jobs, paces, powers } = self.clone();
        serde_json::to_string(&ExperienceText { format: FORMAT, jobs, paces, powers })
            .expect("numbers and text can be written")
    }

    /// Reads the JSON of [`Self::to_json`].
    ///
    /// # Errors
    /// It is damaged, too long, of another version, or holds numbers out of range.
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

/// The kinds of a zone and its ln(measured / predicted time). `None`: the ratio is not a positive number.
fn observed(job: &JobLesson, zone: &PaintedZone) -> Option<(Vec<String>, f64)> {
    let predicted = zone.outlook.sample_time * f64::from(zone.samples);
    let ratio = zone.time.as_secs_f64() / predicted;
    let kind = TaskKind::of_zone(&job.technique, &job.features, &zone.outlook, zone.samples);
    (ratio.is_finite() && ratio > 0.0).then(|| (kind.names(), ratio.ln()))
}

/// Knowledge about a work before any of it is painted.
#[derive(Clone, Debug)]
pub struct Foreknowledge {
    /// The experience from earlier works.
    pub experience: Arc<Experience>,
    /// The technique, as in [`JobLesson::technique`].
    pub technique: Arc<str>,
    /// V_cp from the benchmark.
    pub benchmark: RelativePower,
}

impl Default for Foreknowledge {
    fn default() -> Self {
        Self { experience: Arc::default(), technique: "".into(), benchmark: RelativePower::REFERENCE }
    }
}

impl Foreknowledge {
    /// V_cp to start with: the learned one, or that of the benchmark.
    pub fn power(&self, picture: &TaskFeatures) -> RelativePower {
        self.experience.power(&self.technique, picture).unwrap_or(self.benchmark)
    }

    /// T_est of an unpainted zone, in reference-machine time; without experience the time predicted by the survey.
    ///
    /// - `picture`: the survey's features of the whole picture.
    /// - `samples`: samples per pixel.
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
