//! `bottega rules eval`: what rules decide, and why.

use std::process::ExitCode;

use bottega_fuzzy::{Aggregate, EvaluateError, Explanation, FunctionBlock};
use serde_json::{Map, Value, json};

use bottega::rules::inputs;

use super::args::EvalArgs;
use crate::error::CliError;

pub(super) fn run(args: &EvalArgs) -> Result<ExitCode, CliError> {
    let block = args.rules.function_block()?;
    let values: Vec<(&str, f64)> = args.rules.values.iter().map(|(name, value)| (name.as_str(), *value)).collect();
    let why = block.explain(&values).map_err(|error| unusable(&block, &error))?;
    if args.json {
        println!("{}", as_json(&block, &why, args.explain));
    } else if args.explain {
        print!("{why}");
    } else {
        for (output, value) in block.outputs().iter().zip(why.outputs.values()) {
            println!("{} = {}", output.name, value.map_or("no value".to_owned(), |value| value.to_string()));
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// Values that do not fit the inputs.
pub(super) fn unusable(block: &FunctionBlock, error: &EvaluateError) -> CliError {
    CliError::usage(error.to_string(), format!("give a value, as INPUT=VALUE, to each of {}", inputs(block)))
}

fn as_json(block: &FunctionBlock, why: &Explanation, explain: bool) -> Value {
    let names = || block.outputs().iter().map(|output| output.name.clone());
    let outputs: Map<String, Value> = names().zip(why.outputs.values().iter().map(|value| json!(value))).collect();
    if !explain {
        return json!({"outputs": outputs});
    }
    let inputs: Map<String, Value> = why
        .inputs
        .iter()
        .map(|(name, terms)| {
            let terms: Map<String, Value> = terms.iter().map(|(term, degree)| (term.clone(), json!(degree))).collect();
            (name.clone(), Value::Object(terms))
        })
        .collect();
    let rules: Vec<Value> = why
        .rules
        .iter()
        .map(|rule| json!({"label": rule.label, "degree": rule.degree, "conclusions": rule.conclusions}))
        .collect();
    let aggregate = |aggregate: &Aggregate| match aggregate {
        Aggregate::Singletons(points) => json!({"singletons": points}),
        Aggregate::Linear(points) => json!({"points": points}),
    };
    let together: Map<String, Value> = names().zip(why.aggregates.iter().map(aggregate)).collect();
    json!({"inputs": inputs, "rules": rules, "aggregates": together, "outputs": outputs})
}
