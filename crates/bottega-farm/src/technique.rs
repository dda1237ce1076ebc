//! The meaning of the rules' outputs for each way to follow light.
//!
//! Source: MAGarRO, section 3.4: the outputs depend on the rendering method, the inputs serve any.

use bottega_fuzzy::FunctionBlock;

/// A way to follow light that rules may be written for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Technique {
    /// What the built-in engine does.
    PathTracing,
    /// Photon maps, with final gathering and an irradiance cache. No engine here does it yet.
    PhotonMapping,
}

/// An output that rules may have, and what it stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OutputMeaning {
    /// Its name in the rules, compared without case.
    pub name: &'static str,
    /// What it stands for.
    pub meaning: &'static str,
}

/// The name of the MAGarRO paper's rules for path tracing, as far as it tells them.
pub const PAPER_RULES_NAME: &str = "paper";
/// The same, as FCL text.
pub const PAPER_RULES: &str = include_str!("../../../rules/paper.fcl");

/// Share of the user's depth.
pub(crate) const RECURSION_LEVEL: &str = "recursion_level";
/// Share of the user's samples.
pub(crate) const LIGHT_SAMPLES: &str = "light_samples";
/// Width of the band of a zone that keeps nothing of its settings, in pixels.
pub(crate) const INTERPOLATION_BAND_SIZE: &str = "interpolation_band_size";
/// Width of the band of any zone, in pixels.
pub(crate) const INTERPOLATION_BAND_PIXELS: &str = "interpolation_band_pixels";

const BAND: OutputMeaning = OutputMeaning {
    name: INTERPOLATION_BAND_SIZE,
    meaning: "pixels in which a zone is blended with its neighbors, fewer the more it keeps of its settings",
};

const BAND_IN_PIXELS: OutputMeaning = OutputMeaning {
    name: INTERPOLATION_BAND_PIXELS,
    meaning: "pixels in which a zone is blended with its neighbors, whatever it keeps of its settings",
};

const PATH_TRACING: [OutputMeaning; 4] = [
    OutputMeaning { name: RECURSION_LEVEL, meaning: "share of the bounces that the user allows" },
    OutputMeaning {
        name: LIGHT_SAMPLES,
        meaning: "share of the user's samples of a pixel, and of those of the lights at a bounce",
    },
    BAND,
    BAND_IN_PIXELS,
];

const PHOTON_MAPPING: [OutputMeaning; 6] = [
    OutputMeaning { name: "photons", meaning: "share of the user's stored photons" },
    OutputMeaning { name: "gather_count", meaning: "share of the user's photons of a density estimate" },
    OutputMeaning {
        name: "gather_radius",
        meaning: "factor on the user's greatest distance at which photons are gathered",
    },
    OutputMeaning { name: "final_gather_rays", meaning: "share of the user's rays of a final gather" },
    OutputMeaning {
        name: "irradiance_cache_accuracy",
        meaning: "what the user's permissible error of the irradiance cache is divided by",
    },
    BAND,
];

impl Technique {
    /// All of them.
    pub const ALL: [Self; 2] = [Self::PathTracing, Self::PhotonMapping];

    /// As it is called in sentences.
    pub fn name(self) -> &'static str {
        match self {
            Self::PathTracing => "path tracing",
            Self::PhotonMapping => "photon mapping",
        }
    }

    /// The file of its rules, without the extension.
    pub fn rules_name(self) -> &'static str {
        match self {
            Self::PathTracing => "path-tracing",
            Self::PhotonMapping => "photon-mapping",
        }
    }

    /// The rules for it that come with the program, as FCL text: our own, with the two for path tracing that the paper prints.
    pub fn rules(self) -> &'static str {
        match self {
            Self::PathTracing => include_str!("../../../rules/path-tracing.fcl"),
            Self::PhotonMapping => include_str!("../../../rules/photon-mapping.fcl"),
        }
    }

    /// What rules for it may decide.
    pub fn outputs(self) -> &'static [OutputMeaning] {
        match self {
            Self::PathTracing => &PATH_TRACING,
            Self::PhotonMapping => &PHOTON_MAPPING,
        }
    }

    /// The outputs of some rules that mean something in this technique, and the names of those that mean nothing.
    pub fn sort_outputs(self, rules: &FunctionBlock) -> (Vec<OutputMeaning>, Vec<String>) {
        let (mut known, mut unknown) = (Vec::new(), Vec::new());
        for output in rules.outputs() {
            match self.outputs().iter().find(|one| one.name.eq_ignore_ascii_case(&output.name)) {
                Some(meaning) => known.push(*meaning),
                None => unknown.push(output.name.clone()),
            }
        }
        (known, unknown)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rules_of_each_technique_decide_all_that_it_has_and_nothing_else() {
        for technique in Technique::ALL {
            let rules = FunctionBlock::parse(technique.rules()).unwrap();
            let (known, unknown) = technique.sort_outputs(&rules);
            // A set has one of the two outputs for the width of bands.
            let all = technique.outputs().iter().filter(|output| **output != BAND_IN_PIXELS);
            assert!(known.iter().eq(all), "{known:?}");
            assert_eq!(unknown, Vec::<String>::new());
        }
        let paper = FunctionBlock::parse(PAPER_RULES).unwrap();
        let (known, unknown) = Technique::PathTracing.sort_outputs(&paper);
        assert_eq!((known.len(), known[2], unknown.len()), (3, BAND_IN_PIXELS, 0));
        let rules = FunctionBlock::parse(Technique::PhotonMapping.rules()).unwrap();
        let (known, unknown) = Technique::PathTracing.sort_outputs(&rules);
        assert_eq!((known, unknown.len()), (vec![BAND], 5));
    }
}
