//! The language and its meaning, from text to numbers.

use bottega_fuzzy::{EvaluateError, FunctionBlock, LayoutError, Limits, parse_document};
use proptest::prelude::*;

const LAMP: &str = include_str!("lamp_choice.fcl");

fn value(block: &FunctionBlock, c: f64, op: f64) -> f64 {
    block.evaluate(&[("c", c), ("op", op)]).unwrap().get("ls").unwrap()
}

#[test]
fn the_lamp_example_gives_its_known_results() {
    let block = FunctionBlock::parse(LAMP).unwrap();
    for (c, op, expected) in [
        (0.0, 1.0, 844.8),
        (0.2, 4.0, 820.025_806),
        (0.4, 5.0, 786.681_081),
        (0.5, 5.0, 256.0),
        (0.75, 4.0, 657.509_434),
        (0.9, 4.6, 460.644_043),
        (1.0, 5.0, 83.0),
    ] {
        let found = value(&block, c, op);
        assert!((found - expected).abs() < 1e-6, "c {c}, op {op}: {found}, expected {expected}");
    }
}

#[test]
fn what_is_printed_parses_to_the_same_block() {
    let block = FunctionBlock::parse(LAMP).unwrap();
    assert_eq!(FunctionBlock::parse(&block.to_string()).unwrap(), block);
}

#[test]
fn an_explanation_names_the_rules_that_fired_the_strongest_first() {
    let block = FunctionBlock::parse(LAMP).unwrap();
    let why = block.explain(&[("op", 4.0), ("c", 0.75)]).unwrap();
    let fired: Vec<_> = why.rules.iter().map(|rule| (rule.label.as_str(), rule.degree)).collect();
    assert_eq!(fired, [("1", 0.5), ("2", 0.375)]);
    assert_eq!(why.rules[0].conclusions, ["ls IS many"]);
    assert!(why.to_string().contains("rule 2 fires at 0.375: ls IS few"), "{why}");
}

#[test]
fn inputs_are_laid_out_over_the_interval_found() {
    let mut block = FunctionBlock::parse(LAMP).unwrap();
    let before = value(&block, 0.75, 4.0);
    block.layout_inputs("C", 100.0, 300.0).unwrap();
    assert!((value(&block, 250.0, 4.0) - before).abs() < 1e-9);
    // Nothing differs: everything lies in the middle.
    block.layout_inputs("c", 7.0, 7.0).unwrap();
    for c in [-1e9, 7.0, 8.0] {
        assert_eq!(value(&block, c, 1.0), value(&FunctionBlock::parse(LAMP).unwrap(), 0.5, 1.0));
    }
    assert_eq!(block.layout_inputs("d", 0.0, 1.0), Err(LayoutError::UnknownInput("d".into())));
    for (min, max) in [(1.0, 0.0), (f64::NAN, 1.0), (0.0, f64::INFINITY), (f64::MIN, f64::MAX)] {
        assert!(matches!(block.layout_inputs("c", min, max), Err(LayoutError::BadInterval { .. })), "{min} {max}");
    }
}

#[test]
fn wrong_inputs_are_named() {
    let block = FunctionBlock::parse(LAMP).unwrap();
    let error = |inputs: &[(&str, f64)]| block.evaluate(inputs).unwrap_err();
    assert_eq!(error(&[("c", 1.0)]), EvaluateError::MissingInput("op".into()));
    assert_eq!(error(&[("c", 1.0), ("x", 1.0)]), EvaluateError::UnknownInput("x".into()));
    assert_eq!(error(&[("c", f64::NAN), ("op", 1.0)]), EvaluateError::NotANumber("c".into()));
    assert_eq!(block.evaluate_indexed(&[1.0]), Err(EvaluateError::WrongCount { given: 1, wanted: 2 }));
    assert!(block.evaluate(&[("c", f64::INFINITY), ("op", f64::NEG_INFINITY)]).is_ok());
}

#[test]
fn without_a_default_an_output_keeps_what_it_was() {
    let block = FunctionBlock::parse(&LAMP.replace("DEFAULT := 256", "DEFAULT := NC")).unwrap();
    let silent = block.evaluate(&[("c", 0.5), ("op", 5.0)]).unwrap();
    assert_eq!(silent.get("ls"), None);
    let before = block.evaluate(&[("c", 1.0), ("op", 5.0)]).unwrap();
    assert!((silent.or_unchanged(&before).get("ls").unwrap() - 83.0).abs() < 1e-9);
}

