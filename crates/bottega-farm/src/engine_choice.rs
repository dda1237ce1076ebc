//! The choice between two engines for a zone, by the rules in `rules/engine-choice.fcl` or by others.
//!
//! Their inputs are those of the rules of quality ([`Expert`](crate::Expert)), laid out over the same ranges.

use std::sync::Arc;

use bottega_engines::EnginePreference;
use bottega_fuzzy::FunctionBlock;

use crate::{
    ExpertError, WorkRow, ZoneRow,
    zone_inputs::{COMPLEXITY, NEIGHBOR_DIFFERENCE, SIZE, check_inputs, check_output, laid_out, zone_values},
};

/// The output: −1 prefers the first engine, 1 the last.
const PREFERENCE: &str = "leaning";
const INPUTS: [&str; 3] = [COMPLEXITY, NEIGHBOR_DIFFERENCE, SIZE];

/// Fuzzy rules that choose between two engines.
#[derive(Clone, Debug)]
pub struct EngineChoice(Arc<FunctionBlock>);

impl EngineChoice {
    /// The name of the built-in rules.
    pub const RULES_NAME: &str = "engine-choice";
    /// The built-in rules, as FCL text.
    pub const RULES: &str = include_str!("../../../rules/engine-choice.fcl");

    /// Makes a choice of engines by parsed rules.
    ///
    /// # Errors
    /// The rules have an unknown input, or no output `leaning`.
    pub fn new(rules: FunctionBlock) -> Result<Self, ExpertError> {
        check_inputs(&rules, &INPUTS)?;
        check_output(&rules, PREFERENCE, "engine")?;
        Ok(Self(Arc::new(rules)))
    }

    /// Returns the preferred engine for a zone; no preference if the rules cannot be evaluated.
    pub fn preference(&self, work: &WorkRow, zone: &ZoneRow) -> EnginePreference {
        let evaluate = || -> Result<EnginePreference, ExpertError> {
            let rules = laid_out(&self.0, &work.ranges)?;
            let mut values = zone_values(zone, zone.neighbor_difference.mean).to_vec();
            values.retain(|(name, _)| rules.input_index(name).is_some());
            Ok(EnginePreference::new(rules.evaluate(&values)?.get(PREFERENCE).unwrap_or(0.0) as f32))
        };
        evaluate().unwrap_or_else(|error| {
            tracing::warn!(zone = zone.zone.0, %error, "the rules cannot choose an engine for the zone");
            EnginePreference::default()
        })
    }
}

#[cfg(test)]
mod tests {
    use bottega_engines::Tunables;
    use bottega_image::Rect;

    use super::*;
    use crate::{Goal, InputRanges, NeighborDifference, Optimization, WorkId, WorkSettings, ZoneId};

    fn preferences(rules: &EngineChoice, zones: &[(f64, f64)]) -> Vec<f32> {
        let row = |(index, (complexity, difference)): (u32, &(f64, f64))| {
            let (rect, difference) = (Rect::of_size(100, 100), NeighborDifference::all(*difference));
            ZoneRow::open(WorkId(1), ZoneId(index), rect, complexity * 1e4, difference)
        };
        let rows: Vec<ZoneRow> = (0..).zip(zones).map(row).collect();
        let frame = Rect::of_size(400, 400);
        let settings = WorkSettings {
            picture: frame,
            frame,
            samples: 16,
            goal: Goal::Samples,
            tunables: Tunables { max_depth: 4, light_samples: 1 },
            optimization: Optimization::Off,
        };
        let work = WorkRow {
            work: WorkId(1),
            settings,
            zone_count: rows.len() as u32,
            ranges: InputRanges::of(&rows),
            features: crate::TaskFeatures::default(),
        };
        rows.iter().map(|row| rules.preference(&work, row).get()).collect()
    }

    fn shipped() -> EngineChoice {
        EngineChoice::new(FunctionBlock::parse(EngineChoice::RULES).unwrap()).unwrap()
    }

    #[test]
    fn simple_zones_lean_to_the_first_engine_and_complex_ones_to_the_last() {
        let found = preferences(&shipped(), &[(0.1, 0.0), (1.0, 0.5), (2.0, 0.2), (4.0, 1.0)]);
        assert!(found.is_sorted() && found[0] < -0.9 && found[3] > 0.9, "{found:?}");
    }

    #[test]
    fn where_all_zones_are_alike_none_is_far_from_the_others() {
        let found = preferences(&shipped(), &[(1.0, 0.0), (1.0, 0.0)]);
        assert_eq!(found[0], found[1]);
    }

    #[test]
    fn rules_about_something_else_are_refused() {
        let read = |from: &str, to: &str| FunctionBlock::parse(&EngineChoice::RULES.replace(from, to)).unwrap();
        let wrong = EngineChoice::new(read("complexity", "moon")).unwrap_err();
        assert!(wrong.to_string().contains("`moon`; a zone has only complexity"), "{wrong}");
        let wrong = EngineChoice::new(read("leaning", "taste")).unwrap_err();
        assert!(wrong.to_string().contains("taste"), "{wrong}");
    }
}
