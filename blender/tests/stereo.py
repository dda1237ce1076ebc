# SPDX-License-Identifier: GPL-3.0-or-later
"""Stereo views against those of Cycles: `stereo.py FOLDER`.

Both views of a picture must be those of Cycles, and not each other.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))

import bottega  # noqa: E402
import bpy  # noqa: E402
import numpy as np  # noqa: E402
import scenes  # noqa: E402
import support  # noqa: E402

SIZE, SAMPLES = (192, 128), 64
# The difference of the means from Cycles', and the root mean square of the difference over the mean.
MEAN, DIFFERENCE = 0.01, 0.05
# Kinds of view: the scene, and settings of its camera's stereo.
KINDS: dict[str, tuple[str, dict[str, Any]]] = {
    "off-axis": ("focus", {}),
    "toe-in": ("focus", {"convergence_mode": "TOE"}),
    "panorama": ("spherical", {"use_spherical_stereo": True, "use_pole_merge": True}),
}


def views(scene: Any, engine: str, file: Path) -> dict[str, Any]:
    """Renders both views by an engine, and returns their colors by the suffix of their files."""
    scene.render.engine = engine
    if engine == "CYCLES":
        support.unclamped(scene.cycles, SAMPLES)
    scene.render.image_settings.file_format, scene.render.image_settings.color_depth = "OPEN_EXR", "32"
    scene.render.image_settings.views_format = "INDIVIDUAL"
    scene.render.filepath = str(file)
    bpy.ops.render.render(write_still=True)
    return {side: bottega.read(file.with_stem(file.stem + side)).color for side in ("_L", "_R")}


def main() -> None:
    (folder,) = support.arguments()
    wrong = []
    for name, (setting, stereo) in KINDS.items():
        support.addon()
        scenes.SCENES[setting]()
        support.addon()
        scene = bpy.context.scene
        support.settle(scene, *SIZE, SAMPLES)
        scene.render.use_multiview, scene.render.views_format = True, "STEREO_3D"
        settings = scene.camera.data.stereo
        settings.interocular_distance, settings.convergence_distance = 0.4, 5.0
        for field, value in stereo.items():
            setattr(settings, field, value)
        ours, theirs = (views(scene, engine, Path(folder) / f"{name}-{engine}.exr") for engine in ("BOTTEGA", "CYCLES"))
        for side, other in (("_L", "_R"), ("_R", "_L")):
            mean = float(ours[side].mean() / theirs[side].mean())
            near, far = (float(np.sqrt(np.mean((ours[side] - picture) ** 2)) / theirs[side].mean()) for picture in (theirs[side], theirs[other]))
            print(f"STEREO {name:10} {side} mean {mean:.4f}  difference {near:.3f}, from the other eye {far:.3f}", flush=True)
            if abs(mean - 1.0) > MEAN or near > DIFFERENCE or far < 2.0 * near:
                wrong.append(name + side)
    if wrong:
        support.failed(", ".join(wrong))
    support.leave()


main()