#[test]
fn norms_given_by_half_imply_their_partner_and_strangers_are_refused() {
    let with = |operators: &str| FunctionBlock::parse(&LAMP.replace("AND : MIN; OR : MAX;", operators));
    let only_or = with("OR : BSUM;").unwrap();
    assert_eq!(only_or.rule_blocks()[0].and.word(), "BDIF");
    let error = with("AND : PROD; OR : MAX;").unwrap_err();
    assert!(error.to_string().contains("AND : PROD goes with OR : ASUM"), "{error}");
}

/// Every error with a message of its own, as a change of the example: the replacement, the position in it (or behind it) of the
/// error, and the message.
#[test]
fn mistakes_are_reported_with_line_and_column() {
    for (from, to, seen_at, expected) in [
        ("THEN ls IS many", "THEN lz IS many", "lz", "there is no output `lz`; did you mean `ls`?"),
        ("THEN ls IS many", "THEN ls IS mny", "mny", "there is no term of `ls` called `mny`; did you mean `many`?"),
        ("IF c IS B", "IF cc IS B", "cc", "there is no input `cc`; did you mean `c`?"),
        ("TERM B :=", "TERM s :=", "s :=", "the term `s` is declared twice"),
        ("(0.5, 0) (1, 1)", "(1, 1) (0.5, 0)", "0.5", "the points are out of order: x falls from 1 to 0.5"),
        ("(0, 1) (0.5, 0)", "(0, 1.5) (0.5, 0)", "1.5", "the degree 1.5 lies outside of 0 to 1"),
        ("WITH 0.75", "WITH 75", "75", "the weight 75 lies outside of 0 to 1"),
        ("c : REAL;", "c : REAL; d : REAL;", "d :", "the input `d` is never fuzzified"),
        ("op : REAL;", "C : REAL;", "C :", "the variable `C` is declared twice"),
        ("ls\n    TERM few", "ls\nEND_DEFUZZIFY", "ls", "the output `ls` has no TERM"),
        ("METHOD : COG", "METHOD : COGS", "METHOD", "METHOD COGS does not fit the terms: it needs singletons"),
        ("METHOD : COG", "METHOD : CGO", "CGO", "one of COG, COGS, COA, LM, RM, MM, found `CGO`; did you mean `COG`?"),
        ("(16 .. 1024)", "(1024..16)", "1024", "the range from 1024 to 16 is empty: are its ends swapped?"),
        ("TERM N", "TREM N", "TREM", "found `TREM`; did you mean `TERM`?"),
        ("COG;", "COG", "DEFAULT", "expected `;`, found `DEFAULT`"),
        ("END_FUZZIFY\nFUZZIFY op", "FUZZIFY op", "FUZZIFY", "`TERM`, `RANGE` or `END_FUZZIFY`, found `FUZZIFY`"),
        ("many;", "many", "RULE 2", "expected `;`, `,` or `WITH`, found `RULE`"),
        ("END_RULEBLOCK\nEND_FUNCTION_BLOCK\n", "END_RULEBLOCK", "", "found the end of the text"),
        ("REAL", "INT", "INT", "expected `REAL`, found `INT`"),
        ("FUZZIFY op", "FUZZIFY c", "c", "FUZZIFY `c` is declared twice"),
        ("DEFUZZIFY ls", "DEFUZIFY ls", "DEFUZIFY", "found `DEFUZIFY`; did you mean `DEFUZZIFY`?"),
        (
            "METHOD : COG;",
            "METHOD : CENTROID;",
            "CENTROID",
            "expected one of COG, COGS, COA, LM, RM, MM, found `CENTROID`",
        ),
        ("DEFAULT := 256", "DEFAULT : 256", ": 256", "expected `:=`, found `:`"),
    ] {
        let text = LAMP.replacen(from, to, 1);
        assert_ne!(text, LAMP, "{from} is not in the example");
        let start = LAMP.find(from).unwrap();
        let offset = match seen_at {
            "" => text.len(),
            _ => start + text[start..].find(seen_at).unwrap(),
        };
        let line_start = text[..offset].rfind('\n').map_or(0, |newline| newline + 1);
        let line = text[..offset].matches('\n').count() + 1;
        let error = FunctionBlock::parse(&text).unwrap_err();
        assert!(error.to_string().contains(expected), "{from} -> {to}\n found    {error}\n expected {expected}");
        assert_eq!((error.at.line, error.at.column), (line, offset - line_start + 1), "{error}");
    }
    let early =
        FunctionBlock::parse(&LAMP.replacen("DEFUZZIFY ls", "RULEBLOCK r RULE 1 : IF c IS S THEN ls IS few;", 1));
    assert!(early.unwrap_err().to_string().ends_with("the output `ls` is used in a rule before it is defuzzified"));
    // Without METHOD, and with terms of two kinds, the error has no single position.
    let no_method = FunctionBlock::parse(&LAMP.replace("METHOD : COG;", "")).unwrap_err();
    assert_eq!(no_method.to_string(), "line 12, column 11: the output `ls` has no METHOD");
    let mixed = FunctionBlock::parse(&LAMP.replace("(16, 1) (64, 1) (192, 0)", "16")).unwrap_err();
    assert!(mixed.to_string().ends_with("METHOD COG does not fit the terms: some are singletons and some are not"));
}

