//! Experience: what a machine has learned about the time of zones in earlier works. Read from and written to text; the
//! caller handles files.
//!
//! The survey predicts the time of a zone as a fitted sum of counts. Learned is the logarithm of measured over
//! predicted time:
//!
//! - per technique, a linear function of the zone's features (`features.rs`), fitted online (`regression.rs`);
//! - per picture that was painted before, where it costs how much time (`picture.rs`).
//!
//! A prediction uses the picture, if it is known, else the technique, else the survey alone. It comes with its expected
//! error. V_cp is learned per technique and kind of picture. A farm learns the same from all of its machines together, in
//! time of the reference machine: a machine that has learned nothing starts from that.
//!
//! No pixel depends on experience: with the same settings a zone has the same bits whether it is profiled or not.

mod features;
mod kind;
mod lessons;
mod picture;
mod regression;
mod subject;

use std::{collections::BTreeMap, sync::Arc, time::Duration};

use serde::{Deserialize, Serialize};

pub(crate) use self::kind::plain;
pub use self::subject::Subject;
use self::{
    features::{FeatureVector, KINDS, deviations, features_of},
    kind::TaskKind,
    lessons::Lessons,
    picture::{LearntPicture, MeasuredZone, median},
    regression::Regression,
};
use crate::{PictureOutlook, RelativePower, TaskFeatures, TaskOutlook};

/// Version of the text's format; other versions are rejected.
const FORMAT: u32 = 3;
/// Maximum length of a text, in bytes.
const TEXT_MAX: usize = 1 << 20;
/// Seconds of painting from which a job counts fully; shorter ones have less weight, because of start-up time.
const TELLING_SECONDS: f64 = 1.0;
/// Maximum number of techniques and of pictures kept; the least recently updated are dropped first.
const TECHNIQUES_MAX: usize = 64;
const PICTURES_MAX: usize = 32;
/// Factor on the weight of earlier jobs at each new one.
const REMEMBERED: f64 = 0.5;
/// Standard deviation of the logarithm of a zone's time at known weights.
const NOISE: f64 = 0.15;
/// Number of zones of one job that count for a technique, so that one picture does not outweigh many: its zones share what
/// is peculiar to it.
const ZONES_OF_JOB: f64 = 24.0;
/// Deviation of the predictions for a new picture before any was compared, and the least one.
const DEVIATION: f64 = 0.4;
const DEVIATION_MIN: f64 = 0.2;
/// Bound on logarithms; values beyond it are not plausible measurements.
const LOG_MAX: f64 = 20.0;

/// The learned times of zones and V_cp of a machine.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Experience {
    /// The number of jobs learned from.
    jobs: u64,
    /// ln(measured time / time predicted by the survey), by technique.
    techniques: BTreeMap<String, LearntTechnique>,
    /// The pictures, the least recently updated first.
    pictures: Vec<LearntPicture>,
    /// The learnt values of ln V_cp, per technique and kind of picture.
    powers: Lessons,
}

/// The learned times of a technique.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct LearntTechnique {
    model: Regression,
    /// Standard deviation of the logarithm of measured over predicted time in a new picture.
    deviation: f64,
    /// The number of the last job that updated it.
    job: u64,
}

/// A measured zone of a finished job, which was painted as a whole.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PaintedZone {
    /// The survey's prediction for the zone.
    pub outlook: TaskOutlook,
    /// Samples per pixel that the user requested; rules may have chosen fewer.
    pub samples: u32,
    /// Time of all samples, in the painter's own processor time.
    pub time: Duration,
}

/// The measurements of one machine in one job.
#[derive(Clone, Debug, PartialEq)]
pub struct JobLesson {
    /// Engine, integrator and all else that determines how paths are traced, as a name.
    pub technique: Arc<str>,
    /// The picture of the job: its scene and its view.
    pub subject: Subject,
    /// The survey's features of the whole picture.
    pub features: TaskFeatures,
    /// The survey's predictions for the picture and its zones.
    pub outlook: Arc<PictureOutlook>,
    /// V_cp at the end of the job; `None`: no other machine took part, with which it could be compared.
    pub power: Option<RelativePower>,
    /// V_cp at the end of the job, for converting times to those of the reference machine.
    pub to_reference: RelativePower,
    /// The zones that the machine painted.
    pub zones: Vec<PaintedZone>,
}

