"""Types: those of the stubs are right, and those of the module are strict."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import bottega

PACKAGE = Path(bottega.__file__).parent


def run(*words: str) -> None:
    environment = {**os.environ, "MYPYPATH": str(PACKAGE.parent)}
    done = subprocess.run([sys.executable, "-m", *words], capture_output=True, text=True, env=environment)
    assert done.returncode == 0, done.stdout + done.stderr


def test_the_module_is_strictly_typed(tmp_path: Path) -> None:
    use = tmp_path / "use.py"
    use.write_text("""
import numpy as np
from numpy.typing import NDArray
import bottega

def paint() -> NDArray[np.float32]:
    picture = bottega.render("a.glb", spp=64, size=(640, 480), filter="tent", goal={"samples": 3}, output="a.png")
    request: bottega.Request = bottega.Request.of("a.glb", light="sky", agents=None)
    request.work.optimization = "vb"
    return picture.color

bottega.render("a.glb", spp="many")  # type: ignore[arg-type]
bottega.render("a.glb", filter="boxy")  # type: ignore[arg-type]
bottega.render("a.glb", sample=3)  # type: ignore[call-arg]
""")
    cache = ["--cache-dir", str(PACKAGE.parent / ".mypy_cache")]
    run("mypy", "--strict", *cache, str(PACKAGE), str(use))


def test_the_stubs_are_those_of_the_native_module() -> None:
    run("mypy.stubtest", "bottega._native", "--ignore-missing-stub", "--ignore-positional-only")
