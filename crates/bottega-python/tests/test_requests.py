"""Requests: typed, checked, the same as everywhere."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import bottega
from bottega import Request, RequestError, _native


def test_the_classes_are_those_of_the_schema() -> None:
    generate = Path(__file__).parents[1] / "generate.py"
    done = subprocess.run([sys.executable, generate, _native.__file__, "--check"], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_a_request_goes_through_json_and_back() -> None:
    request = Request.of("a.glb", spp=16, size=(640, 480), light="sky", work={"level": 2, "bands": {"pixels": 3}})
    assert request.goal.samples == 16 and request.film.size == (640, 480) and request.environment.light == "sky"
    assert Request.from_json(request.to_json()) == request
    assert json.loads(request.to_json())["work"]["bands"] == {"pixels": 3}
    request.film.crop = (0, 0, 10, 10)
    assert Request.from_json(request.to_json()).film.crop == (0, 0, 10, 10)
    assert request != Request.of("a.glb")


def test_defaults_are_those_of_the_library() -> None:
    plain = Request(scene=bottega.SceneOptions(file="a.glb"))
    assert plain == Request.from_json('{"scene": {"file": "a.glb"}}')


def test_fields_by_short_name_and_by_section(tmp_path: Path) -> None:
    request = Request.of(tmp_path / "a.glb", goal={"samples": 3}, spp=4, output=tmp_path / "b.png", film={"denoise": True})
    assert request.goal.samples == 4 and request.output.file == str(tmp_path / "b.png") and request.film.denoise
    other = request.changed(goal=bottega.GoalOptions(error=0.5), size=np.array([32, 16]), seed=np.uint64(2**63))  # type: ignore[arg-type]
    assert other.goal.error == 0.5 and other.film.size == (32, 16) and other.seed == 2**63
    assert request.seed == 0, "a change is another request"


@pytest.mark.parametrize(
    ("fields", "field", "said"),
    [
        ({"spp": 0}, "goal.samples", "from 1 to"),
        ({"spp": -1}, "goal.samples", "`goal.samples` is -1: from 1 to 4194304 is allowed"),
        ({"spp": 1.5}, "goal.samples", "is 1.5: a whole number is needed; from 1 to 4194304 is allowed"),
        ({"size": (1, 2, 3)}, "film.size", "3 values"),
        ({"denoise": 1}, "film.denoise", "is 1: true or false is needed"),
        ({"size": (0, 4)}, "film.size", ""),
        ({"size": (4,)}, "film.size", ""),
        ({"spp": "many"}, "goal.samples", "many"),
        ({"filter": "boxy"}, "film.filter", "boxy"),
        ({"error": float("nan")}, "goal.error", "finite"),
        ({"work": {"agents": -1}}, "work.agents", "-1"),
        ({"work": {"agent": 1}}, "work", "agents"),
        ({"spp": object()}, "goal.samples", "object"),
        ({"error": 0.1, "time": 3.0}, None, "time"),
    ],
)
def test_an_error_names_the_field(fields: Any, field: str | None, said: str) -> None:
    with pytest.raises(RequestError) as raised:
        Request.of("a.glb", **fields)
    error = raised.value
    assert said in str(error), str(error)
    assert not re.search(r"\b[uif](8|16|32|64)\b|expected|at line", str(error)), str(error)
    if field is not None:
        assert error.field is not None and error.field.startswith(field), error.field
    assert isinstance(error, ValueError) and isinstance(error, bottega.Error)


def test_fields_that_there_are_not_are_refused() -> None:
    with pytest.raises(TypeError, match="did you mean `spp`"):
        Request.of("a.glb", sp=3)  # type: ignore[call-arg]
    with pytest.raises(TypeError):
        bottega.GoalOptions(sample=3)  # type: ignore[call-arg]
    request = Request.of("a.glb")
    with pytest.raises(AttributeError):
        request.goal.sample = 3  # type: ignore[attr-defined]
    with pytest.raises(RequestError, match="version"):
        Request.from_json('{"version": 99, "scene": {"file": "a.glb"}}')
    with pytest.raises(RequestError, match="line 1"):
        Request.from_json("{")


def test_scenes_that_cannot_be_read_are_reported(tmp_path: Path) -> None:
    with pytest.raises(bottega.SceneError, match="none.glb"):
        bottega.render(tmp_path / "none.glb")
    with pytest.raises(bottega.RequestError, match="no camera"):
        bottega.render(Path(__file__).parents[3] / "scenes" / "cornell-box.glb", camera="nobody")
    with pytest.raises(TypeError):
        bottega.render(3)  # type: ignore[arg-type]
