//! No text makes the reader panic, run for ever, or report a position outside of the text.

use bottega_fuzzy::{FclError, Limits, parse_document};
use proptest::prelude::*;

const LAMP: &str = include_str!("lamp_choice.fcl");

/// Reads, and verifies and evaluates what can be read. An error must lie in the text, or right behind it.
fn survives(text: &str) {
    match parse_document(text) {
        Err(error) => assert_within(text, &error),
        Ok(document) => {
            document.verify();
            for block in &document.blocks {
                let values: Vec<f64> = block.inputs().iter().map(|_| 0.5).collect();
                let outputs = block.evaluate_indexed(&values).unwrap();
                assert!(outputs.values().iter().flatten().all(|value| value.is_finite()), "{text}");
            }
        }
    }
}

fn assert_within(text: &str, error: &FclError) {
    let lines: Vec<&str> = text.split('\n').collect();
    let line = lines.get(error.at.line - 1).unwrap_or_else(|| panic!("{error}: the text has {} lines", lines.len()));
    assert!((1..=line.chars().count() + 1).contains(&error.at.column), "{error} in {line:?}");
    let length = error.to_string().len();
    assert!(length < 1000, "at {}: {length} bytes of message", error.at);
}

/// A word of the language, a name, a number or a mark.
fn any_token() -> impl Strategy<Value = &'static str> {
    prop::sample::select(
        "FUNCTION_BLOCK END_FUNCTION_BLOCK VAR_INPUT VAR_OUTPUT VAR END_VAR FUZZIFY END_FUZZIFY DEFUZZIFY END_DEFUZZIFY \
         RULEBLOCK END_RULEBLOCK TERM RANGE METHOD DEFAULT ACCU ACT AND OR NOT RULE IF IS THEN WITH REAL NC COG COGS MIN \
         PROD BDIF MAX ASUM BSUM NSUM x y few many 0 1 0.5 -1 1e308 1e-320 .. : := ; , ( ) (0,0) (1,1) (1,1) (* *) //"
            .split_whitespace()
            .collect::<Vec<_>>(),
    )
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(512))]

    #[test]
    fn any_characters(text in "\\PC{0,200}") {
        survives(&text);
    }

    #[test]
    fn any_tokens(tokens in prop::collection::vec(any_token(), 0..60), newline in 1..8_usize) {
        let text: String = tokens.chunks(newline).map(|line| line.join(" ") + "\n").collect();
        survives(&text);
        survives(&format!("FUNCTION_BLOCK {text} END_FUNCTION_BLOCK"));
    }

    #[test]
    fn an_example_in_which_something_is_put_for_something_else(
        at in 0..LAMP.len(),
        length in 0..40_usize,
        put in "[A-Z_a-z0-9.:=;(),*/ é-]{0,6}",
    ) {
        let end = (at + length).min(LAMP.len());
        if LAMP.is_char_boundary(at) && LAMP.is_char_boundary(end) {
            survives(&format!("{}{put}{}", &LAMP[..at], &LAMP[end..]));
        }
    }

    #[test]
    fn an_example_with_one_token_for_another(which in 0..1000_usize, put in any_token()) {
        let starts: Vec<usize> = LAMP.match_indices(char::is_whitespace).map(|(at, _)| at + 1).collect();
        let start = starts[which % starts.len()];
        let end = LAMP[start..].find(char::is_whitespace).map_or(LAMP.len(), |length| start + length);
        survives(&format!("{}{put}{}", &LAMP[..start], &LAMP[end..]));
    }
}

#[test]
fn the_largest_texts_end_soon() {
    let too_long = " ".repeat(Limits::TEXT_BYTES_MAX + 1);
    assert!(parse_document(&too_long).unwrap_err().to_string().contains("too many bytes"));
    for unit in [
        "FUNCTION_BLOCK END_FUNCTION_BLOCK ",
        "(* *) ",
        "NOT ",
        "( ",
        "x",
        "9",
        "FUNCTION_BLOCK f VAR x:REAL; END_VAR ",
    ] {
        survives(&unit.repeat(Limits::TEXT_BYTES_MAX / unit.len()));
    }
    // The maximum numbers of inputs and points, and a rule on each pair.
    let points: String = (0..Limits::POINTS_MAX).map(|i| format!("({i},{})", i % 2)).collect();
    let inputs: String = (0..Limits::VARIABLES_MAX).map(|i| format!("v{i} : REAL; ")).collect();
    let terms: String = (0..4).map(|k| format!("TERM t{k} := {points}; ")).collect();
    let sets: String = (0..Limits::VARIABLES_MAX).map(|i| format!("FUZZIFY v{i} {terms} END_FUZZIFY ")).collect();
    let rule =
        |i: usize| format!("RULE r{i} : IF v{} IS t1 AND v{} IS t2 THEN y IS a, y IS b; ", i % 64, (i * 7 + 1) % 64);
    let rules: String = (0..Limits::RULES_MAX / 2).map(rule).collect();
    survives(&format!(
        "FUNCTION_BLOCK VAR_INPUT {inputs} END_VAR VAR_OUTPUT y : REAL; END_VAR {sets}
         DEFUZZIFY y TERM a := 1; TERM b := 2; METHOD : COGS; END_DEFUZZIFY
         RULEBLOCK r {rules} END_RULEBLOCK END_FUNCTION_BLOCK"
    ));
}