impl JobLesson {
    /// Returns the lesson in time of the reference machine, for a farm's experience.
    #[must_use]
    pub fn in_reference_time(&self) -> Self {
        let zone = |zone: &PaintedZone| PaintedZone { time: self.to_reference.to_reference(zone.time), ..*zone };
        let zones = self.zones.iter().map(zone).collect();
        Self { zones, power: None, to_reference: RelativePower::REFERENCE, ..self.clone() }
    }
}

/// A learned factor on times or on V_cp, for display.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LearntFactor {
    /// `time`: a factor on the time predicted by the survey, for a technique; `picture`: a further one for a picture that was
    /// painted before; `power`: on V_cp.
    pub of: String,
    /// The tasks to which the factor applies: those of a technique, of a feature of zones or a kind of picture under
    /// it, or of one picture, named by the first digits of its scene and view.
    pub tasks: String,
    /// The factor. The factors of a zone's features multiply the factor of its technique.
    pub factor: f64,
    /// Expected relative error of a time predicted with this factor, one standard deviation; `None`: not known for one
    /// factor alone.
    pub error: Option<f64>,
    /// Number of zones on which the factor is based; older jobs count less.
    pub zones: f64,
    /// Number of jobs since the factor was last updated.
    pub age: u64,
}

/// An error in reading the text of an experience.
#[derive(Debug, thiserror::Error)]
pub enum ExperienceError {
    /// The text is longer than the maximum: its length, in bytes.
    #[error("the text has {0} bytes, more than an experience can have")]
    TooLong(usize),
    /// The text is not JSON, or has other fields.
    #[error("not the experience of a machine")]
    Syntax(#[source] serde_json::Error),
    /// A later version of Bottega has written the text: its format is newer.
    #[error("the experience has format {found}, not {FORMAT}: a newer version of bottega has written it")]
    Format {
        /// The version found.
        found: u32,
    },
    /// An earlier version of Bottega has written the text: its format is older.
    #[error("the experience has the earlier format {found}, not {FORMAT}")]
    Earlier {
        /// The version found.
        found: u32,
    },
    /// A learned number of these tasks is out of range, or a list has a wrong length.
    #[error("the experience with `{tasks}` is not a valid number")]
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
    techniques: BTreeMap<String, LearntTechnique>,
    pictures: Vec<LearntPicture>,
    powers: Lessons,
}

/// The version alone, read first.
#[derive(Deserialize)]
struct Form {
    format: u32,
}

/// The expected logarithm of measured over predicted time, with the standard deviation of its error.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LogRatio {
    pub(crate) log: f64,
    pub(crate) deviation: f64,
}

impl Experience {
    /// Returns true if nothing was learned.
    pub fn is_empty(&self) -> bool {
        self.jobs == 0
    }

    /// Returns the number of jobs learned from.
    pub fn jobs(&self) -> u64 {
        self.jobs
    }

    /// Learns from a job; does nothing without measured zones.
    ///
    /// - `farm`: what all machines of a farm have learned together, in reference time: the start for a new technique.
    pub fn learn(&mut self, job: &JobLesson, farm: Option<&Self>) {
        let seconds: f64 = job.zones.iter().map(|zone| zone.time.as_secs_f64()).sum();
        let weight = (seconds / TELLING_SECONDS).min(1.0);
        let observed: Vec<(&PaintedZone, f64)> =
            job.zones.iter().filter_map(|zone| Some((zone, log_ratio(zone)?))).collect();
        if observed.is_empty() || weight <= 0.0 {
            return;
        }
        self.jobs += 1;
        self.learn_technique(job, &observed, weight, farm);
        self.learn_picture(job, &observed, weight);
        if let Some(power) = job.power {
            let kind = TaskKind::of_picture(&job.technique, &job.features);
            let alike = vec![(kind.names(), power.get().ln()); observed.len()];
            self.powers.learn(&alike, weight, self.jobs);
        }
    }

