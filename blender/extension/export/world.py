# SPDX-License-Identifier: GPL-3.0-or-later
"""The world: a color, or a panorama."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Callable

import bottega
import bpy
import numpy as np

from .baked import PROPERTY, name_of
from .colors import ColorReader
from .fields import Field, Placing, cached
from .images import MissingPicture, is_known_space
from .materials import folded
from .nodes import CyclicNodes, Input, Source, named
from .report import Fidelity, Report
from .shaders import ShaderReader
from .textures import NoPlace, Pictures, mapping_matrix

KEY = "world"
_FROM_BLENDER = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]], np.float64)
# Directions of Blender's panorama from directions of the environment: -z, its center column, to +x; +x to -y; +y to +z.
_PANORAMA = np.array([[0, 0, -1], [-1, 0, 0], [0, 1, 0]], np.float64)


class WorldReader(ColorReader):
    """Reads colors that may lie on a panorama. `rotation`: (3, 3), from directions of the world to the panorama."""

    def __init__(self, pictures: Pictures, report: Report, owner: str) -> None:
        super().__init__(pictures, lambda node, fidelity, text: report.add(KEY, owner, node.label or node.name, fidelity, text))
        self.rotation = np.eye(3)

    def _of(self, source: Source) -> Field:
        if source.node.bl_idname == "ShaderNodeTexEnvironment":
            return self._environment(source)
        return super()._of(source)

    def _environment(self, source: Source) -> Field:
        node = source.node
        if node.image is None:
            raise MissingPicture("no picture is chosen")
        if node.projection != "EQUIRECTANGULAR":
            raise NoPlace("a mirror ball is unknown to the renderer")
        if not is_known_space(node.image):
            self.note(node, Fidelity.APPROXIMATED, f"the color space {node.image.colorspace_settings.name} is read as sRGB")
        self.rotation = _rotation(named(node, source.groups, "Vector"))
        key = self.pictures.read(node.image, node.image_user)
        pixels = self.pictures.loaded[key]
        height, width = pixels.array.shape[:2]
        linear = cached(pixels.linear)
        return Field(f"{key} panorama", 3, Placing(), lambda: linear()[..., :3], key, size=(width, height))


def _rotation(vector: Input | None) -> np.ndarray:
    source = vector.source() if vector is not None else None
    if source is None:
        return np.eye(3)
    node = source.node
    if node.bl_idname == "ShaderNodeTexCoord" and source.output.name in ("Generated", "Normal", "Object"):
        return np.eye(3)
    if node.bl_idname == "ShaderNodeNewGeometry":
        return np.eye(3)
    if node.bl_idname == "ShaderNodeMapping":
        matrix = mapping_matrix(node, source.groups)[:3, :3]
        lengths = np.linalg.norm(matrix, axis=0)
        if lengths.max() - lengths.min() > 1e-3:
            raise NoPlace("a panorama that is stretched")
        return matrix / lengths.max() @ _rotation(named(node, source.groups, "Vector"))
    raise NoPlace(f"coordinates from the node {node.bl_label}")


def environment_of(
    world: Any, pictures: Pictures, report: Report
) -> tuple[bottega.Environment | None, dict[str, Callable[[], bottega.Image]]]:
    """Returns the environment of a world and its pictures by key. `None`: it is black."""
    report.begin(KEY)
    if world is None:
        return None, {}
    tree = world.node_tree if getattr(world, "use_nodes", True) else None
    if tree is None:
        return _constant(np.array(world.color)), {}
    output = tree.get_output_node("CYCLES") or tree.get_output_node("ALL")
    if output is None:
        return None, {}
    volume = named(output, (), "Volume")
    if volume is not None and volume.source() is not None:
        report.add(KEY, world.name, "Volume", Fidelity.LEFT_OUT, "a volume that fills the world is left out")
    surface = output.inputs["Surface"]
    baked = bpy.data.images.get(str(dict(world.get(PROPERTY, {})).get(name_of(surface)))) if PROPERTY in world else None
    if baked is not None:
        report.add(KEY, world.name, "Surface", Fidelity.BAKED, "a panorama that Cycles has baked is used")
        key = pictures.read(baked, None)
        return bottega.Environment(1.0, key, rotation=_rows(_FROM_BLENDER @ _PANORAMA)), {key: lambda: pictures.loaded[key].to_image()}
    reader = WorldReader(pictures, report, world.name)
    try:
        color = ShaderReader(reader).shader(named(output, (), "Surface")).emission
    except CyclicNodes as error:
        report.add(KEY, world.name, "World Output", Fidelity.LEFT_OUT, f"{error}: the world is black")
        return None, {}
    if color.is_constant:
        return _constant(color.load()), {}
    fields = {"rotation": _rows(_FROM_BLENDER @ reader.rotation.T @ _PANORAMA)}
    if color.image is not None:
        key = color.image
        factor = tuple(float(value) for value in np.broadcast_to(color.factor, (3,)))
        return bottega.Environment(factor, key, **fields), {key: lambda: pictures.loaded[key].to_image()}
    color = replace(color, channels=3)
    return bottega.Environment(1.0, color.key(), **fields), {color.key(): folded(color)}


def _rows(matrix: np.ndarray) -> tuple[tuple[float, ...], ...]:
    return tuple(tuple(float(value) for value in row) for row in matrix)


def _constant(color: Any) -> bottega.Environment | None:
    values = tuple(max(0.0, float(value)) for value in np.broadcast_to(color, (3,)))
    return bottega.Environment(values) if max(values) > 0.0 else None
