#!/usr/bin/env python3
"""Writes the scenes of the self-checks, one room for all engines, beside this script in scenes/: `make_scenes.py`.
The same room as a .blend: `python3 make_scenes.py OUT.blend [TEXTURE]` with bpy, or within Blender
`blender -b --factory-startup --python make_scenes.py -- OUT.blend [TEXTURE]`.

The scenes are dedicated to the public domain (CC0 1.0).
"""

import math
import os
import sys

WIDTH, HEIGHT, FIELD_OF_VIEW = 128, 96, 39.0
EYE, TARGET, UP = (0.0, -3.9, 1.0), (0.0, 0.0, 1.0), (0.0, 0.0, 1.0)
COLORS = {"white": (0.73, 0.71, 0.68), "red": (0.63, 0.065, 0.05), "green": (0.14, 0.45, 0.091)}
LIGHTS = {"lamp": (12.0, 10.0, 6.0), "mark": (4.0, 2.0, 0.5)}
LAMP = (0.0, 0.0, 1.98, 0.3)
# Left, right, lower and upper end of the mark, which hangs before the wall at the back: neither square nor centred.
MARK, MARK_DEPTH = (-0.8, -0.5, 1.4, 1.52), 0.98


def block(x, y, turn, size, height):
    """The four sides and the top of a block that stands on the floor, as quads seen from outside."""
    s, c = math.sin(math.radians(turn)) * size, math.cos(math.radians(turn)) * size
    foot = [(x + c, y + s), (x - s, y + c), (x - c, y - s), (x + s, y - c)]
    sides = [((*foot[i], 0), (*foot[(i + 1) % 4], 0), (*foot[(i + 1) % 4], height), (*foot[i], height))
             for i in range(4)]
    return sides + [tuple((*corner, height) for corner in foot)]


def quads():
    """(name, material or light, four corners, counter-clockwise as seen from where the quad shows)."""
    lx, ly, lz, half = LAMP
    left, right, low, high = MARK
    yield "floor", "white", ((-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0))
    yield "ceiling", "white", ((-1, -1, 2), (-1, 1, 2), (1, 1, 2), (1, -1, 2))
    yield "back", "white", ((-1, 1, 0), (1, 1, 0), (1, 1, 2), (-1, 1, 2))
    yield "left", "red", ((-1, -1, 0), (-1, 1, 0), (-1, 1, 2), (-1, -1, 2))
    yield "right", "green", ((1, -1, 0), (1, -1, 2), (1, 1, 2), (1, 1, 0))
    yield "lamp", "lamp", ((lx - half, ly - half, lz), (lx - half, ly + half, lz), (lx + half, ly + half, lz),
                           (lx + half, ly - half, lz))
    yield "mark", "mark", ((left, MARK_DEPTH, low), (right, MARK_DEPTH, low), (right, MARK_DEPTH, high),
                           (left, MARK_DEPTH, high))
    for name, corners in (("tall", block(-0.35, 0.3, 20, 0.42, 1.2)), ("short", block(0.4, -0.3, 65, 0.4, 0.6))):
        for index, quad in enumerate(corners):
            yield f"{name}{index}", "white", quad


def text(*numbers):
    return " ".join(f"{number:.9g}" for number in numbers)


def mitsuba():
    lines = ['<?xml version="1.0"?>', "<!-- CC0 1.0; written by make_scenes.py -->", '<scene version="3.0.0">',
             '  <integrator type="aov"><string name="aovs" value="d:depth,n:sh_normal,a:albedo"/>',
             '    <integrator type="path" name="image"><integer name="max_depth" value="8"/></integrator>',
             "  </integrator>", '  <sensor type="perspective">',
             f'    <float name="fov" value="{FIELD_OF_VIEW}"/><string name="fov_axis" value="x"/>',
             f'    <transform name="to_world"><lookat origin="{text(*EYE)}" target="{text(*TARGET)}" '
             f'up="{text(*UP)}"/></transform>',
             '    <sampler type="independent"><integer name="sample_count" value="16"/></sampler>',
             f'    <film type="hdrfilm"><integer name="width" value="{WIDTH}"/><integer name="height" '
             f'value="{HEIGHT}"/><rfilter type="gaussian"/></film>', "  </sensor>"]
    for name, color in COLORS.items():
        lines.append(f'  <bsdf type="twosided" id="{name}"><bsdf type="diffuse"><rgb name="reflectance" '
                     f'value="{text(*color)}"/></bsdf></bsdf>')
    lines.append('  <bsdf type="diffuse" id="black"><rgb name="reflectance" value="0 0 0"/></bsdf>')
    for name, material, (a, b, c, d) in quads():
        u = [(q - p) / 2 for p, q in zip(a, b)]
        v = [(q - p) / 2 for p, q in zip(a, d)]
        n = (u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0])
        middle = [(p + q) / 2 for p, q in zip(a, c)]
        matrix = " ".join(text(u[i], v[i], n[i], middle[i]) for i in range(3)) + " 0 0 0 1"
        inside = f'<ref id="{material if material in COLORS else "black"}"/>'
        if material in LIGHTS:
            inside += f'<emitter type="area"><rgb name="radiance" value="{text(*LIGHTS[material])}"/></emitter>'
        lines.append(f'  <shape type="rectangle" id="{name}"><transform name="to_world"><matrix value="{matrix}"/>'
                     f"</transform>{inside}</shape>")
    return "\n".join(lines + ["</scene>", ""])