    fn learn_technique(&mut self, job: &JobLesson, observed: &[(&PaintedZone, f64)], weight: f64, farm: Option<&Self>) {
        let name = plain(&job.technique);
        let mean = job.outlook.mean_density();
        // Start from what the farm knows, in this machine's time
        let of_farm = || Some(farm?.techniques.get(&name)?.slower(job.to_reference));
        let learnt = self.techniques.remove(&name).or_else(of_farm);
        let mut learnt = learnt.unwrap_or_else(LearntTechnique::unknown);
        // Compare what was expected of this picture
        let known = learnt.model.count() > 0.0;
        let x = |zone: &PaintedZone| features_of(mean, &zone.outlook, zone.samples);
        let errors = observed.iter().map(|(zone, log)| (log - learnt.model.expected(&x(zone))).abs()).collect();
        let error = (median(errors) / 0.674).max(DEVIATION_MIN);
        if known {
            learnt.deviation += (1.0 - REMEMBERED) * weight * (error - learnt.deviation);
        }
        // Move the weights
        learnt.model.forget(REMEMBERED.powf(weight), &deviations());
        let each = weight * (ZONES_OF_JOB / observed.len() as f64).min(1.0);
        observed.iter().for_each(|(zone, log)| learnt.model.learn(&x(zone), *log, NOISE, each));
        learnt.job = self.jobs;
        if !learnt.is_sound() {
            tracing::warn!(technique = name, "the experience is not plausible: discarding it");
            return;
        }
        self.techniques.insert(name, learnt);
        while self.techniques.len() > TECHNIQUES_MAX {
            let oldest = self.techniques.iter().min_by_key(|(_, learnt)| learnt.job).map(|(name, _)| name.clone());
            oldest.and_then(|name| self.techniques.remove(&name));
        }
    }

    fn learn_picture(&mut self, job: &JobLesson, observed: &[(&PaintedZone, f64)], weight: f64) {
        if job.subject.scene.is_empty() {
            return;
        }
        let name = plain(&job.technique);
        let place = self.pictures.iter().position(|picture| picture.is(&name, &job.subject));
        let known = place.map(|place| self.pictures.remove(place));
        let mut picture = known.unwrap_or_else(|| LearntPicture::new(&name, &job.subject));
        let zones: Vec<MeasuredZone<'_>> = observed
            .iter()
            .map(|&(zone, log)| {
                let expected = self.of_technique(&name, &job.outlook, &zone.outlook, zone.samples);
                MeasuredZone { outlook: &zone.outlook, log, expected: expected.map_or(0.0, |it| it.log) }
            })
            .collect();
        picture.learn(&job.outlook, &zones, weight, self.jobs);
        self.pictures.push(picture);
        self.forget_oldest_pictures();
    }

    fn forget_oldest_pictures(&mut self) {
        let excess = self.pictures.len().saturating_sub(PICTURES_MAX);
        self.pictures.drain(..excess);
    }

    /// Returns the expectation for a zone of any picture of a technique. `None`: nothing was learned about the
    /// technique.
    pub(crate) fn of_technique(
        &self,
        name: &str,
        outlook: &PictureOutlook,
        zone: &TaskOutlook,
        samples: u32,
    ) -> Option<LogRatio> {
        let LearntTechnique { model, deviation, .. } = self.techniques.get(name)?;
        let x: FeatureVector = features_of(outlook.mean_density(), zone, samples);
        Some(LogRatio { log: model.expected(&x), deviation: deviation.hypot(model.variance(&x).sqrt()) })
    }

    /// Returns the expectation for a zone of a picture that was painted before. `None`: it was not.
    pub(crate) fn of_picture(
        &self,
        name: &str,
        subject: &Subject,
        outlook: &PictureOutlook,
        zone: &TaskOutlook,
        samples: u32,
    ) -> Option<LogRatio> {
        let picture = self.pictures.iter().find(|picture| picture.is(name, subject))?;
        let by_technique = self.of_technique(name, outlook, zone, samples).map_or(0.0, |it| it.log);
        Some(LogRatio { log: picture.expected(outlook, zone, by_technique), deviation: picture.deviation })
    }

    /// Returns the learned V_cp for a kind of picture; `None`: nothing was learned about the technique.
    pub fn power(&self, technique: &str, picture: &TaskFeatures) -> Option<RelativePower> {
        let kind = TaskKind::of_picture(technique, picture);
        self.powers.expected(&kind.names()).map(|log| RelativePower::new(log.exp()))
    }

