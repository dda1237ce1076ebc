"""Expert rules of agents: what they decide, and why.

`file` is a file of FCL, or the name of rules that come with the program: `path-tracing`, `paper`, `photon-mapping`, `engine-choice`, or
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
    """What rules decide for some values of their inputs: a value for each output; `None` where no rule says anything.

    - `block`: which function block, where the file has several.
    - `ranges`: inputs whose terms are laid out over the interval that a scene was found to have, instead of the declared RANGE.

    Raises `RulesError` where the text is wrong, or an input is missing, unknown or no number.
    """
    outputs: dict[str, float | None] = _native.evaluate_rules(file, block, dict(ranges or {}), inputs)["outputs"]
    return outputs


def explain(file: File, /, *, block: str | None = None, ranges: Ranges | None = None, **inputs: float) -> dict[str, Any]:
    """The same with the reasons: `outputs`, `inputs` (the degree to which each term holds), `rules` (those that fire, the strongest
    first: `label`, `degree`, `conclusions`), and `aggregates` (what they say together of each output).
    """
    return _native.explain_rules(file, block, dict(ranges or {}), inputs)


def check(file: File, /) -> list[dict[str, Any]]:
    """What is most likely not meant in rules: contradictions, dead rules, cases without a rule. Each has `line`, `column`, `code`,
    `message`. Raises `RulesError` where the text is no FCL.
    """
    return _native.check_rules(file)
