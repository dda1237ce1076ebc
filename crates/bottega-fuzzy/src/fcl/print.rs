//! The printer: writes a function block as FCL that parses to an equal block.

use std::fmt::{self, Display, Formatter};

use crate::{
    block::{Condition, FunctionBlock, Rule, RuleBlock, Term},
    membership::Membership,
};

impl Display for FunctionBlock {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}", format!("FUNCTION_BLOCK {}", self.name).trim_end())?;
        variables(f, "VAR_INPUT", self.inputs.iter().map(|input| &input.name))?;
        variables(f, "VAR_OUTPUT", self.outputs.iter().map(|output| &output.name))?;
        variables(f, "VAR", self.locals.iter())?;
        for input in &self.inputs {
            writeln!(f, "FUZZIFY {}", input.name)?;
            terms(f, &input.terms)?;
            range(f, input.range)?;
            writeln!(f, "END_FUZZIFY")?;
        }
        for output in &self.outputs {
            writeln!(f, "DEFUZZIFY {}", output.name)?;
            terms(f, &output.terms)?;
            writeln!(f, "    METHOD : {};", output.method.word())?;
            if let Some(accumulation) = output.accumulation {
                writeln!(f, "    ACCU : {};", accumulation.word())?;
            }
            match output.default {
                Some(value) => writeln!(f, "    DEFAULT := {value};")?,
                None => writeln!(f, "    DEFAULT := NC;")?,
            }
            range(f, output.range)?;
            writeln!(f, "END_DEFUZZIFY")?;
        }
        for block in &self.rule_blocks {
            rule_block(f, self, block)?;
        }
        writeln!(f, "END_FUNCTION_BLOCK")
    }
}

fn variables<'a>(
    f: &mut Formatter<'_>,
    keyword: &str,
    names: impl ExactSizeIterator<Item = &'a String>,
) -> fmt::Result {
    if names.len() == 0 {
        return Ok(());
    }
    writeln!(f, "{keyword}")?;
    for name in names {
        writeln!(f, "    {name} : REAL;")?;
    }
    writeln!(f, "END_VAR")
}

fn terms(f: &mut Formatter<'_>, terms: &[Term]) -> fmt::Result {
    for term in terms {
        write!(f, "    TERM {} :=", term.name)?;
        match &term.membership {
            Membership::Singleton(at) => write!(f, " {at}")?,
            Membership::Linear(points) => {
                for (x, y) in points {
                    write!(f, " ({x}, {y})")?;
                }
            }
        }
        writeln!(f, ";")?;
    }
    Ok(())
}

fn range(f: &mut Formatter<'_>, range: Option<(f64, f64)>) -> fmt::Result {
    match range {
        Some((low, high)) => writeln!(f, "    RANGE := ({low} .. {high});"),
        None => Ok(()),
    }
}

fn rule_block(f: &mut Formatter<'_>, block: &FunctionBlock, rules: &RuleBlock) -> fmt::Result {
    writeln!(f, "RULEBLOCK {}", rules.name)?;
    writeln!(f, "    AND : {}; OR : {};", rules.and.word(), rules.or.word())?;
    writeln!(f, "    ACT : {};", rules.activation.word())?;
    writeln!(f, "    ACCU : {};", rules.accumulation.word())?;
    for rule in &rules.rules {
        writeln!(f, "    {}", RuleText { block, rule })?;
    }
    writeln!(f, "END_RULEBLOCK")
}

struct RuleText<'a> {
    block: &'a FunctionBlock,
    rule: &'a Rule,
}

impl Display for RuleText<'_> {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        write!(f, "RULE {} : IF ", self.rule.label)?;
        condition(f, self.block, &self.rule.condition)?;
        write!(f, " THEN ")?;
        for (i, conclusion) in self.rule.conclusions.iter().enumerate() {
            let output = &self.block.outputs[conclusion.output];
            let comma = if i == 0 { "" } else { ", " };
            write!(f, "{comma}{} IS {}", output.name, output.terms[conclusion.term].name)?;
        }
        if self.rule.weight != 1.0 {
            write!(f, " WITH {}", self.rule.weight)?;
        }
        write!(f, ";")
    }
}

fn condition(f: &mut Formatter<'_>, block: &FunctionBlock, what: &Condition) -> fmt::Result {
    let is = |f: &mut Formatter<'_>, input: usize, not: &str, term: usize| {
        let input = &block.inputs[input];
        write!(f, "{} IS {not}{}", input.name, input.terms[term].name)
    };
    match what {
        Condition::Is { input, term } => is(f, *input, "", *term),
        Condition::IsNot { input, term } => is(f, *input, "NOT ", *term),
        Condition::Not(part) => {
            write!(f, "NOT ")?;
            bracketed(f, block, part, matches!(**part, Condition::And(_) | Condition::Or(_)))
        }
        Condition::And(parts) => {
            joined(f, block, parts, " AND ", |part| matches!(part, Condition::And(_) | Condition::Or(_)))
        }
        // AND binds tighter; unneeded brackets could exceed the nesting limit when read again
        Condition::Or(parts) => joined(f, block, parts, " OR ", |part| matches!(part, Condition::Or(_))),
    }
}

fn joined(
    f: &mut Formatter<'_>,
    block: &FunctionBlock,
    parts: &[Condition],
    word: &str,
    needs_brackets: impl Fn(&Condition) -> bool,
) -> fmt::Result {
    for (i, part) in parts.iter().enumerate() {
        if i > 0 {
            write!(f, "{word}")?;
        }
        bracketed(f, block, part, needs_brackets(part))?;
    }
    Ok(())
}

fn bracketed(f: &mut Formatter<'_>, block: &FunctionBlock, part: &Condition, brackets: bool) -> fmt::Result {
    let (open, close) = if brackets { ("(", ")") } else { ("", "") };
    write!(f, "{open}")?;
    condition(f, block, part)?;
    write!(f, "{close}")
}
