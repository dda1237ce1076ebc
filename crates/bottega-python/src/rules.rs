//! The Python functions of expert rules: checking, evaluating, explaining.
#![allow(clippy::needless_pass_by_value, reason = "functions of Python are handed maps that were made for them")]

use std::collections::BTreeMap;

use bottega::rules::{Source, explained, inputs, laid_out};
use pyo3::prelude::*;
use serde_json::{Value, json};

use crate::{
    errors,
    values::{path_of, to_python},
};

/// Evaluates rules.
///
/// - `file`: an FCL file, or the name of built-in rules.
fn decided<'py>(
    file: &Bound<'py, PyAny>,
    block: Option<&str>,
    ranges: &BTreeMap<String, (f64, f64)>,
    values: &BTreeMap<String, f64>,
    explain: bool,
) -> PyResult<Bound<'py, PyAny>> {
    let source = Source::read(&path_of(file)?).map_err(|error| errors::raised(&error))?;
    let ranges: Vec<(&str, f64, f64)> = ranges.iter().map(|(name, (min, max))| (name.as_str(), *min, *max)).collect();
    let block = laid_out(&source, block, &ranges).map_err(|error| errors::raised(&error))?;
    let values: Vec<(&str, f64)> = values.iter().map(|(name, value)| (name.as_str(), *value)).collect();
    let why = block
        .explain(&values)
        .map_err(|error| errors::rules(error.to_string(), format!("give a value to each of {}", inputs(&block))))?;
    to_python(file.py(), &explained(&block, &why, explain))
}

/// Evaluates rules for values of their inputs: `{"outputs": {name: value}}`.
#[pyfunction]
pub(crate) fn evaluate_rules<'py>(
    file: &Bound<'py, PyAny>,
    block: Option<&str>,
    ranges: BTreeMap<String, (f64, f64)>,
    values: BTreeMap<String, f64>,
) -> PyResult<Bound<'py, PyAny>> {
    decided(file, block, &ranges, &values, false)
}

/// Evaluates rules, and also returns the reasons: `inputs`, `rules` and `aggregates`.
#[pyfunction]
pub(crate) fn explain_rules<'py>(
    file: &Bound<'py, PyAny>,
    block: Option<&str>,
    ranges: BTreeMap<String, (f64, f64)>,
    values: BTreeMap<String, f64>,
) -> PyResult<Bound<'py, PyAny>> {
    decided(file, block, &ranges, &values, true)
}

/// Returns warnings about likely mistakes in rules: a list of `{"line", "column", "code", "message"}`.
#[pyfunction]
pub(crate) fn check_rules<'py>(file: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    let source = Source::read(&path_of(file)?).map_err(|error| errors::raised(&error))?;
    let found: Vec<Value> = source
        .document
        .verify()
        .iter()
        .map(|found| {
            json!({"line": found.at.line, "column": found.at.column, "code": found.kind.code(),
                "message": found.kind.to_string()})
        })
        .collect();
    to_python(file.py(), &found)
}
