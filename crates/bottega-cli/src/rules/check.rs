//! `bottega rules check`: reports errors and likely mistakes.

use std::{path::Path, process::ExitCode};

use bottega_farm::Technique;
use bottega_fuzzy::{FunctionBlock, Warning};
use serde_json::{Value, json};

use bottega::rules::Source;

use super::args::RulesCheckArgs;
use crate::{
    error::{CliError, report},
    output::print_report,
};

pub(super) fn run(args: &RulesCheckArgs) -> Result<ExitCode, CliError> {
    let (mut errors, mut warnings) = (0, 0);
    for path in &args.files {
        match Source::read(path) {
            Ok(source) => {
                let found = source.document.verify();
                warnings += found.len();
                if args.json {
                    println!("{}", as_json(&source, &found));
                } else {
                    print(&source, &found);
                }
            }
            Err(error) => {
                errors += 1;
                if args.json {
                    println!("{}", error_as_json(path, &error));
                } else {
                    print_report(&report(&error.into()));
                }
            }
        }
    }
    let failed = errors > 0 || (args.strict && warnings > 0);
    Ok(ExitCode::from(u8::from(failed)))
}

fn print(source: &Source, warnings: &[Warning]) {
    let file = source.path.display();
    for block in &source.document.blocks {
        let (inputs, outputs) = (block.inputs().len(), block.outputs().len());
        let rules = counted(block.rules().count(), "rule");
        println!(
            "{file}: `{}`, {rules} from {} to {}",
            block.name(),
            counted(inputs, "input"),
            counted(outputs, "output")
        );
        for (technique, used, ignored) in techniques(block) {
            println!("  for {technique}: {}", used.join(", "));
            if !ignored.is_empty() {
                println!("  unknown to {technique}: {}", ignored.join(", "));
            }
        }
    }
    for warning in warnings {
        let (at, kind) = (warning.at, &warning.kind);
        println!("{file}:{}:{}: warning: {kind} [{}]", at.line, at.column, kind.code());
    }
}

fn counted(count: usize, what: &str) -> String {
    format!("{count} {what}{}", if count == 1 { "" } else { "s" })
}

/// Returns the techniques that know any output of a block, each with the known and the unknown outputs.
fn techniques(block: &FunctionBlock) -> Vec<(&'static str, Vec<&'static str>, Vec<String>)> {
    let sorted = Technique::ALL.map(|technique| (technique, technique.sort_outputs(block)));
    let any = sorted.into_iter().filter(|(_, (known, _))| !known.is_empty());
    any.map(|(technique, (known, unknown))| {
        (technique.name(), known.into_iter().map(|output| output.name).collect(), unknown)
    })
    .collect()
}

fn as_json(source: &Source, warnings: &[Warning]) -> Value {
    let names = |names: Vec<&str>| json!(names);
    let block = |block: &FunctionBlock| {
        let techniques: Vec<Value> = techniques(block)
            .into_iter()
            .map(|(name, used, ignored)| json!({"technique": name, "uses": used, "ignores": ignored}))
            .collect();
        json!({
            "name": block.name(),
            "rules": block.rules().count(),
            "inputs": names(block.inputs().iter().map(|input| input.name.as_str()).collect()),
            "outputs": names(block.outputs().iter().map(|output| output.name.as_str()).collect()),
            "techniques": techniques,
        })
    };
    let warning = |warning: &Warning| {
        json!({
            "line": warning.at.line,
            "column": warning.at.column,
            "code": warning.kind.code(),
            "message": warning.kind.to_string(),
        })
    };
    json!({
        "file": source.path.display().to_string(),
        "errors": [],
        "warnings": warnings.iter().map(warning).collect::<Vec<_>>(),
        "blocks": source.document.blocks.iter().map(block).collect::<Vec<_>>(),
    })
}

fn error_as_json(path: &Path, error: &bottega::Error) -> Value {
    let described = match error {
        bottega::Error::RulesText { place, problem, .. } => {
            json!({"line": place.line, "column": place.column, "message": problem})
        }
        other => {
            let cause = std::error::Error::source(other).map(|cause| format!(": {cause}")).unwrap_or_default();
            json!({"message": format!("{other}{cause}")})
        }
    };
    json!({"file": path.display().to_string(), "errors": [described], "warnings": [], "blocks": []})
}
