"""Evaluates FCL texts with pyfuzzylite and writes what it finds as JSON, for tests/reference.rs.

    cargo xtask fuzzy-reference         (needs Python 3 and `pip install pyfuzzylite==8.0.6`)

pyfuzzylite (J. Rada-Vilela, GPLv3 or commercial) is run, never linked or shipped: only its numbers are in this folder.
It reads no FCL, so the few lines of it that the texts use are read here, by a reader of its own.

Where its definitions are others than those of the standard:
- NOT before a bracket is none of its words; such conditions are rewritten here by De Morgan's laws, which hold exactly
  for the three pairs of norms.
- NSUM is joined two by two, with a divisor for each place. The standard's divisor is one for all places, and does not
  move a center of gravity or a place of the maximum: its UnboundedSum is used instead.
- Its MeanOfMaximum is the mean over all places of the maximum; the middle between the first and the last is what is
  meant here, and is taken of its SmallestOfMaximum and LargestOfMaximum.
- It integrates by the midpoint rule. RESOLUTION says over how many steps; COA, LM, RM and MM err by up to one of them.
"""

import itertools
import json
import math
import re
import sys
from pathlib import Path

import fuzzylite as fl

HERE = Path(__file__).resolve().parent
RULES = HERE.parents[3] / "rules"
# Steps over the range of an output, for centers of gravity and for what jumps from step to step.
RESOLUTION = {"COG": 40_000, "COA": 2_000_000, "LM": 2_000_000, "RM": 2_000_000, "MM": 2_000_000}

AND = {"MIN": fl.Minimum, "PROD": fl.AlgebraicProduct, "BDIF": fl.BoundedDifference}
OR = {"MAX": fl.Maximum, "ASUM": fl.AlgebraicSum, "BSUM": fl.BoundedSum}
ACT = {"MIN": fl.Minimum, "PROD": fl.AlgebraicProduct}
ACCU = {"MAX": fl.Maximum, "BSUM": fl.BoundedSum, "NSUM": fl.UnboundedSum}
NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"


def section(text, kind):
    """(name, body) of all sections of a kind."""
    return re.findall(rf"^{kind}\s+(\w*)(.*?)^END_{kind}", text, re.S | re.M)


def word(text, name, otherwise=None):
    found = re.search(rf"\b{name}\s*:\s*(\w+)\s*;", text)
    return found.group(1) if found else otherwise


def terms(body):
    for name, value in re.findall(r"TERM\s+(\w+)\s*:=([^;]*);", body):
        points = re.findall(rf"\(\s*({NUMBER})\s*,\s*({NUMBER})\s*\)", value)
        if points:
            yield fl.Discrete(name, [float(value) for point in points for value in point])
        else:
            yield fl.Constant(name, float(value))


def interval(variable, body):
    found = re.search(rf"RANGE\s*:=\s*\(\s*({NUMBER})\s*\.\.\s*({NUMBER})\s*\)", body)
    if found:
        return float(found.group(1)), float(found.group(2))
    xs = [x for term in variable.terms if isinstance(term, fl.Discrete) for x in term.values[:, 0]]
    return (min(xs), max(xs)) if xs else (0.0, 1.0)


def condition(tokens, negated=False):
    """Tokens of a condition as text for pyfuzzylite, with NOT before brackets driven inwards."""

    def disjunction(negated):
        parts = [conjunction(negated)]
        while tokens and tokens[0] == "OR":
            tokens.pop(0)
            parts.append(conjunction(negated))
        return parts[0] if len(parts) == 1 else "( " + (" and " if negated else " or ").join(parts) + " )"

    def conjunction(negated):
        parts = [single(negated)]
        while tokens and tokens[0] == "AND":
            tokens.pop(0)
            parts.append(single(negated))
        return parts[0] if len(parts) == 1 else "( " + (" or " if negated else " and ").join(parts) + " )"

    def single(negated):
        if tokens[0] == "NOT":
            tokens.pop(0)
            return single(not negated)
        if tokens[0] == "(":
            tokens.pop(0)
            inner = disjunction(negated)
            assert tokens.pop(0) == ")"
            return inner
        name, verb = tokens.pop(0), tokens.pop(0)
        assert verb == "IS"
        if tokens[0] == "NOT":
            tokens.pop(0)
            negated = not negated
        return f"{name} is {'not ' if negated else ''}{tokens.pop(0)}"

    return disjunction(negated)


def rules(body):
    for text in re.findall(r"\bRULE\s+\w+\s*:\s*(.*?);", body, re.S):
        found = re.fullmatch(r"IF\s+(.*?)\s+THEN\s+(.*?)(?:\s+WITH\s+(\S+))?\s*", text, re.S)
        antecedent = condition(re.findall(r"\w+|[()]", found.group(1)))
        consequent = re.sub(r"\s+IS\s+", " is ", " and ".join(part.strip() for part in found.group(2).split(",")))
        weight = f" with {found.group(3)}" if found.group(3) else ""
        yield fl.Rule.create(f"if {antecedent} then {consequent}{weight}")


def defuzzifier(method):
    resolution = RESOLUTION.get(method)
    return {
        "COG": lambda: [fl.Centroid(resolution)],
        "COA": lambda: [fl.Bisector(resolution)],
        "LM": lambda: [fl.SmallestOfMaximum(resolution)],
        "RM": lambda: [fl.LargestOfMaximum(resolution)],
        "MM": lambda: [fl.SmallestOfMaximum(resolution), fl.LargestOfMaximum(resolution)],
        "COGS": lambda: [fl.WeightedAverage()],
    }[method]()