def luxcore():
    lines = ["# CC0 1.0; written by make_scenes.py", 'scene.camera.type = "perspective"',
             f"scene.camera.lookat.orig = {text(*EYE)}", f"scene.camera.lookat.target = {text(*TARGET)}",
             f"scene.camera.up = {text(*UP)}", f"scene.camera.fieldofview = {FIELD_OF_VIEW}",
             "scene.camera.autofocus.enable = 0"]
    for name, color in COLORS.items():
        lines += [f'scene.materials.{name}.type = "matte"', f"scene.materials.{name}.kd = {text(*color)}"]
    for name, color in LIGHTS.items():
        lines += [f'scene.materials.{name}.type = "matte"', f"scene.materials.{name}.kd = 0 0 0",
                  f"scene.materials.{name}.emission = {text(*color)}"]
    for name, material, corners in quads():
        lines += [f'scene.shapes.{name}.type = "inlinedmesh"',
                  f"scene.shapes.{name}.vertices = " + "  ".join(text(*corner) for corner in corners),
                  f"scene.shapes.{name}.faces = 0 1 2 0 2 3", f'scene.objects.{name}.shape = "{name}"',
                  f'scene.objects.{name}.material = "{material}"']
    return "\n".join(lines + [""])


def luxcore_config():
    lines = ["# CC0 1.0; written by make_scenes.py", 'scene.file = "room.scn"', f"film.width = {WIDTH}",
             f"film.height = {HEIGHT}", 'renderengine.type = "PATHCPU"']
    for kind in ("total", "diffuse", "glossy", "specular"):
        lines.append(f"path.pathdepth.{kind} = 8")
    for index, kind in enumerate(("DEPTH", "SHADING_NORMAL", "ALBEDO")):
        lines += [f'film.outputs.{index}.type = "{kind}"', f'film.outputs.{index}.filename = "{kind.lower()}.exr"']
    return "\n".join(lines + [""])


def povray():
    """POV-Ray's hand is left, so that y and z change places; its light falls off as that of a lamp of radiance L and
    area A does: 2 c f^2 / d^2 = L A / (pi d^2)."""
    def point(p):
        return f"<{p[0]:.9g}, {p[2]:.9g}, {p[1]:.9g}>"

    reach = 0.05
    lx, ly, lz, half = LAMP
    strength = [light * (2 * half) ** 2 / math.pi / (2 * reach ** 2) for light in LIGHTS["lamp"]]
    lines = ["// CC0 1.0; written by make_scenes.py. +W128 +H96", "#version 3.7;",
             "#ifndef (Light_Samples) #declare Light_Samples = 4; #end", "global_settings {", "  assumed_gamma 1.0",
             "  #ifdef (Radiosity) radiosity { count 60 error_bound 0.6 recursion_limit 2 pretrace_end 0.02 } #end",
             "}",
             f"camera {{ perspective location {point(EYE)} right x * image_width / image_height up y "
             f"angle {FIELD_OF_VIEW} look_at {point(TARGET)} }}",
             f"light_source {{ {point((lx, ly, lz - 0.01))} color rgb <{', '.join(f'{s:.6g}' for s in strength)}>",
             f"  area_light x * {2 * half}, z * {2 * half}, Light_Samples, Light_Samples",
             f"  fade_distance {reach} fade_power 2 }}"]
    for name, color in COLORS.items():
        lines.append(f"#declare T_{name} = texture {{ pigment {{ rgb <{', '.join(map(str, color))}> }} "
                     "finish { ambient 0 diffuse 1 } }")
    for name, color in LIGHTS.items():
        lines.append(f"#declare T_{name} = texture {{ pigment {{ rgb <{', '.join(map(str, color))}> }} "
                     "finish { ambient 0 diffuse 0 emission 1 } }")
    for name, material, corners in quads():
        points = ", ".join(point(corner) for corner in (*corners, corners[0]))
        shadow = " no_shadow" if material in LIGHTS else ""
        lines.append(f"polygon {{ 5, {points} texture {{ T_{material} }}{shadow} }} // {name}")
    return "\n".join(lines + [""])


