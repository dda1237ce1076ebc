# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes made by script: each uses a few features of the add-on. `SCENES` has them by name."""

from __future__ import annotations

import math
import tempfile
from pathlib import Path
from typing import Any, Callable

import bpy
import numpy as np

SCENES: dict[str, Callable[[], None]] = {}


def scene(function: Callable[[], None]) -> Callable[[], None]:
    """Registers a scene by the name of its function."""
    SCENES[function.__name__] = function
    return function


def empty(world: tuple[float, float, float] = (0.05, 0.05, 0.05)) -> Any:
    """Makes an empty scene with a camera and a world of one color, and returns the scene."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    made = bpy.context.scene
    made.view_settings.view_transform = "Standard"
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.location, camera.rotation_euler = (0.0, -7.0, 3.0), (math.radians(70), 0, 0)
    made.collection.objects.link(camera)
    made.camera = camera
    made.world = bpy.data.worlds.new("World")
    made.world.use_nodes = True
    made.world.node_tree.nodes["Background"].inputs[0].default_value = (*world, 1.0)
    return made


def link(name: str, data: Any, location: tuple[float, float, float] = (0, 0, 0)) -> Any:
    """Adds an object."""
    item = bpy.data.objects.new(name, data)
    item.location = location
    bpy.context.scene.collection.objects.link(item)
    return item


def floor(material: Any = None, size: float = 10.0) -> Any:
    """Adds a square floor with texture coordinates."""
    mesh = bpy.data.meshes.new("Floor")
    h = size / 2
    mesh.from_pydata([(-h, -h, 0), (h, -h, 0), (h, h, 0), (-h, h, 0)], [], [(0, 1, 2, 3)])
    uvs = mesh.uv_layers.new(name="UVMap")
    for index, uv in enumerate([(0, 0), (1, 0), (1, 1), (0, 1)]):
        uvs.data[index].uv = uv
    if material is not None:
        mesh.materials.append(material)
    return link("Floor", mesh)


def ball(location: tuple[float, float, float], radius: float = 1.0, material: Any = None) -> Any:
    """Adds a smooth ball."""
    bpy.ops.mesh.primitive_uv_sphere_add(radius=radius, location=location, segments=64, ring_count=32)
    item = bpy.context.object
    for polygon in item.data.polygons:
        polygon.use_smooth = True
    if material is not None:
        item.data.materials.append(material)
    return item


def cube(location: tuple[float, float, float], size: float = 1.5, material: Any = None) -> Any:
    """Adds a cube."""
    bpy.ops.mesh.primitive_cube_add(size=size, location=location)
    if material is not None:
        bpy.context.object.data.materials.append(material)
    return bpy.context.object


def lamp(kind: str, location: tuple[float, float, float], rotation: tuple[float, float, float] = (0, 0, 0), **values: Any) -> Any:
    """Adds a light; angles are degrees."""
    data = bpy.data.lights.new(kind.title(), kind)
    for name, value in values.items():
        setattr(data, name, value)
    item = link(kind.title(), data, location)
    item.rotation_euler = tuple(math.radians(angle) for angle in rotation)
    return item


def nodes(name: str = "Material") -> tuple[Any, Any, Any]:
    """Returns a new material without nodes but its output, the tree, and the output."""
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    return material, tree, tree.nodes.new("ShaderNodeOutputMaterial")


def shaded(kind: str, name: str = "Material", **inputs: Any) -> Any:
    """Returns a material of one shader; inputs by name, with _ for spaces."""
    material, tree, output = nodes(name)
    node = tree.nodes.new(kind)
    if hasattr(node, "distribution"):
        # The renderer's facets scatter once, but for those of Principled.
        node.distribution = "MULTI_GGX" if kind == "ShaderNodeBsdfPrincipled" else "GGX"
    for key, value in inputs.items():
        name = key.replace("_", " ")
        # Before 4.0 some inputs had other names.
        socket = node.inputs[name if name in node.inputs else name.removesuffix(" Weight").replace("Coat", "Clearcoat").replace("Emission Color", "Emission")]
        socket.default_value = (*value, 1.0) if isinstance(value, tuple) and len(value) == 3 and socket.type == "RGBA" else value
    tree.links.new(node.outputs[0], output.inputs["Surface"])
    return material


def principled(name: str = "Principled", **inputs: Any) -> Any:
    """Returns a Principled material."""
    return shaded("ShaderNodeBsdfPrincipled", name, **inputs)


def matte(color: tuple[float, float, float] = (0.8, 0.8, 0.8)) -> Any:
    """Returns a matte material."""
    return shaded("ShaderNodeBsdfDiffuse", "Matte", Color=color)


def picture(name: str = "Picture", width: int = 1024, height: int = 512, space: str = "sRGB", is_float: bool = False) -> Any:
    """Returns a generated picture that has no symmetry, packed."""
    image = bpy.data.images.new(name, width, height, float_buffer=is_float)
    v, u = np.mgrid[0:height, 0:width]
    pixels = np.ones((height, width, 4), np.float32)
    pixels[..., 0] = u / width
    pixels[..., 1] = v / height
    pixels[..., 2] = ((u * 8 // width + v * 4 // height) % 2) * 0.8
    if is_float:
        pixels[..., :3] *= 2.0
    image.pixels.foreach_set(pixels.ravel())
    image.update()
    image.pack()
    if not is_float:
        image.colorspace_settings.name = space
    return image


@scene
def factory() -> None:
    """The scene that Blender starts with: a point light with a radius, a cube."""
    bpy.ops.wm.read_factory_settings()
    bpy.context.scene.view_settings.view_transform = "Standard"


@scene
def lights() -> None:
    """Sun, spot, and areas of all shapes."""
    empty((0.02, 0.02, 0.02))
    floor(matte())
    cube((0, 0, 0.75), material=matte((0.6, 0.3, 0.2)))
    sun = lamp("SUN", (0, 0, 5), (40, 20, 0), energy=0.7, angle=0.0)
    lamp("SPOT", (-3, -1, 3.5), (0, -30, 0), energy=300, spot_size=math.radians(50), spot_blend=0.3, shadow_soft_size=0.0)
    lamp("AREA", (3, -1, 3), (0, 30, 0), energy=60, shape="RECTANGLE", size=1.5, size_y=0.5)
    lamp("AREA", (0, 2.5, 3), (-20, 0, 0), energy=60, shape="DISK", size=1.0)
    lamp("AREA", (-2.5, 2, 2.5), (0, 0, 0), energy=20, shape="ELLIPSE", size=1.0, size_y=0.4)
    glow = lamp("POINT", (2.5, -2, 1.5), energy=0.3, shadow_soft_size=0.0)
    # Nodes: a temperature, and a strength by a falloff
    glow.data.use_nodes = True
    tree = glow.data.node_tree
    emission = next(node for node in tree.nodes if node.bl_idname == "ShaderNodeEmission")
    black_body, falloff = tree.nodes.new("ShaderNodeBlackbody"), tree.nodes.new("ShaderNodeLightFalloff")
    black_body.inputs[0].default_value, falloff.inputs["Strength"].default_value = 3000.0, 100.0
    tree.links.new(black_body.outputs[0], emission.inputs["Color"])
    tree.links.new(falloff.outputs["Quadratic"], emission.inputs["Strength"])
    if hasattr(glow.data, "normalize"):
        # Power per area, and per solid angle
        for data, values in ((glow.data, {"shadow_soft_size": 0.2, "use_soft_falloff": False}), (sun.data, {"energy": 90.0, "angle": 0.1})):
            data.normalize = False
            for name, value in values.items():
                setattr(data, name, value)


@scene
def dielectrics() -> None:
    """Glass, smooth and rough, by both shaders."""
    empty((0.6, 0.6, 0.6))
    floor(matte((0.5, 0.3, 0.2)))
    ball((-2.2, 0, 1), material=shaded("ShaderNodeBsdfGlass", Roughness=0.0, IOR=1.45))
    ball((0, 0, 1), material=shaded("ShaderNodeBsdfGlass", Roughness=0.3, IOR=1.45, Color=(0.8, 0.9, 1.0)))
    ball((2.2, 0, 1), material=principled(Transmission_Weight=1.0, Roughness=0.1, IOR=1.5))
    lamp("AREA", (0, 0, 6), energy=200, size=2.0)


@scene
def metals() -> None:
    """Glossy and metallic surfaces."""
    empty((0.4, 0.4, 0.4))
    floor(matte())
    ball((-2.2, 0, 1), material=shaded("ShaderNodeBsdfAnisotropic", Color=(0.9, 0.6, 0.2), Roughness=0.2))
    ball((0, 0, 1), material=principled(Metallic=1.0, Roughness=0.3, Base_Color=(0.9, 0.5, 0.3)))
    ball((2.2, 0, 1), material=principled(Metallic=0.0, Roughness=0.05, Base_Color=(0.1, 0.2, 0.6)))
    lamp("AREA", (0, -3, 5), (30, 0, 0), energy=200, size=2.0)


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
    lamp("AREA", (0, -2, 5), (20, 0, 0), energy=200, size=2.0)


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
    lamp("AREA", (0, -3, 5), (30, 0, 0), energy=200, size=2.0)


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
    lamp("AREA", (0, -2, 5), (20, 0, 0), energy=200, size=2.0)


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
    lamp("AREA", (0, -3, 5), (30, 0, 0), energy=200, size=2.0)


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
    lamp("AREA", (0, 3, 4), (-40, 0, 0), energy=300, size=2.0)
    lamp("AREA", (0, -3, 5), (30, 0, 0), energy=100, size=2.0)


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
    lamp("AREA", (0, -2, 5), (20, 0, 0), energy=200, size=2.0)


@scene
def instances() -> None:
    """A collection placed twice, once mirrored; a slot linked to the object; shared data."""
    made = empty((0.5, 0.5, 0.5))
    floor(matte())
    collection = bpy.data.collections.new("Parts")
    part = cube((0, 0, 0.4), 0.8, matte((0.2, 0.6, 0.3)))
    part.location = (0.3, 0.2, 0.4)
    for holder in part.users_collection:
        holder.objects.unlink(part)
    collection.objects.link(part)
    for index, (x, scale) in enumerate([(-2.0, (1, 1, 1)), (0.0, (-1, 1, 1.5))]):
        holder = bpy.data.objects.new(f"Placed {index}", None)
        holder.instance_type, holder.instance_collection = "COLLECTION", collection
        holder.location, holder.scale = (x, 0, 0), scale
        made.collection.objects.link(holder)
    shared = link("Shared", part.data, (2.0, 0, 0.4))
    shared.material_slots[0].link = "OBJECT"
    shared.material_slots[0].material = matte((0.8, 0.2, 0.2))
    shared.rotation_euler = (0, 0, 0.5)
    lamp("AREA", (0, -2, 5), (20, 0, 0), energy=200, size=2.0)


@scene
def text() -> None:
    """Text, curves and metaballs."""
    empty((0.5, 0.5, 0.5))
    floor(matte())
    bpy.ops.object.text_add(location=(-2.5, 0, 0.2), rotation=(math.radians(90), 0, 0))
    bpy.context.object.data.body = "Ünï中"
    bpy.context.object.data.extrude = 0.1
    bpy.ops.curve.primitive_bezier_circle_add(location=(1.5, 0, 1))
    bpy.context.object.data.bevel_depth = 0.15
    bpy.ops.object.metaball_add(type="BALL", location=(3, 1, 1))
    lamp("AREA", (0, -2, 5), (20, 0, 0), energy=200, size=2.0)


@scene
def shifted_camera() -> None:
    """Sensor fit, shift, a high picture of wide pixels."""
    made = textured_room()
    data = made.camera.data
    data.sensor_fit, data.sensor_height, data.lens = "VERTICAL", 30.0, 40.0
    data.shift_x, data.shift_y = 0.15, -0.1
    made.render.pixel_aspect_x = 1.3


@scene
def orthographic() -> None:
    """An orthographic camera, shifted."""
    made = textured_room()
    data = made.camera.data
    data.type, data.ortho_scale = "ORTHO", 6.0
    data.shift_x = 0.1


@scene
def spherical() -> None:
    """An equirectangular camera."""
    made = textured_room()
    made.camera.data.type = "PANO"
    if hasattr(made.camera.data, "panorama_type"):
        made.camera.data.panorama_type = "EQUIRECTANGULAR"
    else:
        made.camera.data.cycles.panorama_type = "EQUIRECTANGULAR"
    made.camera.location = (0, -2, 2)


@scene
def focus() -> None:
    """Depth of field."""
    made = textured_room()
    dof = made.camera.data.dof
    dof.use_dof, dof.focus_distance, dof.aperture_fstop = True, 6.0, 0.3


def textured_room() -> Any:
    """Makes a floor with a picture and two bodies."""
    made = empty((0.6, 0.6, 0.6))
    material, tree, output = nodes("Picture")
    diffuse, image = tree.nodes.new("ShaderNodeBsdfDiffuse"), tree.nodes.new("ShaderNodeTexImage")
    image.image = picture()
    tree.links.new(image.outputs["Color"], diffuse.inputs["Color"])
    tree.links.new(diffuse.outputs[0], output.inputs["Surface"])
    floor(material)
    cube((-1, 0, 0.75), material=matte((0.7, 0.2, 0.2)))
    ball((1.5, 1, 1), material=matte((0.2, 0.3, 0.7)))
    lamp("AREA", (0, -2, 5), (20, 0, 0), energy=200, size=2.0)
    return made


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
    lamp("AREA", (0, -2, 5), (20, 0, 0), energy=200, size=2.0)


@scene
def layered() -> None:
    """Coat, sheen, alpha and emission of the Principled BSDF."""
    empty((0.5, 0.5, 0.5))
    floor(matte())
    ball((-2.4, 0, 1), 0.8, principled(Base_Color=(0.6, 0.05, 0.05), Roughness=0.4, Coat_Weight=1.0, Coat_Roughness=0.05))
    ball((-0.8, 0, 1), 0.8, principled(Base_Color=(0.1, 0.1, 0.3), Roughness=0.9, Sheen_Weight=0.5))
    ball((0.8, 0, 1), 0.8, principled(Base_Color=(0.2, 0.6, 0.2), Alpha=0.5))
    ball((2.4, 0, 1), 0.8, principled(Base_Color=(0.1, 0.1, 0.1), Emission_Color=(0.3, 0.5, 1.0), Emission_Strength=1.5))
    lamp("AREA", (0, -2, 5), (20, 0, 0), energy=200, size=2.0)


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
    lamp("POINT", (0, -3, 5), energy=200, shadow_soft_size=0.0)


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
    for item in (lamp("AREA", (0.9, 2, 1.2), (70, 0, 0), energy=20, size=0.8), lamp("POINT", (-0.6, 1, 1.4), energy=20, shadow_soft_size=0.25)):
        item.visible_camera = True


@scene
def clear_panorama() -> None:
    """A transparent film in front of a panorama, with a lamp and a surface that emit, which the camera sees."""
    made = pictured_world()
    made.render.film_transparent = True
    ball((0, -1.5, 0.5), 0.5, shaded("ShaderNodeEmission", Color=(0.2, 0.5, 1.0), Strength=1.5))
    light = lamp("POINT", (-0.6, -1.3, 1.8), energy=20, shadow_soft_size=0.25)
    light.visible_camera = True
    if hasattr(light.data, "use_soft_falloff"):
        light.data.use_soft_falloff = False


@scene
def world_by_ray() -> None:
    """A panorama that glossy surfaces do not reflect, by the ray visibility of the world."""
    made = pictured_world()
    made.world.cycles_visibility.glossy = False


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
    lamp("AREA", (0, -2, 5), (20, 0, 0), energy=200, size=2.0)


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
    lamp("AREA", (0, -2, 5), (20, 0, 0), energy=200, size=2.0)


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


@scene
def hair() -> None:
    """Hair of particles: pigments, color and absorption, with children and without."""
    made = empty((0.6, 0.65, 0.8))
    made.cycles_curves.shape = "THICK"
    lamp("AREA", (3, -3, 5), (45, 0, 45), energy=600.0, size=3.0)
    kinds: list[tuple[str, dict[str, Any]]] = [
        ("MELANIN", {"Melanin": 0.5, "Melanin Redness": 0.7}),
        ("COLOR", {"Color": (0.5, 0.1, 0.05, 1.0), "Roughness": 0.4}),
        ("ABSORPTION", {"Absorption Coefficient": (0.2, 0.4, 0.8), "Radial Roughness": 0.5}),
    ]
    for index, (kind, inputs) in enumerate(kinds):
        material, tree, output = nodes(kind)
        node = tree.nodes.new("ShaderNodeBsdfHairPrincipled")
        if hasattr(node, "model"):
            node.model = "CHIANG"
        node.parametrization = kind
        for name, value in {"Random Roughness": 0.0, "Random Color": 0.0, **inputs}.items():
            if name in node.inputs:
                node.inputs[name].default_value = value
        tree.links.new(node.outputs[0], output.inputs["Surface"])
        emitter = ball((2.2 * (index - 1), 0, 1.2), 0.6, matte((0.2, 0.2, 0.2)))
        emitter.data.materials.append(material)
        emitter.modifiers.new("Hair", "PARTICLE_SYSTEM")
        settings = emitter.particle_systems[0].settings
        settings.type, settings.count, settings.hair_length = "HAIR", 300, 0.6
        settings.material, settings.root_radius, settings.tip_radius = 2, 3.0, 1.0
        settings.shape = (0.0, 0.5, -0.5)[index]
        if index == 1:
            settings.child_type, settings.rendered_child_count = "SIMPLE", 4


def fibres() -> None:
    """Curves of a curves object, twice, with a matte surface."""
    made = empty((0.6, 0.65, 0.8))
    made.cycles_curves.shape = "THICK"
    lamp("SUN", (0, 0, 5), (30, 20, 0), energy=2.0)
    data = bpy.data.hair_curves.new("Fibres")
    data.materials.append(matte((0.7, 0.4, 0.1)))
    counts = [2 + index % 6 for index in range(150)]
    data.add_curves(counts)
    random = np.random.default_rng(3)
    places = []
    for count in counts:
        root = np.array([*random.uniform(-2, 2, 2), 0.0])
        bend = random.normal(0, 0.25, 3)
        share = np.linspace(0, 1, count)[:, None]
        places.append(root + share * np.array([0, 0, 1.5]) + share**2 * bend)
    points = np.concatenate(places).astype(np.float32)
    data.attributes["position"].data.foreach_set("vector", points.ravel())
    radius = data.attributes.get("radius") or data.attributes.new("radius", "FLOAT", "POINT")
    radius.data.foreach_set("value", np.full(len(points), 0.03, np.float32))
    link("Fibres", data)
    other = link("More", data, (0.5, 1.0, 0.0))
    other.scale = (1.0, -1.0, 1.5)
    floor(matte((0.4, 0.4, 0.4)), 6.0)


# Before 4.0 Python cannot make such curves.
if "add_curves" in bpy.types.Curves.bl_rna.functions:
    scene(fibres)


def moved(item: Any, name: str, before: Any, after: Any, index: int = -1) -> None:
    """Lets a property change evenly from frame 0 to frame 2."""
    bpy.context.preferences.edit.keyframe_new_interpolation_type = "LINEAR"
    for frame, value in ((0, before), (2, after)):
        if index < 0:
            setattr(item, name, value)
        else:
            getattr(item, name)[index] = value
        item.keyframe_insert(name, index=index, frame=frame)


def blurred(made: Any, shutter: float = 1.0, position: str = "CENTER") -> Any:
    """Switches motion blur on, and goes to frame 1. Returns the scene."""
    made.render.use_motion_blur, made.render.motion_blur_shutter = True, shutter
    owner = made.render if hasattr(made.render, "motion_blur_position") else made.cycles
    owner.motion_blur_position = position
    made.frame_set(1)
    return made


@scene
def moving_objects() -> None:
    """Objects that move, stretch and follow a parent, with a shutter that opens at the frame; one has motion blur switched off."""
    made = empty((0.5, 0.5, 0.5))
    floor(matte())
    first = cube((-2.0, 0, 0.6), 1.0, matte((0.7, 0.2, 0.2)))
    moved(first, "location", (-3.0, 0, 0.6), (-1.0, 0, 0.6))
    parent = link("Parent", None, (0.5, 0, 0))
    child = ball((0.0, 0, 1.0), 0.6, matte((0.2, 0.5, 0.3)))
    child.parent = parent
    moved(parent, "location", (0.5, -0.5, -0.2), (0.5, 0.5, 0.8))
    moved(child, "scale", (0.8, 0.8, 0.8), (1.2, 1.2, 1.2))
    sharp = cube((2.5, 0, 0.5), 0.8, matte((0.2, 0.3, 0.7)))
    moved(sharp, "location", (2.0, 0, 0.5), (3.0, 0, 0.5))
    sharp.cycles.use_motion_blur = False
    lamp("AREA", (0, -2, 5), (20, 0, 0), energy=200, size=2.0)
    blurred(made, 0.6, "START")


@scene
def turning_objects() -> None:
    """Bars that turn: by few steps and by many, which are bent otherwise; and a mirrored one."""
    made = empty((0.5, 0.5, 0.5))
    floor(matte())
    for x, steps, scale in ((-2.0, 1, 1.0), (0.0, 4, 1.0), (2.0, 3, -1.0)):
        bar = cube((x, 0.5, 1.2), 1.0, matte((0.8, 0.4, 0.1)))
        bar.scale = (1.7 * scale, 0.25, 0.25)
        bar.cycles.motion_steps = steps
        moved(bar, "rotation_euler", (0, 0, 0), (0, math.radians(250), 0))
    lamp("AREA", (0, -2, 5), (20, 0, 0), energy=200, size=2.0)
    blurred(made, 0.8, "END")


@scene
def deforming_meshes() -> None:
    """Shape keys, an armature and a modifier; a flat grid that bends, and a mesh that folds up to no area."""
    made = empty((0.5, 0.5, 0.5))
    floor(matte())
    stretched = ball((-2.2, 0, 1), 0.7, matte((0.7, 0.2, 0.2)))
    stretched.shape_key_add(name="Basis")
    key = stretched.shape_key_add(name="Stretched")
    for point in key.data:
        point.co.x *= 1.8
    moved(key, "value", 0.0, 1.0)
    bpy.ops.mesh.primitive_grid_add(x_subdivisions=8, y_subdivisions=8, size=1.6, location=(0, 0, 0.9), rotation=(math.radians(60), 0, 0))
    grid = bpy.context.object
    grid.data.materials.append(matte((0.2, 0.6, 0.3)))
    bend = grid.modifiers.new("Bend", "SIMPLE_DEFORM")
    bend.deform_method, bend.deform_axis = "BEND", "Z"
    moved(bend, "angle", 0.0, math.radians(120))
    bpy.ops.object.armature_add(location=(2.2, 0, 0))
    armature = bpy.context.object
    arm = cube((2.2, 0, 0.8), 0.5, matte((0.2, 0.3, 0.7)))
    arm.scale.z = 3.0
    group = arm.vertex_groups.new(name="Bone")
    group.add([vertex.index for vertex in arm.data.vertices if vertex.co.z > 0], 1.0, "REPLACE")
    arm.modifiers.new("Armature", "ARMATURE").object = armature
    moved(armature.pose.bones[0], "location", (-0.4, 0, 0), (0.4, 0, 0))
    folded = cube((1.0, -1.5, 0.3), 0.6, matte((0.7, 0.7, 0.2)))
    folded.shape_key_add(name="Basis")
    flat = folded.shape_key_add(name="Flat")
    for point in flat.data:
        point.co = (0, 0, 0)
    moved(flat, "value", -1.0, 1.0)
    flat.slider_min = -1.0
    lamp("AREA", (0, -2, 5), (20, 0, 0), energy=200, size=2.0)
    blurred(made)


@scene
def moving_camera() -> None:
    """A camera that moves and turns."""
    made = textured_room()
    made.camera.cycles.motion_steps = 2
    moved(made.camera, "location", (-0.6, -7.0, 3.0), (0.6, -7.0, 3.0))
    moved(made.camera, "rotation_euler", (math.radians(70), 0, math.radians(-4)), (math.radians(70), 0, math.radians(6)))
    blurred(made)


@scene
def moving_panorama() -> None:
    """An equirectangular camera that moves and turns."""
    spherical()
    made = bpy.context.scene
    moved(made.camera, "location", (-0.2, -2, 2), (0.2, -2, 2))
    moved(made.camera, "rotation_euler", (math.radians(70), 0, 0), (math.radians(70), 0, math.radians(30)))
    blurred(made)


@scene
def moving_glow() -> None:
    """A surface that emits and moves, seen in a mirror, by a shutter that opens slowly."""
    made = empty((0.2, 0.2, 0.25))
    floor(matte())
    glow = ball((0, -0.5, 1.6), 0.6, shaded("ShaderNodeEmission", Color=(1.0, 0.8, 0.5), Strength=3.0))
    moved(glow, "location", (-2.5, -0.5, 1.6), (2.5, -0.5, 1.6))
    cube((0, 0.5, 0.5), 1.0, matte((0.3, 0.5, 0.7)))
    ball((2.0, 1.0, 0.8), 0.8, shaded("ShaderNodeBsdfAnisotropic", Color=(0.9, 0.9, 0.9), Roughness=0.1))
    curve = made.render.motion_blur_shutter_curve
    points = curve.curves[0].points
    points[0].location, points[1].location, points[-1].location = (0.0, 0.0), (0.5, 1.0), (1.0, 0.0)
    for point in points:
        point.handle_type = "VECTOR"
    curve.update()
    blurred(made)


@scene
def moving_lamps() -> None:
    """Lamps that move and turn, which stand still by Cycles: it is compared by the mean of many moments. See `BY_MOMENTS`."""
    made = empty((0.02, 0.02, 0.02))
    floor(matte())
    for x in (-1.5, 0.0, 1.5):
        cube((x, 0.3, 0.4), 0.6, matte((0.6, 0.5, 0.4)))
    point = lamp("POINT", (0, 0, 0), energy=100, shadow_soft_size=0.05)
    moved(point, "location", (-2.5, -1.5, 1.5), (-0.5, -1.5, 1.5))
    area = lamp("AREA", (0, 0, 0), energy=60, size=0.6)
    moved(area, "location", (0.5, 1.0, 2.5), (2.5, 1.0, 2.5))
    moved(area, "rotation_euler", (0.2, -0.6, 0), (0.2, 0.8, 0))
    spot = lamp("SPOT", (3.0, -3.0, 3.0), energy=200, spot_size=math.radians(30), spot_blend=0.2, shadow_soft_size=0.0)
    moved(spot, "rotation_euler", (math.radians(40), math.radians(10), math.radians(20)), (math.radians(40), math.radians(10), math.radians(80)))
    blurred(made)


@scene
def moving_instances() -> None:
    """Collections whose holders move, particles, and instances on the faces of a parent that turns."""
    made = empty((0.5, 0.5, 0.5))
    floor(matte())
    collection = bpy.data.collections.new("Parts")
    part = cube((0, 0, 0), 0.4, matte((0.2, 0.6, 0.3)))
    for holder in part.users_collection:
        holder.objects.unlink(part)
    collection.objects.link(part)
    for index, steps in enumerate((1, 3)):
        holder = link(f"Placed {index}", None)
        holder.instance_type, holder.instance_collection = "COLLECTION", collection
        holder.cycles.motion_steps = steps
        moved(holder, "location", (-2.5 + 1.2 * index, -0.5, 0.3), (-1.9 + 1.2 * index, 0.5, 0.9))
    bpy.ops.mesh.primitive_circle_add(vertices=6, radius=0.9, location=(2.0, 0, 0.8), fill_type="TRIFAN")
    wheel = bpy.context.object
    wheel.instance_type, wheel.show_instancer_for_render = "FACES", False
    item = cube((0, 0, 0), 0.3, matte((0.2, 0.3, 0.7)))
    item.parent = wheel
    moved(wheel, "rotation_euler", (0, 0, 0), (0, 0, math.radians(50)))
    source = cube((0.4, 1.5, 2.0), 0.8)
    source.modifiers.new("Swarm", "PARTICLE_SYSTEM")
    settings = source.particle_systems[0].settings
    settings.count, settings.frame_start, settings.frame_end, settings.lifetime = 40, -3, 0, 100
    settings.render_type, settings.instance_object, settings.particle_size = "OBJECT", part, 0.3
    settings.normal_factor = 12.0
    settings.effector_weights.gravity = 0.0
    source.particle_systems[0].point_cache.frame_start = -3
    for frame in range(-3, 3):
        made.frame_set(frame)
    lamp("AREA", (0, -2, 5), (20, 0, 0), energy=200, size=2.0)
    blurred(made)


@scene
def moving_nodes() -> None:
    """Instances of Geometry Nodes that move, with a mesh that changes its shape; and vertices with velocities."""
    made = empty((0.5, 0.5, 0.5))
    floor(matte())
    group = bpy.data.node_groups.new("Row", "GeometryNodeTree")
    if hasattr(group, "interface"):
        group.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    else:
        group.outputs.new("NodeSocketGeometry", "Geometry")
    end = group.nodes.new("NodeGroupOutput")
    line, shape, bend, place, paint = (
        group.nodes.new(f"GeometryNode{kind}") for kind in ("MeshLine", "MeshCube", "Transform", "InstanceOnPoints", "SetMaterial")
    )
    line.inputs["Count"].default_value = 4
    line.inputs["Start Location"].default_value, line.inputs["Offset"].default_value = (-2.2, 0, 1.2), (1.1, 0, 0)
    shape.inputs["Size"].default_value = (0.5, 0.5, 0.5)
    paint.inputs["Material"].default_value = matte((0.7, 0.2, 0.4))
    group.links.new(shape.outputs["Mesh"], bend.inputs["Geometry"])
    group.links.new(bend.outputs[0], paint.inputs["Geometry"])
    group.links.new(line.outputs["Mesh"], place.inputs["Points"])
    group.links.new(paint.outputs[0], place.inputs["Instance"])
    group.links.new(place.outputs[0], end.inputs[0])
    moved(bend.inputs["Scale"], "default_value", (0.5, 1, 1), (1.5, 1, 1))
    moved(line.inputs["Offset"], "default_value", (0.9, 0, -0.3), (1.3, 0, 0.3))
    bearer = link("Row", bpy.data.meshes.new("Row"))
    bearer.modifiers.new("Row", "NODES").node_group = group
    flying = cube((1.8, -1.5, 0.5), 0.5, matte((0.2, 0.3, 0.7)))
    velocity = flying.data.attributes.new("velocity", "FLOAT_VECTOR", "POINT")
    velocity.data.foreach_set("vector", [12.0, 0.0, 0.0] * 4 + [24.0, 0.0, 0.0] * 4)
    lamp("AREA", (0, -2, 5), (20, 0, 0), energy=200, size=2.0)
    blurred(made)
