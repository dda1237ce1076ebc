//! The Expert: fuzzy rules of an agent that choose the settings of a zone.
//!
//! Source: MAGarRO, section 3.4, "Using Expert Knowledge". The fuzzy sets of the inputs are laid out at run time over
//! the ranges found in the scene.

use std::sync::Arc;

use bottega_engines::{EngineDescription, EnginePreference, Tunables};
use bottega_fuzzy::{EvaluateError, FunctionBlock};
use bottega_image::Sides;

use crate::{
    Choice, EngineChoice, ExpertError, Goal, Technique, WorkRow, WorkSettings, ZoneRow,
    cells::octave_end,
    technique::{INTERPOLATION_BAND_PIXELS, INTERPOLATION_BAND_SIZE, LIGHT_SAMPLES, RECURSION_LEVEL, SAMPLES},
    zone_inputs::{COMPLEXITY, NEIGHBOR_DIFFERENCE, SIZE, check_inputs, laid_out, zone_values},
};

/// The input for the user's Optimization Level, 1 (VS) to 5 (VB).
const OPTIMIZATION_LEVEL: &str = "optimization_level";
const INPUTS: [&str; 4] = [COMPLEXITY, NEIGHBOR_DIFFERENCE, SIZE, OPTIMIZATION_LEVEL];
/// Minimum share of the user's settings that rules may choose, so that no picture turns black.
const SHARE_MIN: f64 = 0.05;
/// Maximum number of rules listed as reasons.
const REASONS_MAX: usize = 6;
/// Maximum width of a band, in pixels: its cost grows with its width.
pub const BAND_MAX: u32 = 64;
/// Maximum width of a band that hides lower quality, as a share of the zone's shorter side: four such bands add a sixth
/// to its pixels.
const BAND_OF_SIDE: f64 = 1.0 / 24.0;

/// The width of interpolation bands. With optimization off there are none, because zones agree bit for bit.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum BandWidth {
    /// No bands.
    Off,
    /// The rules choose, edge by edge.
    #[default]
    Rules,
    /// The user's width in pixels beyond each edge of each zone; a larger one than [`BAND_MAX`] counts as that.
    Pixels(u32),
}

/// The shares of the user's settings that the rules leave to a zone, each from [`SHARE_MIN`] squared to 1.
#[derive(Clone, Copy, Debug)]
struct Shares {
    /// The share of the maximum depth.
    depth: f64,
    /// The share of the samples per pixel.
    samples: f64,
    /// The share of the light samples at a bounce.
    light_samples: f64,
}

/// The fuzzy rules by which an agent chooses the settings of a zone. Agents may have different rules.
#[derive(Clone, Debug)]
pub struct Expert {
    rules: Arc<FunctionBlock>,
    ignored: Arc<[String]>,
    has_max_depth: bool,
    has_light_samples: bool,
    is_profiled: bool,
    engine_choice: Option<EngineChoice>,
    bands: BandWidth,
}

impl Expert {
    /// Parses rules for path tracing from FCL text.
    ///
    /// # Errors
    /// The text is not one valid function block of FCL; or those of [`Self::new`].
    pub fn parse(text: &str) -> Result<Self, ExpertError> {
        Self::new(FunctionBlock::parse(text)?)
    }

    /// Makes the rules of an agent for path tracing from parsed ones. Unknown outputs are ignored, see
    /// [`Self::ignored_outputs`].
    ///
    /// # Errors
    /// The rules have an unknown input, or no output that path tracing knows.
    pub fn new(rules: FunctionBlock) -> Result<Self, ExpertError> {
        check_inputs(&rules, &INPUTS)?;
        let technique = Technique::PathTracing;
        let (known, ignored) = technique.sort_outputs(&rules);
        if known.is_empty() {
            return Err(ExpertError::NoOutput { technique, found: ignored });
        }
        let (rules, ignored) = (Arc::new(rules), ignored.into());
        let (has_max_depth, has_light_samples, is_profiled) = (true, true, true);
        let (engine_choice, bands) = (None, BandWidth::default());
        Ok(Self { rules, ignored, has_max_depth, has_light_samples, is_profiled, engine_choice, bands })
    }

