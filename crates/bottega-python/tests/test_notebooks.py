"""The notebooks, cell by cell, as they stand."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from conftest import ROOT

EXAMPLES = Path(ROOT, "examples")


def run(name: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> list[list[str]]:
    """Runs a notebook in its folder; returns the words of each line that it prints."""
    cells = json.loads((EXAMPLES / f"{name}.ipynb").read_text())["cells"]
    monkeypatch.chdir(EXAMPLES)
    names: dict[str, object] = {}
    for cell in cells:
        if cell["cell_type"] == "code":
            exec(compile("".join(cell["source"]), f"{name}.ipynb", "exec"), names)
            assert cell["outputs"], "what it shows is kept in the file"
    return [line.split() for line in capsys.readouterr().out.splitlines()]


def test_all_of_them_are_run_here() -> None:
    assert sorted(file.stem for file in EXAMPLES.glob("*.ipynb")) == ["ala", "hra", "magarro"]


def test_time_falls_and_the_difference_grows_with_the_level(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    lines = run("magarro", monkeypatch, capsys)
    rows = {line[0]: [float(word) for word in line[1:]] for line in lines if len(line) == 4 and line[0] != "level"}
    assert list(rows) == ["off", "vs", "s", "n", "b", "vb"]
    assert rows["off"][2] == 0.0 and 0 < rows["s"][2] < rows["vb"][2]
    assert all(seconds > 0 for seconds, *_ in rows.values())


def test_lighting_agents_are_as_near_to_the_reference_as_they_say(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    lines = run("ala", monkeypatch, capsys)
    errors = [float(line[-1]) for line in lines[1:]]
    assert len(errors) == 4 and all(0 < error < 0.2 for error in errors), errors


def test_every_processor_gives_the_same_picture(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    lines = run("hra", monkeypatch, capsys)
    assert lines[-1] == ["equal:", "True"]
    assert lines[1][0] == "1" and [float(lines[1][2]), float(lines[1][4])] == [1.0, 1.0]
