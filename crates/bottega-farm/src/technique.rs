//! Rendering techniques and the meaning of the rules' outputs for each.
//!
//! Source: MAGarRO, section 3.4: outputs depend on the rendering method, inputs suit any.

use bottega_fuzzy::FunctionBlock;

/// A rendering technique for which there are rules.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Technique {
    /// Path tracing, as in the built-in engine.
    PathTracing,
    /// Photon maps with final gathering and an irradiance cache. No engine here uses these rules yet.
    PhotonMapping,
}

/// An output of rules and its meaning.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OutputMeaning {
    /// The name of the output in the rules; compared without case.
    pub name: &'static str,
    /// The meaning of the output, for users.
    pub meaning: &'static str,
}

/// The name of the rule file with the rules that the MAGarRO paper prints for path tracing.
pub const PAPER_RULES_NAME: &str = "paper";
/// The rules that the MAGarRO paper prints for path tracing, as FCL text.
pub const PAPER_RULES: &str = include_str!("../../../rules/paper.fcl");

/// Output: share of the user's maximum depth.
pub(crate) const RECURSION_LEVEL: &str = "recursion_level";
/// Output: share of the user's samples per pixel, and of the light samples at a bounce.
pub(crate) const SAMPLES: &str = "samples";
/// Output: share of the user's light samples at a bounce alone, as in the paper.
pub(crate) const LIGHT_SAMPLES: &str = "light_samples";
/// Output: width of the band of a zone at the lowest quality, in pixels; scaled down with higher quality.
pub(crate) const INTERPOLATION_BAND_SIZE: &str = "interpolation_band_size";
/// Output: width of the band in pixels, independent of quality.
pub(crate) const INTERPOLATION_BAND_PIXELS: &str = "interpolation_band_pixels";

const BAND: OutputMeaning = OutputMeaning {
    name: INTERPOLATION_BAND_SIZE,
    meaning: "pixels in which a zone is blended with its neighbors, fewer the more it keeps of its settings",
};

const BAND_IN_PIXELS: OutputMeaning = OutputMeaning {
    name: INTERPOLATION_BAND_PIXELS,
    meaning: "pixels in which a zone is blended with its neighbors, whatever it keeps of its settings",
};

const LIGHT_SAMPLES_ALONE: OutputMeaning =
    OutputMeaning { name: LIGHT_SAMPLES, meaning: "share of the user's light samples at a bounce" };

const PATH_TRACING: [OutputMeaning; 5] = [
    OutputMeaning { name: RECURSION_LEVEL, meaning: "share of the bounces that the user allows" },
    OutputMeaning {
        name: SAMPLES,
        meaning: "share of the user's samples per pixel, and of the light samples at a bounce",
    },
    LIGHT_SAMPLES_ALONE,
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
    /// All techniques, in the order of their declaration.
    pub const ALL: [Self; 2] = [Self::PathTracing, Self::PhotonMapping];

    /// Returns the name in messages and errors, such as `path tracing`.
    pub fn name(self) -> &'static str {
        match self {
            Self::PathTracing => "path tracing",
            Self::PhotonMapping => "photon mapping",
        }
    }

    /// Returns the name of the technique's rule file, without the extension.
    pub fn rules_name(self) -> &'static str {
        match self {
            Self::PathTracing => "path-tracing",
            Self::PhotonMapping => "photon-mapping",
        }
    }

    /// Returns the built-in rules as FCL text: our own, and for path tracing the two that the paper prints.
    pub fn rules(self) -> &'static str {
        match self {
            Self::PathTracing => include_str!("../../../rules/path-tracing.fcl"),
            Self::PhotonMapping => include_str!("../../../rules/photon-mapping.fcl"),
        }
    }

    /// Returns the outputs that the technique's rules may have.
    pub fn outputs(self) -> &'static [OutputMeaning] {
        match self {
            Self::PathTracing => &PATH_TRACING,
            Self::PhotonMapping => &PHOTON_MAPPING,
        }
    }

    /// Returns the outputs of some rules that this technique knows, and the names of the others.
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
            // The paper's set has an output of its own for samples and for the width of bands.
            let is_papers = |output: &OutputMeaning| [BAND_IN_PIXELS, LIGHT_SAMPLES_ALONE].contains(output);
            let all = technique.outputs().iter().filter(|output| !is_papers(output));
            assert!(known.iter().eq(all), "{known:?}");
            assert_eq!(unknown, Vec::<String>::new());
        }
        let paper = FunctionBlock::parse(PAPER_RULES).unwrap();
        let (known, unknown) = Technique::PathTracing.sort_outputs(&paper);
        assert_eq!((known.len(), known[1], known[2], unknown.len()), (3, LIGHT_SAMPLES_ALONE, BAND_IN_PIXELS, 0));
        let rules = FunctionBlock::parse(Technique::PhotonMapping.rules()).unwrap();
        let (known, unknown) = Technique::PathTracing.sort_outputs(&rules);
        assert_eq!((known, unknown.len()), (vec![BAND], 5));
    }
}
