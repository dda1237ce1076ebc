# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes of lights, objects, cameras and hair, for the comparison with Cycles; see `scenes.py`."""

from __future__ import annotations

import math
from typing import Any

import bpy
import numpy as np
from scene_parts import add_light, ball, cube, empty, floor, link, matte, nodes, scene, shaded, textured_room


@scene
def factory() -> None:
    """The scene that Blender starts with: a point light with a radius, a cube."""
    bpy.ops.wm.read_factory_settings()
    bpy.context.scene.view_settings.view_transform = "Standard"


@scene
def bare() -> None:
    """Surfaces without a material."""
    empty((0.3, 0.3, 0.3))
    floor()
    cube((0, 0, 0.75))
    add_light("AREA", (3, -1, 3), (0, 30, 0), energy=60, shape="RECTANGLE", size=1.5, size_y=0.5)


@scene
def lights() -> None:
    """Sun, spot, and areas of all shapes."""
    empty((0.02, 0.02, 0.02))
    floor(matte())
    cube((0, 0, 0.75), material=matte((0.6, 0.3, 0.2)))
    sun = add_light("SUN", (0, 0, 5), (40, 20, 0), energy=0.7, angle=0.0)
    add_light("SPOT", (-3, -1, 3.5), (0, -30, 0), energy=300, spot_size=math.radians(50), spot_blend=0.3, shadow_soft_size=0.0)
    add_light("AREA", (3, -1, 3), (0, 30, 0), energy=60, shape="RECTANGLE", size=1.5, size_y=0.5)
    add_light("AREA", (0, 2.5, 3), (-20, 0, 0), energy=60, shape="DISK", size=1.0)
    add_light("AREA", (-2.5, 2, 2.5), (0, 0, 0), energy=20, shape="ELLIPSE", size=1.0, size_y=0.4)
    glow = add_light("POINT", (2.5, -2, 1.5), energy=0.3, shadow_soft_size=0.0)
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
    add_light("AREA", (0, -2, 5), (20, 0, 0), energy=200, size=2.0)


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
    add_light("AREA", (0, -2, 5), (20, 0, 0), energy=200, size=2.0)


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


def all_around(kind: str, **settings: float) -> Any:
    """Returns a room seen by a panoramic camera."""
    made = textured_room()
    data = made.camera.data
    data.type = "PANO"
    owner = data if hasattr(data, "panorama_type") else data.cycles
    owner.panorama_type = kind
    for name, value in settings.items():
        setattr(owner, name, value)
    made.camera.location = (0, -2, 2)
    return made


@scene
def spherical() -> None:
    """An equirectangular camera."""
    all_around("EQUIRECTANGULAR")


@scene
def fisheye() -> None:
    """A fisheye whose angles are in proportion, stretched over a picture that is not square."""
    all_around("FISHEYE_EQUIDISTANT", fisheye_fov=math.radians(200.0))


@scene
def equisolid() -> None:
    """A fisheye of equal areas with a sensor, whose circle is cut off above and below."""
    all_around("FISHEYE_EQUISOLID", fisheye_fov=math.radians(180.0), fisheye_lens=10.0)


@scene
def equisolid_by_height() -> None:
    """The same with a sensor that fits the picture's height."""
    made = all_around("FISHEYE_EQUISOLID", fisheye_fov=math.radians(150.0), fisheye_lens=12.0)
    made.camera.data.sensor_fit = "VERTICAL"


@scene
def mirror_ball() -> None:
    """A panorama as in a mirror ball."""
    all_around("MIRRORBALL")


@scene
def focus() -> None:
    """Depth of field."""
    made = textured_room()
    dof = made.camera.data.dof
    dof.use_dof, dof.focus_distance, dof.aperture_fstop = True, 6.0, 0.3


@scene
def blades() -> None:
    """Small lamps out of focus, behind an aperture with five blades that is narrower than high."""
    made = empty()
    floor(matte())
    dof = made.camera.data.dof
    dof.use_dof, dof.focus_distance, dof.aperture_fstop = True, 4.0, 0.1
    dof.aperture_blades, dof.aperture_rotation, dof.aperture_ratio = 5, 0.4, 1.6
    for index in range(5):
        ball((index - 2.0, 0.5, 0.6 + 0.4 * index), 0.15, shaded("ShaderNodeEmission", Strength=8.0))


@scene
def hair() -> None:
    """Hair of particles: pigments, color and absorption, with children and without."""
    made = empty((0.6, 0.65, 0.8))
    made.cycles_curves.shape = "THICK"
    add_light("AREA", (3, -3, 5), (45, 0, 45), energy=600.0, size=3.0)
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
    add_light("SUN", (0, 0, 5), (30, 20, 0), energy=2.0)
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
