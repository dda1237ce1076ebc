//! The emission plan of a picture's photons and agents, and its unit of length.

use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use super::{lookouts::Lookouts, projection::Projection, trial::try_out};
use crate::{
    extent::Extent,
    lights::{Emission, EmissionPlan},
    prepare::PreparedScene,
    settings::View,
};

/// The emission plan of a view.
pub(crate) struct PhotonPlan {
    /// The view of the plan.
    pub(crate) view: View,
    /// Light sources of the scene.
    pub(crate) sources: Arc<Emission>,
    /// Region that photons are sent to; shared by views that show the whole scene.
    pub(crate) emission: Arc<EmissionPlan>,
    projection: OnceLock<Projection>,
    projection_of_lookouts: OnceLock<Projection>,
}

impl PhotonPlan {
    fn new(view: View, sources: Arc<Emission>, emission: Arc<EmissionPlan>) -> Self {
        Self { view, sources, emission, projection: OnceLock::new(), projection_of_lookouts: OnceLock::new() }
    }

    /// Returns center and size of the visible part of the scene.
    pub(crate) fn extent(&self) -> &Extent {
        self.emission.extent()
    }

    /// Returns the share of caustic photons that the camera sees: sent without the importance of lookouts, and with it;
    /// `None`: none have been sent yet.
    pub(crate) fn shares_seen(&self) -> Option<[f64; 2]> {
        self.projection_of_lookouts.get()?.shares_seen()
    }

    /// Returns the projection map to mirrors and glass; the first caller traces its trial photons.
    ///
    /// - `by_lookouts`: `true`: photons that the camera sees count more.
    pub(crate) fn projection(&self, prepared: &PreparedScene, by_lookouts: bool) -> &Projection {
        let place = if by_lookouts { &self.projection_of_lookouts } else { &self.projection };
        place.get_or_init(|| {
            let lookouts = by_lookouts.then(|| prepared.on_threads(|| Lookouts::of_view(prepared, &self.view)));
            try_out(prepared, &self.sources, &self.emission, lookouts.as_ref())
        })
    }
}

/// The plans of some views.
#[derive(Default)]
pub(crate) struct PhotonPlans {
    sources: OnceLock<Arc<Emission>>,
    views: Mutex<Vec<(View, Arc<PhotonPlan>)>>,
}

impl PhotonPlans {
    /// Returns the plan of a view; the first caller makes it, while others wait.
    pub(crate) fn of_view(&self, prepared: &PreparedScene, view: &View) -> Arc<PhotonPlan> {
        /// Number of views whose plans are kept.
        const VIEWS_MAX: usize = 8;
        let mut plans = self.views.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, plan)) = plans.iter().find(|(known, _)| known == view) {
            return Arc::clone(plan);
        }
        let extent = Extent::of_view(prepared, view);
        let sources = Arc::clone(self.sources.get_or_init(|| Arc::new(Emission::new(prepared))));
        let same = plans.iter().find(|(_, plan)| *plan.extent() == extent);
        let emission =
            same.map_or_else(|| Arc::new(sources.plan(prepared, extent)), |(_, it)| Arc::clone(&it.emission));
        let plan = Arc::new(PhotonPlan::new(view.clone(), sources, emission));
        if plans.len() == VIEWS_MAX {
            plans.remove(0);
        }
        plans.push((view.clone(), Arc::clone(&plan)));
        plan
    }
}