    /// Returns all learned factors: of V_cp, of techniques with the features of zones, and of pictures.
    pub fn factors(&self) -> Vec<LearntFactor> {
        let age = |job: u64| self.jobs.saturating_sub(job);
        let of_power = self.powers.iter().map(|(tasks, lesson)| LearntFactor {
            of: "power".to_owned(),
            tasks: tasks.to_owned(),
            factor: lesson.factor(),
            error: None,
            zones: lesson.count(),
            age: age(lesson.job()),
        });
        let of_technique = self.techniques.iter().flat_map(|(name, LearntTechnique { model, deviation, job })| {
            KINDS.iter().zip(model.weights()).enumerate().map(move |(place, (kind, weight))| LearntFactor {
                of: "time".to_owned(),
                tasks: if place == 0 { name.clone() } else { format!("{name}, {}", kind.name) },
                factor: (weight * kind.step).exp(),
                error: (place == 0).then_some(*deviation),
                zones: model.count(),
                age: age(*job),
            })
        });
        let of_picture = self.pictures.iter().rev().map(|picture| LearntFactor {
            of: "picture".to_owned(),
            tasks: picture.title(),
            factor: picture.offset.exp(),
            error: Some(picture.deviation),
            zones: picture.count,
            age: age(picture.job),
        });
        of_power.chain(of_technique).chain(of_picture).collect()
    }

    /// Returns the experience as JSON, which [`Self::from_json`] reads.
    pub fn to_json(&self) -> String {
        let Self { jobs, techniques, pictures, powers } = self.clone();
        serde_json::to_string(&ExperienceText { format: FORMAT, jobs, techniques, pictures, powers })
            .expect("numbers and text can be written")
    }

    /// Reads the JSON of [`Self::to_json`].
    ///
    /// # Errors
    /// The text is damaged, too long, of another version, or holds numbers out of range.
    pub fn from_json(text: &str) -> Result<Self, ExperienceError> {
        if text.len() > TEXT_MAX {
            return Err(ExperienceError::TooLong(text.len()));
        }
        let Form { format: found } = serde_json::from_str(text).map_err(ExperienceError::Syntax)?;
        if found < FORMAT {
            return Err(ExperienceError::Earlier { found });
        }
        if found != FORMAT {
            return Err(ExperienceError::Format { found });
        }
        let ExperienceText { jobs, techniques, pictures, mut powers, .. } =
            serde_json::from_str(text).map_err(ExperienceError::Syntax)?;
        let of_power = powers.nonsense().map(str::to_owned);
        let of_technique = techniques.iter().find(|(_, learnt)| !learnt.is_sound()).map(|(name, _)| name.clone());
        let of_picture = pictures.iter().find(|picture| !picture.is_sound()).map(LearntPicture::title);
        if let Some(tasks) = of_power.or(of_technique).or(of_picture) {
            return Err(ExperienceError::Factor { tasks });
        }
        powers.forget_oldest();
        let mut experience = Self { jobs, techniques, pictures, powers };
        experience.forget_oldest_pictures();
        Ok(experience)
    }
}

impl LearntTechnique {
    fn unknown() -> Self {
        let model = Regression::new(FeatureVector::default(), &deviations());
        Self { model, deviation: DEVIATION, job: 0 }
    }

    /// Converts reference-machine times to those of a machine with this V_cp.
    fn slower(&self, power: RelativePower) -> Self {
        Self { model: self.model.shifted(power.get().ln()), ..self.clone() }
    }

    fn is_sound(&self) -> bool {
        self.model.is_sound() && (0.0..=LOG_MAX).contains(&self.deviation)
    }
}

/// Returns ln of the measured over the predicted time of a zone. `None`: it is not a plausible number.
fn log_ratio(zone: &PaintedZone) -> Option<f64> {
    let predicted = zone.outlook.sample_time * f64::from(zone.samples);
    let log = (zone.time.as_secs_f64() / predicted).ln();
    (log.abs() <= LOG_MAX).then_some(log)
}

#[cfg(test)]
mod tests;
