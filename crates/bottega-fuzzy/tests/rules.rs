//! The rule base that comes with the program: whole, alive, and monotone where it must be.

use std::{collections::BTreeSet, path::Path};

use bottega_fuzzy::{FunctionBlock, parse_document};

fn block() -> FunctionBlock {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../rules/path-tracing.fcl");
    let text = std::fs::read_to_string(path).unwrap();
    let document = parse_document(&text).unwrap();
    assert_eq!(document.warnings, []);
    assert_eq!(document.blocks.len(), 1);
    document.blocks.into_iter().next().unwrap()
}

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
    let block = block();
    let labels: Vec<String> = block.rules().map(|rule| rule.label.clone()).collect();
    assert_eq!(labels, (1..=28).map(|n| n.to_string()).collect::<Vec<_>>());
    assert_eq!(block.inputs().iter().map(|input| input.name.as_str()).collect::<Vec<_>>(), INPUTS);
    let outputs: Vec<_> = block.outputs().iter().map(|output| output.name.as_str()).collect();
    assert_eq!(outputs, ["recursion_level", "light_samples", "interpolation_band_size"]);
    assert_eq!(FunctionBlock::parse(&block.to_string()).unwrap(), block);
}

#[test]
fn every_rule_can_fire_and_some_rule_always_does() {
    let block = block();
    let mut fired = BTreeSet::new();
    for [c, n, s] in zones() {
        for op in steps(1.0, 5.0, 9) {
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

#[test]
fn more_optimization_never_means_more_quality() {
    let block = block();
    for [c, n, s] in zones() {
        let mut before = [f64::INFINITY; 2];
        for op in steps(1.0, 5.0, 41) {
            let values = block.evaluate_indexed(&[c, n, s, op]).unwrap();
            for (before, value) in before.iter_mut().zip(values.values()) {
                let value = value.unwrap();
                assert!(value <= *before + 1e-9, "c {c} nd {n} size {s} op {op}: {value} after {before}");
                assert!((0.2 - 1e-9..=1.0 + 1e-9).contains(&value), "{value}");
                *before = value;
            }
        }
    }
}

#[test]
fn the_band_grows_with_the_difference_of_neighbors() {
    let block = block();
    for c in steps(0.0, 1.0, 13) {
        let mut before = f64::NEG_INFINITY;
        for n in steps(0.0, 1.0, 41) {
            let band = block.evaluate_indexed(&[c, n, 0.5, 3.0]).unwrap().get("interpolation_band_size").unwrap();
            assert!(band >= before - 1e-9, "c {c} nd {n}: {band} after {before}");
            before = band;
        }
        assert!((before - 16.0).abs() < 1e-9, "c {c}: {before}");
    }
}

#[test]
fn very_small_leaves_everything_and_very_big_saves_most_in_large_complex_zones() {
    let block = block();
    let quality = |c, n, s, op| {
        let outputs = block.evaluate_indexed(&[c, n, s, op]).unwrap();
        (outputs.get("light_samples").unwrap(), outputs.get("recursion_level").unwrap())
    };
    for [c, n, s] in zones() {
        let (samples, recursion) = quality(c, n, s, 1.0);
        assert!((samples - 1.0).abs() < 1e-9 && (recursion - 1.0).abs() < 1e-9);
    }
    // The paper's rule 11.
    let (samples, recursion) = quality(1.0, 0.5, 1.0, 5.0);
    assert!((samples - 0.2).abs() < 1e-9 && (recursion - 0.2).abs() < 1e-9, "{samples} {recursion}");
    for [c, n, s] in zones() {
        let (others, _) = quality(c, n, s, 5.0);
        assert!(others >= samples - 1e-9);
    }
    // Among its like a simple zone is optimized harder than beside different neighbors.
    assert!(quality(0.0, 0.0, 0.5, 5.0).0 < quality(0.0, 1.0, 0.5, 5.0).0);
}

#[test]
fn zones_that_do_not_differ_stand_in_the_middle() {
    let mut block = block();
    for input in &INPUTS[..3] {
        block.layout_inputs(input, 42.0, 42.0).unwrap();
    }
    let alike = block.evaluate_indexed(&[42.0, 42.0, 42.0, 3.0]).unwrap();
    assert_eq!(alike, self::block().evaluate_indexed(&[0.5, 0.5, 0.5, 3.0]).unwrap());
}
