"""What the tests share: scenes, the program, a scene of arrays."""

from __future__ import annotations

import os
import shutil
import sys
from pathlib import Path

import numpy as np
import pytest

import bottega

ROOT = Path(__file__).resolve().parents[3]


@pytest.fixture
def box() -> Path:
    """The Cornell box."""
    return ROOT / "scenes" / "cornell-box.glb"


@pytest.fixture
def program() -> str:
    """The program `bottega` of the same build."""
    found = os.environ.get("BOTTEGA_PROGRAM") or shutil.which("bottega")
    if not found or not Path(found).exists():
        pytest.skip("the program bottega is not built: cargo build --workspace")
    return found


@pytest.fixture
def pyramid() -> bottega.Scene:
    """A pyramid under a lamp."""
    scene = bottega.Scene()
    scene.materials["floor"] = bottega.Material.matte((0.7, 0.7, 0.7))
    scene.materials["orange"] = bottega.Material(bottega.Layered((0.7, 0.3, 0.1), roughness=0.4))
    scene.materials["lamp"] = bottega.Material.emitter((12, 12, 12))
    meshes = {
        "floor": ([[-6, 0, -6], [6, 0, -6], [6, 0, 6], [-6, 0, 6]], [[0, 2, 1], [0, 3, 2]]),
        "orange": (
            [[-1, 0, -1], [1, 0, -1], [1, 0, 1], [-1, 0, 1], [0, 1.5, 0]],
            [[1, 0, 4], [2, 1, 4], [3, 2, 4], [0, 3, 4]],
        ),
        "lamp": ([[-1, 5, -1], [1, 5, -1], [1, 5, 1], [-1, 5, 1]], [[0, 1, 2], [0, 2, 3]]),
    }
    for key, (positions, triangles) in meshes.items():
        arrays = np.array(positions, np.float32), np.array(triangles, np.int32)
        scene.meshes[key] = bottega.Mesh(*arrays, materials=key)
        scene.objects[key] = bottega.Object(key)
    scene.environment = bottega.Environment((0.1, 0.1, 0.1))
    scene.cameras["main"] = bottega.Camera.looking((3, 2.5, 5), (0, 0.6, 0), fov=35)
    return scene


def child(code: str, *, timeout: float = 60) -> str:
    """What a fresh Python prints; it must end well."""
    import subprocess

    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=timeout)
    assert done.returncode == 0, f"ended with {done.returncode}\n{done.stdout}\n{done.stderr}"
    return done.stdout