    /// Returns the names of the rules' outputs that path tracing ignores.
    pub fn ignored_outputs(&self) -> &[String] {
        &self.ignored
    }

    /// Makes the built-in rules for path tracing: the two printed in the paper and 26 of our own.
    pub fn path_tracing() -> Self {
        Self::parse(Technique::PathTracing.rules()).expect("the built-in rules are valid")
    }

    /// Returns the rules as FCL text, which [`Self::parse`] reads.
    pub fn rules_text(&self) -> String {
        self.rules.to_string()
    }

    /// Returns the Expert for an engine: settings that the engine lacks stay at the user's value.
    #[must_use]
    pub fn for_engine(self, engine: &EngineDescription) -> Self {
        let &EngineDescription { has_max_depth, has_light_samples, is_profiled, .. } = engine;
        self.for_knobs(has_max_depth, has_light_samples, is_profiled)
    }

    /// Returns the Expert for an engine with these capabilities.
    pub(crate) fn for_knobs(self, has_max_depth: bool, has_light_samples: bool, is_profiled: bool) -> Self {
        Self { has_max_depth, has_light_samples, is_profiled, ..self }
    }

    /// Returns the Expert with rules that choose between two engines; `None`: it prefers neither.
    #[must_use]
    pub fn choosing(self, engine_choice: Option<EngineChoice>) -> Self {
        Self { engine_choice, ..self }
    }

    /// Returns the Expert with the user's choice of bands.
    #[must_use]
    pub fn with_bands(self, bands: BandWidth) -> Self {
        Self { bands, ..self }
    }

    /// Returns the preferred one of two engines for a zone; no preference without rules for it, or if they cannot be
    /// evaluated. Independent of quality, so it is used with optimization off too.
    pub fn preference(&self, work: &WorkRow, zone: &ZoneRow) -> EnginePreference {
        self.engine_choice.as_ref().map_or_else(EnginePreference::default, |choice| choice.preference(work, zone))
    }

    /// Returns the settings for a zone, never above the user's. With optimization off, or if the rules cannot be
    /// evaluated, exactly the user's settings. Bands follow [`Self::with_bands`].
    pub fn decide(&self, work: &WorkRow, zone: &ZoneRow) -> Choice {
        self.try_decide(work, zone).unwrap_or_else(|error| {
            tracing::warn!(zone = zone.zone.0, %error, "the rules cannot be used here");
            self.banded(Choice::unchanged(&work.settings))
        })
    }

    /// Returns the settings for a zone as [`Self::decide`] does, or the error if the rules cannot be evaluated.
    ///
    /// # Errors
    /// The rules do not fit the ranges of the work, or cannot be evaluated.
    pub fn try_decide(&self, work: &WorkRow, zone: &ZoneRow) -> Result<Choice, ExpertError> {
        // With the user's settings zones agree bit for bit, so there is nothing to blend.
        let Some(level) = work.settings.optimization.rule_input() else {
            return Ok(Choice::unchanged(&work.settings));
        };
        self.by_rules(work, zone, level).map(|choice| self.banded(choice))
    }

    /// Returns the choice with the bands that the user wants.
    fn banded(&self, choice: Choice) -> Choice {
        match self.bands {
            BandWidth::Off => Choice { bands: Sides::all(0), ..choice },
            BandWidth::Rules => choice,
            BandWidth::Pixels(pixels) => Choice { bands: Sides::all(pixels.min(BAND_MAX)), ..choice },
        }
    }

