# SPDX-License-Identifier: GPL-3.0-or-later
"""Volume objects: smoke and fire of OpenVDB grids, each in a box."""

from __future__ import annotations

import os
import tempfile
from dataclasses import dataclass
from typing import Any

import bottega
import numpy as np

from . import axes
from .colors import ColorReader
from .context import Context
from .fields import as_number, is_constant_of
from .lights import visibility_of
from .materials import medium_of
from .nodes import CyclicNodes, Input, Source, named, uid_of
from .report import Fidelity, Report
from .textures import Pictures

BOX = "volume box"
"""Key of the unit cube that all volumes use."""


@dataclass(frozen=True)
class Look:
    """A volume shader.

    - `density`, `temperature`: names of grids; an empty temperature: it does not shine.
    - `emission`: R G B, factor of the radiance of black bodies. `kelvin`: factor of the temperatures.
    """

    absorption: tuple[float, ...]
    scattering: tuple[float, ...]
    g: float
    density: str = "density"
    temperature: str = ""
    emission: tuple[float, ...] = (0.0, 0.0, 0.0)
    kelvin: float = 1.0


DEFAULT_LOOK = Look((0.5, 0.5, 0.5), (0.5, 0.5, 0.5), 0.0)
"""The look without a material: Cycles' Principled Volume as it is added."""


class Volumes:
    """The volume objects of a scene that follows a scene of Blender."""

    def __init__(self, scene: bottega.Scene, report: Report) -> None:
        self._scene, self._report = scene, report
        self._placed: dict[str, tuple[Any, ...]] = {}
        # Voxels by volume and names of grids, with what they were read from.
        self._voxels: dict[tuple[Any, str, str], tuple[Any, bottega.Voxels]] = {}

    def update(self, volumes: list[tuple[str, Any, int]], matrices: Any, dirty: set[Any]) -> None:
        """Brings the scene to the evaluated volumes: key, object and row of its matrix."""
        seen: set[tuple[Any, str, str]] = set()
        for key, item, row in volumes:
            self._report.begin(key)
            if not self._put(key, item, matrices[row].astype(np.float64), dirty, seen):
                self._remove(key)
        self._voxels = {place: voxels for place, voxels in self._voxels.items() if place in seen}
        there = {key for key, _, _ in volumes}
        for key in [key for key in self._placed if key not in there]:
            self._remove(key)
            self._report.forget(key)
        if not self._placed and BOX in self._scene.meshes:
            del self._scene.meshes[BOX]

    def keys(self) -> list[str]:
        """Returns the keys of materials, media and objects, in the order in which they were found."""
        return list(self._placed)

    def _put(self, key: str, item: Any, matrix: Any, dirty: set[Any], seen: set[tuple[Any, str, str]]) -> bool:
        """Puts a volume into the scene. Returns false if nothing of it can be seen."""
        look = self._look(key, item)
        if look is None:
            return False
        place = (uid_of(item.data.original), look.density, look.temperature)
        seen.add(place)
        voxels = self._read(key, item, place, dirty)
        if voxels is None:
            return False
        determinant = abs(np.linalg.det(matrix[:3, :3]))
        if not (np.isfinite(matrix).all() and determinant > 1e-24):
            self._note(key, item, "Scale", Fidelity.LEFT_OUT, "a volume whose scale is 0 is left out")
            return False
        factor = 1.0
        if getattr(item.data.render, "space", "OBJECT") == "OBJECT":
            # As Cycles measures the scale of an object.
            factor = 1.0 / float(np.linalg.norm(matrix[:3, :3] @ np.full(3, 3.0**-0.5)))
        transform = axes.TURN @ matrix
        state = (look, id(voxels), transform.tobytes(), factor, visibility_of(item))
        if self._placed.get(key) != state:
            self._remove(key)
            self._add(key, look, voxels, transform, factor, item)
            self._placed[key] = state
        else:
            # Keep the order of this pass.
            self._placed[key] = self._placed.pop(key)
        return True

    def _add(self, key: str, look: Look, voxels: bottega.Voxels, transform: Any, factor: float, item: Any) -> None:
        scene = self._scene
        if BOX not in scene.meshes:
            scene.meshes[BOX] = unit_cube()
        scene.media[key] = bottega.Medium(
            absorption=scaled(look.absorption, factor),
            scattering=scaled(look.scattering, factor),
            emission=scaled(look.emission, factor),
            g=look.g,
            voxels=voxels,
            transform=transform,
            temperature_scale=look.kelvin,
            blackbody="power",
        )
        scene.materials[key] = bottega.Material(bottega.Null(), interior=key)
        box = (transform @ np.array(voxels.transform))[None].astype(np.float32)
        scene.objects[key] = bottega.Object(BOX, np.ascontiguousarray(box), [key], visibility=visibility_of(item))

    def _remove(self, key: str) -> None:
        if self._placed.pop(key, None) is not None:
            del self._scene.objects[key]
            del self._scene.materials[key]
            del self._scene.media[key]

    def _read(self, key: str, item: Any, place: tuple[Any, str, str], dirty: set[Any]) -> bottega.Voxels | None:
        """Reads the grids of a volume, unless they are known."""
        grids = item.data.grids
        grids.load()
        path = grids.frame_filepath
        known = self._voxels.get(place)
        is_changed = not path and place[0] in dirty
        source = (path, os.stat(path).st_mtime_ns if path and os.path.exists(path) else 0)
        if known is not None and known[0] == source and not is_changed:
            return known[1]
        try:
            if path:
                voxels = bottega.Voxels(path, place[1], place[2] or None)
            else:
                # Grids that modifiers make are nowhere but in memory.
                with tempfile.TemporaryDirectory() as folder:
                    path = os.path.join(folder, "volume.vdb")
                    if len(grids) == 0 or not grids.save(path):
                        raise bottega.SceneError(grids.error_message or "there are no grids")
                    voxels = bottega.Voxels(path, place[1], place[2] or None)
        except bottega.Error as error:
            self._note(key, item, "Grids", Fidelity.LEFT_OUT, f"the volume is left out: {error}")
            return None
        self._voxels[place] = (source, voxels)
        return voxels

    def _look(self, key: str, item: Any) -> Look | None:
        """Reads the volume shader of an object; `None`: it has none."""
        material = item.material_slots[0].material if item.material_slots else None
        if material is None:
            return DEFAULT_LOOK
        tree = material.node_tree if getattr(material, "use_nodes", True) else None
        output = tree and (tree.get_output_node("CYCLES") or tree.get_output_node("ALL"))
        found = output and named(output, (), "Volume")

        def note(node: Any, fidelity: Fidelity, text: str) -> None:
            self._report.add(key, material.name, node if isinstance(node, str) else node.label or node.name, fidelity, text)

        try:
            source = found.source() if found else None
            if source is None:
                note("Volume", Fidelity.LEFT_OUT, "a volume object without a volume shader is left out")
                return None
            return look_of(ColorReader(Pictures(), note, Context()), source, note)
        except CyclicNodes as error:
            note("Material Output", Fidelity.LEFT_OUT, f"{error}: the volume is left out")
            return None

    def _note(self, key: str, item: Any, node: str, fidelity: Fidelity, text: str) -> None:
        self._report.add(key, item.name, node, fidelity, text)


