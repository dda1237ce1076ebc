# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes of materials, for the comparison with Cycles; see `scenes.py`."""

from __future__ import annotations

import math
import tempfile
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from scene_parts import add_light, ball, cube, empty, floor, link, matte, nodes, picture, principled, scene, shaded


@scene
def dielectrics() -> None:
    """Glass, smooth and rough, by both shaders."""
    empty((0.6, 0.6, 0.6))
    floor(matte((0.5, 0.3, 0.2)))
    ball((-2.2, 0, 1), material=shaded("ShaderNodeBsdfGlass", Roughness=0.0, IOR=1.45))
    ball((0, 0, 1), material=shaded("ShaderNodeBsdfGlass", Roughness=0.3, IOR=1.45, Color=(0.8, 0.9, 1.0)))
    ball((2.2, 0, 1), material=principled(Transmission_Weight=1.0, Roughness=0.1, IOR=1.5))
    add_light("AREA", (0, 0, 6), energy=200, size=2.0)


@scene
def metals() -> None:
    """Glossy and metallic surfaces."""
    empty((0.4, 0.4, 0.4))
    floor(matte())
    ball((-2.2, 0, 1), material=shaded("ShaderNodeBsdfAnisotropic", Color=(0.9, 0.6, 0.2), Roughness=0.2))
    ball((0, 0, 1), material=principled(Metallic=1.0, Roughness=0.3, Base_Color=(0.9, 0.5, 0.3)))
    ball((2.2, 0, 1), material=principled(Metallic=0.0, Roughness=0.05, Base_Color=(0.1, 0.2, 0.6)))
    add_light("AREA", (0, -3, 5), (30, 0, 0), energy=200, size=2.0)


@scene
def textures() -> None:
    """A picture with a mapping, a folded chain, a channel, and a normal map of one color."""
    empty((0.5, 0.5, 0.5))
    material, tree, output = nodes("Textured")
    shader = tree.nodes.new("ShaderNodeBsdfPrincipled")
    shader.distribution = "MULTI_GGX"
    image = tree.nodes.new("ShaderNodeTexImage")
    image.image = picture()
    mapping, coordinates = tree.nodes.new("ShaderNodeMapping"), tree.nodes.new("ShaderNodeTexCoord")
    mapping.inputs["Scale"].default_value = (2.0, 1.5, 1.0)
    mapping.inputs["Rotation"].default_value = (0, 0, math.radians(25))
    mapping.inputs["Location"].default_value = (0.2, 0.1, 0)
    tree.links.new(coordinates.outputs["UV"], mapping.inputs["Vector"])
    tree.links.new(mapping.outputs[0], image.inputs["Vector"])
    hue = tree.nodes.new("ShaderNodeHueSaturation")
    hue.inputs["Hue"].default_value, hue.inputs["Saturation"].default_value = 0.7, 0.6
    tree.links.new(image.outputs["Color"], hue.inputs["Color"])
    tree.links.new(hue.outputs[0], shader.inputs["Base Color"])
    ramp = tree.nodes.new("ShaderNodeValToRGB")
    ramp.color_ramp.elements[0].position = 0.2
    tree.links.new(image.outputs["Color"], ramp.inputs["Fac"])
    tree.links.new(ramp.outputs[0], shader.inputs["Roughness"])
    tree.links.new(shader.outputs[0], output.inputs["Surface"])
    floor(material)
    plain, plain_tree, plain_output = nodes("Plain picture")
    diffuse, other = plain_tree.nodes.new("ShaderNodeBsdfDiffuse"), plain_tree.nodes.new("ShaderNodeTexImage")
    other.image = image.image
    plain_tree.links.new(other.outputs["Color"], diffuse.inputs["Color"])
    plain_tree.links.new(diffuse.outputs[0], plain_output.inputs["Surface"])
    ball((-1.5, 0, 1), material=plain)
    cube((1.5, 0, 0.75), material=plain)
    add_light("AREA", (0, -2, 5), (20, 0, 0), energy=200, size=2.0)