class Block:
    """A function block as an engine of pyfuzzylite."""

    def __init__(self, text):
        text = re.sub(r"//[^\n]*", "", text)
        ((_, rule_body),) = section(text, "RULEBLOCK")
        self.engine = fl.Engine()
        self.defuzzifiers = {}
        for name, body in section(text, "FUZZIFY"):
            variable = fl.InputVariable(name, terms=list(terms(body)))
            variable.minimum, variable.maximum = interval(variable, body)
            self.engine.input_variables.append(variable)
        accumulation = word(rule_body, "ACCU", "MAX")
        for name, body in section(text, "DEFUZZIFY"):
            method = word(body, "METHOD")
            default = re.search(rf"DEFAULT\s*:=\s*({NUMBER})", body)
            variable = fl.OutputVariable(name, terms=list(terms(body)))
            variable.minimum, variable.maximum = interval(variable, body)
            variable.default_value = float(default.group(1))
            # Singletons are not joined before they are weighed.
            variable.aggregation = None if method == "COGS" else ACCU[accumulation]()
            variable.defuzzifier = defuzzifier(method)[0]
            self.defuzzifiers[name] = defuzzifier(method)
            self.engine.output_variables.append(variable)
        act = None if any(word(b, "METHOD") == "COGS" for _, b in section(text, "DEFUZZIFY")) else ACT[word(rule_body, "ACT", "MIN")]()
        self.engine.rule_blocks.append(
            fl.RuleBlock(
                conjunction=AND[word(rule_body, "AND", "MIN")](),
                disjunction=OR[word(rule_body, "OR", "MAX")](),
                implication=act,
                activation=fl.General(),
                rules=list(rules(rule_body)),
            )
        )
        for block in self.engine.rule_blocks:
            block.load_rules(self.engine)

    def evaluate(self, point):
        for variable, value in zip(self.engine.input_variables, point, strict=True):
            variable.value = value
        found = []
        for variable in self.engine.output_variables:
            variable.fuzzy.clear()
        for block in self.engine.rule_blocks:
            block.activate()
        for variable in self.engine.output_variables:
            if not variable.fuzzy.terms:
                found.append(variable.default_value)
                continue
            each = [
                float(one.defuzzify(variable.fuzzy, variable.minimum, variable.maximum))
                for one in self.defuzzifiers[variable.name]
            ]
            value = sum(each) / len(each)
            # Rules of degree 0 may be among the terms; its own output variables take the default then, too.
            found.append(variable.default_value if math.isnan(value) else value)
        return found


def steps(low, high, count):
    return [low + (high - low) * i / (count - 1) for i in range(count)]


def case(file, text, points, put=None):
    block = Block(text)
    values = [[float(f"{value:.12g}") for value in block.evaluate(point)] for point in points]
    print(f"{file} {put or ''}: {len(points)} points", file=sys.stderr)
    return {
        "file": file,
        "put": put or {},
        "inputs": [variable.name for variable in block.engine.input_variables],
        "outputs": [variable.name for variable in block.engine.output_variables],
        "points": points,
        "values": values,
    }


def exchanged(text, put):
    for name, value in put.items():
        text, count = re.subn(rf"\b{name} : \w+;", f"{name} : {value};", text)
        assert count == 1, name
    return text


def write(name, cases):
    lines = ",\n".join(json.dumps(case) for case in cases)
    (HERE / name).write_text(f"[\n{lines}\n]\n")


def main():
    pairs = [("MIN", "MAX"), ("PROD", "ASUM"), ("BDIF", "BSUM")]
    operators = (HERE / "operators.fcl").read_text()
    fine = [list(point) for point in itertools.product(steps(0.3, 9.7, 6), steps(-2.6, 2.9, 5))]
    coarse = [[2.2, -1.5], [3.1, 0.7], [4.6, 1.9], [6.3, -0.2], [7.7, 2.6], [9.3, 0.4]]
    cases = []
    for (conjunction, disjunction), act, accu in itertools.product(pairs, ["MIN", "PROD"], ["MAX", "BSUM", "NSUM"]):
        put = {"AND": conjunction, "OR": disjunction, "ACT": act, "ACCU": accu}
        for method in ["COG", "COA", "LM", "RM", "MM"]:
            # Places of a maximum jump between pieces that rounding alone tells apart, unless plateaus make them.
            if method in ("LM", "RM", "MM") and (act == "PROD" or accu == "NSUM"):
                continue
            points = fine if method == "COG" else coarse
            all_put = {**put, "METHOD": method}
            cases.append(case("operators.fcl", exchanged(operators, all_put), points, all_put))
    singletons = (HERE / "singletons.fcl").read_text()
    for conjunction, disjunction in pairs:
        put = {"AND": conjunction, "OR": disjunction}
        cases.append(case("singletons.fcl", exchanged(singletons, put), fine, put))
    write("operators.json", cases)

    grid = [list(point) for point in itertools.product([0.03, 0.31, 0.5, 0.72, 1.0], [0.0, 0.17, 0.55, 0.94], [0.1, 0.5, 0.83], [1.0, 1.7, 2.5, 3.0, 4.2, 5.0])]
    files = ["path-tracing.fcl", "photon-mapping.fcl"]
    write("rules.json", [case(name, (RULES / name).read_text(), grid) for name in files])


main()