def look_of(reader: ColorReader, source: Source, note: Any) -> Look | None:
    """Returns the look of a volume shader; `None`: it cannot be rendered."""
    node = source.node
    grid, amount = density_of(reader, source)
    made = medium_of(reader, source, note, amount, has_grid=True)
    if made is None:
        return None
    look = Look(made.absorption, made.scattering, made.g, grid)
    if node.bl_idname != "ShaderNodeVolumePrincipled":
        return look
    if any(made.emission):
        note(node, Fidelity.LEFT_OUT, "Emission Strength of a volume object is rendered as 0")
    colored = named(node, source.groups, "Color Attribute")
    if colored is not None and colored.value():
        note(node, Fidelity.LEFT_OUT, f"the grid of colors {colored.value()} is left out")
    intensity, kelvin = reader.at(source, "Blackbody Intensity"), reader.at(source, "Temperature", 1000.0)
    if is_constant_of(intensity, 0.0):
        return look
    if not (intensity.is_constant and kelvin.is_constant):
        note(node, Fidelity.LEFT_OUT, "Blackbody Intensity or Temperature that varies is rendered as 0")
        return look
    tint = reader.color_at(source, "Blackbody Tint")
    factor = np.clip(tint.load(), 0.0, None) * max(intensity.number(), 0.0) if tint.is_constant else np.full(3, intensity.number())
    temperature = named(node, source.groups, "Temperature Attribute")
    name = str(temperature.value()) if temperature is not None else ""
    emission = tuple(float(value) for value in np.broadcast_to(factor, (3,)))
    return Look(look.absorption, look.scattering, look.g, grid, name, emission, kelvin.number())


def is_gas_domain(item: Any) -> bool:
    """Returns true if an object is the domain of a simulation of smoke or fire."""
    fluids = [modifier for modifier in item.modifiers if modifier.type == "FLUID" and modifier.fluid_type == "DOMAIN"]
    return any(modifier.domain_settings.domain_type == "GAS" for modifier in fluids)


def density_of(reader: ColorReader, source: Source) -> tuple[str, float | None]:
    """Returns the grid of the density, and its factor; `None`: that of the shader's input."""
    attribute = named(source.node, source.groups, "Density Attribute")
    if attribute is not None:
        return str(attribute.value() or "density"), None
    # Scatter and Absorption take the grid from a node, perhaps times a number.
    density = named(source.node, source.groups, "Density")
    fed = density.source() if density is not None else None
    factor = 1.0
    if fed is not None and fed.node.bl_idname == "ShaderNodeMath" and fed.node.operation == "MULTIPLY":
        sides = [Input(socket, fed.groups) for socket in fed.node.inputs[:2]]
        grids = [side for side in sides if side.source() is not None]
        numbers = [as_number(reader.number(side)) for side in sides if side.source() is None]
        if len(grids) == 1 and len(numbers) == 1:
            fed, factor = grids[0].source(), numbers[0].number()
    if fed is not None and fed.node.bl_idname == "ShaderNodeAttribute":
        return fed.node.attribute_name, factor
    if fed is not None and fed.node.bl_idname == "ShaderNodeVolumeInfo" and fed.output.name == "Density":
        return "density", factor
    return "density", None


def scaled(color: Any, factor: float) -> tuple[float, ...]:
    return tuple(factor * value for value in np.broadcast_to(color, (3,)).tolist())


def unit_cube() -> bottega.Mesh:
    """Returns the cube from 0 to 1, whose faces look out."""
    corners = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)], np.float32)
    faces = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    triangles = [triangle for a, b, c, d in faces for triangle in ((a, b, c), (a, c, d))]
    return bottega.Mesh(corners, np.array(triangles, np.int32))