@scene
def clips() -> None:
    """A picture with nothing around it."""
    empty((0.5, 0.5, 0.5))
    material, tree, output = nodes("Clipped")
    shader, texture, place, uv = (tree.nodes.new(f"ShaderNode{kind}") for kind in ("BsdfDiffuse", "TexImage", "Mapping", "TexCoord"))
    texture.image, texture.extension = picture(), "CLIP"
    place.inputs["Scale"].default_value, place.inputs["Location"].default_value = (1.6, 2.0, 1.0), (-0.3, -0.4, 0.0)
    tree.links.new(uv.outputs["UV"], place.inputs["Vector"])
    tree.links.new(place.outputs[0], texture.inputs["Vector"])
    tree.links.new(texture.outputs["Color"], shader.inputs["Color"])
    tree.links.new(shader.outputs[0], output.inputs["Surface"])
    floor(material)
    ball((0, 0, 1), material=matte())


@scene
def tiles() -> None:
    """A picture of UDIM tiles, one of which is missing and one smaller than the others."""
    made = empty((0.5, 0.5, 0.5))
    folder = Path(tempfile.mkdtemp(prefix="bottega-tiles-"))
    for number, width in ((1001, 64), (1002, 32), (1011, 64)):
        image = picture(f"tile {number}", width, width)
        pixels = np.empty(4 * width * width, np.float32)
        image.pixels.foreach_get(pixels)
        pixels[number % 3 :: 4] *= 0.3
        image.pixels.foreach_set(pixels)
        image.filepath_raw, image.file_format = str(folder / f"tile.{number}.png"), "PNG"
        image.save()
        bpy.data.images.remove(image)
    tiled = bpy.data.images.load(str(folder / "tile.1001.png"))
    tiled.source = "TILED"
    tiled.filepath = str(folder / "tile.<UDIM>.png")
    for number in (1002, 1011):
        if tiled.tiles.get(number) is None:
            tiled.tiles.new(tile_number=number)
    material, tree, output = nodes("Tiled")
    shader, texture = tree.nodes.new("ShaderNodeBsdfDiffuse"), tree.nodes.new("ShaderNodeTexImage")
    texture.image, texture.interpolation = tiled, "Closest"
    tree.links.new(texture.outputs["Color"], shader.inputs["Color"])
    tree.links.new(shader.outputs[0], output.inputs["Surface"])
    plane = floor(material)
    for corner in plane.data.uv_layers[0].data:
        corner.uv = (2.0 * corner.uv[0], 2.0 * corner.uv[1])
    made.camera.location, made.camera.rotation_euler = (0, -7, 9), (math.radians(38), 0, 0)


@scene
def reliefs() -> None:
    """A bump map on a floor, and a normal map on a ball."""
    empty((0.4, 0.4, 0.4))
    v, u = np.mgrid[0:128, 0:128] / 128
    height = 0.5 + 0.25 * np.sin(8 * math.pi * u) + 0.25 * np.sin(6 * math.pi * v)
    slopes = np.stack([*np.gradient(-3 * height)[::-1], np.ones_like(height)], -1)
    normals = slopes / np.linalg.norm(slopes, axis=-1, keepdims=True)
    for name, values in (("Bump", np.repeat(height[..., None], 3, -1)), ("Normals", 0.5 + 0.5 * normals)):
        image = bpy.data.images.new(name, 128, 128, float_buffer=True)
        image.colorspace_settings.name = "Non-Color"
        image.pixels.foreach_set(np.concatenate([values, np.ones((128, 128, 1))], -1).astype(np.float32).ravel())
        image.pack()
        material, tree, output = nodes(name)
        shader, texture = tree.nodes.new("ShaderNodeBsdfDiffuse"), tree.nodes.new("ShaderNodeTexImage")
        relief = tree.nodes.new("ShaderNodeBump" if name == "Bump" else "ShaderNodeNormalMap")
        texture.image = image
        if name == "Bump":
            relief.inputs["Strength"].default_value, relief.inputs["Distance"].default_value = 1.0, 0.3
        tree.links.new(texture.outputs["Color"], relief.inputs["Height" if name == "Bump" else "Color"])
        tree.links.new(relief.outputs[0], shader.inputs["Normal"])
        tree.links.new(shader.outputs[0], output.inputs["Surface"])
    floor(bpy.data.materials["Bump"])
    ball((0, 0, 1), material=bpy.data.materials["Normals"])
    add_light("AREA", (0, -3, 5), (30, 0, 0), energy=200, size=2.0)


