# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes of lamps whose light a profile or a picture shapes."""

from __future__ import annotations

from typing import Any

import bpy
from scene_parts import add_light, ball, cube, empty, floor, matte, picture, scene

# A lamp of two unlike beams: not symmetric around its axis, and 0 above 120°.
PROFILE = """IESNA:LM-63-2002
[TEST] two beams
TILT=NONE
1 1000 2.5 13 5 1 2 0 0 0
0.9 1 20
0 10 20 30 40 50 60 70 80 90 100 110 120
0 90 180 270 360
90 80 110 180 200 150 70 30 20 15 10 5 0
90 85 80 70 60 50 40 30 20 15 10 5 0
90 70 50 30 20 15 10 8 6 5 4 2 0
90 95 90 85 150 60 40 30 20 15 10 5 0
90 80 110 180 200 150 70 30 20 15 10 5 0
"""


def profiled(light: Any, strength: float = 1.0, color: tuple[float, float, float] = (1, 1, 1)) -> Any:
    """Gives a light the profile, as a text block. Returns the tree."""
    light.data.use_nodes = True
    tree = light.data.node_tree
    emission = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeEmission")
    emission.inputs["Color"].default_value = (*color, 1)
    node = tree.nodes.new("ShaderNodeTexIES")
    text = bpy.data.texts.get("lamp") or bpy.data.texts.new("lamp")
    text.from_string(PROFILE)
    node.mode, node.ies = "INTERNAL", text
    node.inputs["Strength"].default_value = strength
    tree.links.new(node.outputs[0], emission.inputs["Strength"])
    return tree


def room() -> Any:
    """Makes a floor, a wall and two bodies."""
    made = empty((0.02, 0.02, 0.02))
    floor(matte((0.7, 0.7, 0.7)))
    wall = floor(matte((0.6, 0.6, 0.7)))
    wall.location, wall.rotation_euler = (0, 3, 0), (1.5708, 0, 0)
    cube((-1.5, 0, 0.5), 1.0, matte((0.7, 0.3, 0.2)))
    ball((1.5, 0, 0.6), 0.6, matte((0.3, 0.5, 0.7)))
    return made


@scene
def profiles() -> None:
    """Profiles on points, a spot and an area light, turned."""
    room()
    point = add_light("POINT", (-1, 1, 2.5), (20, 10, 30), energy=8, shadow_soft_size=0.05)
    profiled(point)
    profiled(add_light("POINT", (1.5, 2, 2), (90, 0, 0), energy=3, shadow_soft_size=0.0), 0.5, (1, 0.6, 0.3))
    profiled(add_light("SPOT", (2, -2, 3), (30, 10, 40), energy=20, spot_size=1.4, spot_blend=0.3, shadow_soft_size=0.1), color=(0.4, 0.7, 1))
    profiled(add_light("AREA", (0, -3, 4), (30, 0, 0), energy=2, size=1.0, spread=2.5))


def pictured(light: Any) -> None:
    """Gives a light a picture."""
    light.data.use_nodes = True
    tree = light.data.node_tree
    emission = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeEmission")
    image = tree.nodes.new("ShaderNodeTexImage")
    image.image = picture()
    tree.links.new(image.outputs["Color"], emission.inputs["Color"])


@scene
def lantern() -> None:
    """A picture on a point light, by direction."""
    room()
    pictured(add_light("POINT", (0, 0, 2), (10, 20, 30), energy=200, shadow_soft_size=0.02))


@scene
def screen() -> None:
    """Pictures on a rectangle and on a disk."""
    room()
    pictured(add_light("AREA", (-1.5, -2, 3.0), (60, 0, -20), energy=150, shape="RECTANGLE", size=2.0, size_y=1.0))
    pictured(add_light("AREA", (1.5, -1, 3.5), (20, 10, 0), energy=200, shape="DISK", size=1.5))
