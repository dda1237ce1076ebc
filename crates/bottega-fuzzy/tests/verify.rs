//! Verification of rule bases: its warnings, and cases without a warning.

use bottega_fuzzy::{Limits, parse_document};

/// The example with rules that name all terms.
fn lamp() -> String {
    include_str!("lamp_choice.fcl").replace("op IS NOT N", "op IS VB")
}

/// Returns the warnings of a text, as displayed.
fn warnings_of(text: &str) -> Vec<String> {
    parse_document(text).unwrap().verify().iter().map(ToString::to_string).collect()
}

/// Returns the warnings of the example after a replacement in it.
fn warnings_after(from: &str, to: &str) -> Vec<String> {
    assert!(lamp().contains(from), "{from} is not in the example");
    warnings_of(&lamp().replacen(from, to, 1))
}

/// Returns the example with these rules and without a default.
fn with_rules(rules: &str) -> String {
    let lamp = lamp();
    let start = lamp.find("RULE 1").unwrap();
    let end = lamp.find("END_RULEBLOCK").unwrap();
    format!("{}{rules}\n{}", &lamp[..start], &lamp[end..])
}

fn warnings_of_rules(rules: &str) -> Vec<String> {
    warnings_of(&with_rules(rules)).into_iter().filter(|warning| !warning.contains("no rule ")).collect()
}

#[test]
fn a_sound_rule_base_is_praised_by_silence() {
    assert_eq!(warnings_of(&lamp()), Vec::<String>::new());
}

#[test]
fn unused_names_are_reported() {
    assert_eq!(warnings_after("RULE 2", "RULE 1"), ["line 22, column 5: the label `1` is used twice in `expert`"]);
    assert_eq!(
        warnings_after("TERM B :=", "TERM M := (0, 0) (0.5, 1) (1, 0); TERM B :="),
        ["line 6, column 10: no rule names the term `M` of `c`"]
    );
    assert_eq!(
        warnings_after("END_VAR", "d : REAL; END_VAR FUZZIFY d TERM S := (0, 1) (1, 0); END_FUZZIFY"),
        ["line 2, column 33: no rule asks for the input `d`"]
    );
    let silent = "END_DEFUZZIFY DEFUZZIFY x TERM t := 1; METHOD : COGS; DEFAULT := 3; END_DEFUZZIFY";
    let text = lamp().replace("ls : REAL;", "ls : REAL; x : REAL;").replace("END_DEFUZZIFY", silent);
    assert_eq!(warnings_of(&text), ["line 3, column 23: no rule speaks of the output `x`: it is 3 always"]);
    let never = warnings_of(&text.replace("DEFAULT := 3", "DEFAULT := NC"));
    assert!(never[0].ends_with("no rule speaks of the output `x`: it never has a value"), "{never:?}");
}

#[test]
fn sets_that_hold_nowhere_are_reported() {
    let empty = warnings_after("TERM B := (0.5, 0) (1, 1);", "TERM B := (0.5, 0) (1, 1); RANGE := (0 .. 0.5);");
    assert_eq!(empty[0], "line 6, column 10: the term `B` of `c` holds for no value in its range");
    let flat = warnings_after("(16, 1) (64, 1) (192, 0)", "(16, 0) (64, 0) (192, 0)");
    assert_eq!(flat.len(), 1);
    assert!(flat[0].contains("the term `few` of `ls` has no area in its range"), "{flat:?}");
    // A needle has height and no area: no method sees it.
    assert_eq!(warnings_after("(16, 1) (64, 1) (192, 0)", "(64, 0) (64, 1) (64, 0)").len(), 1);
    assert_eq!(warnings_after("(16, 1) (64, 1) (192, 0)", "(0, 0) (16, 0) (1024, 0.1)"), Vec::<String>::new());
}