@scene
def mixes() -> None:
    """Mix, transparency, emission, translucency."""
    empty((0.3, 0.3, 0.3))
    floor(matte())
    material, tree, output = nodes("Mixed")
    mix = tree.nodes.new("ShaderNodeMixShader")
    mix.inputs[0].default_value = 0.4
    one, two = tree.nodes.new("ShaderNodeBsdfDiffuse"), tree.nodes.new("ShaderNodeBsdfAnisotropic")
    one.inputs["Color"].default_value = (0.8, 0.1, 0.1, 1)
    two.inputs["Roughness"].default_value = 0.2
    tree.links.new(one.outputs[0], mix.inputs[1])
    tree.links.new(two.outputs[0], mix.inputs[2])
    tree.links.new(mix.outputs[0], output.inputs["Surface"])
    ball((-2.2, 0, 1), material=material)
    clear, tree, output = nodes("Clear")
    mix = tree.nodes.new("ShaderNodeMixShader")
    mix.inputs[0].default_value = 0.6
    one, two = tree.nodes.new("ShaderNodeBsdfTransparent"), tree.nodes.new("ShaderNodeBsdfDiffuse")
    tree.links.new(one.outputs[0], mix.inputs[1])
    tree.links.new(two.outputs[0], mix.inputs[2])
    tree.links.new(mix.outputs[0], output.inputs["Surface"])
    ball((0, 0, 1), material=clear)
    ball((2.2, 0, 1), material=shaded("ShaderNodeBsdfTranslucent", Color=(0.3, 0.8, 0.4)))
    cube((0, 2, 0.5), 0.6, shaded("ShaderNodeEmission", Color=(1.0, 0.5, 0.2), Strength=3.0))
    for x, kind in ((-2.0, "ShaderNodeMixShader"), (2.0, "ShaderNodeAddShader"), (3.2, "ShaderNodeMixShader")):
        # Emission, mixed with transparency and added to a surface that is clear in part
        glow, tree, output = nodes("Glow")
        join, light = tree.nodes.new(kind), tree.nodes.new("ShaderNodeEmission")
        light.inputs["Color"].default_value = (0.2, 0.6, 1.0, 1)
        other = tree.nodes.new("ShaderNodeBsdfTransparent" if x < 3.0 and kind == "ShaderNodeMixShader" else "ShaderNodeBsdfPrincipled")
        if "Alpha" in other.inputs:
            other.inputs["Alpha"].default_value = 0.4
        tree.links.new(other.outputs[0], join.inputs[-2])
        tree.links.new(light.outputs[0], join.inputs[-1])
        tree.links.new(join.outputs[0], output.inputs["Surface"])
        cube((x, 1.5, 0.5), 0.8, glow)
    add_light("AREA", (0, -2, 5), (20, 0, 0), energy=200, size=2.0)


@scene
def coats() -> None:
    """Reflections that Fresnel and Layer Weight nodes mix in over matte."""
    empty((0.5, 0.5, 0.5))
    floor(matte())
    for x, kind, roughness in ((-2.2, "ShaderNodeFresnel", 0.0), (0.0, "ShaderNodeFresnel", 0.3), (2.2, "ShaderNodeLayerWeight", 0.1)):
        material, tree, output = nodes("Coat")
        mix, share = tree.nodes.new("ShaderNodeMixShader"), tree.nodes.new(kind)
        below, above = tree.nodes.new("ShaderNodeBsdfDiffuse"), tree.nodes.new("ShaderNodeBsdfAnisotropic")
        below.inputs["Color"].default_value = (0.6, 0.1, 0.1, 1)
        above.distribution, above.inputs["Roughness"].default_value = "GGX", roughness
        if kind == "ShaderNodeLayerWeight":
            share.inputs["Blend"].default_value = 0.3
        tree.links.new(share.outputs["Fac" if "Fac" in share.outputs else 0], mix.inputs[0])
        tree.links.new(below.outputs[0], mix.inputs[1])
        tree.links.new(above.outputs[0], mix.inputs[2])
        tree.links.new(mix.outputs[0], output.inputs["Surface"])
        ball((x, 0, 1), material=material)
    add_light("AREA", (0, -3, 5), (30, 0, 0), energy=200, size=2.0)


