"""Importance maps, zones, rules and differences: those of the command line."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import bottega
from bottega import rules

INPUTS: Any = {"complexity": 4.2, "neighbor_difference": 0.3, "size": 900, "optimization_level": 3}


def printed(program: str, *words: str) -> Any:
    done = subprocess.run([program, *words], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_zones_are_those_of_the_command_line(box: Path, program: str, tmp_path: Path) -> None:
    words = ["--agents", "4", "--size", "160x120", "-o", str(tmp_path), "--json"]
    expected = printed(program, "analyze", str(box), *words)
    found = bottega.analyze(box, agents=4, size=(160, 120), work={"level": 2})
    assert repr(found) == f"<bottega.Analysis 160x120, {len(found.zones)} zones for 4 agents>"
    zones = next(level["zones"] for level in expected["levels"] if level["level"] == 2)
    assert found.rects.tolist() == [zone["rect"] for zone in zones]
    assert [zone["complexity"] for zone in found.zones] == pytest.approx([zone["complexity"] for zone in zones])
    rows, columns = found.cost.shape
    assert [columns, rows] == expected["cells"] and found.importance.shape == found.cost.shape
    assert found.size == (160, 120) and found.agents == 4
    covered = np.zeros((120, 160), int)
    for x0, y0, x1, y1 in found.rects:
        covered[y0:y1, x0:x1] += 1
    assert (covered == 1).all()


def test_a_scene_of_arrays_is_analyzed(pyramid: bottega.Scene) -> None:
    found = bottega.analyze(pyramid, size=(96, 64))
    assert found.cost.mean() == pytest.approx(1, rel=0.05) and len(found.zones) == len(found.rects) > 1


def test_rules_decide_as_on_the_command_line(program: str) -> None:
    values = [f"{name}={value}" for name, value in INPUTS.items()]
    expected = printed(program, "rules", "eval", "path-tracing", *values, "--explain", "--json")
    why = rules.explain("path-tracing", **INPUTS)
    assert why == expected and rules.evaluate("path-tracing", **INPUTS) == expected["outputs"]
    assert why["rules"][0]["degree"] > 0
    ranged = rules.evaluate("path-tracing", ranges={"complexity": (0.1, 7)}, **INPUTS)
    assert ranged != expected["outputs"]
    assert rules.check("path-tracing") == []


def test_rules_that_are_wrong_are_refused(tmp_path: Path) -> None:
    with pytest.raises(bottega.RulesError, match="complexity"):
        rules.evaluate("path-tracing", size=3)
    with pytest.raises(bottega.Error, match="nothing"):
        rules.evaluate("path-tracing", ranges={"nothing": (0, 1)}, **INPUTS)
    broken = tmp_path / "broken.fcl"
    broken.write_text("FUNCTION_BLOCK a\nVAR_INPUT x REAL; END_VAR\n")
    with pytest.raises(bottega.RulesError, match="line"):
        rules.check(broken)
    with pytest.raises(bottega.Error):
        rules.check(tmp_path / "none.fcl")


def test_differences_are_those_of_the_command_line(box: Path, program: str, tmp_path: Path) -> None:
    pictures = [bottega.render(box, spp=4, size=(40, 30), seed=seed, exact=True) for seed in (0, 1)]
    files = [tmp_path / f"{index}.exr" for index in (0, 1)]
    for picture, file in zip(pictures, files):
        picture.save(file)
    expected = printed(program, "diff", *map(str, files), "--json")
    found = bottega.diff(*pictures)
    flip_map = found.pop("flip_map")
    assert found == expected and flip_map.shape == (30, 40) and flip_map.dtype == np.float32
    assert bottega.diff(files[0], pictures[1].color)["flip"] == found["flip"]
    assert bottega.diff(pictures[0], pictures[0])["rmse"] == 0
    with pytest.raises(ValueError, match="differ in size"):
        bottega.diff(pictures[0], np.zeros((3, 4, 3)))
    with pytest.raises(ValueError, match="height, width, 3"):
        bottega.diff(np.zeros((3, 4)), np.zeros((3, 4)))
