# SPDX-License-Identifier: GPL-3.0-or-later
"""Baking of worlds: what the renderer does not know of a world, such as a sky, becomes a panorama that Cycles renders."""

from __future__ import annotations

import math
import os
import tempfile
from pathlib import Path
from typing import Any

import bpy

# Samples per pixel of the panorama: a sun is smaller than a pixel.
_SAMPLES = 64


def is_wanted(world: Any) -> bool:
    """Returns true if something of a world's surface is unknown to the renderer."""
    from .export.report import Fidelity, Report
    from .export.textures import Pictures
    from .export.world import KEY, surroundings_of

    if world is None:
        return False
    report = Report()
    surroundings_of(world, Pictures(), report, False)
    return any(note.fidelity is Fidelity.LEFT_OUT and note.node != "Volume" for note in report.notes.get(KEY, []))


def bake_world(world: Any, width: int) -> None:
    """Renders a world as a panorama, and keeps it, packed, with the world."""
    from .export.baked import PROPERTY, name_of

    tree = world.node_tree
    output = tree.get_output_node("CYCLES") or tree.get_output_node("ALL")
    scene = bpy.data.scenes.new("Bottega panorama")
    camera = bpy.data.objects.new("Bottega panorama", bpy.data.cameras.new("Bottega panorama"))
    try:
        image = _rendered(scene, camera, world, width)
    finally:
        data = camera.data
        bpy.data.objects.remove(camera)
        bpy.data.cameras.remove(data)
        bpy.data.scenes.remove(scene)
    kept = dict(world.get(PROPERTY, {}))
    kept[name_of(output.inputs["Surface"])] = image.name
    world[PROPERTY] = kept


def _rendered(scene: Any, camera: Any, world: Any, width: int) -> Any:
    """Returns the panorama of a world as a packed image."""
    scene.collection.objects.link(camera)
    scene.camera, scene.world = camera, world
    # The center of the panorama looks along +x, as that of an environment texture.
    camera.rotation_euler = (math.pi / 2, 0.0, -math.pi / 2)
    camera.data.type = "PANO"
    owner = camera.data if hasattr(camera.data, "panorama_type") else camera.data.cycles
    owner.panorama_type = "EQUIRECTANGULAR"
    render, cycles = scene.render, scene.cycles
    render.engine = "CYCLES"
    render.resolution_x, render.resolution_y, render.resolution_percentage = width, width // 2, 100
    render.image_settings.file_format, render.image_settings.color_depth = "OPEN_EXR", "32"
    cycles.samples, cycles.use_adaptive_sampling, cycles.use_denoising, cycles.device = _SAMPLES, False, False, "CPU"
    cycles.pixel_filter_type = "BOX"
    cycles.sample_clamp_direct = 0.0
    folder = tempfile.mkdtemp(prefix="bottega-bake-")
    file = Path(folder) / "panorama.exr"
    render.filepath = str(file)
    try:
        bpy.ops.render.render(write_still=True, scene=scene.name)
        image = bpy.data.images.load(str(file))
        image.name = f"{world.name} baked"
        image.pack()
    finally:
        if file.is_file():
            os.remove(file)
        os.rmdir(folder)
    image.use_fake_user = True
    return image
