//! The rule bases that come with the program: whole, alive, and monotone where they must be.

use std::{collections::BTreeSet, path::Path};

use bottega_fuzzy::{FunctionBlock, parse_document};

fn read(name: &str) -> FunctionBlock {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../rules").join(name);
    let text = std::fs::read_to_string(path).unwrap();
    let document = parse_document(&text).unwrap();
    assert_eq!(document.verify(), []);
    assert_eq!(document.blocks.len(), 1);
    document.blocks.into_iter().next().unwrap()
}

fn path_tracing() -> FunctionBlock {
    read("path-tracing.fcl")
}

/// The paper's own set.
fn paper() -> FunctionBlock {
    read("paper.fcl")
}

fn photon_mapping() -> FunctionBlock {
    read("photon-mapping.fcl")
}

/// Beginning of the names of outputs for the width of a band.
const BAND: &str = "interpolation_band";
const INPUTS: [&str; 4] = ["complexity", "neighbor_difference", "size", "optimization_level"];

/// Evenly spaced, with the ends.
fn steps(low: f64, high: f64, count: usize) -> impl Iterator<Item = f64> + Clone {
    (0..count).map(move |i| low + (high - low) * i as f64 / (count - 1) as f64)
}

/// Complexity, neighbor difference and size on a grid that is finer than the terms.
fn zones() -> impl Iterator<Item = [f64; 3]> {
    steps(0.0, 1.0, 13).flat_map(|c| steps(0.0, 1.0, 13).flat_map(move |n| steps(0.0, 1.0, 7).map(move |s| [c, n, s])))
}

#[test]
fn there_are_28_rules_on_the_variables_of_the_paper() {
    let photons = [
        "photons",
        "gather_count",
        "gather_radius",
        "final_gather_rays",
        "irradiance_cache_accuracy",
        "interpolation_band_size",
    ];
    for (block, expected) in [
        (path_tracing(), &["recursion_level", "samples", "interpolation_band_size"][..]),
        (paper(), &["recursion_level", "light_samples", "interpolation_band_pixels"][..]),
        (photon_mapping(), &photons[..]),
    ] {
        let labels: Vec<String> = block.rules().map(|rule| rule.label.clone()).collect();
        assert_eq!(labels, (1..=28).map(|n| n.to_string()).collect::<Vec<_>>());
        assert_eq!(block.inputs().iter().map(|input| input.name.as_str()).collect::<Vec<_>>(), INPUTS);
        let outputs: Vec<_> = block.outputs().iter().map(|output| output.name.as_str()).collect();
        assert_eq!(outputs, expected);
        assert_eq!(FunctionBlock::parse(&block.to_string()).unwrap(), block);
    }
}

#[test]
fn every_rule_can_fire_and_some_rule_always_does() {
    for block in [path_tracing(), paper(), photon_mapping()] {
        let mut fired = BTreeSet::new();
        for [c, n, s] in zones() {
            for op in steps(1.0, 5.0, 5) {
                let inputs = [(INPUTS[0], c), (INPUTS[1], n), (INPUTS[2], s), (INPUTS[3], op)];
                let why = block.explain(&inputs).unwrap();
                let concludes =
                    |output: &str| why.rules.iter().any(|rule| rule.conclusions.iter().any(|c| c.starts_with(output)));
                assert!(block.outputs().iter().all(|output| concludes(&output.name)), "{inputs:?}: {why}");
                fired.extend(why.rules.into_iter().map(|rule| rule.label));
            }
        }
        assert_eq!(fired.len(), 28);
    }
    // Without their defaults the outputs have no hole either: verified over all cells of the terms, not on a grid.
    for name in ["path-tracing.fcl", "paper.fcl", "photon-mapping.fcl"] {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../rules").join(name);
        let text = std::fs::read_to_string(path).unwrap();
        let bare: String =
            text.lines().filter(|line| !line.contains("DEFAULT")).map(|line| format!("{line}\n")).collect();
        assert_eq!(parse_document(&bare).unwrap().verify(), []);
    }
}

#[test]
fn more_optimization_never_means_more_quality() {
    for (block, grows) in [(path_tracing(), None), (paper(), None), (photon_mapping(), Some("gather_radius"))] {
        let quality: Vec<_> = block.outputs().iter().filter(|output| !output.name.starts_with(BAND)).collect();
        let signs: Vec<f64> = quality.iter().map(|o| if grows == Some(o.name.as_str()) { -1.0 } else { 1.0 }).collect();
        for [c, n, s] in zones() {
            let mut before = vec![f64::INFINITY; quality.len()];
            for op in steps(1.0, 5.0, 21) {
                let values = block.evaluate_indexed(&[c, n, s, op]).unwrap();
                for (((before, value), sign), output) in
                    before.iter_mut().zip(values.values()).zip(&signs).zip(&quality)
                {
                    let value = value.unwrap();
                    let (low, high) = if *sign > 0.0 { (0.2, 1.0) } else { (1.0, 2.0) };
                    assert!((low - 1e-9..=high + 1e-9).contains(&value), "{}: {value}", output.name);
                    assert!(sign * value <= *before + 1e-9, "{}, c {c} nd {n} size {s} op {op}: {value}", output.name);
                    *before = sign * value;
                }
            }
        }
    }
}

#[test]
fn the_band_grows_with_the_difference_of_neighbors() {
    for (block, widest) in [(path_tracing(), 16.0), (paper(), 4.0), (photon_mapping(), 16.0)] {
        let width = block.outputs().iter().find(|output| output.name.starts_with(BAND)).unwrap();
        for c in steps(0.0, 1.0, 13) {
            let mut before = f64::NEG_INFINITY;
            for n in steps(0.0, 1.0, 41) {
                let band = block.evaluate_indexed(&[c, n, 0.5, 3.0]).unwrap().get(&width.name).unwrap();
                assert!(band >= before - 1e-9, "c {c} nd {n}: {band} after {before}");
                before = band;
            }
            assert!((before - widest).abs() < 1e-9, "c {c}: {before}");
        }
    }
}