    fn by_rules(&self, work: &WorkRow, zone: &ZoneRow, level: f64) -> Result<Choice, ExpertError> {
        let settings = &work.settings;
        let rules = laid_out(&self.rules, &work.ranges)?;
        let evaluate = |difference: f64| {
            let mut values = zone_values(zone, difference).to_vec();
            values.push((OPTIMIZATION_LEVEL, level));
            values.retain(|(name, _)| rules.input_index(name).is_some());
            rules.evaluate(&values)
        };
        // Evaluate the rules for the zone as a whole
        let outputs = evaluate(zone.neighbor_difference.mean)?;
        let share = |name: &str| outputs.get(name).unwrap_or(1.0).clamp(SHARE_MIN, 1.0);
        // Choose a band for each edge, from the difference to the zones beyond it and from how far this zone falls
        // behind the user's settings: a zone at full quality has nothing to hide and leaves blending to its neighbors.
        // Pixels in a band are painted twice, so its width is limited. An output in pixels, as in the paper's rules, is
        // used as it is.
        let shares = Shares {
            depth: share(RECURSION_LEVEL),
            samples: share(SAMPLES),
            light_samples: share(SAMPLES) * share(LIGHT_SAMPLES),
        };
        let behind = 1.0 - shares.depth * shares.light_samples;
        let most = f64::from(zone.rect.width().min(zone.rect.height())) * BAND_OF_SIDE;
        let band = |difference: f64| {
            let outputs = evaluate(difference)?;
            let hiding = outputs.get(INTERPOLATION_BAND_SIZE).map_or(0.0, |band| (band * behind).min(most));
            let band = outputs.get(INTERPOLATION_BAND_PIXELS).unwrap_or(0.0).max(hiding);
            Ok::<_, EvaluateError>(band.clamp(0.0, f64::from(BAND_MAX)).round() as u32)
        };
        let Sides { left, top, right, bottom } = zone.neighbor_difference.sides;
        let bands = Sides { left: band(left)?, top: band(top)?, right: band(right)?, bottom: band(bottom)? };
        Ok(self.scaled(settings, shares, bands))
    }

    /// Returns the rules that fired, the strongest first and six at most, with their degrees: `path_tracing: 12 0.83,
    /// 22 0.40`. `None` with optimization off, and if the rules cannot be evaluated.
    pub fn reasons(&self, work: &WorkRow, zone: &ZoneRow) -> Option<Arc<str>> {
        let level = work.settings.optimization.rule_input()?;
        let rules = laid_out(&self.rules, &work.ranges).ok()?;
        let mut values = zone_values(zone, zone.neighbor_difference.mean).to_vec();
        values.push((OPTIMIZATION_LEVEL, level));
        values.retain(|(name, _)| rules.input_index(name).is_some());
        let fired = rules.explain(&values).ok()?.rules;
        let reasons = fired.iter().take(REASONS_MAX).map(|rule| format!("{} {:.2}", rule.label, rule.degree));
        Some(format!("{}: {}", rules.name(), reasons.collect::<Vec<_>>().join(", ")).into())
    }

    /// Returns the number of samples per pixel of a zone's first painting: those of profiling, or all of them if the
    /// engine is not profiled; then the zone's time is known only at its end.
    pub fn first_samples(&self, choice: &Choice, goal: &Goal) -> u32 {
        if self.is_profiled || *goal != Goal::Samples { choice.profile_samples(goal) } else { choice.samples }
    }

    /// Returns the number of samples per pixel to reach next. If it is not above `samples`, the zone is finished, or
    /// the Master decides when it continues.
    ///
    /// - `samples`: samples per pixel reached so far.
    /// - `unfinished`: share of the zone's pixels whose error is too large, 0..=1.
    pub fn next_samples(&self, settings: &WorkSettings, samples: u32, choice: &Choice, unfinished: f64) -> u32 {
        match settings.goal {
            Goal::Samples => choice.samples,
            Goal::Error(_) if unfinished > 0.0 => octave_end(samples, choice.samples),
            Goal::Error(_) | Goal::Time(_) => samples,
        }
    }

    /// Scales the user's settings. Half a bounce rounds up, and at least one bounce and one light sample remain if the
    /// user allows any.
    fn scaled(&self, settings: &WorkSettings, shares: Shares, bands: Sides<u32>) -> Choice {
        let Tunables { max_depth, light_samples } = settings.tunables;
        let part = |value: u32, share: f64| (f64::from(value) * share).round() as u32;
        // Allow for rounding in the rules, which are exact to about 1e-9
        let bounces = (f64::from(max_depth) * shares.depth + 0.5 + 1e-6).floor() as u32;
        let max_depth = if self.has_max_depth { bounces.clamp(max_depth.min(1), max_depth) } else { max_depth };
        let at_vertex = part(light_samples, shares.light_samples).max(light_samples.min(1));
        let light_samples = if self.has_light_samples { at_vertex } else { light_samples };
        let samples = part(settings.samples, shares.samples).max(1);
        Choice { tunables: Tunables { max_depth, light_samples }, samples, bands }
    }
}