#[test]
fn the_mean_of_maxima_goes_by_two_names() {
    let [mm, mom] =
        ["MM", "mom"].map(|word| FunctionBlock::parse(&LAMP.replace(": COG", &format!(": {word}"))).unwrap());
    assert_eq!(mm, mom);
    // From where `many` reaches 0.5 to the end of the RANGE.
    assert!((value(&mm, 0.25, 5.0) - 0.5 * (704.0 + 1024.0)).abs() < 1e-9);
}

#[test]
fn several_blocks_make_a_document_and_one_is_chosen_by_name() {
    let two = format!("{LAMP}\n{LAMP}");
    assert_eq!(parse_document(&two).unwrap().blocks.len(), 2);
    assert!(FunctionBlock::parse(&two).unwrap_err().to_string().contains("expected one function block, found 2"));
    assert!(FunctionBlock::parse("").unwrap_err().to_string().contains("found 0"));
}

#[test]
fn brackets_nest_up_to_a_bound_and_no_further() {
    let nested = |depth: usize| {
        let condition = format!("{}c IS S{}", "(".repeat(depth), ")".repeat(depth));
        FunctionBlock::parse(&LAMP.replacen("op IS N OR c IS S", &condition, 1))
    };
    assert!(nested(Limits::DEPTH_MAX - 1).is_ok());
    assert!(nested(100_000).unwrap_err().to_string().contains("too many brackets within brackets"));
    let nots = LAMP.replacen("op IS N OR c IS S", &format!("{}c IS S", "NOT ".repeat(100_000)), 1);
    assert!(FunctionBlock::parse(&nots).is_err());
}

#[test]
fn rules_and_conclusions_have_bounds_and_the_worst_block_is_evaluated_soon() {
    let with = |rule: &str, count: usize| {
        let text = LAMP.replace("END_RULEBLOCK", &format!("{}\nEND_RULEBLOCK", rule.repeat(count)));
        FunctionBlock::parse(&text.replace("ACCU : MAX", "ACCU : BSUM"))
    };
    let rule = "RULE x : IF c IS S THEN ls IS few;\n";
    let worst = with(rule, Limits::RULES_MAX - 2).unwrap();
    assert!(worst.evaluate(&[("c", 0.3), ("op", 4.0)]).unwrap().get("ls").is_some());
    assert!(with(rule, Limits::RULES_MAX).unwrap_err().to_string().contains("too many rules"));
    let rule = "RULE x : IF c IS S THEN ls IS few, ls IS few, ls IS many, ls IS many;\n";
    assert!(with(rule, Limits::RULES_MAX / 2).unwrap_err().to_string().contains("too many conclusions"));
}

