# SPDX-License-Identifier: GPL-3.0-or-later
"""Cameras: what is where, beside Cycles: sensor fit, aspect, shift, region and crop. `camera.py FOLDER`."""

from __future__ import annotations

import itertools
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import bpy  # noqa: E402
import numpy as np  # noqa: E402
import scenes  # noqa: E402
import support  # noqa: E402


def board() -> None:
    """Makes a dark world with bright boards of different sizes, without symmetry."""
    scenes.empty((0.0, 0.0, 0.0))
    bright = scenes.shaded("ShaderNodeEmission", Strength=1.0)
    for x, z, size in [(-2.2, 2.0, 0.9), (0.3, 1.0, 1.6), (2.4, 3.1, 0.5), (1.9, -0.3, 1.1)]:
        scenes.cube((x, 0.0, z), size, bright)


def main() -> None:
    folder = Path(support.arguments()[0])
    support.addon()
    board()
    support.addon()
    scene = bpy.context.scene
    wrong = 0
    cases = itertools.product(("AUTO", "HORIZONTAL", "VERTICAL"), ((96, 64), (56, 96)), ((0.0, 0.0), (0.2, -0.15)), ("PERSP", "ORTHO"))
    for number, (fit, size, shift, kind) in enumerate(cases):
        data = scene.camera.data
        data.sensor_fit, data.type, data.ortho_scale = fit, kind, 8.0
        data.sensor_width, data.sensor_height = 36.0, 20.0
        data.shift_x, data.shift_y = shift
        support.settle(scene, *size, 64)
        render = scene.render
        render.use_border, render.use_crop_to_border = number % 3 > 0, number % 3 > 1
        render.border_min_x, render.border_max_x, render.border_min_y, render.border_max_y = 0.2, 0.85, 0.1, 0.7
        render.pixel_aspect_x = 1.4 if number % 4 == 3 else 1.0
        render.pixel_aspect_y = 1.2 if number % 8 == 5 else 1.0
        ours, theirs = (support.picture_of(engine, folder / f"camera-{engine}.exr", 64) for engine in ("BOTTEGA", "CYCLES"))
        if ours.shape != theirs.shape:
            print(f"CAMERA {fit} {size} {shift} {kind}: size {ours.shape} for {theirs.shape}")
            wrong += 1
            continue
        differs = np.abs(ours[..., 0] - theirs[..., 0]) > 0.35
        if differs.sum() > 0.002 * differs.size:
            print(f"CAMERA {fit} {size} {shift} {kind} border {number % 3}: {int(differs.sum())} of {differs.size} pixels differ")
            wrong += 1
    print(f"CAMERA {number + 1} cases, {wrong} wrong", flush=True)
    if wrong:
        support.failed("cameras differ")
    support.leave()


main()