#[cfg(test)]
mod tests {
    use bottega_image::Rect;

    use super::*;
    use crate::{InputRanges, NeighborDifference, Optimization, PAPER_RULES, WorkId, ZoneId};

    fn zone(index: u32, complexity: f64, difference: f64) -> ZoneRow {
        ZoneRow::open(
            WorkId(1),
            ZoneId(index),
            Rect::of_size(480, 480),
            complexity * 480.0 * 480.0,
            NeighborDifference::all(difference),
        )
    }

    fn work(optimization: Optimization, rows: &[ZoneRow]) -> WorkRow {
        let frame = Rect::of_size(960, 960);
        let tunables = Tunables { max_depth: 10, light_samples: 4 };
        let goal = Goal::Samples;
        let settings = WorkSettings { picture: frame, frame, samples: 256, goal, tunables, optimization };
        WorkRow {
            work: WorkId(1),
            settings,
            zone_count: rows.len() as u32,
            ranges: InputRanges::of(rows),
            features: crate::TaskFeatures::default(),
        }
    }

    #[test]
    fn off_is_the_users_settings_exactly() {
        let rows = [zone(0, 0.2, 0.0), zone(1, 3.0, 2.0)];
        let work = work(Optimization::Off, &rows);
        for row in &rows {
            assert_eq!(Expert::path_tracing().decide(&work, row), Choice::unchanged(&work.settings));
        }
    }

    #[test]
    fn a_stronger_level_never_asks_for_more() {
        let rows = [zone(0, 0.2, 0.0), zone(1, 1.0, 0.3), zone(2, 3.0, 2.0)];
        for row in &rows {
            let choices: Vec<Choice> = Optimization::ALL[1..]
                .iter()
                .map(|&level| Expert::path_tracing().decide(&work(level, &rows), row))
                .collect();
            let cost = |choice: &Choice| choice.samples * choice.tunables.light_samples;
            assert!(choices.is_sorted_by_key(|choice| std::cmp::Reverse(cost(choice))), "{choices:?}");
            assert!(cost(&choices[4]) < cost(&choices[0]));
            assert_eq!((choices[0].samples, choices[0].tunables), (256, Tunables { max_depth: 10, light_samples: 4 }));
        }
    }

    #[test]
    fn the_band_is_wide_where_neighbors_differ() {
        let rows = [zone(0, 0.2, 0.0), zone(1, 3.0, 2.0)];
        let work = work(Optimization::Normal, &rows);
        let band = |row: &ZoneRow| Expert::path_tracing().decide(&work, row).bands.left;
        let [even, rim] = rows.each_ref().map(band);
        assert!(rim >= 8 && even <= 2, "{even} {rim}");
        // What is painted twice is a part of the zone at most.
        let small = ZoneRow { rect: Rect::of_size(48, 480), ..rows[1].clone() };
        assert_eq!(band(&small), 2);
    }

    /// Rule 11 of the paper, and the resulting settings of each level for a large complex zone.
    #[test]
    fn in_the_papers_rules_each_level_leaves_other_bounces() {
        let paper = Expert::parse(crate::PAPER_RULES).unwrap();
        let rows = [zone(0, 0.2, 0.0), zone(1, 3.0, 2.0)];
        for (most, depths) in [(8, [8, 8, 7, 7, 6]), (16, [16, 15, 14, 13, 12])] {
            let chosen: Vec<Choice> = Optimization::ALL[1..]
                .iter()
                .map(|&level| {
                    let mut work = work(level, &rows);
                    work.settings.tunables = Tunables { max_depth: most, light_samples: 16 };
                    paper.decide(&work, &rows[1])
                })
                .collect();
            assert_eq!(chosen.iter().map(|choice| choice.tunables.max_depth).collect::<Vec<_>>(), depths);
            let light_samples: Vec<u32> = chosen.iter().map(|choice| choice.tunables.light_samples).collect();
            assert_eq!(light_samples, [16, 13, 10, 7, 4]);
            // The paper's rules lower the samples of lights, not those of pixels.
            assert!(chosen.iter().all(|choice| choice.samples == 256), "{chosen:?}");
        }
    }

