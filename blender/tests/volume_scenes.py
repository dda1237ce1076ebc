# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes with volume objects, for the comparison with Cycles; see `scenes.py`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import bpy
from scene_parts import add_light, empty, floor, matte, nodes, scene

FIRE = Path(__file__).parents[2] / "crates/bottega-scene/tests/voxels/data/fire.vdb"
"""A ball of smoke, densest and hottest in its middle, around (1.8, 2.8, 3.8), 1.7 wide."""


def volume(location: Any, scale: Any, material: Any, file: Path = FIRE) -> Any:
    """Adds a volume object whose file has its middle at `location`."""
    data = bpy.data.volumes.new("Fire")
    data.filepath = str(file)
    item = bpy.data.objects.new("Fire", data)
    middle = (1.8, 2.8, 3.8)
    item.location = [at - size * center for at, size, center in zip(location, scale, middle)]
    item.scale = scale
    item.data.materials.append(material)
    bpy.context.collection.objects.link(item)
    return item


def shader(kind: str, **values: Any) -> Any:
    """Returns a material with one volume shader. Values: see `set_inputs`; `A_B` names the input `A B`."""
    material, tree, output = nodes(kind)
    node = tree.nodes.new(kind)
    for name, value in values.items():
        node.inputs[name.replace("_", " ")].default_value = value
    tree.links.new(node.outputs[0], output.inputs["Volume"])
    return material


@scene
def clouds() -> None:
    """Smoke of two colors, one stretched and turned, one by a grid that an Attribute node names."""
    empty((0.5, 0.5, 0.5))
    floor(matte())
    principled = shader("ShaderNodeVolumePrincipled", Density=4.0, Color=(0.8, 0.5, 0.3, 1), Anisotropy=0.4)
    item = volume((-1.4, 0, 1.2), (1.2, 0.8, 1.4), principled)
    item.rotation_euler = (0.0, 0.1, 0.2)
    scatter = shader("ShaderNodeVolumeScatter", Color=(0.4, 0.6, 0.9, 1))
    tree = scatter.node_tree
    grid, product = tree.nodes.new("ShaderNodeAttribute"), tree.nodes.new("ShaderNodeMath")
    grid.attribute_name, product.operation = "half", "MULTIPLY"
    product.inputs[1].default_value = 5.0
    tree.links.new(grid.outputs["Fac"], product.inputs[0])
    tree.links.new(product.outputs[0], tree.nodes["Volume Scatter"].inputs["Density"])
    volume((1.4, 0, 1.2), (1.2, 1.2, 1.2), scatter)
    add_light("AREA", (0, -2, 5), (20, 0, 0), energy=300, size=2.0)


@scene
def fire() -> None:
    """A ball of fire over a floor that it lights."""
    empty((0.02, 0.02, 0.02))
    floor(matte())
    burning = shader("ShaderNodeVolumePrincipled", Density=2.0, Color=(0.3, 0.3, 0.3, 1), Blackbody_Intensity=1.0, Temperature=1.0)
    volume((0, 0, 1.3), (1.3, 1.3, 1.3), burning)