#[test]
fn rules_that_can_never_fire_are_reported() {
    for (condition, dead) in [
        ("c IS S AND c IS B", true),
        ("c IS S AND c IS NOT S", false),
        ("op IS N AND op IS VB", false),
        ("op IS VB AND NOT op IS VB AND c IS S AND c IS B", true),
        ("NOT (c IS S OR c IS NOT S)", false),
        ("(c IS S OR op IS N) AND c IS B", false),
        ("NOT (c IS NOT S) AND c IS B", true),
    ] {
        let rules =
            format!("RULE 1 : IF op IS N OR NOT op IS N THEN ls IS many; RULE 7 : IF {condition} THEN ls IS many;");
        let warnings = warnings_of_rules(&rules);
        let expected = "rule 7 can never fire: no values of the inputs meet its condition";
        assert_eq!(warnings.iter().any(|warning| warning.contains(expected)), dead, "{condition}: {warnings:?}");
    }
    // Under the bounded norms 0.5 and 0.5 make nothing.
    let bounded =
        with_rules("RULE 7 : IF op IS N AND op IS VB THEN ls IS few;").replace("AND : MIN; OR : MAX;", "AND : BDIF;");
    assert!(warnings_of(&bounded).iter().any(|warning| warning.contains("can never fire")), "{bounded}");
    assert_eq!(warnings_after("WITH 0.75", "WITH 0"), ["line 22, column 5: rule 2 says nothing: its weight is 0"]);
}

#[test]
fn rules_that_contradict_each_other_are_reported() {
    for (one, other, expected) in [
        ("c IS S", "c IS S", Some("under the same condition, a says `few` and b says `many` of `ls`")),
        ("c IS S AND op IS N", "op IS N AND c IS S", Some("under the same condition")),
        ("NOT (c IS S OR op IS N)", "c IS NOT S AND op IS NOT N", Some("under the same condition")),
        ("c IS S AND op IS N", "c IS S", Some("the other does at least as strongly")),
        ("c IS S", "c IS S OR op IS N", Some("the other does at least as strongly")),
        ("c IS S", "c IS B", None),
        ("c IS S AND op IS N", "c IS S AND op IS VB", None),
        // Half of each holds between 3 and 5, but neither is in the other.
        ("op IS N", "op IS VB", None),
    ] {
        let rules = format!("RULE a : IF {one} THEN ls IS few; RULE b : IF {other} THEN ls IS many;");
        let warnings = warnings_of_rules(&rules);
        match expected {
            Some(expected) => {
                assert_eq!(warnings.len(), 1, "{one} | {other}: {warnings:?}");
                assert!(
                    warnings[0].contains("rule b contradicts rule a: ") && warnings[0].contains(expected),
                    "{warnings:?}"
                );
            }
            None => assert_eq!(warnings, Vec::<String>::new(), "{one} | {other}"),
        }
    }
    let itself = warnings_of_rules("RULE a : IF c IS S THEN ls IS few, ls IS many;");
    assert!(itself[0].contains("rule a contradicts itself: it says both `few` and `many` of `ls`"), "{itself:?}");
}

#[test]
fn rules_that_repeat_each_other_are_reported() {
    let rules = "RULE a : IF c IS S THEN ls IS few WITH 0.5; RULE b : IF c IS S AND op IS N THEN ls IS few WITH 0.4;";
    let covered = warnings_of_rules(rules);
    assert!(
        covered[0].contains("rule b changes nothing: rule a says the same, always at least as strongly"),
        "{covered:?}"
    );
    assert_eq!(warnings_of_rules(&rules.replace("0.4", "0.6")), Vec::<String>::new());
    let sums = |rules| warnings_of(&with_rules(rules).replace("ACCU : MAX", "ACCU : BSUM"));
    assert!(!sums(rules).iter().any(|warning| warning.contains("repeats")));
    let twice = sums("RULE a : IF c IS S THEN ls IS few; RULE b : IF c IS S THEN ls IS few WITH 0.1;");
    assert!(
        twice.iter().any(|warning| warning.contains("rule b repeats rule a, which then counts twice")),
        "{twice:?}"
    );
}