fn condition_text() -> impl Strategy<Value = String> {
    let leaf = prop::sample::select(vec!["c IS S", "c IS NOT B", "op IS VB", "NOT op IS N"]).prop_map(str::to_owned);
    leaf.prop_recursive(5, 24, 4, |inner| {
        prop_oneof![
            prop::collection::vec(inner.clone(), 2..4).prop_map(|parts| format!("({})", parts.join(" AND "))),
            prop::collection::vec(inner.clone(), 2..4).prop_map(|parts| format!("({})", parts.join(" OR "))),
            inner.prop_map(|part| format!("NOT ({part})")),
        ]
    })
}

fn term_text() -> impl Strategy<Value = String> {
    prop::collection::vec((-1e6..1e6, 0.0..=1.0), 2..6).prop_map(|mut points: Vec<(f64, f64)>| {
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        points.iter().map(|(x, y)| format!("({x:e}, {y})")).collect()
    })
}

/// A random block of the shape of the example.
fn block_text() -> impl Strategy<Value = String> {
    let operators = prop::sample::select(vec![
        "",
        "AND : PROD;",
        "or : bsum; ACT : PROD;",
        "ACCU : BSUM;",
        "ACCU : NSUM; ACT : MIN;",
    ]);
    let method = prop::sample::select(vec!["COG", "COA", "LM", "RM", "MM"]);
    let rules = prop::collection::vec((condition_text(), any::<bool>(), 0.0..=1.0), 1..6);
    (term_text(), term_text(), term_text(), operators, method, rules).prop_map(|(s, b, few, operators, method, rules)| {
        let rules: String = rules
            .into_iter()
            .enumerate()
            .map(|(i, (condition, many, weight))| {
                let term = if many { "many" } else { "few" };
                format!("RULE r{i} : IF {condition} THEN ls IS {term} WITH {weight};\n")
            })
            .collect();
        format!(
            "function_block f VAR_INPUT c : REAL; op : REAL; END_VAR VAR_OUTPUT ls : REAL; END_VAR VAR free : REAL; END_VAR
             FUZZIFY c TERM S := {s}; TERM B := {b}; RANGE := (-1e6 .. 1e6); END_FUZZIFY
             FUZZIFY op TERM N := (1, 1) (3, 1) (5, 0); TERM VB := (3, 0) (5, 1); END_FUZZIFY
             DEFUZZIFY ls TERM few := {few}; TERM many := (0, 0) (5, 1) (5, 0.5) (1e6, 0); METHOD : {method}; END_DEFUZZIFY
             RULEBLOCK all {operators} {rules} END_RULEBLOCK END_FUNCTION_BLOCK"
        )
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(128))]

    #[test]
    fn print_and_parse_are_inverse_and_values_lie_in_the_range(text in block_text(), c in -1e6..1e6, op in 0.0..6.0) {
        let block = FunctionBlock::parse(&text).unwrap();
        let again = FunctionBlock::parse(&block.to_string()).unwrap();
        prop_assert_eq!(&again, &block);
        let value = block.evaluate(&[("c", c), ("op", op)]).unwrap();
        prop_assert_eq!(again.evaluate_indexed(&[c, op]).unwrap(), value.clone());
        let (low, high) = block.outputs()[0].declared_range();
        if let Some(value) = value.get("ls") {
            prop_assert!((low..=high).contains(&value), "{value} outside of {low} to {high}");
        }
    }

    #[test]
    fn a_rule_without_weight_might_as_well_not_be_there(c in 0.0..1.0, op in 1.0..5.0) {
        let silenced = FunctionBlock::parse(&LAMP.replace("WITH 0.75", "WITH 0")).unwrap();
        let removed = FunctionBlock::parse(&LAMP.lines().filter(|line| !line.contains("RULE 2")).collect::<Vec<_>>().join("\n")).unwrap();
        prop_assert_eq!(value(&silenced, c, op), value(&removed, c, op));
    }

    #[test]
    fn a_greater_weight_draws_the_result_to_its_rule(c in 0.51..1.0, op in 3.1..5.0, less in 0.0..1.0, more in 0.0..1.0) {
        let (less, more) = if less < more { (less, more) } else { (more, less) };
        let with = |weight: f64| FunctionBlock::parse(&LAMP.replace("WITH 0.75", &format!("WITH {weight}"))).unwrap();
        // Rule 2 concludes few, the lower term.
        prop_assert!(value(&with(more), c, op) <= value(&with(less), c, op) + 1e-9);
    }
}