    #[test]
    fn a_zone_that_keeps_all_its_settings_has_no_seam_to_hide() {
        let rows = [zone(0, 0.2, 0.0), zone(1, 3.0, 2.0)];
        let work = work(Optimization::VerySmall, &rows);
        for row in &rows {
            assert_eq!(Expert::path_tracing().decide(&work, row), Choice::unchanged(&work.settings));
        }
    }

    /// The bounces that each term of `recursion_level` leaves, from VS to VB.
    fn bounces(rules: &str, max_depth: u32) -> Vec<u32> {
        let rows = [zone(0, 1.0, 0.0)];
        let work = work(Optimization::Normal, &rows);
        let settings = WorkSettings { tunables: Tunables { max_depth, light_samples: 1 }, ..work.settings };
        let work = WorkRow { settings, ..work };
        // All rules conclude the one term.
        let depth = |term: &str| {
            let conclusion = |text: &str| format!("recursion_level IS {text};");
            let text = ["VS", "S", "N", "B", "VB"]
                .iter()
                .fold(rules.to_owned(), |text, any| text.replace(&conclusion(any), &conclusion(&format!(" {term}"))));
            Expert::parse(&text).unwrap().decide(&work, &rows[0]).tunables.max_depth
        };
        ["VS", "S", "N", "B", "VB"].map(depth).to_vec()
    }

    #[test]
    fn each_term_of_the_recursion_level_leaves_other_bounces() {
        let ours = Technique::PathTracing.rules();
        assert_eq!(bounces(ours, 8), [4, 5, 6, 7, 8]);
        assert_eq!(bounces(ours, 16), [8, 10, 12, 14, 16]);
        assert_eq!(bounces(ours, 4), [2, 3, 3, 4, 4]);
        assert_eq!(bounces(PAPER_RULES, 8), [6, 7, 7, 8, 8]);
        assert_eq!(bounces(PAPER_RULES, 16), [12, 13, 14, 15, 16]);
        assert_eq!(bounces(PAPER_RULES, 4), [3, 3, 4, 4, 4]);
        // Never more than the user allows; none only where the user wants none.
        for rules in [ours, PAPER_RULES] {
            assert_eq!(bounces(rules, 1), [1; 5]);
            assert_eq!(bounces(rules, 0), [0; 5]);
        }
    }

    #[test]
    fn the_rules_that_the_paper_prints_do_what_they_say() {
        let rows = [zone(0, 0.2, 0.0), zone(1, 3.0, 2.0)];
        let paper = Expert::parse(PAPER_RULES).unwrap();
        let decide = |optimization, row: &ZoneRow| {
            let work = work(optimization, &rows);
            let tunables = Tunables { max_depth: 8, light_samples: 16 };
            let settings = WorkSettings { tunables, samples: 1600, ..work.settings };
            paper.decide(&WorkRow { settings, ..work }, row)
        };
        // R11: of a complex zone that is not small, VS of the light samples and VS of the bounces.
        let choice = decide(Optimization::VeryBig, &rows[1]);
        assert_eq!((choice.samples, choice.tunables), (1600, Tunables { max_depth: 6, light_samples: 4 }));
        // R22: a band of VB where neighbors differ most, whatever the zone keeps.
        for optimization in &Optimization::ALL[1..] {
            assert_eq!(decide(*optimization, &rows[1]).bands, Sides::all(4));
            assert_eq!(decide(*optimization, &rows[0]).bands, Sides::all(0));
        }
        // VS takes nothing, and every level takes more.
        let samples = Optimization::ALL.map(|level| decide(level, &rows[1]).tunables.light_samples);
        assert_eq!(samples, [16, 16, 13, 10, 7, 4]);
    }

