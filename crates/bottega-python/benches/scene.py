"""Measures edits of a scene in memory: `PYTHONPATH=… python3 crates/bottega-python/benches/scene.py`.

Prints the best of several times, in milliseconds, beside the greatest that is meant: a mesh of a million triangles by corner, 100,000
instances in one call, and the first new pixels of a viewport after a change of a material, a light and the camera.
"""

from __future__ import annotations

import gc
import os
import tempfile
import time
from pathlib import Path
from typing import Callable

import numpy as np

import bottega


def best(count: int, run: Callable[[], object]) -> float:
    times = []
    for _ in range(count):
        begun = time.perf_counter()
        run()
        times.append(time.perf_counter() - begun)
    return 1000 * min(times)


def report(what: str, milliseconds: float, most: float) -> None:
    print(f"{what:55} {milliseconds:8.1f} ms   (at most {most:.0f})", flush=True)


def grid(side: int) -> bottega.Mesh:
    """A wavy square of 2 × side × side triangles, with normals and texture coordinates by corner."""
    x, z = np.meshgrid(np.linspace(-1, 1, side + 1, dtype=np.float32), np.linspace(-1, 1, side + 1, dtype=np.float32))
    positions = np.stack([x, 0.05 * np.sin(9 * x) * np.cos(7 * z), z], -1).reshape(-1, 3).astype(np.float32)
    first = (np.arange(side)[:, None] * (side + 1) + np.arange(side)).ravel()
    quads = np.stack([first, first + side + 1, first + side + 2, first, first + side + 2, first + 1], -1)
    corner_vertices = quads.reshape(-1).astype(np.int32)
    normals = np.tile(np.array([0, 1, 0], np.float32), (len(positions), 1))[corner_vertices]
    uvs = np.ascontiguousarray(positions[:, [0, 2]])[corner_vertices]
    triangles = np.arange(len(corner_vertices), dtype=np.int32).reshape(-1, 3)
    return bottega.Mesh(positions, triangles, corner_vertices, normals, uvs, materials="gray")


def resident() -> float:
    """Returns the memory of this process in MB."""
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6


def memory(scene: bottega.Scene, large: bottega.Mesh) -> None:
    """Prints the memory that a mesh needs in the scene, beside the arrays that were given."""
    arrays = (large.positions, large.triangles, large.corner_vertices, large.normals, large.uvs)
    given = sum(array.nbytes for array in arrays if array is not None) / 1e6
    gc.collect()
    before = resident()
    scene.meshes["large"] = large
    print(f"{'memory of this mesh':55} {resident() - before:8.1f} MB   (at most {given:.0f}, the size of the arrays)", flush=True)


def main() -> None:
    scene = bottega.Scene()
    scene.materials["gray"] = bottega.Material(bottega.Layered(0.5))
    large = grid(708)
    memory(scene, large)
    report(f"a mesh of {len(large.triangles)} triangles by corner", best(5, lambda: scene.meshes.__setitem__("large", large)), 500)
    scene.meshes["small"] = grid(2)
    transforms = np.tile(np.diag([0.01, 0.01, 0.01, 1.0]).astype(np.float32), (100_000, 1, 1))
    transforms[:, :3, 3] = np.random.default_rng(1).uniform(-1, 1, (100_000, 3))
    transforms[::2, 0, 0] *= -1
    many = bottega.Object("small", transforms)
    report("100000 instances in one call", best(5, lambda: scene.objects.__setitem__("many", many)), 300)
    scene.objects["large"] = bottega.Object("large")
    scene.lights["sun"] = bottega.SunLight((-1, -2, -1), 3.0)
    scene.environment = bottega.Environment(0.3)
    scene.cameras["main"] = bottega.Camera.looking((0, 1.5, 3), (0, 0, 0))
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "scene.bottega"
        report("writing the scene to a file", best(3, lambda: scene.save(file)), 500)
        report("reading the file", best(3, lambda: bottega.Scene.read(file)), 1000)

    def beyond() -> float:
        session = bottega.Session(scene, spp=1, size=(160, 120))
        heard: list[object] = []
        begun = time.perf_counter()
        picture = session.render(on_event=heard.append)
        return 1000 * (time.perf_counter() - begun - float(picture.report["seconds"]))

    report("a call that hears all events, beyond the painting", min(beyond() for _ in range(3)), 100)
    scene.lights["lamp"] = bottega.AreaLight(power=1.0)
    with bottega.Viewport(scene, size=(720, 480), spp=1024) as viewport:
        pixels = np.empty(viewport.shape, np.float32)

        def first(look: int | None) -> None:
            frame = None
            while frame is None or frame.look != look:
                viewport.wait(0.01)
                frame = viewport.frame_into(pixels)

        first(0)
        numbers = iter(range(1000))

        def material() -> None:
            scene.materials["gray"].roughness = 0.1 + 0.001 * next(numbers)
            first(viewport.update())

        def light() -> None:
            scene.lights["sun"].irradiance = 1 + 0.01 * next(numbers)
            first(viewport.update())

        def camera() -> None:
            first(viewport.look(camera=bottega.Camera.looking((0.01 * next(numbers), 1.5, 3), (0, 0, 0))))

        def move() -> None:
            scene.objects["large"].transforms = np.diag([1, 1 + 0.01 * next(numbers), 1, 1])
            first(viewport.update())

        report("new pixels after a change of a material", best(5, material), 100)
        report("new pixels after a change of a light", best(5, light), 100)
        report("new pixels after a change of the camera", best(5, camera), 60)
        report("new pixels after a large mesh has moved", best(3, move), 300)
        begun = time.perf_counter()
        viewport.stop()
        report("stop", 1000 * (time.perf_counter() - begun), 300)


if __name__ == "__main__":
    main()