def blend(path, texture):
    import bpy
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene

    def material(name, color, strength):
        made = bpy.data.materials.new(name)
        made.use_nodes = True
        tree = made.node_tree
        tree.nodes.clear()
        node = tree.nodes.new("ShaderNodeEmission" if strength else "ShaderNodeBsdfDiffuse")
        node.inputs["Color"].default_value = (*color, 1.0)
        if strength:
            # Like those of the other engines, lamps shine from their front only.
            side = tree.nodes.new("ShaderNodeNewGeometry")
            front = tree.nodes.new("ShaderNodeMath")
            front.operation = "MULTIPLY_ADD"
            front.inputs[1].default_value, front.inputs[2].default_value = -strength, strength
            tree.links.new(side.outputs["Backfacing"], front.inputs[0])
            tree.links.new(front.outputs[0], node.inputs["Strength"])
        elif texture and name == "white":
            picture = tree.nodes.new("ShaderNodeTexImage")
            picture.image = bpy.data.images.new("texture", 4, 4)
            picture.image.source = "FILE"
            picture.image.filepath = texture
            tree.links.new(picture.outputs["Color"], node.inputs["Color"])
        output = tree.nodes.new("ShaderNodeOutputMaterial")
        tree.links.new(node.outputs[0], output.inputs["Surface"])
        return made

    made = {name: material(name, color, 0.0) for name, color in COLORS.items()}
    for name, color in LIGHTS.items():
        made[name] = material(name, [part / max(color) for part in color], max(color))
    for name, kind, corners in quads():
        mesh = bpy.data.meshes.new(name)
        mesh.from_pydata(corners, [], [(0, 1, 2, 3)])
        mesh.materials.append(made[kind])
        scene.collection.objects.link(bpy.data.objects.new(name, mesh))
    camera = bpy.data.cameras.new("camera")
    camera.sensor_fit, camera.angle = "HORIZONTAL", math.radians(FIELD_OF_VIEW)
    thing = bpy.data.objects.new("camera", camera)
    thing.location, thing.rotation_euler = EYE, (math.radians(90), 0, 0)
    scene.collection.objects.link(thing)
    scene.camera = thing
    scene.world = bpy.data.worlds.new("world")
    scene.world.use_nodes = True
    scene.world.node_tree.nodes["Background"].inputs["Strength"].default_value = 0.0
    scene.render.engine = "CYCLES"
    # Twice the size at half the percentage: the worker must take both into account.
    scene.render.resolution_x, scene.render.resolution_y = 2 * WIDTH, 2 * HEIGHT
    scene.render.resolution_percentage = 50
    scene.frame_start, scene.frame_end = 1, 3
    for bounces in ("max_bounces", "diffuse_bounces", "glossy_bounces", "transmission_bounces"):
        setattr(scene.cycles, bounces, 6)
    layer = scene.view_layers[0]
    layer.use_pass_z = layer.use_pass_normal = layer.use_pass_diffuse_color = True
    # The camera turns a little with each frame, so that frames differ.
    thing.keyframe_insert("rotation_euler", frame=1)
    thing.rotation_euler = (math.radians(90), 0, math.radians(4))
    thing.keyframe_insert("rotation_euler", frame=3)
    scene.frame_set(1)
    bpy.ops.wm.save_as_mainfile(filepath=os.path.abspath(path), compress=False)


def main():
    arguments = sys.argv[sys.argv.index("--") + 1:] if "--" in sys.argv else sys.argv[1:]
    if arguments:
        blend(arguments[0], arguments[1] if len(arguments) > 1 else None)
        return
    folder = os.path.join(os.path.dirname(os.path.abspath(__file__)), "scenes")
    os.makedirs(folder, exist_ok=True)
    for name, content in (("room.xml", mitsuba()), ("room.scn", luxcore()), ("room.cfg", luxcore_config()),
                          ("room.pov", povray())):
        with open(os.path.join(folder, name), "w") as file:
            file.write(content)


if __name__ == "__main__":
    main()
