# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes with motion blur, for the comparison with Cycles; see `scenes.py`."""

from __future__ import annotations

import math

import bpy
from object_scenes import spherical
from scene_parts import add_light, ball, blurred, cube, empty, floor, link, matte, moved, scene, shaded, textured_room


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
    add_light("AREA", (0, -2, 5), (20, 0, 0), energy=200, size=2.0)
    blurred(made, 0.6, "START")


@scene
def rolling_shutter() -> None:
    """A bar that moves sideways while the rows are exposed one after another: it slants."""
    made = empty((0.5, 0.5, 0.5))
    floor(matte())
    for x, length in ((-1.5, 3.0), (1.5, -3.0)):
        bar = cube((x, 0.5, 1.5), 1.0, matte((0.8, 0.4, 0.1)))
        bar.scale = (0.3, 0.3, 3.0)
        moved(bar, "location", (x - 0.5 * length, 0.5, 1.5), (x + 0.5 * length, 0.5, 1.5))
    add_light("AREA", (0, -2, 5), (20, 0, 0), energy=200, size=2.0)
    made.cycles.rolling_shutter_type, made.cycles.rolling_shutter_duration = "TOP", 0.2
    blurred(made)


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
    add_light("AREA", (0, -2, 5), (20, 0, 0), energy=200, size=2.0)
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
    add_light("AREA", (0, -2, 5), (20, 0, 0), energy=200, size=2.0)
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
    point = add_light("POINT", (0, 0, 0), energy=100, shadow_soft_size=0.05)
    moved(point, "location", (-2.5, -1.5, 1.5), (-0.5, -1.5, 1.5))
    area = add_light("AREA", (0, 0, 0), energy=60, size=0.6)
    moved(area, "location", (0.5, 1.0, 2.5), (2.5, 1.0, 2.5))
    moved(area, "rotation_euler", (0.2, -0.6, 0), (0.2, 0.8, 0))
    spot = add_light("SPOT", (3.0, -3.0, 3.0), energy=200, spot_size=math.radians(30), spot_blend=0.2, shadow_soft_size=0.0)
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
    add_light("AREA", (0, -2, 5), (20, 0, 0), energy=200, size=2.0)
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
    add_light("AREA", (0, -2, 5), (20, 0, 0), energy=200, size=2.0)
    blurred(made)
