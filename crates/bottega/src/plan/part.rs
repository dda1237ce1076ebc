//! The part of a picture that this process plans, and when its zones are finished.

use std::{
    path::Path,
    time::{Duration, Instant},
};

use bottega_engines::Urgency;
use bottega_farm::Goal;

use crate::request::Request;

/// Shortest time left for rendering if the time limit has not passed yet.
const LEAST_PAINTING: Duration = Duration::from_millis(20);

/// The part of a picture that this process renders.
#[derive(Clone, Copy, Debug)]
pub enum PicturePart<'a> {
    /// The whole picture, alone or with a farm.
    Whole {
        /// The moment from which the time limit counts.
        begun: Instant,
        /// The urgency of the picture.
        urgency: Urgency,
    },
    /// Zones of another process's job, whose Master enforces the time limit.
    Zones {
        /// The folder on this machine that holds all files of the scene.
        files: &'a Path,
        /// Index of the rule set of this machine, modulo their number.
        turn: usize,
    },
    /// Zones or surveys beside an external engine, which decides when they are finished.
    BesideEngine,
}

impl<'a> PicturePart<'a> {
    /// Returns the goal of zones.
    pub(crate) fn goal(&self, request: &Request) -> Goal {
        match self {
            Self::Whole { begun, .. } => match (request.goal.error, request.goal.time) {
                (None, Some(time)) => time_goal(time, *begun, Duration::ZERO),
                (error, _) => error.map_or(Goal::Samples, Goal::Error),
            },
            Self::Zones { .. } => request.goal.error.map_or(Goal::Samples, Goal::Error),
            Self::BesideEngine => Goal::Samples,
        }
    }

    /// Returns the number of Render Agents that this part fixes; `None`: the request decides.
    pub(super) fn agents(&self) -> Option<usize> {
        matches!(self, Self::Zones { .. }).then_some(1)
    }

    /// Returns the urgency of the work. Crops are more urgent than whole pictures.
    pub(super) fn urgency(&self, request: &Request) -> Urgency {
        let of_request = if request.film.crop.is_some() { Urgency::Crop } else { Urgency::Picture };
        match self {
            Self::Whole { urgency, .. } => of_request.max(*urgency),
            Self::Zones { .. } => of_request,
            Self::BesideEngine => Urgency::Picture,
        }
    }

    /// Returns the index of the rule set that comes first.
    pub(crate) fn turn(&self) -> usize {
        if let Self::Zones { turn, .. } = self { *turn } else { 0 }
    }

    /// Returns the folder of the files that another machine has sent; `None`: the scene is the user's own.
    pub(crate) fn sent_files(&self) -> Option<&'a Path> {
        if let Self::Zones { files, .. } = self { Some(*files) } else { None }
    }
}

/// Returns the goal of a picture with a time limit: what is left of it since `begun`, without the estimate `finishing`.
///
/// - `time`: the limit, in seconds.
pub(crate) fn time_goal(time: f64, begun: Instant, finishing: Duration) -> Goal {
    let left = Duration::from_secs_f64(time).saturating_sub(begun.elapsed() + finishing);
    // Allow at least a moment for rendering: late is better than no picture.
    Goal::Time(left.max(LEAST_PAINTING))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::request::GoalOptions;

    fn request(error: Option<f64>, time: Option<f64>) -> Request {
        Request { goal: GoalOptions { error, time, ..GoalOptions::default() }, ..Request::new("a.glb") }
    }

    #[test]
    fn a_time_that_reading_the_scene_has_used_up_leaves_a_moment_for_the_picture() {
        let begun = Instant::now();
        while begun.elapsed() < Duration::from_millis(2) {
            std::hint::spin_loop();
        }
        assert_eq!(time_goal(0.001, begun, Duration::ZERO), Goal::Time(LEAST_PAINTING));
        let Goal::Time(left) = time_goal(3600.0, begun, Duration::from_secs(600)) else { panic!("it has a time") };
        assert!(left < Duration::from_secs(3000) && left > Duration::from_secs(2000), "{left:?}");
    }

    #[test]
    fn a_time_limit_is_enforced_by_the_process_that_plans_the_whole_picture() {
        let whole = PicturePart::Whole { begun: Instant::now(), urgency: Urgency::Picture };
        let zones = PicturePart::Zones { files: Path::new("."), turn: 0 };
        let timed = request(None, Some(60.0));
        assert!(matches!(whole.goal(&timed), Goal::Time(_)));
        assert_eq!((zones.goal(&timed), PicturePart::BesideEngine.goal(&timed)), (Goal::Samples, Goal::Samples));
        let both = request(Some(0.01), Some(60.0));
        assert_eq!((whole.goal(&both), zones.goal(&both)), (Goal::Error(0.01), Goal::Error(0.01)));
        assert_eq!((zones.agents(), whole.agents()), (Some(1), None));
    }
}
