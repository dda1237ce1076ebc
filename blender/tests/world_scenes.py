# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes of worlds and transparent films, for the comparison with Cycles; see `scenes.py`."""

from __future__ import annotations

import math
from typing import Any

from scene_parts import add_light, ball, cube, empty, floor, matte, picture, principled, scene, shaded


@scene
def panorama() -> None:
    """A picture as world, turned."""
    made = empty()
    tree = made.world.node_tree
    image = tree.nodes.new("ShaderNodeTexEnvironment")
    image.image = picture("Sky", is_float=True)
    mapping, coordinates = tree.nodes.new("ShaderNodeMapping"), tree.nodes.new("ShaderNodeTexCoord")
    mapping.inputs["Rotation"].default_value = (math.radians(10), math.radians(20), math.radians(70))
    tree.links.new(coordinates.outputs["Generated"], mapping.inputs["Vector"])
    tree.links.new(mapping.outputs[0], image.inputs["Vector"])
    tree.links.new(image.outputs["Color"], tree.nodes["Background"].inputs["Color"])
    floor(matte())
    ball((0, 0, 1), material=shaded("ShaderNodeBsdfAnisotropic", Color=(0.9, 0.9, 0.9), Roughness=0.0))


def background(tree: Any, value: Any) -> Any:
    """Adds a background of a color, or of a rotated picture if `value` is `None`. Returns the node."""
    made = tree.nodes.new("ShaderNodeBackground")
    if value is not None:
        made.inputs["Color"].default_value = (*value, 1.0)
        return made
    panorama, mapping, place = (tree.nodes.new(f"ShaderNode{kind}") for kind in ("TexEnvironment", "Mapping", "TexCoord"))
    panorama.image = picture("Sky", is_float=True)
    mapping.inputs["Rotation"].default_value = (0.2, 0.1, 0.9)
    tree.links.new(place.outputs["Generated"], mapping.inputs["Vector"])
    tree.links.new(mapping.outputs[0], panorama.inputs["Vector"])
    tree.links.new(panorama.outputs[0], made.inputs["Color"])
    return made


def balls() -> None:
    """Adds a matte and a glossy ball on a floor."""
    floor(matte(), 5.0)
    ball((-1.2, 0, 1), material=matte((0.7, 0.3, 0.2)))
    ball((1.2, 0, 1), material=shaded("ShaderNodeBsdfAnisotropic", Color=(0.9, 0.9, 0.9), Roughness=0.1))


def two_worlds(seen: Any, lighting: Any) -> Any:
    """Makes a world whose camera rays see one background, and all others another: colors, or `None` for a picture. Returns the scene."""
    made = empty()
    tree = made.world.node_tree
    path, mix = tree.nodes.new("ShaderNodeLightPath"), tree.nodes.new("ShaderNodeMixShader")
    tree.links.new(path.outputs["Is Camera Ray"], mix.inputs[0])
    for index, value in ((1, lighting), (2, seen)):
        tree.links.new(background(tree, value).outputs[0], mix.inputs[index])
    tree.links.new(mix.outputs[0], tree.nodes["World Output"].inputs["Surface"])
    balls()
    return made


def pictured_world() -> Any:
    """Makes a world with a rotated panorama, and balls. Returns the scene."""
    made = empty()
    tree = made.world.node_tree
    tree.links.new(background(tree, None).outputs[0], tree.nodes["World Output"].inputs["Surface"])
    balls()
    return made


@scene
def plain_background() -> None:
    """A panorama lights the scene, and the camera sees one color."""
    two_worlds((0.2, 0.5, 0.8), None)


@scene
def pictured_background() -> None:
    """One color lights the scene, and the camera sees a panorama."""
    two_worlds(None, (0.7, 0.6, 0.5))


@scene
def two_colors() -> None:
    """The camera sees another color than lights the scene."""
    two_worlds((0.1, 0.2, 0.4), (0.7, 0.6, 0.5))


@scene
def clear_film() -> None:
    """A transparent film, in front of a world of one color, with lamps, light from a surface, and a surface that is clear in part."""
    made = empty((0.6, 0.5, 0.4))
    made.render.film_transparent = True
    floor(matte(), 4.0)
    ball((-1.5, 0, 1), 0.8, shaded("ShaderNodeEmission", Color=(0.2, 0.5, 1.0), Strength=1.5))
    ball((0.2, 0, 0.8), 0.8, principled(Base_Color=(0.8, 0.3, 0.2), Alpha=0.5))
    ball((1.8, 0, 0.8), 0.8, shaded("ShaderNodeBsdfGlass", Roughness=0.0, IOR=1.45))
    for item in (add_light("AREA", (0.9, 2, 1.2), (70, 0, 0), energy=20, size=0.8), add_light("POINT", (-0.6, 1, 1.4), energy=20, shadow_soft_size=0.25)):
        item.visible_camera = True


@scene
def clear_panorama() -> None:
    """A transparent film in front of a panorama, with a lamp and a surface that emit, which the camera sees."""
    made = pictured_world()
    made.render.film_transparent = True
    ball((0, -1.5, 0.5), 0.5, shaded("ShaderNodeEmission", Color=(0.2, 0.5, 1.0), Strength=1.5))
    light = add_light("POINT", (-0.6, -1.3, 1.8), energy=20, shadow_soft_size=0.25)
    light.visible_camera = True
    if hasattr(light.data, "use_soft_falloff"):
        light.data.use_soft_falloff = False


@scene
def world_by_ray() -> None:
    """A panorama that glossy surfaces do not reflect, by the ray visibility of the world."""
    made = pictured_world()
    made.world.cycles_visibility.glossy = False


def sky() -> None:
    """Blender's sky, which must be baked. Not in `SCENES`."""
    made = empty()
    tree = made.world.node_tree
    texture = tree.nodes.new("ShaderNodeTexSky")
    texture.sun_elevation, texture.sun_rotation = 0.6, 1.0
    tree.links.new(texture.outputs[0], tree.nodes["Background"].inputs["Color"])
    tree.nodes["Background"].inputs["Strength"].default_value = 0.1
    floor(matte())
    ball((0, 0, 1), material=principled(Roughness=0.2))
    cube((2.5, 0, 0.75))