    #[test]
    fn the_user_says_how_wide_bands_are() {
        let rows = [zone(0, 0.2, 0.0), zone(1, 3.0, 2.0)];
        for (bands, expected) in
            [(BandWidth::Off, 0), (BandWidth::Pixels(5), 5), (BandWidth::Pixels(1 << 20), BAND_MAX)]
        {
            for (optimization, expected) in [(Optimization::Off, 0), (Optimization::Normal, expected)] {
                let work = work(optimization, &rows);
                let ruled = Expert::path_tracing().decide(&work, &rows[1]);
                let choice = Expert::path_tracing().with_bands(bands).decide(&work, &rows[1]);
                assert_eq!(choice, Choice { bands: Sides::all(expected), ..ruled });
            }
        }
    }

    #[test]
    fn an_engine_without_a_knob_keeps_what_it_has() {
        let rows = [zone(0, 0.2, 0.0), zone(1, 3.0, 2.0)];
        let work = work(Optimization::VeryBig, &rows);
        let engine = EngineDescription {
            name: "plain".to_owned(),
            has_max_depth: false,
            has_light_samples: false,
            resumes_samples: true,
            is_profiled: true,
            exact_by_pixel: true,
        };
        let choice = Expert::path_tracing().for_engine(&engine).decide(&work, &rows[1]);
        assert_eq!(choice.tunables, work.settings.tunables);
        assert!(choice.samples < 256);
    }

    #[test]
    fn an_engine_that_is_not_profiled_paints_a_zone_at_once() {
        let work = work(Optimization::Off, &[zone(0, 1.0, 0.0)]);
        let choice = Choice::unchanged(&work.settings);
        let first = |is_profiled, goal| {
            let engine = EngineDescription {
                name: "plain".to_owned(),
                has_max_depth: true,
                has_light_samples: true,
                resumes_samples: true,
                is_profiled,
                exact_by_pixel: true,
            };
            Expert::path_tracing().for_engine(&engine).first_samples(&choice, &goal)
        };
        assert_eq!(first(true, Goal::Samples), 13);
        assert_eq!(first(false, Goal::Samples), 256);
        // The number of samples is unknown until the error is met.
        assert_eq!(first(false, Goal::Error(0.1)), 8);
    }

    #[test]
    fn rules_about_something_else_are_refused() {
        let text = "FUNCTION_BLOCK f VAR_INPUT moon : REAL; END_VAR VAR_OUTPUT light_samples : REAL; END_VAR \
            FUZZIFY moon TERM full := (0, 1) (1, 0); END_FUZZIFY \
            DEFUZZIFY light_samples TERM few := (0, 1) (1, 0); METHOD : COG; DEFAULT := 1; END_DEFUZZIFY \
            RULEBLOCK r RULE 1 : IF moon IS full THEN light_samples IS few; END_RULEBLOCK END_FUNCTION_BLOCK";
        assert!(matches!(Expert::parse(text), Err(ExpertError::UnknownInput { name, .. }) if name == "moon"));
        assert!(matches!(Expert::parse("no rules"), Err(ExpertError::Fcl(_))));
    }

    #[test]
    fn outputs_of_another_technique_are_left_aside_and_rules_without_any_of_ours_are_refused() {
        let photons = Technique::PhotonMapping.rules();
        let expert = Expert::parse(photons).unwrap();
        assert_eq!(expert.ignored_outputs().len(), 5);
        let rows = [zone(0, 0.2, 0.0), zone(1, 3.0, 2.0)];
        let work = work(Optimization::VeryBig, &rows);
        let choice = expert.decide(&work, &rows[1]);
        // Nothing is lowered, so there is nothing for a band to hide.
        assert_eq!(choice, Choice::unchanged(&work.settings));
        let error = Expert::parse(&photons.replace(INTERPOLATION_BAND_SIZE, "width")).unwrap_err();
        assert!(matches!(&error, ExpertError::NoOutput { found, .. } if found.len() == 6), "{error}");
        assert!(error.to_string().contains("they have photons, gather_count"), "{error}");
        assert_eq!(Expert::path_tracing().ignored_outputs(), Vec::<String>::new());
    }
}