#[test]
fn photon_mapping_keeps_what_photons_are_for() {
    let block = photon_mapping();
    let outputs = |c, n, s, op| block.evaluate_indexed(&[c, n, s, op]).unwrap();
    for [c, n, s] in zones() {
        let as_set = outputs(c, n, s, 1.0);
        for output in block.outputs().iter().filter(|output| !output.name.starts_with(BAND)) {
            assert!((as_set.get(&output.name).unwrap() - 1.0).abs() < 1e-9, "{}", output.name);
        }
        // Nowhere may a caustic lose more photons than a plain wall does.
        let plain = outputs(0.0, 0.0, s, 5.0).get("photons").unwrap();
        assert!(outputs(c, n, s, 5.0).get("photons").unwrap() >= plain - 1e-9);
    }
    let (beside, plain) = (outputs(0.0, 1.0, 0.5, 5.0), outputs(0.0, 0.0, 0.5, 5.0));
    for output in ["photons", "gather_count", "irradiance_cache_accuracy"] {
        assert!(beside.get(output) >= plain.get(output), "{output}");
    }
    // Fewer photons over a wider disc: about as many to an estimate.
    for op in steps(1.0, 5.0, 17) {
        let plain = outputs(0.0, 0.0, 0.5, op);
        let in_reach = plain.get("photons").unwrap() * plain.get("gather_radius").unwrap().powi(2);
        assert!((0.75..=1.5).contains(&in_reach), "op {op}: {in_reach}");
    }
}

#[test]
fn very_small_leaves_everything_and_very_big_saves_most_in_large_complex_zones() {
    for (block, samples, least) in [(path_tracing(), "samples", (0.2, 0.5)), (paper(), "light_samples", (0.25, 0.75))] {
        let quality = |c, n, s, op| {
            let outputs = block.evaluate_indexed(&[c, n, s, op]).unwrap();
            (outputs.get(samples).unwrap(), outputs.get("recursion_level").unwrap())
        };
        for [c, n, s] in zones() {
            let (samples, recursion) = quality(c, n, s, 1.0);
            assert!((samples - 1.0).abs() < 1e-9 && (recursion - 1.0).abs() < 1e-9);
        }
        // The rule 11 of the paper: both are VS.
        let (samples, recursion) = quality(1.0, 0.5, 1.0, 5.0);
        assert!((samples - least.0).abs() < 1e-9 && (recursion - least.1).abs() < 1e-9, "{samples} {recursion}");
        for [c, n, s] in zones() {
            let (others, _) = quality(c, n, s, 5.0);
            assert!(others >= samples - 1e-9);
        }
        // Among its like a simple zone is optimized harder than beside different neighbors.
        assert!(quality(0.0, 0.0, 0.5, 5.0).0 < quality(0.0, 1.0, 0.5, 5.0).0);
    }
}

#[test]
fn zones_that_do_not_differ_stand_in_the_middle() {
    let mut block = path_tracing();
    for input in &INPUTS[..3] {
        block.layout_inputs(input, 42.0, 42.0).unwrap();
    }
    let alike = block.evaluate_indexed(&[42.0, 42.0, 42.0, 3.0]).unwrap();
    assert_eq!(alike, path_tracing().evaluate_indexed(&[0.5, 0.5, 0.5, 3.0]).unwrap());
}

/// Those of other people's engines, which have rules of their own where they differ from our path tracer.
const ENGINES: [&str; 4] = ["cycles.fcl", "luxcore.fcl", "mitsuba.fcl", "povray.fcl"];

/// The values of a block's inputs, for a zone and a level.
fn values_for(block: &FunctionBlock, [c, n, s]: [f64; 3], level: f64) -> Vec<(&'static str, f64)> {
    let all = [(INPUTS[0], c), (INPUTS[1], n), (INPUTS[2], s), (INPUTS[3], level)];
    all.into_iter().filter(|(name, _)| block.input_index(name).is_some()).collect()
}

#[test]
fn rules_of_engines_have_no_dead_rule_and_never_ask_for_more_at_a_higher_level() {
    for name in ENGINES {
        let block = read(name);
        let mut fired = BTreeSet::new();
        for zone in zones() {
            let mut before = vec![f64::INFINITY; block.outputs().len()];
            for level in steps(1.0, 5.0, 9) {
                let values = values_for(&block, zone, level);
                let outputs = block.evaluate(&values).unwrap();
                for (before, output) in
                    before.iter_mut().zip(block.outputs()).filter(|(_, it)| !it.name.starts_with(BAND))
                {
                    let value = outputs.get(&output.name).unwrap();
                    assert!((0.1..=1.0 + 1e-9).contains(&value), "{name}, {}: {value}", output.name);
                    assert!(value <= *before + 1e-9, "{name}, {} of {zone:?} at {level}: {value}", output.name);
                    *before = value;
                }
                fired.extend(block.explain(&values).unwrap().rules.into_iter().map(|rule| rule.label));
            }
        }
        assert_eq!(fired.len(), block.rules().count(), "{name}: {fired:?}");
        // The lowest level of optimization is no optimization.
        let outputs = block.evaluate(&values_for(&block, [0.5; 3], 1.0)).unwrap();
        assert_eq!(outputs.get("samples"), Some(1.0), "{name}");
    }
}