#[test]
fn holes_are_reported_where_no_default_covers_them() {
    let holes = |rules: &str| {
        let text = with_rules(rules).replace("DEFAULT := 256", "DEFAULT := NC");
        warnings_of(&text)
            .into_iter()
            .filter_map(|warning| Some(warning.split_once("no DEFAULT, ")?.1.to_owned()))
            .collect::<Vec<_>>()
    };
    assert_eq!(holes("RULE 1 : IF op IS N THEN ls IS few;"), ["where `op` is above 5"]);
    assert_eq!(holes("RULE 1 : IF op IS VB THEN ls IS few;"), ["where `op` is below 3"]);
    // In the example's c one point belongs to neither term.
    assert_eq!(holes("RULE 1 : IF c IS S OR c IS B THEN ls IS few;"), ["where `c` is 0.5"]);
    assert_eq!(
        holes("RULE 1 : IF c IS S THEN ls IS few; RULE 2 : IF op IS N THEN ls IS many;"),
        ["where `c` is above 0.5 and `op` is above 5"]
    );
    assert_eq!(holes("RULE 1 : IF c IS S OR c IS NOT S THEN ls IS few;"), Vec::<String>::new());
    assert_eq!(
        holes("RULE 1 : IF c IS S AND op IS N OR c IS B AND op IS VB THEN ls IS few;"),
        [
            "where `c` is above 0.5 and `op` is below 3",
            "where `c` is 0.5 and `op` is above 3",
            "where `c` is below 0.5 and `op` is above 5"
        ]
    );
    assert_eq!(warnings_of_rules("RULE 1 : IF op IS N THEN ls IS few;"), Vec::<String>::new(), "the default covers it");
}

#[test]
fn a_declared_range_bounds_what_must_be_covered() {
    let text = with_rules("RULE 1 : IF op IS N THEN ls IS few;").replace("DEFAULT := 256", "DEFAULT := NC");
    let ranged = text.replace("TERM VB := (3, 0) (5, 1);", "TERM VB := (3, 0) (5, 1); RANGE := (1 .. 4.5);");
    assert!(warnings_of(&text).iter().any(|warning| warning.contains("no DEFAULT")));
    assert!(!warnings_of(&ranged).iter().any(|warning| warning.contains("no DEFAULT")), "{:?}", warnings_of(&ranged));
}

#[test]
fn what_is_too_large_to_be_verified_is_said_to_be() {
    // Nine inputs with seven cells and more each: too many places to look at for rules on all of them.
    let names: Vec<String> = (0..9).map(|i| format!("v{i}")).collect();
    let all = |f: &dyn Fn(&String) -> String, between: &str| names.iter().map(f).collect::<Vec<_>>().join(between);
    let text = format!(
        "FUNCTION_BLOCK VAR_INPUT {} END_VAR VAR_OUTPUT y : REAL; END_VAR {}
         DEFUZZIFY y TERM a := 1; TERM b := 2; METHOD : COGS; END_DEFUZZIFY
         RULEBLOCK r RULE 1 : IF {} THEN y IS a; RULE 2 : IF {} THEN y IS b; END_RULEBLOCK END_FUNCTION_BLOCK",
        all(&|v| format!("{v} : REAL;"), " "),
        all(&|v| format!("FUZZIFY {v} TERM s := (0, 1) (1, 0); TERM t := (0, 0) (1, 1); END_FUZZIFY"), " "),
        all(&|v| format!("{v} IS s"), " AND "),
        all(&|v| format!("{v} IS t"), " AND "),
    );
    let warnings = warnings_of(&text);
    assert_eq!(
        warnings.iter().filter(|warning| warning.contains("too large to be verified completely")).count(),
        1,
        "{warnings:?}"
    );
    // Many rules of the same kind end soon, too.
    let rule = "RULE x : IF NOT (op IS N AND c IS B) OR op IS VB THEN ls IS few, ls IS many;\n";
    let many = parse_document(&with_rules(&rule.repeat(Limits::CONCLUSIONS_MAX / 2))).unwrap();
    assert!(!many.verify().is_empty());
}
