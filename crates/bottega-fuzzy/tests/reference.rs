//! Inference beside an independent library's: every operator, every method, and the rules that come with the program.
//! `data/reference.py` names the library, and the differences in its definitions. `cargo xtask fuzzy-reference` makes
//! the numbers again.

use std::{collections::BTreeMap, fs, path::Path};

use bottega_fuzzy::FunctionBlock;
use serde_json::Value;

/// Share of an output's range by which a value may differ. The library's integrals are sums over at least 40,000 steps.
const TOLERANCE: f64 = 1e-6;

fn folder(of: &str) -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(of)
}

fn cases(name: &str) -> Vec<Value> {
    let text = fs::read_to_string(folder("tests/data").join(name)).unwrap();
    serde_json::from_str(&text).unwrap()
}

fn strings(value: &Value) -> Vec<&str> {
    value.as_array().unwrap().iter().map(|one| one.as_str().unwrap()).collect()
}

fn rows(value: &Value) -> Vec<Vec<f64>> {
    let numbers = |row: &Value| row.as_array().unwrap().iter().map(|one| one.as_f64().unwrap()).collect();
    value.as_array().unwrap().iter().map(numbers).collect()
}

/// Replaces words of the text: `ACT : PROD;` for `ACT : MIN;`.
fn exchanged(text: &str, put: &Value) -> String {
    put.as_object().unwrap().iter().fold(text.to_owned(), |text, (name, word)| {
        let start = text.find(&format!("{name} : ")).unwrap() + name.len() + 3;
        let end = start + text[start..].find(';').unwrap();
        format!("{}{}{}", &text[..start], word.as_str().unwrap(), &text[end..])
    })
}

/// Compares a case and returns the greatest difference, as a share of the range of the output.
fn compare(text: &str, case: &Value) -> f64 {
    let block = FunctionBlock::parse(&exchanged(text, &case["put"])).unwrap();
    let (inputs, outputs) = (strings(&case["inputs"]), strings(&case["outputs"]));
    let (points, values) = (rows(&case["points"]), rows(&case["values"]));
    assert!(!points.is_empty() && points.len() == values.len());
    let mut greatest = 0.0_f64;
    for (point, expected) in points.iter().zip(&values) {
        let named: Vec<(&str, f64)> = inputs.iter().copied().zip(point.iter().copied()).collect();
        let found = block.evaluate(&named).unwrap();
        for (name, expected) in outputs.iter().zip(expected) {
            let (low, high) = block.outputs()[block.output_index(name).unwrap()].declared_range();
            let difference = (found.get(name).unwrap() - expected).abs() / (high - low);
            assert!(difference < TOLERANCE, "{} {} {named:?}: {found:?}, not {expected}", case["file"], case["put"]);
            greatest = greatest.max(difference);
        }
    }
    greatest
}

#[test]
fn every_operator_and_method_agrees_with_an_independent_library() {
    let mut seen: BTreeMap<String, usize> = BTreeMap::new();
    for case in cases("operators.json") {
        let file = case["file"].as_str().unwrap();
        let text = fs::read_to_string(folder("tests/data").join(file)).unwrap();
        compare(&text, &case);
        for (name, word) in case["put"].as_object().unwrap() {
            *seen.entry(format!("{name} {}", word.as_str().unwrap())).or_default() += 1;
        }
    }
    let words: Vec<&str> = seen.keys().map(String::as_str).collect();
    let expected = "ACCU BSUM,ACCU MAX,ACCU NSUM,ACT MIN,ACT PROD,AND BDIF,AND MIN,AND PROD,METHOD COA,METHOD COG,METHOD LM,\
                    METHOD MM,METHOD RM,OR ASUM,OR BSUM,OR MAX";
    assert_eq!(words.join(","), expected);
}

#[test]
fn the_rules_of_the_program_agree_with_an_independent_library() {
    let cases = cases("rules.json");
    assert_eq!(cases.len(), 2);
    for case in cases {
        let text = fs::read_to_string(folder("../../rules").join(case["file"].as_str().unwrap())).unwrap();
        assert!(compare(&text, &case) > 0.0, "another way of reckoning rounds otherwise somewhere");
    }
}
