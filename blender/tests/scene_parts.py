# SPDX-License-Identifier: GPL-3.0-or-later
"""Parts that the scenes are made of: cameras, bodies, lights, materials, pictures and motion. `SCENES` has all scenes by name."""

from __future__ import annotations

import math
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


def add_light(kind: str, location: tuple[float, float, float], rotation: tuple[float, float, float] = (0, 0, 0), **values: Any) -> Any:
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
    add_light("AREA", (0, -2, 5), (20, 0, 0), energy=200, size=2.0)
    return made


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