@scene
def subsurface() -> None:
    """Light below surfaces: short and long ways, a share of it, and a gloss above."""
    empty((0.4, 0.4, 0.45))
    floor(matte())
    walks = ((-2.4, (0.8, 0.5, 0.3), 0.5, 1.0), (0.0, (0.9, 0.7, 0.5), 4.0, 1.0), (2.4, (0.3, 0.6, 0.8), 1.5, 0.6))
    for x, color, scale, weight in walks:
        below = {"Subsurface_Radius": (1.0, 0.5, 0.25), "Specular IOR Level" if bpy.app.version >= (4, 0, 0) else "Specular": 0.0}
        if bpy.app.version >= (4, 0, 0):
            below |= {"Subsurface_Weight": weight, "Subsurface_Scale": scale}
        else:
            below |= {"Subsurface": scale * weight, "Subsurface_Color": color}
        material = principled(Base_Color=color, Roughness=1.0, **below)
        if bpy.app.version < (4, 0, 0):
            material.node_tree.nodes["Principled BSDF"].subsurface_method = "RANDOM_WALK_FIXED_RADIUS"
        ball((x, 0, 1), material=material)
    add_light("AREA", (0, 3, 4), (-40, 0, 0), energy=300, size=2.0)
    add_light("AREA", (0, -3, 5), (30, 0, 0), energy=100, size=2.0)


@scene
def groups() -> None:
    """A node group with an input, a muted node, a reroute."""
    empty((0.5, 0.5, 0.5))
    group = bpy.data.node_groups.new("Paint", "ShaderNodeTree")
    if hasattr(group, "interface"):
        group.interface.new_socket("Color", in_out="INPUT", socket_type="NodeSocketColor")
        group.interface.new_socket("Shader", in_out="OUTPUT", socket_type="NodeSocketShader")
    else:
        group.inputs.new("NodeSocketColor", "Color")
        group.outputs.new("NodeSocketShader", "Shader")
    begin, end = group.nodes.new("NodeGroupInput"), group.nodes.new("NodeGroupOutput")
    shader, gamma = group.nodes.new("ShaderNodeBsdfDiffuse"), group.nodes.new("ShaderNodeGamma")
    gamma.inputs["Gamma"].default_value = 2.0
    muted = group.nodes.new("ShaderNodeInvert")
    muted.mute = True
    group.links.new(begin.outputs[0], gamma.inputs["Color"])
    group.links.new(gamma.outputs[0], muted.inputs["Color"])
    group.links.new(muted.outputs[0], shader.inputs["Color"])
    group.links.new(shader.outputs[0], end.inputs[0])
    material, tree, output = nodes("Grouped")
    node = tree.nodes.new("ShaderNodeGroup")
    node.node_tree = group
    color = tree.nodes.new("ShaderNodeRGB")
    color.outputs[0].default_value = (0.9, 0.5, 0.3, 1)
    reroute = tree.nodes.new("NodeReroute")
    tree.links.new(color.outputs[0], reroute.inputs[0])
    tree.links.new(reroute.outputs[0], node.inputs[0])
    tree.links.new(node.outputs[0], output.inputs["Surface"])
    floor(material)
    ball((0, 0, 1), material=material)
    add_light("AREA", (0, -2, 5), (20, 0, 0), energy=200, size=2.0)


