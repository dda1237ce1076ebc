"""Expert rules of agents: evaluating, explaining, checking.

`file` is an FCL file, or the name of built-in rules: `path-tracing`, `paper`, `photon-mapping`, `engine-choice`, `technique-choice`, or
the name of an engine.

>>> from bottega import rules
>>> rules.evaluate("path-tracing", complexity=4.2, neighbor_difference=0.3, size=900, optimization_level=3)["samples"]
"""

from __future__ import annotations

import os
from typing import Any, Mapping

from . import _native

__all__ = ["check", "evaluate", "explain"]

File = str | os.PathLike[str]
Ranges = Mapping[str, tuple[float, float]]


def evaluate(file: File, /, *, block: str | None = None, ranges: Ranges | None = None, **inputs: float) -> dict[str, float | None]:
    """Evaluates rules for values of their inputs. Returns the value of each output; `None`: no rule concludes about it.

    - `block`: name of the function block, if the file has several.
    - `ranges`: intervals (minimum, maximum) over which the terms of inputs are laid out, instead of their declared RANGE.

    Raises `RulesError` if the text is invalid, or an input is missing, unknown or not a number.
    """
    outputs: dict[str, float | None] = _native.evaluate_rules(file, block, dict(ranges or {}), inputs)["outputs"]
    return outputs


def explain(file: File, /, *, block: str | None = None, ranges: Ranges | None = None, **inputs: float) -> dict[str, Any]:
    """Evaluates rules like `evaluate`, and returns the reasons too: `outputs`, `inputs` (degree of membership of each term), `rules`
    (those that fire, strongest first: `label`, `degree`, `conclusions`), and `aggregates` (aggregated result per output).
    """
    return _native.explain_rules(file, block, dict(ranges or {}), inputs)


def check(file: File, /) -> list[dict[str, Any]]:
    """Returns warnings about likely mistakes in rules: contradictions, dead rules, cases without a rule. Each has `line`, `column`,
    `code`, `message`. Raises `RulesError` if the text is not FCL.
    """
    return _native.check_rules(file)
