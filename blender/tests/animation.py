# SPDX-License-Identifier: GPL-3.0-or-later
"""Animations: with Persistent Data, where only what moved is read again, frames have the same bits as without. `animation.py FOLDER`."""

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

FRAMES = 4


def keyed() -> None:
    """Makes a scene in which an object, a light, a camera, a material and a shape change over time."""
    scenes.textured_room()
    cube = bpy.data.objects["Cube"]
    for frame, x in ((1, -1.0), (FRAMES, 1.0)):
        cube.location.x = x
        cube.keyframe_insert("location", frame=frame)
        light = next(light for light in bpy.data.lights)
        light.energy = 100.0 * frame
        light.keyframe_insert("energy", frame=frame)
        camera = bpy.context.scene.camera
        camera.location.z = 3.0 + 0.1 * frame
        camera.keyframe_insert("location", frame=frame)
        node = bpy.data.materials["Matte"].node_tree.nodes["Diffuse BSDF"]
        node.inputs[0].default_value = (0.2 * frame, 0.3, 0.1, 1.0)
        node.inputs[0].keyframe_insert("default_value", frame=frame)
    wave = bpy.data.objects["Floor"].modifiers.new("Wave", "WAVE")
    wave.height = 0.3


def frames(folder: Path, name: str, persistent: bool) -> list[Any]:
    scene = bpy.context.scene
    scene.render.engine = "BOTTEGA"
    scene.render.use_persistent_data = persistent
    scene.frame_start, scene.frame_end = 1, FRAMES
    scene.render.image_settings.file_format, scene.render.image_settings.color_depth = "OPEN_EXR", "32"
    scene.render.filepath = str(folder / f"{name}-")
    bpy.ops.render.render(animation=True)
    return [bottega.read(folder / f"{name}-{frame:04}.exr").color for frame in range(1, FRAMES + 1)]


def main() -> None:
    folder = Path(support.arguments()[0])
    support.addon()
    keyed()
    support.addon()
    support.settle(bpy.context.scene, 48, 32, 4)
    alone, kept = (frames(folder, name, persistent) for name, persistent in (("animation", False), ("persistent", True)))
    for number, (one, other) in enumerate(zip(alone, kept), 1):
        if not np.array_equal(one, other):
            support.failed(f"frame {number} has other bits with Persistent Data")
    if any(np.array_equal(one, other) for one, other in zip(alone, alone[1:])):
        support.failed("two frames are the same")
    print(f"ANIMATION {FRAMES} frames have the same bits with Persistent Data", flush=True)
    support.leave()


main()