@scene
def smoke() -> None:
    """A cube of fog without a surface, and colored absorption in glass."""
    empty((0.5, 0.5, 0.5))
    floor(matte())
    material, tree, output = nodes("Fog")
    volume = tree.nodes.new("ShaderNodeVolumeScatter")
    volume.inputs["Color"].default_value = (0.8, 0.6, 0.4, 1)
    volume.inputs["Density"].default_value = 1.0
    volume.inputs["Anisotropy"].default_value = 0.3
    tree.links.new(volume.outputs[0], output.inputs["Volume"])
    cube((-1.5, 0, 1), 1.8, material)
    glass = shaded("ShaderNodeBsdfGlass", Roughness=0.0, IOR=1.3)
    absorb = glass.node_tree.nodes.new("ShaderNodeVolumeAbsorption")
    absorb.inputs["Color"].default_value = (0.3, 0.7, 0.9, 1)
    end = next(node for node in glass.node_tree.nodes if node.bl_idname == "ShaderNodeOutputMaterial")
    glass.node_tree.links.new(absorb.outputs[0], end.inputs["Volume"])
    ball((1.5, 0, 1), material=glass)
    add_light("AREA", (0, -2, 5), (20, 0, 0), energy=200, size=2.0)


@scene
def layered() -> None:
    """Coat, sheen, alpha and emission of the Principled BSDF."""
    empty((0.5, 0.5, 0.5))
    floor(matte())
    ball((-2.4, 0, 1), 0.8, principled(Base_Color=(0.6, 0.05, 0.05), Roughness=0.4, Coat_Weight=1.0, Coat_Roughness=0.05))
    ball((-0.8, 0, 1), 0.8, principled(Base_Color=(0.1, 0.1, 0.3), Roughness=0.9, Sheen_Weight=0.5))
    ball((0.8, 0, 1), 0.8, principled(Base_Color=(0.2, 0.6, 0.2), Alpha=0.5))
    ball((2.4, 0, 1), 0.8, principled(Base_Color=(0.1, 0.1, 0.1), Emission_Color=(0.3, 0.5, 1.0), Emission_Strength=1.5))
    add_light("AREA", (0, -2, 5), (20, 0, 0), energy=200, size=2.0)


def by_ray(name: str, output: str, first: str, second: str, **values: Any) -> Any:
    """Returns a material that is `first` for most rays, and `second` where an output of Light Path is 1. Values: see `set_inputs`."""
    material, tree, end = nodes(name)
    path, mix = tree.nodes.new("ShaderNodeLightPath"), tree.nodes.new("ShaderNodeMixShader")
    tree.links.new(path.outputs[output], mix.inputs[0])
    for index, kind in ((1, first), (2, second)):
        shader = tree.nodes.new(kind)
        if hasattr(shader, "distribution"):
            shader.distribution = "GGX"
        for key, value in values.items():
            which, _, socket = key.partition("_")
            if which == ("first", "second")[index - 1]:
                shader.inputs[socket.replace("_", " ")].default_value = (*value, 1.0) if isinstance(value, tuple) else value
        tree.links.new(shader.outputs[0], mix.inputs[index])
    tree.links.new(mix.outputs[0], end.inputs["Surface"])
    return material


@scene
def kinds_of_ray() -> None:
    """Light Path in materials: a lamp that the camera sees in another color, glass without shadows, what mirrors alone see."""
    empty((0.3, 0.3, 0.3))
    floor(matte())
    emission, diffuse = "ShaderNodeEmission", "ShaderNodeBsdfDiffuse"
    lit = by_ray("Lit", "Is Camera Ray", emission, emission, first_Color=(1, 0.5, 0.2), first_Strength=6.0, second_Color=(0.1, 0.3, 0.9), second_Strength=0.6)
    ball((-2.4, 0.5, 1.2), 0.5, lit)
    glass = by_ray("Glass", "Is Shadow Ray", "ShaderNodeBsdfGlass", "ShaderNodeBsdfTransparent", first_Roughness=0.0, first_IOR=1.45)
    ball((-0.6, 0, 1), 0.9, glass)
    ball((1.2, 0.4, 0.9), 0.9, shaded("ShaderNodeBsdfAnisotropic", Color=(0.9, 0.9, 0.9), Roughness=0.0))
    cube((2.6, -0.6, 0.5), 1.0, by_ray("Reflected", "Is Glossy Ray", diffuse, diffuse, first_Color=(0.1, 0.5, 0.1), second_Color=(0.8, 0.1, 0.1)))
    add_light("POINT", (0, -3, 5), energy=200, shadow_soft_size=0.0)


