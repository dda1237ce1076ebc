//! The plan of a picture's photons and agents, and the lengths that measure them.

use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use super::{projection::Projection, trial::try_out};
use crate::{
    View,
    extent::Extent,
    lights::{Emission, EmissionPlan},
    prepare::PreparedScene,
};

/// What photons of a view go by. Views of which each shows the whole scene share one.
pub(crate) struct PhotonPlan {
    /// What emits photons in the scene.
    pub(crate) sources: Arc<Emission>,
    /// Where photons are sent.
    pub(crate) emission: EmissionPlan,
    projection: OnceLock<Projection>,
}

impl PhotonPlan {
    fn new(prepared: &PreparedScene, sources: Arc<Emission>, extent: Extent) -> Self {
        Self { emission: sources.plan(prepared, extent), sources, projection: OnceLock::new() }
    }

    /// Where what is seen is, and how wide.
    pub(crate) fn extent(&self) -> &Extent {
        self.emission.extent()
    }

    /// Where photons must leave the lights to come to mirrors and glass; the first who asks tries it out.
    pub(crate) fn projection(&self, prepared: &PreparedScene) -> &Projection {
        self.projection.get_or_init(|| try_out(prepared, &self.sources, &self.emission))
    }
}

/// The plans of some views.
#[derive(Default)]
pub(crate) struct PhotonPlans {
    sources: OnceLock<Arc<Emission>>,
    views: Mutex<Vec<(View, Arc<PhotonPlan>)>>,
}

impl PhotonPlans {
    /// The plan of a view; the first who asks looks at it, while others wait.
    pub(crate) fn of_view(&self, prepared: &PreparedScene, view: View) -> Arc<PhotonPlan> {
        /// Views whose plans are kept.
        const VIEWS_MAX: usize = 8;
        let mut plans = self.views.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, plan)) = plans.iter().find(|(known, _)| *known == view) {
            return Arc::clone(plan);
        }
        let extent = Extent::of_view(prepared, view);
        let same = plans.iter().find(|(_, plan)| *plan.extent() == extent).map(|(_, plan)| Arc::clone(plan));
        let sources = || Arc::clone(self.sources.get_or_init(|| Arc::new(Emission::new(prepared))));
        let plan = same.unwrap_or_else(|| Arc::new(PhotonPlan::new(prepared, sources(), extent)));
        if plans.len() == VIEWS_MAX {
            plans.remove(0);
        }
        plans.push((view, Arc::clone(&plan)));
        plan
    }
}
