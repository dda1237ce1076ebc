//! The choice between paths and photons for a picture and its zones, by the rules in `rules/technique-choice.fcl` or by
//! others. Their inputs are measured by a trial: see [`TechniqueEvidence`].

use bottega_farm::{ExpertError, check_inputs, check_output};
use bottega_fuzzy::FunctionBlock;
use bottega_render::{TechniqueEvidence, TechniqueJudge};

/// The output: above 0 prefers photons.
const TECHNIQUE: &str = "technique";
/// The known inputs.
const INPUTS: [&str; 5] = ["gain", "worse_gain", "found", "noise", "picture"];
/// Bound on values: a technique without any error is infinitely better.
const VALUE_MAX: f64 = 20.0;

/// Fuzzy rules that choose between paths and photons.
#[derive(Clone, Debug)]
pub struct TechniqueChoice {
    rules: FunctionBlock,
    digest: u64,
}

impl TechniqueChoice {
    /// The name of the built-in rules.
    pub const RULES_NAME: &str = "technique-choice";
    /// The built-in rules, as FCL text.
    pub const RULES: &str = include_str!("../../../rules/technique-choice.fcl");

    /// Makes a choice of techniques by parsed rules.
    ///
    /// - `text`: the text that the rules were parsed from.
    ///
    /// # Errors
    /// The rules have an unknown input, or no output `technique`.
    pub fn new(text: &str, rules: FunctionBlock) -> Result<Self, ExpertError> {
        check_inputs(&rules, &INPUTS)?;
        check_output(&rules, TECHNIQUE, "technique")?;
        let digest = blake3::hash(text.as_bytes());
        let first = digest.as_bytes().first_chunk().copied().unwrap_or_default();
        Ok(Self { rules, digest: u64::from_le_bytes(first) })
    }

    /// Returns the digest of the rules' text: pictures of different rules have different zones.
    pub fn digest(&self) -> u64 {
        self.digest
    }
}

impl TechniqueJudge for TechniqueChoice {
    /// Returns the output of the rules; paths if they cannot be evaluated.
    fn preference(&self, evidence: &TechniqueEvidence) -> f64 {
        let TechniqueEvidence { gain, worse_gain, found, noise, picture } = *evidence;
        let picture = picture.map_or(0.0, |by_photons| if by_photons { 1.0 } else { -1.0 });
        let values = INPUTS.into_iter().zip([gain, worse_gain, found, noise, picture]);
        let values: Vec<_> = values
            .filter(|(name, _)| self.rules.input_index(name).is_some())
            .map(|(name, value)| (name, value.clamp(-VALUE_MAX, VALUE_MAX)))
            .collect();
        let preference = match self.rules.evaluate(&values) {
            Ok(outputs) => outputs.get(TECHNIQUE).unwrap_or(0.0),
            Err(error) => {
                tracing::warn!(%error, "the rules cannot choose a technique");
                0.0
            }
        };
        tracing::debug!(gain, worse_gain, found, noise, picture, preference, "choice between paths and photons");
        preference
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shipped() -> TechniqueChoice {
        let rules = FunctionBlock::parse(TechniqueChoice::RULES).unwrap();
        TechniqueChoice::new(TechniqueChoice::RULES, rules).unwrap()
    }

    /// True if the built-in rules choose photons.
    fn by_photons(gain: f64, worse_gain: f64, picture: Option<bool>) -> bool {
        shipped().preference(&TechniqueEvidence { gain, worse_gain, found: 1.0, noise: 0.1, picture }) > 0.0
    }

    #[test]
    fn photons_must_be_better_by_a_tenth_and_not_much_worse_by_one_measure() {
        let chosen = [0.0f64, 1.05, 1.15, 2.0, f64::INFINITY].map(|factor| by_photons(factor.log2(), 0.0, None));
        assert_eq!(chosen, [false, false, true, true, true]);
        assert!(by_photons(1.0, 0.81f64.log2(), None) && !by_photons(1.0, 0.79f64.log2(), None));
        assert!(!by_photons(f64::NAN, f64::NAN, None));
    }

    #[test]
    fn a_zone_departs_from_its_picture_if_the_other_technique_is_better_by_a_half() {
        let chosen = |picture| [0.6f64, 0.7, 1.45, 1.55].map(|factor| by_photons(factor.log2(), -9.0, Some(picture)));
        assert_eq!(chosen(true), [false, true, true, true]);
        assert_eq!(chosen(false), [false, false, false, true]);
    }

    #[test]
    fn rules_about_something_else_are_refused() {
        let read = |from: &str, to: &str| {
            let text = TechniqueChoice::RULES.replace(from, to);
            TechniqueChoice::new(&text, FunctionBlock::parse(&text).unwrap()).unwrap_err().to_string()
        };
        assert!(read("gain", "moon").contains("`moon`"));
        assert!(read("technique", "taste").contains("`technique`"));
    }
}