@scene
def object_values() -> None:
    """Object Info and attributes of objects: random numbers, color, index, location, custom properties, of objects and instances."""
    made = empty((0.6, 0.6, 0.6))
    floor(matte())
    material, tree, output = nodes("Many")
    info, shader, ramp, mix = (tree.nodes.new(f"ShaderNode{kind}") for kind in ("ObjectInfo", "BsdfDiffuse", "ValToRGB", "MixRGB"))
    ramp.color_ramp.elements[0].color, ramp.color_ramp.elements[1].color = (0.9, 0.2, 0.1, 1), (0.1, 0.3, 0.9, 1)
    tree.links.new(info.outputs["Random"], ramp.inputs[0])
    tree.links.new(ramp.outputs[0], mix.inputs[1])
    tree.links.new(info.outputs["Color"], mix.inputs[2])
    tree.links.new(mix.outputs[0], shader.inputs["Color"])
    tree.links.new(shader.outputs[0], output.inputs["Surface"])
    part = cube((0, 0, 0), 0.5, material)
    for index in range(5):
        other = link(f"Cube {index}", part.data, (index - 2.0, -1.0, 0.25))
        other.color = (0.2 * index, 0.5, 1.0 - 0.2 * index, 1.0)
    collection = bpy.data.collections.new("Parts")
    for holder in part.users_collection:
        holder.objects.unlink(part)
    collection.objects.link(part)
    for index in range(5):
        holder = bpy.data.objects.new(f"Placed {index}", None)
        holder.instance_type, holder.instance_collection = "COLLECTION", collection
        holder.location = (index - 2.0, 0.0, 0.25)
        made.collection.objects.link(holder)
    own, tree, output = nodes("Own")
    shader, combine, index_info = (tree.nodes.new(f"ShaderNode{kind}") for kind in ("BsdfDiffuse", "CombineXYZ", "ObjectInfo"))
    for socket, (kind, name) in enumerate((("OBJECT", "shade"), ("INSTANCER", "glow"))):
        attribute = tree.nodes.new("ShaderNodeAttribute")
        attribute.attribute_type, attribute.attribute_name = kind, name
        tree.links.new(attribute.outputs["Fac"], combine.inputs[socket])
    divide = tree.nodes.new("ShaderNodeMath")
    divide.operation, divide.inputs[1].default_value = "DIVIDE", 10.0
    tree.links.new(index_info.outputs["Object Index"], divide.inputs[0])
    tree.links.new(divide.outputs[0], combine.inputs[2])
    tree.links.new(combine.outputs[0], shader.inputs["Color"])
    tree.links.new(shader.outputs[0], output.inputs["Surface"])
    for index in range(4):
        item = ball((index - 1.5, 1.2, 0.4), 0.4, own)
        item["shade"], item["glow"], item.pass_index = 0.2 * index, 0.9 - 0.2 * index, 2 * index
    add_light("AREA", (0, -2, 5), (20, 0, 0), energy=200, size=2.0)


def procedural() -> None:
    """A noise texture and a checker, which must be baked. Not in `SCENES`."""
    empty((0.5, 0.5, 0.5))
    material, tree, output = nodes("Procedural")
    shader = tree.nodes.new("ShaderNodeBsdfDiffuse")
    mix = tree.nodes.new("ShaderNodeMixRGB")
    noise, checker = tree.nodes.new("ShaderNodeTexNoise"), tree.nodes.new("ShaderNodeTexChecker")
    noise.inputs["Scale"].default_value, checker.inputs["Scale"].default_value = 3.0, 6.0
    tree.links.new(noise.outputs["Color"], mix.inputs[1])
    tree.links.new(checker.outputs["Color"], mix.inputs[2])
    tree.links.new(mix.outputs[0], shader.inputs["Color"])
    tree.links.new(shader.outputs[0], output.inputs["Surface"])
    floor(material)
    add_light("AREA", (0, -2, 5), (20, 0, 0), energy=200, size=2.0)
