"""The tutorial's Python, run as it stands."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from conftest import ROOT


def test_the_scene_of_the_tutorial_is_made_and_changed(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    page = Path(ROOT, "docs", "tutorials", "scene-in-memory.md").read_text()
    blocks = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    shown = re.findall(r"```text\n(.*?)```", page, re.DOTALL)
    monkeypatch.chdir(ROOT)
    names: dict[str, object] = {}
    for block in blocks:
        exec(compile(block, "scene-in-memory.md", "exec"), names)
    assert capsys.readouterr().out == "".join(shown)


def test_the_table_of_the_tutorial_is_made(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    page = Path(ROOT, "docs", "tutorials", "paper-table.md").read_text()
    blocks = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    assert len(blocks) == 2
    # Pages are read in the folder of the repository.
    monkeypatch.chdir(ROOT)
    names: dict[str, object] = {}
    for block in blocks:
        exec(compile(block, "paper-table.md", "exec"), names)
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].split() == ["level", "seconds", "FLIP", "against", "off"]
    rows = {line.split()[0]: [float(value) for value in line.split()[1:]] for line in lines[1:7]}
    assert list(rows) == ["off", "vs", "s", "n", "b", "vb"]
    # The same picture; and the more is saved, the more differs. Times of so small pictures are not compared.
    assert rows["off"][1] == 0.0 and 0 < rows["s"][1] < rows["vb"][1]
    assert all(seconds > 0 for seconds, _ in rows.values())
    assert lines[7].startswith("two seeds of off differ by FLIP 0.")
