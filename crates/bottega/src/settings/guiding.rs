//! The settings of path guiding, learned before the first sample.

use bottega_render::AgentUse;

use crate::request::{GuideChoice, GuideOptions, GuideUse};

/// Returns true if paths learn the directions that light comes from.
pub fn directions(guide: &GuideOptions) -> bool {
    match choice(guide) {
        GuideChoice::None => false,
        GuideChoice::Directions => true,
        GuideChoice::Ala => has(guide, GuideUse::Directions),
    }
}

/// Returns the uses of lighting agents as guides, except directions: shadows, choice of lights, Russian roulette. None if the
/// request chooses another guide.
pub fn guide_agents(guide: &GuideOptions) -> AgentUse {
    if choice(guide) != GuideChoice::Ala {
        return AgentUse::default();
    }
    AgentUse {
        shadows: has(guide, GuideUse::Shadows),
        lights: has(guide, GuideUse::Lights),
        roulette: has(guide, GuideUse::Roulette),
    }
}

/// Returns the settings of a guide that is used for everything it can do: true if paths learn directions, and the uses of
/// lighting agents.
pub fn whole_guide(choice: GuideChoice) -> (bool, AgentUse) {
    let guide = GuideOptions { by: Some(choice), ..GuideOptions::default() };
    (directions(&guide), guide_agents(&guide))
}

/// Returns true if the request explicitly asks for lighting agents as guides.
pub(crate) fn asks_for_agents(guide: &GuideOptions) -> bool {
    guide.by == Some(GuideChoice::Ala) || !guide.uses.is_empty()
}

fn choice(guide: &GuideOptions) -> GuideChoice {
    guide.by.unwrap_or(GuideChoice::Ala)
}

fn has(guide: &GuideOptions, what: GuideUse) -> bool {
    guide.uses.is_empty() || guide.uses.contains(&what)
}
