//! Foreknowledge: the predicted times of a work's zones and V_cp, before any of it is painted.

use std::{sync::Arc, time::Duration};

use crate::{
    Experience, PictureOutlook, RelativePower, Subject, TaskFeatures, TaskOutlook,
    adaptation::scaled,
    experience::{LogRatio, plain},
};

/// A predicted time is trusted as much as a profile up to this standard deviation of its logarithm.
const TRUSTED_DEVIATION: f64 = 0.25;

/// Knowledge about a work before any of it is painted.
#[derive(Clone, Debug)]
pub struct Foreknowledge {
    /// The machine's experience from earlier works.
    pub experience: Arc<Experience>,
    /// The experience of all machines of the farm together, in reference time.
    pub of_farm: Arc<Experience>,
    /// The technique, as in [`JobLesson::technique`](crate::JobLesson::technique).
    pub technique: Arc<str>,
    /// The picture to predict: its scene and its view.
    pub subject: Subject,
    /// V_cp from the benchmark.
    pub benchmark: RelativePower,
}

/// The predicted time of an unpainted zone, with its expected error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ZoneForecast {
    /// T_est, in reference-machine time.
    pub time: Duration,
    /// Standard deviation of the logarithm of measured over predicted time; `None`: predicted by the survey alone,
    /// whose error is unknown.
    pub deviation: Option<f64>,
}

impl ZoneForecast {
    /// Returns true if profiling the zone adds little information.
    pub fn is_trusted(&self) -> bool {
        self.deviation.is_some_and(|deviation| deviation <= TRUSTED_DEVIATION)
    }
}

impl Default for Foreknowledge {
    fn default() -> Self {
        Self {
            experience: Arc::default(),
            of_farm: Arc::default(),
            technique: "".into(),
            subject: Subject::default(),
            benchmark: RelativePower::REFERENCE,
        }
    }
}

impl Foreknowledge {
    /// Returns V_cp to start with: the learned one, or that of the benchmark.
    pub fn power(&self, picture: &TaskFeatures) -> RelativePower {
        self.experience.power(&self.technique, picture).unwrap_or(self.benchmark)
    }

    /// Returns T_est of an unpainted zone: by the picture as the farm or this machine knows it, else by the technique,
    /// else by the survey.
    ///
    /// - `picture`: the survey's features of the whole picture.
    /// - `samples`: samples per pixel.
    pub fn forecast(
        &self,
        picture: &TaskFeatures,
        outlook: &PictureOutlook,
        zone: &TaskOutlook,
        samples: u32,
    ) -> ZoneForecast {
        let predicted = Duration::try_from_secs_f64(zone.sample_time * f64::from(samples)).unwrap_or_default();
        let name = plain(&self.technique);
        // The machine's own time becomes that of the reference machine
        let power = self.power(picture).get().ln();
        let own = |ratio: LogRatio| LogRatio { log: ratio.log - power, ..ratio };
        let Self { experience, of_farm, subject, .. } = self;
        let ratio = of_farm
            .of_picture(&name, subject, outlook, zone, samples)
            .or_else(|| experience.of_picture(&name, subject, outlook, zone, samples).map(own))
            .or_else(|| experience.of_technique(&name, outlook, zone, samples).map(own))
            .or_else(|| of_farm.of_technique(&name, outlook, zone, samples));
        match ratio {
            Some(LogRatio { log, deviation }) => {
                ZoneForecast { time: scaled(predicted, log.exp()), deviation: Some(deviation) }
            }
            None => ZoneForecast { time: predicted, deviation: None },
        }
    }
}
