//! Options of `bottega rules`.

use std::path::PathBuf;

use bottega::rules::{Source, laid_out};
use bottega_fuzzy::FunctionBlock;
use clap::{Args, Subcommand, ValueHint};

use crate::{error::CliError, option_value::InvalidValue};

#[derive(Debug, Args)]
pub(crate) struct RulesArgs {
    #[command(subcommand)]
    pub(crate) command: RulesCommand,
}

#[derive(Debug, Subcommand)]
pub(crate) enum RulesCommand {
    /// Find errors and likely mistakes: contradictions, dead rules, cases without a rule.
    Check(RulesCheckArgs),
    /// Evaluate the rules for given values of their inputs, and explain the result.
    #[command(
        after_help = "For example: bottega rules eval path-tracing complexity=4.2 neighbor_difference=0.3 size=900 \
        optimization_level=3 --range complexity=0.1..7 --range size=256..4096 --explain"
    )]
    Eval(EvalArgs),
    /// Draw the terms of all variables, or an output over two inputs.
    #[command(
        after_help = "For example: bottega rules plot path-tracing -o terms.svg\n             bottega rules plot \
        path-tracing -o surface.png --surface samples --over complexity,optimization_level size=0.5 \
        neighbor_difference=0.2"
    )]
    Plot(PlotArgs),
}

#[derive(Debug, Args)]
pub(crate) struct RulesCheckArgs {
    /// FCL texts, or rules that come with the program: path-tracing, paper, photon-mapping, engine-choice, technique-choice, or the name of an engine.
    #[arg(value_name = "FILE", required = true, value_hint = ValueHint::FilePath)]
    pub(crate) files: Vec<PathBuf>,
    /// Exit with 1 also if there are warnings.
    #[arg(long)]
    pub(crate) strict: bool,
    /// Print one JSON object per line, one per file.
    #[arg(long)]
    pub(crate) json: bool,
}

/// Some rules with their inputs laid out, and values for these.
#[derive(Debug, Args)]
pub(crate) struct LaidOutArgs {
    /// An FCL text, or rules that come with the program: path-tracing, paper, photon-mapping, engine-choice, technique-choice, or the name of an engine.
    #[arg(value_name = "FILE", value_hint = ValueHint::FilePath)]
    pub(crate) file: PathBuf,
    /// The function block, if the file has several.
    #[arg(long, value_name = "NAME")]
    pub(crate) block: Option<String>,
    /// Lay an input's terms out over the interval found in a scene, instead of the declared RANGE.
    #[arg(long = "range", value_name = "INPUT=MIN..MAX", value_parser = parse_range)]
    pub(crate) ranges: Vec<(String, f64, f64)>,
    /// Values of inputs.
    #[arg(value_name = "INPUT=VALUE", value_parser = parse_value)]
    pub(crate) values: Vec<(String, f64)>,
}

impl LaidOutArgs {
    /// Returns the function block, with the input terms placed as requested.
    pub(super) fn function_block(&self) -> Result<FunctionBlock, CliError> {
        let source = Source::read(&self.file)?;
        let ranges: Vec<(&str, f64, f64)> =
            self.ranges.iter().map(|(name, min, max)| (name.as_str(), *min, *max)).collect();
        Ok(laid_out(&source, self.block.as_deref(), &ranges)?)
    }
}

#[derive(Debug, Args)]
pub(crate) struct EvalArgs {
    #[command(flatten)]
    pub(crate) rules: LaidOutArgs,
    /// Print the degree of each input's terms, the rules that fire, and the value of each output.
    #[arg(long)]
    pub(crate) explain: bool,
    /// Print a JSON object.
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct PlotArgs {
    #[command(flatten)]
    pub(crate) rules: LaidOutArgs,
    /// The picture to write: .svg or .png.
    #[arg(short, long, value_name = "OUT", value_hint = ValueHint::FilePath)]
    pub(crate) output: PathBuf,
    /// Draw this output in false colours over two inputs; the other inputs need values.
    #[arg(long, value_name = "OUTPUT", requires = "over")]
    pub(crate) surface: Option<String>,
    /// The inputs along the axes of the surface.
    #[arg(long, value_name = "INPUT,INPUT", value_parser = parse_axes, requires = "surface")]
    pub(crate) over: Option<[String; 2]>,
}

fn number(text: &str) -> Result<f64, InvalidValue> {
    let number = text.trim().parse::<f64>().ok().filter(|number| number.is_finite());
    number.ok_or_else(|| format!("`{}` is not a number", text.trim()).into())
}

fn parse_value(text: &str) -> Result<(String, f64), InvalidValue> {
    match text.split_once('=') {
        Some((name, value)) if !name.trim().is_empty() => Ok((name.trim().to_owned(), number(value)?)),
        _ => Err("the name of an input, `=` and a number are needed, such as size=900".into()),
    }
}

fn parse_range(text: &str) -> Result<(String, f64, f64), InvalidValue> {
    let named = text.split_once('=').filter(|(name, _)| !name.trim().is_empty());
    match named.and_then(|(name, range)| Some((name, range.split_once("..")?))) {
        Some((name, (min, max))) => Ok((name.trim().to_owned(), number(min)?, number(max)?)),
        None => Err("an input, `=` and two numbers with `..` between are needed, such as size=256..4096".into()),
    }
}

fn parse_axes(text: &str) -> Result<[String; 2], InvalidValue> {
    match text.split_once(',').map(|(x, y)| [x.trim(), y.trim()]) {
        Some([x, y]) if !x.is_empty() && !y.is_empty() && !y.contains(',') && !x.eq_ignore_ascii_case(y) => {
            Ok([x.to_owned(), y.to_owned()])
        }
        _ => Err("two inputs with a comma between are needed, such as complexity,size".into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_ranges_and_axes_are_checked() {
        assert_eq!(parse_value(" size = 9e2"), Ok(("size".to_owned(), 900.0)));
        assert_eq!(parse_range("c=0.1..7"), Ok(("c".to_owned(), 0.1, 7.0)));
        assert_eq!(parse_range("c=-1. .. .5"), Ok(("c".to_owned(), -1.0, 0.5)));
        assert_eq!(parse_axes("a, b"), Ok(["a".to_owned(), "b".to_owned()]));
        for absurd in ["", "size", "=3", "size=", "size=nan", "size=1e999", "size=a"] {
            assert!(parse_value(absurd).is_err(), "{absurd}");
            assert!(parse_range(absurd).is_err(), "{absurd}");
        }
        for absurd in ["", "a", "a,", ",b", "a,b,c", "a,A"] {
            assert!(parse_axes(absurd).is_err(), "{absurd}");
        }
    }
}
